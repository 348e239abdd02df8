// @ts-check
// The page of a stream marks the part that is chosen as bad, and lists what is marked. The samples stay in the stream;
// recordings and windows of monitors do without them.

import { get, send } from "../shell/api.js";
import { h, keepingFocus, notice, smallButton, table } from "../shell/dom.js";
import { failBeside, placeFaults, pointed } from "../shell/faults.js";
import { instant, words } from "../shell/format.js";
import { isoBefore, secondsOf } from "./instants.js";

/** @typedef {{ from: string, to: string, signals?: string[] | null, reason: string }} StreamMark */

const COLUMNS = [
  { title: "From" },
  { title: "To" },
  { title: "Signals" },
  { title: "Reason" },
  { title: "Actions" },
];

/**
 * Gives the spans that plots shade for marks, in seconds since 1970.
 *
 * @param {StreamMark[]} marks
 */
export const spansOf = (marks) =>
  marks.map(({ from, to, signals = null }) => ({
    from: secondsOf(from),
    to: secondsOf(to),
    kind: "marked",
    signals,
  }));

/** @param {StreamMark} mark */
const signalsOf = ({ signals }) => (signals ? signals.map(words).join(", ") : "all signals");

export class StreamMarks {
  /**
   * `chosen()` gives the part that is chosen, in seconds since 1970; `show(from, to)` shows a part, and
   * `changed(spans)` is called with what is to be shaded.
   *
   * @param {{
   *   view: any, address: string, signals: { name: string }[],
   *   chosen: () => number[], show: (from: number, to: number) => void, changed: (spans: any[]) => void,
   * }} options
   */
  constructor({ view, address, signals, chosen, show, changed }) {
    this.view = view;
    this.address = `${address}/marks`;
    this.chosen = chosen;
    this.show = show;
    this.changed = changed;
    this.number = 0;
    /** @type {StreamMark[]} */
    this.marks = [];
    /** @type {StreamMark[] | null} */
    this.before = null;
    this.outcome = notice();
    this.list = h("div", { class: "marks" });
    this.undo = h("button", { type: "button", hidden: true, onclick: () => this.takeBack() }, "Undo");
    this.reason = h("input", { type: "text", size: "32", maxlength: "200", autocomplete: "off" });
    this.boxes = signals.map(({ name }) => h("input", { type: "checkbox", value: name }));
    this.form = h(
      "form",
      { class: "for-writers", "aria-label": "Mark the part as bad", onsubmit: (event) => this.mark(event) },
      h(
        "div",
        { class: "fields" },
        pointed(h("label", {}, "Reason", this.reason), ["reason"]),
        h("button", { type: "submit" }, "Mark this part as bad"),
        this.undo,
      ),
      h(
        "details",
        {},
        h("summary", {}, "Signals that are bad there; all where none is chosen"),
        h(
          "div",
          { class: "choices" },
          this.boxes.map((box) => h("label", { class: "inline" }, box, words(box.value))),
        ),
      ),
    );
    this.element = h(
      "section",
      { "aria-label": "Marks" },
      h("h2", {}, "Marks"),
      h(
        "p",
        { class: "quiet" },
        "Samples that are marked stay in the stream. Recordings that are cut out of it and windows of monitors do without them.",
      ),
      this.form,
      this.outcome.place,
      this.list,
    );
    this.outcome.attempt(() => this.read());
  }

  async read() {
    const { data } = await get(this.address, this.view.signal);
    this.take(data);
  }

  take({ number, marks }) {
    this.number = number;
    this.marks = marks;
    keepingFocus(this.element, () => this.draw());
    this.changed(spansOf(marks));
  }

  draw() {
    this.undo.hidden = this.before === null;
    const rows = this.marks.map((mark, k) => {
      const text = `${signalsOf(mark)}, ${mark.from}, ${mark.reason}`;
      return [
        instant(mark.from, true),
        instant(mark.to, true),
        signalsOf(mark),
        mark.reason,
        h(
          "span",
          { class: "row-actions" },
          smallButton("Show", `Show ${text}`, () => this.look(mark)),
          h(
            "span",
            { class: "for-writers" },
            smallButton("Remove", `Remove the mark: ${text}`, () => this.remove(k)),
          ),
        ),
      ];
    });
    this.list.replaceChildren(table("Marks", COLUMNS, rows, { empty: "Nothing is marked.", stacked: true }));
  }

  look(mark) {
    const [from, to] = [secondsOf(mark.from), secondsOf(mark.to)];
    const room = Math.max(0.5 * (to - from), 1);
    this.show(from - room, to + room);
  }

  // Stores marks in the place of those that are shown. Where the stream has others by now, these are shown first and
  // nothing is stored.
  async store(marks) {
    const before = this.marks;
    try {
      const body = { marks, based_on: this.number };
      const { data } = await send("PUT", this.address, body, { signal: this.view.signal });
      this.before = before;
      this.take(data);
    } catch (error) {
      if (error.status === 409) {
        await this.read();
        throw {
          title: "Marked by someone else meanwhile",
          message: "Your change is not stored: look at the marks, and repeat it if it is still wanted.",
        };
      }
      throw error;
    }
  }

  async mark(event) {
    event.preventDefault();
    placeFaults(this.form, []);
    this.outcome.clear();
    const [from, to] = this.chosen();
    const signals = this.boxes.filter(({ checked }) => checked).map(({ value }) => value);
    const mark = {
      from: isoBefore(from),
      to: isoBefore(to),
      ...(signals.length ? { signals } : {}),
      reason: this.reason.value.trim(),
    };
    try {
      await this.store([...this.marks, mark]);
    } catch (error) {
      // The server counts the marks; the form has the last of them alone.
      const errors = (error.errors ?? []).map((fault) => ({
        ...fault,
        pointer: (fault.pointer ?? "").replace(/^\/marks\/\d+/, ""),
      }));
      failBeside(this.form, this.outcome, Object.assign(error, { errors }));
    }
  }

  remove(place) {
    this.outcome.attempt(() => this.store(this.marks.filter((_, k) => k !== place)));
  }

  takeBack() {
    this.outcome.attempt(async () => {
      await this.store(this.before);
      this.before = null;
      this.draw();
    });
  }
}
