// @ts-check
// The first rows of a text stand below the chosen file as the server reads them, before anything is sent to be
// kept. What the reader chooses at a row or a column becomes the value of an option of the form, and the server
// is asked again.

import { query, request } from "../shell/api.js";
import { h, keepingFocus, quoted } from "../shell/dom.js";
import { count, unitText, words } from "../shell/format.js";
import { parametersOf } from "./layouts.js";
import {
  changesOfKind,
  changesOfRole,
  changesOfRow,
  isLong,
  isOpen,
  kindOfRow,
  LAYOUT_OPTIONS,
  namedLines,
  ROLE_OPTIONS,
  ROLE_WORDS,
  rolesOf,
  sentenceOf,
} from "./roles.js";

const WAIT_MS = 250;
const HEAD_BYTES = 65_536;
const COLUMNS_SHOWN = 60;
const KIND_WORDS = { titles: "titles", units: "units", left_out: "left out", data: "data" };

// The part shows the first rows of a file. `form.values()` gives the options by their names, `form.saved()` the
// layout that is chosen, `form.put(changes)` sets fields and has the server asked again, and `form.answered(faults)`
// is called with what the server refuses in the rows.
export class LayoutPart {
  constructor(form, signal) {
    this.form = form;
    this.signal = signal;
    /** @type {{ head: Blob, type: string } | null} */
    this.file = null;
    // The guesses are the answers for options that give no column a role, by the values of these options.
    /** @type {Map<string, import("./roles.js").Answer>} */
    this.guesses = new Map();
    this.timer = null;
    this.asking = new AbortController();
    this.sentence = h("p", { role: "status" });
    this.choices = h("div", { class: "fields" });
    this.box = h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": "First rows" });
    this.refusal = h("div", { "aria-live": "polite" });
    this.element = h(
      "section",
      { class: "first-rows", "aria-label": "How the file is read", hidden: true },
      this.sentence,
      this.choices,
      this.box,
      this.refusal,
    );
  }

  // Shows the first rows of a file, and no rows where there is no file or the file is no text.
  choose(file, type) {
    this.file = file && { head: file.slice(0, HEAD_BYTES), type };
    this.guesses.clear();
    this.hide();
    this.soon(0);
  }

  soon(wait = WAIT_MS) {
    clearTimeout(this.timer);
    this.asking.abort();
    if (this.file) {
      this.timer = setTimeout(() => this.ask(), wait);
    }
  }

  // An answer that comes after the next question is dropped.
  async ask() {
    this.asking = new AbortController();
    const values = this.form.values();
    const parameters = parametersOf(values, this.form.saved());
    try {
      const { data } = await request("POST", `/v1/layouts${query(parameters)}`, {
        body: this.file.head,
        signal: AbortSignal.any([this.asking.signal, this.signal]),
        headers: { "content-type": this.file.type },
      });
      this.show(data, values);
    } catch (error) {
      if (error.name !== "AbortError") {
        this.fail(error, parameters);
      }
    }
  }

  // Rows that were shown stay while an option is refused, and a refused option is told where no rows were shown.
  // Whatever else goes wrong, the file can be uploaded without its rows being shown.
  fail({ status, message, errors = [] }, parameters) {
    const isTold = !this.element.hidden || errors.some(({ parameter }) => parameters[parameter]);
    if (isTold && [400, 422].includes(status)) {
      this.element.hidden = false;
      this.refuse(errors.length ? errors : [{ detail: message }]);
    } else {
      this.hide();
    }
  }

  hide() {
    this.element.hidden = true;
    this.box.hidden = true;
    for (const part of [this.sentence, this.choices, this.box, this.refusal]) {
      part.replaceChildren();
    }
  }

  /** @param {import("./roles.js").Answer} answer */
  show(answer, values) {
    const unrelated = Object.entries(values).filter(([option]) => !LAYOUT_OPTIONS.includes(option));
    const keyOf = (titles, units) => JSON.stringify([titles, units, unrelated]);
    const key = keyOf(values.header_row, values.unit_row);
    if (ROLE_OPTIONS.every((option) => !values[option])) {
      this.guesses.set(key, answer);
    }
    const guess = this.guesses.get(key);
    const layout = { answer, values, guess, rowGuess: this.guesses.get(keyOf("", "")) };
    if (answer.rows.length === 0) {
      this.hide();
      return;
    }
    this.element.hidden = false;
    keepingFocus(this.element, () => this.draw(layout));
    this.refuse(answer.faults);
  }

  refuse(faults) {
    this.refusal.replaceChildren(
      ...(faults.length
        ? [
            h("p", {}, h("strong", {}, "As it stands, the file would be refused:")),
            h(
              "ul",
              { class: "warnings" },
              faults.map(({ detail }) => h("li", {}, quoted(detail))),
            ),
          ]
        : []),
    );
    this.form.answered(faults);
  }

  draw(layout) {
    this.box.hidden = false;
    this.sentence.textContent = sentenceOf(layout.answer);
    this.choices.replaceChildren(...this.choicesOf(layout));
    this.box.replaceChildren(this.tableOf(layout));
  }

