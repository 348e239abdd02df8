// @ts-check
// The page of a recording shows its marks: the newest version, the buttons that change the marks, and the versions
// before the newest one.

import { get, items, query, send } from "../shell/api.js";
import { h, keepingFocus, notice, smallButton, table } from "../shell/dom.js";
import { count, instant } from "../shell/format.js";
import { counted, markText, overtakenText, signalsText, spanText, UNMARKED } from "./marks.js";

const COLUMNS = [{ title: "When" }, { title: "Signals" }, { title: "Reason" }, { title: "Actions" }];

// Says who made a version, and when.
/** @param {import("./marks.js").Version} version */
const origin = ({ made_by: by, created_at: at }) =>
  [by && `made by ${by}`, at && ["at ", instant(at, true)]]
    .filter(Boolean)
    .flatMap((part, k) => (k ? [" ", part] : [part]));

export class MarksPart {
  /**
   * `changed(marks)` is called with the marks of the newest version, and `show(span, name)` shows a place on the
   * plots. `begin(place)` opens the form for marks behind an element.
   *
   * @param {any} view
   * @param {any} dataset
   * @param {{
   *   changed: (marks: import("./marks.js").Mark[]) => void,
   *   show: (span: { from_s: number, to_s: number }, name: string | null) => void,
   *   begin: (place: Element) => void,
   * }} acts
   */
  constructor(view, dataset, { changed, show, begin }) {
    this.view = view;
    this.dataset = dataset;
    this.address = `/v1/datasets/${dataset.id}/versions`;
    this.changed = changed;
    this.show = show;
    /** @type {import("./marks.js").Version[]} */
    this.versions = [];
    this.next = null;
    this.outcome = notice();
    this.list = h("div", { class: "marks" });
    this.begin = h("button", { type: "button", onclick: () => begin(this.actions) }, "Mark a stretch");
    this.undo = h("button", { type: "button", onclick: () => this.act(() => this.takeBack()) });
    this.actions = h("div", { class: "actions for-writers" }, this.begin, this.undo);
    this.summary = h("summary", {});
    this.earlier = h("details", {}, this.summary);
    this.element = h(
      "section",
      { "aria-label": "Marks" },
      h("h2", {}, "Marks"),
      this.outcome.place,
      this.list,
      this.actions,
      this.earlier,
    );
    this.draw();
    dataset.version > 0 && this.act(() => this.read());
  }

  get newest() {
    return this.versions[0] ?? UNMARKED;
  }

  act(step) {
    return this.outcome.attempt(step);
  }

  // Reads the newest versions, or the versions that come after those that are shown.
  async read(further = false) {
    const page = query({ page_token: further ? this.next : null });
    const { data } = await get(`${this.address}${page}`, this.view.signal);
    this.versions = further ? [...this.versions, ...items(data)] : items(data);
    this.next = data.next_page_token ?? null;
    this.draw();
  }

  // Stores the marks that `change` makes of those of the newest version as the next version. Where a version came
  // from elsewhere meanwhile, it is shown first and nothing is stored.
  async store(change) {
    const { number: based_on, marks } = this.newest;
    try {
      const body = { marks: change(marks), based_on };
      const { data, status } = await send("POST", this.address, body, { signal: this.view.signal });
      this.versions = status === 201 ? [data, ...this.versions] : this.versions;
      this.draw();
    } catch (error) {
      if (error.status !== 409) {
        throw error;
      }
      await this.read();
      throw { title: "Marked by someone else meanwhile", message: overtakenText(this.newest, marks) };
    }
  }

  add(marks) {
    return this.store((before) => [...before, ...marks]);
  }

  async restore(number) {
    const { marks } =
      number === 0 ? UNMARKED : (await get(`${this.address}/${number}`, this.view.signal)).data;
    await this.store(() => marks);
  }

  takeBack() {
    return this.restore(this.newest.number - 1);
  }

  draw() {
    keepingFocus(this.element, () => {
      const { newest } = this;
      this.list.replaceChildren(...this.drawNewest(newest));
      this.undo.hidden = newest.number === 0;
      this.undo.textContent = `Undo: back to version ${newest.number - 1}`;
      this.undo.setAttribute("aria-label", this.undo.textContent);
      this.drawEarlier();
    });
    this.changed(this.newest.marks);
  }

  drawNewest(newest) {
    if (newest.number === 0) {
      return [
        h(
          "p",
          { class: "quiet" },
          "Nothing is marked. Samples that are marked as bad stay in the recording; jobs leave them out.",
        ),
      ];
    }
    return [
      h(
        "p",
        {},
        h("strong", {}, `Version ${newest.number}`),
        `, ${counted(newest.marks.length, "mark")}, `,
        origin(newest),
      ),
      table(
        `Marks of version ${newest.number}`,
        COLUMNS,
        newest.marks.map((mark, k) => this.row(mark, k)),
        { empty: "This version marks nothing.", stacked: true },
      ),
    ];
  }

  row(mark, place) {
    const text = markText(mark);
    const remove = () => this.store((marks) => marks.filter((_, k) => k !== place));
    return [
      spanText(mark),
      signalsText(mark),
      mark.reason,
      h(
        "span",
        { class: "row-actions" },
        smallButton("Show", `Show ${text}`, () => this.show(mark, mark.signals?.[0] ?? null)),
        smallButton("Remove", `Remove the mark: ${text}`, () => this.act(remove)),
      ),
    ];
  }

  drawEarlier() {
    const earlier = this.versions.slice(1);
    this.earlier.hidden = this.newest.number === 0;
    const isLast = !this.next;
    this.summary.textContent = `Earlier versions (${count(this.newest.number)})`;
    this.earlier.replaceChildren(
      this.summary,
      h(
        "ul",
        { class: "versions" },
        earlier.map((version) => this.version(version)),
        isLast && h("li", {}, "Version 0: the recording as it came. ", this.restoring(0)),
      ),
      h(
        "button",
        { type: "button", hidden: isLast, onclick: () => this.act(() => this.read(true)) },
        "Older versions",
      ),
    );
  }

  version(version) {
    return h(
      "li",
      {},
      `Version ${version.number}: ${counted(version.marks.length, "mark")}, `,
      origin(version),
      " ",
      this.restoring(version.number),
    );
  }

  restoring(number) {
    return smallButton("Restore", `Restore version ${number}`, () => this.act(() => this.restore(number)));
  }
}
