// This module plays a person at the page: one who presses what is to be seen, finds it by its words alone, and counts
// clicks and keys. A person has a mouse, or a keyboard alone.

import path from "node:path";
import { performance } from "node:perf_hooks";
import { open, PATIENCE } from "./browser.mjs";

const PRESSED = "a[href], button, summary, [role=radio], [role=tab], input[type=checkbox], input[type=radio]";
const FIELDS = "input, select, textarea, [contenteditable=true]";
const MOST_TABS = 600;
const FRAMES_AT_REST = 4;

// Finds the control in sight whose name has the words, in the part of the page that `within` names: the control with
// exactly this name goes before those whose name begins with the words, and those before all others.
function controlIn({ words, kinds, within, is }) {
  const simple = (text) => (text ?? "").replace(/\s+/g, " ").trim();
  const labelOf = (element) => {
    const label = element.labels?.[0]?.cloneNode(true);
    for (const nested of label?.querySelectorAll("input, select, textarea, datalist") ?? []) {
      nested.remove();
    }
    return label?.textContent;
  };
  const namesOf = (element) =>
    [element.getAttribute("aria-label"), labelOf(element), element.innerText].map(simple).filter(Boolean);
  const isSeen = (element) =>
    element.checkVisibility({ opacityProperty: true, visibilityProperty: true }) &&
    element.getClientRects().length > 0;
  const parts = [...document.querySelectorAll("section, aside, form, fieldset, nav, tr, li, div, dialog")];
  const part = within
    ? (parts.find((element) => simple(element.getAttribute("aria-label")) === within) ??
      parts.filter((element) => isSeen(element) && simple(element.innerText).includes(within)).at(-1))
    : document;
  const rankOf = (name) => (name === words ? 0 : name.startsWith(words) ? 1 : name.includes(words) ? 2 : 3);
  const rank = (element) => Math.min(3, ...namesOf(element).map(rankOf));
  const all = [...(part?.querySelectorAll(kinds) ?? [])]
    .filter((element) => isSeen(element) && !element.disabled)
    .map((element) => ({ element, place: rank(element) }))
    .filter(({ place }) => place < 3)
    .sort((a, b) => a.place - b.place);
  return is ? all.length > 0 : (all[0]?.element ?? null);
}

// Waits until an element stands still, and answers its place; a person scrolls to what is out of sight.
export function placeAtRest(element) {
  return element.evaluate(
    (part, frames) =>
      new Promise((resolve) => {
        const { top, bottom } = part.getBoundingClientRect();
        (top < 0 || bottom > innerHeight) && part.scrollIntoView({ block: "center" });
        let [place, still] = ["", 0];
        const look = () => {
          const { x, y, width, height } = part.getBoundingClientRect();
          still = place === `${x},${y}` ? still + 1 : 0;
          place = `${x},${y}`;
          still >= frames ? resolve({ x, y, width, height }) : requestAnimationFrame(look);
        };
        look();
      }),
    FRAMES_AT_REST,
  );
}

// Drags across a plot between two shares of its width.
export async function dragAcross(page, over, from, to) {
  const { x, y, width, height } = await placeAtRest(over);
  const at = (share) => x + 1 + share * (width - 2);
  await page.mouse.move(at(from), y + height / 2);
  await page.mouse.down();
  await page.mouse.move(at(to), y + height / 2, { steps: 5 });
  await page.mouse.up();
}

const seconds = (from) => (performance.now() - from) / 1000;

export class Person {
  // `hands` is "mouse" or "keys".
  static async at(address, hands) {
    const page = await open(address);
    // A question of the page is answered with a click, or with the Enter key.
    page.on("dialog", async (dialog) => {
      person.did[hands === "keys" ? "keys" : "clicks"] += 1;
      await dialog.accept();
    });
    const person = new Person(page, hands);
    return person;
  }

  constructor(page, hands) {
    this.page = page;
    this.hands = hands;
    this.did = { clicks: 0, keys: 0 };
    this.rows = [];
    this.stumbles = [];
  }

