// @ts-check
// The form marks stretches and samples of a recording as bad. A stretch that is dragged, a sample that is clicked and
// the places of a warning come into the same form, where all can be changed before they are stored.

import { h, notice, smallButton } from "../shell/dom.js";
import { failBeside, placeFaults, pointed } from "../shell/faults.js";
import { numberOf, words } from "../shell/format.js";
import { faultsInForm, faultsOfDraft, marksOf, REASONS } from "./marks.js";

// An instant such as 47 times 0.01 s is written with so many digits, which leave out how it was computed.
const DIGITS = 15;

export class MarkForm {
  /**
   * `store(marks)` adds the marks to the newest version, and rejects where they cannot be stored. `before()` gives how
   * many marks the newest version has. `changed(marks)` is called with what the form has, to shade it.
   *
   * @param {any} dataset
   * @param {{
   *   store: (marks: import("./marks.js").Mark[]) => Promise<void>,
   *   before: () => number,
   *   changed: (marks: import("./marks.js").Mark[]) => void,
   * }} acts
   */
  constructor(dataset, { store, before, changed }) {
    this.store = store;
    this.before = before;
    this.changed = changed;
    /** @type {HTMLElement | null} */
    this.opener = null;
    this.outcome = notice();
    this.rows = h("div", { class: "spans" });
    this.all = h("input", { type: "checkbox", onchange: () => this.drawAll() });
    this.boxes = new Map(
      dataset.signals.map(({ name }) => [name, h("input", { type: "checkbox", value: name })]),
    );
    this.reason = h("input", {
      type: "text",
      size: "32",
      maxlength: "200",
      list: "mark-reasons",
      autocomplete: "off",
    });
    this.hint = h("p", { class: "quiet", hidden: true });
    this.button = h("button", { type: "submit", class: "primary" }, "Save");
    this.element = h(
      "form",
      {
        class: "panel mark-form",
        "aria-label": "Mark as bad",
        onsubmit: (event) => this.save(event),
        onchange: () => this.changed(marksOf(this.draft)),
        onkeydown: (event) => event.key === "Escape" && this.close(),
      },
      this.fields(),
    );
  }

  fields() {
    const box = (input, title) => h("label", { class: "inline" }, input, title);
    const add = () => this.addRow({ from_s: NaN, to_s: NaN }).querySelector("input").focus();
    return [
      h("h3", {}, "Mark as bad"),
      this.hint,
      this.rows,
      smallButton("Add a stretch", "Add a stretch", add),
      pointed(
        h(
          "fieldset",
          {},
          h("legend", {}, "Signals that are bad there"),
          box(this.all, "all signals"),
          h(
            "div",
            { class: "choices" },
            [...this.boxes].map(([name, input]) => box(input, words(name))),
          ),
        ),
        ["signals"],
      ),
      pointed(h("label", {}, "Reason", this.reason), ["reason"]),
      h(
        "datalist",
        { id: "mark-reasons" },
        REASONS.map((value) => h("option", { value })),
      ),
      this.outcome.place,
      h(
        "div",
        { class: "actions" },
        this.button,
        h("button", { type: "button", onclick: () => this.close() }, "Cancel"),
      ),
    ];
  }

  get isOpen() {
    return this.element.isConnected;
  }

  /**
   * Shows the form behind an element. Stretches are added to those that an open form has; the reason and the signals
   * that were chosen there stay, and `name` is chosen beside them.
   *
   * @param {Element} place
   * @param {{ spans: { from_s: number, to_s: number }[], name?: string | null, reason?: string, hint?: string }} marked
   */
  open(place, { spans, name = null, reason = "", hint = "" }) {
    if (!this.isOpen) {
      this.clear();
    }
    this.opener = /** @type {HTMLElement | null} */ (document.activeElement);
    this.dropEmpty();
    const before = this.draft.spans;
    const isNew = ({ from_s, to_s }) => !before.some((span) => span.from_s === from_s && span.to_s === to_s);
    for (const span of spans.filter(isNew)) {
      this.addRow(span);
    }
    if (name === null && ![...this.boxes.values()].some((box) => box.checked)) {
      this.all.checked = true;
    }
    const box = this.boxes.get(name);
    if (box && !this.all.checked) {
      box.checked = true;
    }
    this.drawAll();
    this.reason.value ||= reason;
    this.hint.textContent = hint;
    this.hint.hidden = !hint;
    place.after(this.element);
    this.changed(marksOf(this.draft));
    const empty = [...this.rows.querySelectorAll("input")].find((input) => !input.value);
    (empty ?? this.reason).focus({ preventScroll: true });
    this.element.scrollIntoView({ block: "nearest" });
  }

  clear() {
    this.rows.replaceChildren();
    for (const box of [this.all, ...this.boxes.values()]) {
      box.checked = false;
    }
    this.reason.value = "";
    this.outcome.clear();
    placeFaults(this.element, []);
  }

  close() {
    this.element.remove();
    this.changed([]);
    this.opener?.isConnected && this.opener.focus({ preventScroll: true });
  }

  // A mark that is about all signals needs no choice of them.
  drawAll() {
    for (const box of this.boxes.values()) {
      box.disabled = this.all.checked;
    }
  }

  dropEmpty() {
    for (const row of [...this.rows.children]) {
      const isEmpty = [...row.querySelectorAll("input")].every((input) => input.value.trim() === "");
      isEmpty && row.remove();
    }
  }

  addRow({ from_s, to_s }) {
    const field = (member, title, value) =>
      h(
        "label",
        { class: "inline", "data-member": member },
        title,
        h("input", {
          type: "text",
          inputmode: "decimal",
          size: "10",
          value: Number.isFinite(value) ? String(Number(value.toPrecision(DIGITS))) : "",
        }),
      );
    const row = h(
      "div",
      { class: "span-row", role: "group" },
      field("from_s", "from, s", from_s),
      field("to_s", "to, s", to_s),
    );
    const remove = smallButton("×", "", () => {
      row.remove();
      this.number();
      this.changed(marksOf(this.draft));
      (this.rows.querySelector("input") ?? this.reason).focus();
    });
    row.append(remove);
    this.rows.append(row);
    this.number();
    return row;
  }

  // Names the rows by their places, which the faults of the server name too.
  number() {
    [...this.rows.children].forEach((row, k) => {
      row.setAttribute("aria-label", `Stretch ${k + 1}`);
      row.lastElementChild.setAttribute("aria-label", `Leave stretch ${k + 1} unmarked`);
      for (const label of row.querySelectorAll("label")) {
        pointed(label, ["spans", k, label.dataset.member]);
      }
    });
  }

  get draft() {
    const chosen = [...this.boxes].filter(([, box]) => box.checked).map(([name]) => name);
    return {
      spans: [...this.rows.children].map((row) => {
        const [from_s, to_s] = [...row.querySelectorAll("input")].map(({ value }) => numberOf(value));
        return { from_s, to_s };
      }),
      signals: this.all.checked ? null : chosen,
      reason: this.reason.value,
    };
  }

  async save(event) {
    event.preventDefault();
    const { draft } = this;
    this.button.disabled = true;
    placeFaults(this.element, []);
    this.outcome.clear();
    try {
      const errors = faultsOfDraft(draft);
      if (errors.length) {
        throw { title: "Nothing is marked yet", errors };
      }
      await this.store(marksOf(draft));
      this.close();
    } catch (error) {
      const errors = faultsInForm(error.errors ?? [], this.before());
      failBeside(this.element, this.outcome, Object.assign(error, { errors }));
      this.element.scrollIntoView({ block: "nearest" });
    }
    this.button.disabled = false;
  }
}
