// The tests mark samples of a recording as bad on the page, as an engineer does who looks through a recording before a
// job, and see that jobs take the marks.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import {
  fill,
  labelled,
  launch,
  open,
  PATIENCE,
  picture,
  press,
  SIZES,
  says,
  specification,
  text,
  tools,
} from "./browser.mjs";
import { numberIn } from "./numbers.mjs";
import { base, ended, JOB, post, recording } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const shared = { browser: null, checker: "" };

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
  }
});

after(() => shared.browser?.close());

const api = async (address) => (await fetch(base + address)).json();
const FORM = "form[aria-label='Mark as bad']";
const DRAGGING = "::-p-xpath(//label[contains(., 'Dragging across')]/select)";

// The drive's position has a spike at 1.2 s and stands still from 3 s to 3.59 s. The server takes equal recordings for
// the same, so that each is a little different.
let made = 0;
async function flawed() {
  made += 1;
  const rows = (await recording()).trim().split("\n");
  const still = rows[301].split(",")[2];
  const flawedRows = rows.map((row, k) => {
    const [time, force, position] = row.split(",");
    const isStill = k > 300 && k <= 360;
    const shift = k === 121 ? 0.02 : k > 0 ? (made + (Date.now() % 1e5)) * 1e-12 : 0;
    const value = isStill ? still : k > 0 ? (Number(position) + shift).toFixed(14) : position;
    return `${time},${force},${value}`;
  });
  return (await post("/v1/datasets?name=flawed", `${flawedRows.join("\n")}\n`, "text/csv")).id;
}

const versionsOf = async (id) => (await api(`/v1/datasets/${id}/versions`)).items;