  choicesOf(layout) {
    const { answer, values } = layout;
    const hasKind = ["wide_csv", "long_csv"].includes(answer.format);
    const kinds = [
      ["wide", "one sample of every signal"],
      ["long", "one sample of one signal"],
    ];
    const kind = isLong(answer) ? "long" : "wide";
    const hidden = answer.columns.length - COLUMNS_SHOWN;
    return [
      hasKind
        ? h(
            "label",
            {},
            "Each row holds",
            h(
              "select",
              { onchange: ({ target }) => this.form.put(changesOfKind(layout, target.value)) },
              kinds.map(([value, text]) => h("option", { value, selected: value === kind }, text)),
            ),
          )
        : h("p", {}, `Format: ${words(answer.format)}.`),
      this.wayBack(values),
      hidden > 0 && h("p", { class: "quiet" }, `${count(hidden)} more columns are not shown.`),
    ].filter(Boolean);
  }

  // A button takes the choices at the rows back to the chosen layout, or to the guess of the server.
  wayBack(values) {
    const saved = this.form.saved();
    const before = Object.fromEntries(LAYOUT_OPTIONS.map((option) => [option, saved?.options[option] ?? ""]));
    const back = () => {
      this.form.put(before);
      this.box.focus();
    };
    const isChanged = LAYOUT_OPTIONS.some((option) => values[option] !== before[option]);
    const text = saved ? "Back to what the layout says" : "Back to what the file tells";
    return isChanged && h("button", { type: "button", onclick: back }, text);
  }

  tableOf(layout) {
    const { columns, rows } = layout.answer;
    const width = Math.min(
      COLUMNS_SHOWN,
      Math.max(columns.length, ...rows.map(({ fields }) => fields.length)),
    );
    const lines = namedLines(layout.answer);
    return h(
      "table",
      {},
      h("caption", { class: "unseen" }, "First rows of the file, and what each row and column is"),
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          h("th", { scope: "col" }, "Line"),
          Array.from({ length: width }, (_, k) => this.headOf(layout, k)),
        ),
      ),
      h(
        "tbody",
        {},
        rows.map((row) => this.rowOf(layout, row, { width, isNamed: lines.includes(row.line) })),
      ),
    );
  }

  // Above a column stand the name and the unit that its samples get, and its role.
  headOf(layout, k) {
    const column = layout.answer.columns[k];
    if (!column) {
      return h("th", { scope: "col" }, "No title");
    }
    const name = column.name || column.title || `column ${k + 1}`;
    const options = rolesOf(layout.answer, column).map((role) => {
      const changes = changesOfRole(layout, k, role);
      const text = ROLE_WORDS[role] ?? words(role);
      const isSelected = role === column.role;
      return h("option", { value: role, selected: isSelected, disabled: changes === null }, text);
    });
    const doubt = isOpen(layout.answer, column.role) && doubted(ROLE_WORDS[column.role]);
    return h(
      "th",
      { scope: "col", class: roleClass(column) },
      h("span", { class: "name" }, name),
      column.unit && h("span", { class: "unit" }, ` ${unitText(column.unit)}`),
      h(
        "select",
        {
          "aria-label": `Role of column ${k + 1}, ${name}`,
          onchange: ({ target }) => this.form.put(changesOfRole(layout, k, target.value)),
        },
        options,
        doubt,
      ),
    );
  }

  rowOf(layout, { line, fields }, { width, isNamed }) {
    const kind = kindOfRow(layout.answer, line);
    const { columns } = layout.answer;
    // A line of a comment has no columns.
    const isWhole = fields.length === 1 && width > 1;
    const cells = isWhole
      ? [h("td", { colspan: String(width) }, fields[0])]
      : Array.from({ length: width }, (_, k) => h("td", { class: roleClass(columns[k]) }, fields[k] ?? ""));
    return h(
      "tr",
      { class: kind.replace("_", "-") },
      h(
        "th",
        { scope: "row" },
        h("span", { class: "line" }, String(line)),
        isNamed ? this.kindChoice(layout, line, kind) : KIND_WORDS[kind],
      ),
      cells,
    );
  }

  kindChoice(layout, line, kind) {
    const isSpecial = kind === "titles" || kind === "units";
    const last = isSpecial ? ["neither", "neither"] : [kind, KIND_WORDS[kind]];
    const options = [["titles", "titles"], ["units", "units"], last].map(([value, text]) => {
      const disabled = value !== kind && changesOfRow(layout, line, value) === null;
      return h("option", { value, selected: value === kind, disabled }, text);
    });
    const option = { titles: "header_row", units: "unit_row" }[kind];
    return h(
      "select",
      {
        "aria-label": `What line ${line} is`,
        onchange: ({ target }) => this.form.put(changesOfRow(layout, line, target.value)),
      },
      options,
      isOpen(layout.answer, option) && doubted(KIND_WORDS[kind]),
    );
  }
}

// A guess that the server asks about stands with a question mark, so that the reader can choose it.
const doubted = (text) =>
  h("option", { value: "", selected: true, disabled: true, hidden: true }, `${text}?`);

const roleClass = (column) => (column ? column.role.replace("_", "-") : "left-out");