  get isWithoutMouse() {
    return this.hands === "keys";
  }

  // A step has its own row of the table.
  async step(name, act) {
    const before = { ...this.did };
    const from = performance.now();
    let outcome;
    try {
      outcome = await act();
    } catch (error) {
      this.stumble(`${name}: ${error.message.split("\n")[0]}`);
      throw error;
    } finally {
      const { clicks, keys } = this.did;
      const row = [name, clicks - before.clicks, keys - before.keys, seconds(from).toFixed(1)];
      this.rows.push(row);
      console.log(
        `  ${row[0].padEnd(62)} ${String(row[1]).padStart(4)} ${String(row[2]).padStart(5)} ${row[3].padStart(7)}`,
      );
    }
    return outcome;
  }

  stumble(text) {
    this.stumbles.push(text);
    console.log(`  STUMBLE ${text}`);
  }

  sum() {
    const total = (k) => this.rows.reduce((sum, row) => sum + Number(row[k]), 0);
    return `${total(1)} clicks, ${total(2)} keys, ${total(3).toFixed(1)} s`;
  }

  async key(name) {
    this.did.keys += 1;
    await this.page.keyboard.press(name);
  }

  async write(text) {
    this.did.keys += text.length;
    await this.page.keyboard.type(text);
  }

  sees(words, patience = PATIENCE) {
    return this.page.waitForFunction((text) => document.body.innerText.includes(text), patience, words);
  }

  async isOffered(words, within = "") {
    return this.page.evaluate(controlIn, { words, kinds: PRESSED, within, is: true });
  }

  async control(words, kinds, within, patience = PATIENCE) {
    const found = await this.page.waitForFunction(controlIn, patience, { words, kinds, within }).catch(() => {
      throw new Error(`nothing in sight is called “${words}”${within ? ` in “${within}”` : ""}`);
    });
    return found.asElement();
  }

  async click(control) {
    const box = await placeAtRest(control);
    const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
    const above = await control.evaluate(
      (element, at) => {
        const top = element.getRootNode().elementFromPoint(at.x, at.y);
        const isIts = element.contains(top) || top?.contains(element) || element.labels?.[0]?.contains(top);
        return isIts ? null : (top?.outerHTML.slice(0, 80) ?? "nothing");
      },
      { x, y },
    );
    if (above) {
      throw new Error(`the control is covered by ${above}`);
    }
    this.did.clicks += 1;
    await this.page.mouse.click(x, y);
  }

  // Goes to a control by Tab, or back by Shift and Tab where the control stands before the focus.
  async tabTo(control) {
    const where = () =>
      control.evaluate((element) => {
        const { activeElement: focused } = document;
        const at = focused?.shadowRoot?.activeElement ?? focused;
        const isBefore = at?.compareDocumentPosition(element) & Node.DOCUMENT_POSITION_PRECEDING;
        const group = element.tabIndex < 0 ? element.closest("[role=radiogroup], [role=tablist]") : null;
        if (at === element || group?.contains(at)) {
          return at === element ? "there" : "in the group";
        }
        return at !== document.body && isBefore ? "before" : "after";
      });
    for (let turn = 0; turn < MOST_TABS; turn += 1) {
      const place = await where();
      if (place === "there") {
        return;
      }
      if (place === "before") {
        await this.page.keyboard.down("Shift");
      }
      await this.key(place === "in the group" ? "ArrowRight" : "Tab");
      await this.page.keyboard.up("Shift");
    }
    throw new Error("Tab does not come to the control");
  }

  async reach(words, kinds, within, act) {
    for (let turn = 0; ; turn += 1) {
      const control = await this.control(words, kinds, within);
      try {
        return await act(control);
      } catch (error) {
        // A form that draws its parts anew takes the control away between the look and the hand.
        if (turn >= 5 || !/detached|not attached|Node is/.test(error.message)) {
          throw error;
        }
      }
    }
  }

