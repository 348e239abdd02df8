// @ts-check
// The first rows of a text stand below the chosen file as the server reads them, before anything is sent to be
// kept. What the reader chooses at a row or a column becomes the value of an option of the form, and the server
// is asked again.

import { query, request } from "../shell/api.js";
import { h, keepingFocus, quoted, smallButton } from "../shell/dom.js";
import { count, unitText, words } from "../shell/format.js";
import { parametersOf } from "./layouts.js";
import { isLeftOut, withLine } from "./lines.js";
import { answersIn, textOfOptions } from "./options.js";
import {
  changesOfKind,
  changesOfRole,
  changesOfRow,
  isLong,
  isOpen,
  isWhole,
  kindOfRow,
  LAYOUT_OPTIONS,
  namedLines,
  ROLE_OPTIONS,
  ROLE_WORDS,
  rolesOf,
  sentenceOf,
  withRolesOfOptions,
} from "./roles.js";
import { unitsIn, unitsSupposed, withUnit } from "./units.js";

const WAIT_MS = 250;
const HEAD_BYTES = 65_536;
const MOST_WHOLE_BYTES = 33_554_432;
const COLUMNS_SHOWN = 60;
const LONG_TEXT = 28;
const FORMATS = { wide: "wide_csv", paired: "paired_csv", long: "long_csv" };
const KIND_WORDS = {
  titles: "titles",
  units: "units",
  left_out: "left out",
  data: "data",
  skipped: "left out by you",
};

// The part shows the first rows of a file. `form.values()` gives the options by their names, `form.saved()` the
// layout that is chosen, `form.put(changes)` sets fields and has the server asked again, and `form.answered(faults)`
// is called with what the server refuses in the rows.
export class LayoutPart {
  constructor(form, signal) {
    this.form = form;
    this.signal = signal;
    /** @type {{ head: Promise<Blob>, type: string } | null} */
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
    this.notes = h("div", {});
    this.element = h(
      "section",
      { class: "first-rows", "aria-label": "How the file is read", hidden: true },
      this.sentence,
      this.choices,
      this.box,
      this.refusal,
      this.notes,
    );
  }

  // Shows the first rows of a file, and no rows where there is no file or it is too large to be looked at.
  choose(file, type) {
    this.file = file && !isTooLarge(file) ? { head: headOf(file), type } : null;
    // A file that is not packed as its name says is told when it is read.
    this.file?.head.catch(() => {});
    this.guesses.clear();
    this.hide();
    this.soon(0);
  }

  soon(wait = WAIT_MS) {
    clearTimeout(this.timer);
    this.asking.abort();
    if (this.file) {
      this.element.setAttribute("aria-busy", "true");
      this.timer = setTimeout(() => this.ask(), wait);
    }
  }