async function newest(id, number) {
  for (let turn = 0; turn < 100; turn += 1) {
    const [version] = await versionsOf(id);
    if (version?.number === number) {
      return version;
    }
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
  return assert.fail(`version ${number} does not come`);
}

async function opened(id, size) {
  const page = await open(`/#/datasets/${id}`, size);
  await page.waitForSelector(".surface:not(.empty) .u-over", PATIENCE);
  return page;
}

// Gives the surface of a signal's plot, and the place of an instant in it.
async function placesOn(page, title, spanned = [0, 5.99]) {
  const over = await page.waitForSelector(`.surface[aria-label^='${title}.'] .u-over`, PATIENCE);
  await over.scrollIntoView();
  const box = await over.boundingBox();
  return { box, x: (time) => box.x + ((time - spanned[0]) / (spanned[1] - spanned[0])) * box.width };
}

async function drag(page, title, from, to) {
  const { box, x } = await placesOn(page, title);
  await page.mouse.move(x(from), box.y + 20);
  await page.mouse.down();
  await page.mouse.move(x(to), box.y + 20, { steps: 5 });
  await page.mouse.up();
}

async function reason(page, words) {
  const field = await labelled(page, "Reason");
  await field.click({ count: 3 });
  await page.keyboard.type(words);
}

const save = (page) => page.click(`${FORM} button.primary`);
const closed = (page) => page.waitForFunction((form) => !document.querySelector(form), PATIENCE, FORM);
const legends = (page) =>
  page.$$eval("figure", (plots) => plots.map((plot) => plot.querySelector(".legend")?.innerText ?? ""));

async function violations(page) {
  await page.evaluate(shared.checker);
  const { violations } = await page.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ["violations"] }),
  );
  return violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`);
}

test("a line of the quality report leads to its place and marks it", { skip }, async () => {
  const id = await flawed();
  const page = await opened(id);
  await says(page, "Nothing is marked.");
  await page.click("button[aria-label='Show: spike in position']");
  await page.waitForFunction(
    () => /time 0\.95 to 1\.45/.test(document.querySelector(".surface[aria-label^='position.']").ariaLabel),
    PATIENCE,
  );
  await page.click("button[aria-label='Mark spike in position']");
  await page.waitForSelector(FORM, PATIENCE);
  assert.equal(await (await labelled(page, "Reason")).evaluate(({ value }) => value), "spike");
  assert.deepEqual(
    await page.$$eval(`${FORM} input[inputmode]`, (fields) => fields.map(({ value }) => value)),
    ["1.2", "1.2"],
  );
  // The stretch of the other line comes into the form that is open; it is taken out of it again.
  await page.click("button[aria-label='Mark sensor frozen in position']");
  await page.waitForSelector(`${FORM} [aria-label='Stretch 2']`, PATIENCE);
  assert.deepEqual(await violations(page), []);
  await picture(page, "marks-form");
  await page.click("[aria-label='Leave stretch 1 unmarked']");
  await reason(page, "sensor frozen");
  await save(page);
  await closed(page);
  const first = await newest(id, 1);
  assert.deepEqual(first.marks, [{ from_s: 3, to_s: 3.59, signals: ["position"], reason: "sensor frozen" }]);
  await says(page, "Version 1, 1 mark");
  assert.equal((await api(`/v1/datasets/${id}`)).version, 1);
  const [force, position] = await legends(page);
  assert.doesNotMatch(force, /marked as bad/);
  assert.match(position, /marked as bad/);
  assert.deepEqual(page.faults, []);
  await page.close();

  const list = await open("/#/datasets");
  await says(list, "version 1");
  assert.deepEqual(list.faults, []);
  await list.close();
});

test("stretches are marked by dragging, samples by a click and by keyboard", { skip }, async () => {
  const id = await flawed();
  const page = await opened(id);
  await page.select(DRAGGING, "mark");
  await drag(page, "drive force", 2, 2.5);
  await page.waitForSelector(FORM, PATIENCE);
  await reason(page, "sensor unplugged");
  await save(page);
  await closed(page);
  const [{ from_s, to_s, signals }] = (await newest(id, 1)).marks;
  assert.ok(Math.abs(from_s - 2) < 0.03 && Math.abs(to_s - 2.5) < 0.03, `${from_s} to ${to_s}`);
  assert.deepEqual(signals, ["drive_force"]);

  // A click takes the sample under it, however narrow the spike is.
  const { box, x } = await placesOn(page, "position");
  const { min, max } = (await api(`/v1/datasets/${id}`)).signals[1];
  const { time_s: times, signals: columns } = await api(`/v1/datasets/${id}/samples?signals=position`);
  const spike = columns.position.values[times.findIndex((time) => Math.abs(time - 1.2) < 1e-9)];
  const share = (1.05 * max - 0.05 * min - spike) / (1.1 * (max - min));
  await page.mouse.click(x(1.2) + 1, box.y + share * box.height + 2);
  await page.waitForSelector(FORM, PATIENCE);
  await reason(page, "spike");
  await picture(page, "marks-plot");
  await save(page);
  await closed(page);
  const clicked = (await newest(id, 2)).marks[1];
  assert.deepEqual(clicked, { from_s: 1.2, to_s: 1.2, signals: ["position"], reason: "spike" });

  await page.focus(".surface[aria-label^='position.']");
  await page.keyboard.press("Home");
  await page.keyboard.press("[");
  for (let step = 0; step < 10; step += 1) {
    await page.keyboard.press("ArrowRight");
  }
  await page.keyboard.press("]");
  await page.waitForSelector(FORM, PATIENCE);
  // A refusal of the server stands beside its field, and nothing is stored.
  await save(page);
  await page.waitForSelector(`${FORM} input[list][aria-invalid]`, PATIENCE);
  page.faults.splice(0);
  await reason(page, "maintenance");
  await page.click(`${FORM} input[type='checkbox']`);
  await save(page);
  await closed(page);
  const { marks } = await newest(id, 3);
  assert.deepEqual(marks[2], { from_s: 0, to_s: 0.1, reason: "maintenance" });
  await says(page, "all signals");
  assert.match((await legends(page))[0], /marked as bad/);

  // Each version can be had again, and nothing of a recording changes.
  await page.click("button[aria-label^='Remove the mark: position, 1.2 s']");
  await says(page, "Version 4, 2 marks");
  await press(page, "Undo: back to version 3");
  await says(page, "Version 5, 3 marks");
  assert.deepEqual((await newest(id, 5)).marks, marks);
  await press(page, "Earlier versions");
  await page.click("button[aria-label='Restore version 1']");
  await says(page, "Version 6, 1 mark");
  assert.deepEqual((await newest(id, 6)).marks, marks.slice(0, 1));
  await page.click("button[aria-label='Restore version 0']");
  await says(page, "Version 7, 0 marks");
  assert.deepEqual((await newest(id, 7)).marks, []);
  await says(page, "This version marks nothing.");
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("marks of two people meet, and nothing that was typed is lost", { skip }, async () => {
  const id = await flawed();
  const page = await opened(id);
  await page.click("button[aria-label='Mark spike in position']");
  await page.waitForSelector(FORM, PATIENCE);
  const theirs = { from_s: 4, to_s: 4.5, reason: "plant in another mode" };
  await post(`/v1/datasets/${id}/versions`, { marks: [theirs], based_on: 0 });
  await reason(page, "my very particular spike");
  await save(page);
  await says(page, "Marked by someone else meanwhile");
  await says(page, "all signals, 4 to 4.5 s, plant in another mode");
  page.faults.splice(0);
  assert.deepEqual(await violations(page), []);
  await picture(page, "marks-overtaken");
  assert.equal(
    await (await labelled(page, "Reason")).evaluate(({ value }) => value),
    "my very particular spike",
  );
  await save(page);
  await closed(page);
  const { marks } = await newest(id, 2);
  const mine = { from_s: 1.2, to_s: 1.2, signals: ["position"], reason: "my very particular spike" };
  assert.deepEqual(marks, [theirs, mine]);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("a job leaves out the version that its form names", { skip }, async () => {
  const id = await flawed();
  const mark = (from_s, to_s, signals) => ({ from_s, to_s, signals, reason: "spike" });
  const [spike, still] = [mark(1.2, 1.2, ["position"]), mark(3, 3.59, ["position"])];
  await post(`/v1/datasets/${id}/versions`, { marks: [spike], based_on: 0 });
  await post(`/v1/datasets/${id}/versions`, { marks: [spike, still], based_on: 1 });
  const page = await open(`/#/new?dataset=${id}&model=positioning_drive`);
  await says(page, "Leaves out what is marked as bad: version 2 (2 marks)");
  await page.waitForFunction(
    () => document.querySelector(".experiment").innerText.includes("left out"),
    PATIENCE,
  );
  await picture(page, "marks-new-job");
  assert.equal((await specification(page)).experiments[0].version, undefined);
  const choice = "select[aria-label='Version of the marks of flawed']";
  await page.select(choice, "1");
  await says(page, "version 2 is newer");
  assert.equal((await specification(page)).experiments[0].version, 1);
  await page.click("::-p-text(Add a window)");
  await page.waitForFunction(() => document.querySelectorAll(".window-block").length === 2, PATIENCE);
  assert.deepEqual(
    (await specification(page)).experiments.map(({ version }) => version),
    [1, 1],
  );
  await page.select(choice, "0");
  await says(page, "Nothing that is marked as bad is left out");
  assert.deepEqual(
    (await specification(page)).experiments.map(({ version }) => version),
    [0, 0],
  );
  assert.deepEqual(page.faults, []);
  await page.close();

  const job = JOB(id, "icra_genetic");
  job.experiments[0].version = 1;
  const { id: jobId } = await post("/v1/jobs", job);
  const { status, spec } = await ended(jobId);
  assert.equal(status, "succeeded");
  assert.deepEqual(spec.experiments[0].version, { number: 1, marks: [spike] });
  const result = await open(`/#/jobs/${jobId}`);
  await result.waitForSelector("[aria-label='Outputs'] figure .legend", PATIENCE);
  const outputs = await result.$$eval("[aria-label='Outputs'] figure", (plots) =>
    plots.map((plot) => [
      plot.querySelector(".plot-title").textContent,
      /left out/.test(plot.querySelector(".legend")?.innerText),
    ]),
  );
  assert.deepEqual(
    outputs.map(([, isShaded]) => isShaded),
    [true, true, false],
    outputs.join("; "),
  );
  await picture(result, "marks-result");
  // A completed specification says its version as an object, whose number the form shows.
  await press(result, "Use as template");
  await says(result, "version 2 is newer");
  assert.equal(await result.$eval("select[aria-label^='Version of the marks']", ({ value }) => value), "1");
  assert.deepEqual(result.faults, []);
  await result.close();
});