  // Presses the button, the link or the box that the words name.
  press(words, within = "") {
    return this.reach(words, PRESSED, within, async (control) => {
      if (!this.isWithoutMouse) {
        return this.click(control);
      }
      await this.tabTo(control);
      const isBox = await control.evaluate((element) => element.matches("input"));
      return this.key(isBox ? "Space" : "Enter");
    });
  }

  // Types into the field that the words name, in the place of what it has, and leaves the field.
  type(words, text, within = "") {
    return this.reach(words, FIELDS, within, async (control) => {
      this.isWithoutMouse ? await this.tabTo(control) : await this.click(control);
      await this.page.keyboard.down("Control");
      await this.key("a");
      await this.page.keyboard.up("Control");
      await this.write(text);
      await this.key("Tab");
    });
  }

  // Writes a text into the editor of the page, in the place of what it has.
  async writeEquations(text) {
    const editor = await this.page.waitForSelector(".editor >>> .cm-content", PATIENCE);
    this.isWithoutMouse ? await this.tabTo(editor) : await this.click(editor);
    await this.page.keyboard.down("Control");
    await this.key("a");
    await this.page.keyboard.up("Control");
    await this.key("Delete");
    // An editor completes brackets that are typed; a text that is inserted stays as it is.
    this.did.keys += text.length;
    await this.page.keyboard.sendCharacter(text);
  }

  // Chooses of a list. With the mouse these are two clicks, on the list and on the choice; the browser of this program
  // shows no list that could be clicked, so that the arrow keys do the choosing in both cases.
  choose(words, text, within = "") {
    return this.reach(words, "select", within, async (control) => {
      this.isWithoutMouse ? await this.tabTo(control) : await control.focus();
      const moves = await control.evaluate(({ options, selectedIndex }, wanted) => {
        const open = [...options].filter((option) => !option.disabled);
        const place = open.findIndex((option) => option.text.includes(wanted));
        return place < 0 ? null : place - open.indexOf(options[selectedIndex]);
      }, text);
      if (moves === null) {
        throw new Error(`“${words}” does not offer “${text}”`);
      }
      for (let k = 0; k < Math.abs(moves); k += 1) {
        await this.page.keyboard.press(moves > 0 ? "ArrowDown" : "ArrowUp");
      }
      this.did.keys += this.isWithoutMouse ? Math.abs(moves) : 0;
      this.did.clicks += this.isWithoutMouse ? 0 : 2;
    });
  }

  // Chooses a file in the dialog of the system: a click on the file and one on the button, or its name and the Enter key.
  give(words, file, within = "") {
    return this.reach(words, "input[type=file]", within, async (control) => {
      const asked = this.page.waitForFileChooser(PATIENCE);
      if (this.isWithoutMouse) {
        await this.tabTo(control);
        await this.key("Enter");
        this.did.keys += path.basename(file).length + 1;
      } else {
        await this.click(control);
        this.did.clicks += 2;
      }
      await (await asked).accept([file]);
    });
  }

  // Drags across the plot of a signal between two shares of its width. With the keyboard the cursor goes to both ends in
  // steps of a twentieth of the plot, where [ and ] say so.
  drag(title, from, to) {
    return this.reach(title, ".surface", "", async (surface) => {
      if (this.isWithoutMouse) {
        await this.tabTo(surface);
        await this.key("Home");
        await this.stride(20 * from);
        await this.key("[");
        await this.stride(20 * (to - from));
        await this.key("]");
        return;
      }
      await dragAcross(this.page, await surface.$(".u-over"), from, to);
      this.did.clicks += 1;
    });
  }

  async stride(times) {
    await this.page.keyboard.down("Shift");
    for (let k = 0; k < Math.round(times); k += 1) {
      await this.key("ArrowRight");
    }
    await this.page.keyboard.up("Shift");
  }

  async close() {
    await this.page.close();
  }
}