  // An answer that comes after the next question is dropped.
  async ask() {
    this.asking = new AbortController();
    const { head, type } = this.file;
    const values = this.form.values();
    const parameters = parametersOf(values, this.form.saved());
    try {
      const { data } = await request("POST", `/v1/layouts${query(parameters)}`, {
        body: await head,
        signal: AbortSignal.any([this.asking.signal, this.signal]),
        headers: { "content-type": type },
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
    this.element.removeAttribute("aria-busy");
    for (const part of [this.sentence, this.choices, this.box, this.refusal, this.notes]) {
      part.replaceChildren();
    }
  }

  /**
   * @param {import("./roles.js").Answer} told
   * @param {Record<string, string>} values
   */
  show(told, values) {
    const answer = withRolesOfOptions(told, values);
    const unrelated = Object.entries(values).filter(
      ([option]) => option === "skip" || !LAYOUT_OPTIONS.includes(option),
    );
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
    this.note(answer.warnings);
  }

  refuse(faults) {
    this.element.removeAttribute("aria-busy");
    this.refusal.replaceChildren(
      ...(faults.length
        ? [
            h("p", {}, h("strong", {}, "As it stands, the file would be refused:")),
            h(
              "ul",
              { class: "warnings" },
              merged(faults).map(({ detail, column, rest }) =>
                h("li", {}, quoted(detail), rest && ` (${rest})`, this.answersTo(detail, column)),
              ),
            ),
          ]
        : []),
    );
    this.form.answered(faults.filter((fault) => !this.hasUnitField(fault)));
  }

  // Lists what the report of the recording will tell.
  note(warnings) {
    this.notes.replaceChildren(
      ...(warnings.length
        ? [
            h("p", { class: "quiet" }, "The report of the recording will tell:"),
            ...warnings.map(({ signal, detail }) =>
              h(
                "p",
                { class: "note" },
                signal && [h("strong", {}, signal), ": "],
                quoted(detail),
                this.answersTo(detail),
              ),
            ),
          ]
        : []),
    );
  }

  // A button for each answer that the server words, and for each unit that it supposes a column to have.
  answersTo(detail, column = "") {
    const values = this.form.values();
    const answers = answersIn(detail)
      .filter(([option, value]) => values[option] !== value)
      .map(([option, value]) => ({
        // A further line is left out beside those that are.
        changes: { [option]: option === "skip" ? withLine(values.skip, Number(value)) : value },
        text: textOfOptions({ [option]: value }),
      }));
    const supposed = (column ? unitsSupposed(detail) : []).map((unit) => ({
      changes: { units: withUnit(values.units, { name: column, unit: null }, unit) },
      text: `Unit of ${column}: ${unit}`,
    }));
    const buttons = [...answers, ...supposed].map(({ changes, text }) => {
      const act = () => {
        this.form.put(changes);
        this.box.focus();
      };
      return smallButton(text, text, act);
    });
    return buttons.length > 0 && h("span", { class: "answers" }, buttons);
  }

  draw(layout) {
    this.box.hidden = false;
    this.sentence.textContent = sentenceOf(layout.answer);
    this.choices.replaceChildren(...this.choicesOf(layout));
    this.box.replaceChildren(this.tableOf(layout));
  }

  choicesOf(layout) {
    const { answer, values } = layout;
    const kind = Object.keys(FORMATS).find((name) => FORMATS[name] === answer.format);
    const hasPairs = [answer, layout.guess].some((told) => told?.format === FORMATS.paired);
    const isLongFile = answer.file && layout.guess && isLong(layout.guess);
    const kinds = [
      ...(isLongFile ? [] : [["wide", "one sample of every signal"]]),
      ...(hasPairs ? [["paired", "signals with a time or quality each"]] : []),
      ["long", "one sample of one signal"],
    ];
    const hidden = answer.columns.length - COLUMNS_SHOWN;
    return [
      this.sheetChoice(answer),
      kind
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

  // A workbook of several worksheets shows one of them.
  sheetChoice({ sheet, sheets }) {
    const names = sheets.includes(sheet) ? sheets : [sheet, ...sheets];
    return (
      sheets.length > 1 &&
      h(
        "label",
        {},
        "Worksheet",
        h(
          "select",
          { onchange: ({ target }) => this.form.put({ sheet: target.value }) },
          names.map((name) => h("option", { value: name, selected: name === sheet }, name)),
        ),
      )
    );
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
    const read = rows.filter(({ line }) => !isLeftOut(layout.values.skip, line));
    const width = Math.min(
      COLUMNS_SHOWN,
      Math.max(columns.length, ...read.map(({ fields }) => fields.length)),
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
      // The server gives some formats no columns, though they have titles.
      const titles = layout.answer.rows.find(({ line }) => line === layout.answer.header_row);
      return h("th", { scope: "col" }, titles?.fields[k] || "No title");
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
      this.unitOf(layout, k),
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

  // A unit that is asked for is said above its column, where there is a field for it.
  hasUnitField(fault) {
    const fields = [...this.box.querySelectorAll("input.unit")];
    return fields.some((field) => isAboutUnit(fault, { name: field.dataset.name }));
  }

  // A column that is a signal by itself has a field for its unit.
  unitOf({ answer, values }, k) {
    const column = answer.columns[k];
    const isSignal = column.role === "signal" && !isLong(answer);
    if (!isSignal) {
      return column.unit && h("span", { class: "unit" }, ` ${unitText(column.unit)}`);
    }
    const text = unitsIn(values.units)[column.name] ?? column.unit ?? "";
    const isUnknown = answer.faults.some((fault) => isAboutUnit(fault, column));
    return h("input", {
      type: "text",
      class: "unit",
      value: text,
      size: "1",
      "data-name": column.name,
      placeholder: "unit",
      "aria-label": `Unit of column ${k + 1}, ${column.name}`,
      "aria-invalid": isUnknown && "true",
      onchange: ({ target }) =>
        this.form.put({ units: withUnit(this.form.values().units, column, target.value.trim()) }),
    });
  }

  rowOf(layout, { line, fields }, { width, isNamed }) {
    const kind = kindOfRow(layout.answer, line, layout.values.skip);
    const { columns } = layout.answer;
    // A line of a comment has no columns, and neither has one that is left out.
    const isOne = kind === "skipped" || (fields.length === 1 && width > 1);
    const cells = isOne
      ? [h("td", { colspan: String(width) }, fields.join(" "))]
      : Array.from({ length: width }, (_, k) =>
          this.cellOf(columns.length ? roleClass(columns[k]) : null, fields[k] ?? ""),
        );
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

  // A text that is too long for its column is told whole by the pointer.
  cellOf(kind, text) {
    return h("td", { class: kind, title: text.length > LONG_TEXT && text }, text);
  }

  kindChoice(layout, line, kind) {
    const isSpecial = kind === "titles" || kind === "units";
    const last = isSpecial ? ["neither", "neither"] : [kind, KIND_WORDS[kind]];
    const skipped = ["skipped", KIND_WORDS.skipped];
    const read = kind === "skipped" ? ["data", "read"] : last;
    const options = [["titles", "titles"], ["units", "units"], read, skipped].map(([value, text]) => {
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

const isAboutUnit = ({ code, column }, { name }) => code === "unknown_unit" && column === name;

const isTooLarge = ({ name, size }) => isWhole(name) && size > MOST_WHOLE_BYTES;

// Gives what the server looks at: a workbook or a Parquet file as a whole, and the beginning of a text, unpacked
// where its name says that it is packed.
async function headOf(file) {
  if (isWhole(file.name)) {
    return file;
  }
  if (!/\.gz$/i.test(file.name)) {
    return file.slice(0, HEAD_BYTES);
  }
  const reader = file.stream().pipeThrough(new DecompressionStream("gzip")).getReader();
  const parts = [];
  let size = 0;
  while (size < HEAD_BYTES) {
    const { done, value } = await reader.read();
    if (done) {
      break;
    }
    parts.push(value);
    size += value.length;
  }
  reader.cancel();
  return new Blob(parts).slice(0, HEAD_BYTES);
}

// Faults of a kind in a column are told once, with the number of the rest.
function merged(faults) {
  const kinds = new Map();
  for (const [k, fault] of faults.entries()) {
    const key = fault.column ? `${fault.code} ${fault.column}` : String(k);
    const more = Number(/and (\d+) more like it/.exec(fault.detail)?.[1] ?? 0);
    const kind = kinds.get(key);
    kinds.set(key, { first: kind?.first ?? fault, lines: (kind?.lines ?? 0) + 1 + more });
  }
  return [...kinds.values()].map(({ first, lines }) => ({
    detail: first.detail,
    column: first.column,
    rest: lines > 1 && `and ${count(lines - 1)} more like it`,
  }));
}

// A guess that the server asks about stands with a question mark, so that the reader can choose it.
const doubted = (text) =>
  h("option", { value: "", selected: true, disabled: true, hidden: true }, `${text}?`);

const roleClass = (column) => (column ? column.role.replace("_", "-") : "left-out");