test("marks are accessible and fit a phone and a desk, in both schemes", { skip }, async () => {
  const id = await flawed();
  const marks = Array.from({ length: 12 }, (_, k) => ({
    from_s: k / 4,
    to_s: k / 4 + 0.1,
    ...(k % 3 && { signals: ["position"] }),
    reason:
      k % 2 ? "sensor unplugged while the cable of the encoder was replaced by a longer cable" : "spike",
  }));
  await post(`/v1/datasets/${id}/versions`, { marks: marks.slice(0, 1), based_on: 0 });
  await post(`/v1/datasets/${id}/versions`, { marks, based_on: 1 });
  const faults = [];
  for (const size of SIZES) {
    // The list and the form of a job have little that is new: a desk in light and a phone in the dark are enough.
    const isOuter = size === SIZES[0] || size === SIZES.at(-1);
    const further = isOuter ? ["/#/datasets", `/#/new?dataset=${id}`] : [];
    for (const address of [`/#/datasets/${id}`, ...further]) {
      const page = await open(address, size);
      await says(page, "version 2");
      await page.waitForNetworkIdle({ idleTime: 400, timeout: 15_000 }).catch(() => {});
      if (address.includes("datasets/")) {
        await press(page, "Earlier versions");
        await page.click("button[aria-label='Mark spike in position']");
        await page.waitForSelector(FORM, PATIENCE);
      }
      const name = `marks-${address.replace(/ds_\w+/, "page").replace(/\W+/g, "")}-${size.width}-${size.scheme}`;
      await picture(page, name);
      const wide = await page.evaluate(() => document.documentElement.scrollWidth);
      const all = [
        ...(await violations(page)),
        ...page.faults,
        ...(wide > size.width ? [`${wide} px wide`] : []),
      ];
      faults.push(...all.map((fault) => `${name}: ${fault}`));
      await page.close();
    }
  }
  assert.deepEqual(faults, []);
});

// Looks at the preview of the form, which stores nothing: gives what the plots of the position say of their first samples.
async function previewed(page, form) {
  const preview = `${form} [aria-label='Preview']`;
  const stored = async () => (await api("/v1/datasets?limit=200")).items.length;
  const count = await stored();
  await press(page, "Preview");
  await page.waitForSelector(`${preview} figure`, PATIENCE);
  assert.equal(await page.$eval(`${preview} select`, (signal) => signal.value), "work");
  assert.equal((await page.$$(`${preview} figure`)).length, 1, "the work was not recorded");
  assert.match(await text(page, preview), /step 2: work \[J\] = drive_force\*position/);
  await page.select(`${preview} select`, "position");
  const plots = `${preview} figure`;
  await page.waitForFunction((all) => document.querySelectorAll(all).length === 2, PATIENCE, plots);
  const values = [];
  for (const surface of await page.$$(`${plots} .surface`)) {
    await surface.focus();
    await page.keyboard.press("Home");
    const readout = await surface.evaluate((element) => element.nextElementSibling.textContent);
    values.push(numberIn(readout.split(" · ").at(-1)));
  }
  assert.deepEqual(await violations(page), []);
  await picture(page, "recipe-preview");
  await page.setViewport({ width: 390, height: 844 });
  await page.waitForFunction(() => document.documentElement.scrollWidth <= 390, PATIENCE);
  await page.setViewport({ width: SIZES[0].width, height: SIZES[0].height });
  assert.equal(await stored(), count);
  return values;
}

test("a recording is prepared step by step, and other steps begin with those that were done", {
  skip,
}, async () => {
  const id = await flawed();
  const page = await opened(id);
  const prepare = "form[aria-label='Prepare']";
  const step = (k, title) => `${prepare} li[aria-label='Step ${k}: ${title}']`;
  const add = async (kind, k, title) => {
    await page.select(`${prepare} > .actions select`, kind);
    await page.click(`${prepare} > .actions button`);
    await page.waitForSelector(step(k, title), PATIENCE);
  };
  await press(page, "Prepare…");
  await add("cut", 1, "Cut to a part");
  await fill(page, `${step(1, "Cut to a part")} input`, "1.5");
  await add("calculate", 2, "Calculate a signal");
  const calculated = step(2, "Calculate a signal");
  await fill(page, `${calculated} [data-pointer$='signal'] input`, "work");
  await fill(page, `${calculated} [data-pointer$='unit'] input`, "J");
  await fill(page, `${calculated} [data-pointer$='equation'] input`, "drive_force*time");
  assert.deepEqual(await violations(page), []);
  await picture(page, "recipe-form");
  // What is wrong stands beside its field; the form keeps what was typed.
  await page.click(`${prepare} button.primary`);
  await page.waitForSelector(`${calculated} [data-pointer$='equation'] .fault`, PATIENCE);
  await fill(page, `${calculated} [data-pointer$='equation'] input`, "drive_force*position");
  const before = await previewed(page, prepare);
  await page.click(`${prepare} button.primary`);
  await says(page, "do other steps");
  await says(page, "step 2:");
  await says(page, "[J] = drive_force*position");
  const made = await api(`/v1/datasets/${page.url().split("/").at(-1)}`);
  assert.deepEqual(made.signals.map(({ name, unit }) => [name, unit]).slice(-1), [["work", "J"]]);
  // The preview has shown the recorded position and the prepared one at their first samples.
  const first = async (dataset) =>
    (await api(`/v1/datasets/${dataset}/samples?signals=position&max_points=100000`)).signals.position
      .values[0];
  assert.deepEqual(
    before.map((value) => value.toFixed(6)),
    [await first(id), await first(made.id)].map((value) => value.toFixed(6)),
  );
  await picture(page, "prepared-recording");
  await press(page, "do other steps");
  await page.waitForSelector(calculated, PATIENCE);
  const shown = await page.$$eval(`${prepare} li input[type=text]`, (fields) =>
    fields.map(({ value }) => value),
  );
  assert.deepEqual(shown, ["1.5", "", "work", "J", "drive_force*position"]);
  assert.ok(page.url().includes(id));
  await page.close();
});
