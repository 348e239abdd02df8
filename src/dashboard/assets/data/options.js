// @ts-check
// The options tell the server what a file does not say. Each has a field, and the fields that the server asks
// for stand beside the file.

import { described, namesOfParameter } from "../shell/description.js";
import { h } from "../shell/dom.js";
import { words } from "../shell/format.js";

// Each option tells the server something about a file; it has a title and either a hint or a list of
// choices. The server says which choices the options of NAMED have.
const NAMED = ["format", "quality_scheme"];
// A hint of so many characters fits a field of the usual width.
const SHORT_HINT = 18;
export const OPTIONS = {
  tz: { title: "Time zone of its clock", hint: "Europe/Berlin", list: () => zones() },
  time_unit: {
    title: "What its times are",
    choices: [
      ["s", "seconds"],
      ["ms", "milliseconds"],
      ["us", "microseconds"],
      ["ns", "nanoseconds"],
      ["min", "minutes"],
      ["h", "hours"],
      ["dmy", "dates, day first"],
      ["mdy", "dates, month first"],
      ["excel", "Excel's serial days"],
      ["datenum", "MATLAB's days (datenum)"],
      ["julian", "Julian days"],
      ["labview", "LabVIEW's seconds since 1904"],
      ["filetime", "Windows file times"],
      ["ticks", ".NET ticks"],
    ],
  },
  header_row: { title: "Line of the titles", hint: "a line, or none" },
  unit_row: { title: "Line of the units", hint: "a line, or none" },
  skip: { title: "Lines to leave out", hint: "7, 20-25, 100-" },
  time: { title: "Column of the time", hint: "first column" },
  tag: { title: "Column that names the signal" },
  value: { title: "Columns of values", hint: "name, name" },
  quality: { title: "Column of the quality" },
  decimal: {
    title: "Decimal sign",
    choices: [
      [".", "point"],
      [",", "comma"],
    ],
  },
  units: { title: "Units of signals", hint: "pressure:bar, position:mm" },
  missing: { title: "What stands for no sample", hint: "-9999, Bad" },
  ignore: { title: "Signals to leave out", hint: "name, name" },
  rename: { title: "New names", hint: "old:new, old:new" },
  encoding: { title: "Encoding", hint: "windows-1252" },
  format: { title: "Format", choices: [] },
  quality_scheme: { title: "Codes of quality", choices: [] },
  interpolation: { title: "Between samples", hint: "hold, or valve:hold" },
  grid: { title: "Common instants", hint: "10ms, 100Hz or none" },
  sheet: { title: "Worksheet", hint: "first that has anything in it" },
};

function zones() {
  const zone = Intl.DateTimeFormat().resolvedOptions().timeZone;
  return [zone, ...(Intl.supportedValuesOf?.("timeZone") ?? [])];
}

// The server asks for an option in a refusal by naming it, in the words of a fault, as the parameter of a fault
// or, where a layout is saved, by the path of the option. The words also name the column, which may be called like
// an option.
export function askedFor(faults) {
  const named = faults.flatMap(({ detail = "", parameter, pointer = "", column }) => [
    parameter,
    /^\/options\/([a-z_]+)$/.exec(pointer)?.[1],
    ...[...detail.matchAll(/`([a-z_]+)`|\b([a-z_]+)=/g)]
      .map(([, quotedName, name]) => quotedName ?? name)
      .filter((name) => name !== column),
  ]);
  return [...new Set(named)].filter((name) => name in OPTIONS);
}

// Lists the answers that the words of the server give with their option, such as missing=-9999. The words
// `units=name:unit` only tell how units are written.
/**
 * @param {string} detail
 * @returns {[string, string][]}
 */
export function answersIn(detail) {
  const answers = [...detail.matchAll(/\b([a-z_]+)=(\S+?)(?=[`.,;:]*(?:\s|$))/g)];
  return answers
    .map(([, option, value]) => /** @type {[string, string]} */ ([option, value]))
    .filter(([option]) => option in OPTIONS && option !== "units");
}

// Writes options in the words of their fields.
/** @param {Record<string, string>} options */
export function textOfOptions(options) {
  const said = Object.keys(OPTIONS).filter((option) => options[option]);
  return said.map((option) => `${OPTIONS[option].title}: ${valueText(option, options[option])}`).join("; ");
}

function valueText(option, value) {
  const text = OPTIONS[option].choices?.find(([choice]) => choice === value)?.[1];
  return text ?? (NAMED.includes(option) ? words(value) : value);
}

const choiceOf = (option, value) => h("option", { value }, valueText(option, value));

function field(option) {
  const { title, hint, choices, list } = OPTIONS[option];
  const suggestions = list
    ? h(
        "datalist",
        { id: `list-${option}` },
        [...new Set(list())].map((value) => h("option", { value })),
      )
    : null;
  const input = choices
    ? h(
        "select",
        {},
        h("option", { value: "" }, "as the file says"),
        choices.map(([value]) => choiceOf(option, value)),
      )
    : h("input", {
        type: "text",
        placeholder: hint,
        size: hint && hint.length > SHORT_HINT && String(hint.length),
        list: suggestions ? suggestions.id : null,
      });
  return { label: h("label", {}, title, input, suggestions), input };
}

// The fields of all options stand among the questions that the server asks, or among the rest. `changed()` is
// called when the reader has changed a field.
export class OptionFields {
  constructor(changed) {
    this.fields = new Map(Object.keys(OPTIONS).map((option) => [option, field(option)]));
    this.heading = h("strong", {});
    this.questions = h("div", { class: "fields", onchange: changed }, h("p", {}, this.heading));
    this.rest = h("div", { class: "fields", onchange: changed });
    this.settle();
  }

  /** @returns {Record<string, string>} */
  values() {
    return Object.fromEntries([...this.fields].map(([option, { input }]) => [option, input.value.trim()]));
  }

  /** @param {Record<string, string>} values */
  put(values) {
    for (const [option, value] of Object.entries(values)) {
      const { input } = this.fields.get(option);
      this.offer(option, value);
      input.value = value;
    }
  }

  // A list of choices takes a value that the page does not know.
  offer(option, value) {
    const { input } = this.fields.get(option);
    const isChoice = input.tagName === "SELECT";
    if (isChoice && ![...input.options].some((choice) => choice.value === value)) {
      input.append(choiceOf(option, value));
    }
  }

  // The server says which choices the options of NAMED have.
  async offerNamed() {
    const description = await described();
    for (const option of NAMED) {
      for (const value of namesOfParameter(description, "/v1/datasets", "post", option)) {
        this.offer(option, value);
      }
    }
  }

  // Every field stands among the rest again.
  settle() {
    this.rest.append(...[...this.fields.values()].map(({ label }) => label));
    this.questions.hidden = true;
  }

  // A field that is asked for stays among the questions until another file is chosen, and so does the focus.
  // The answer is the first field that is asked for.
  ask(options, text) {
    this.heading.textContent = options.length ? text : "The file left this open:";
    const asked = options.map((option) => this.fields.get(option));
    for (const { label } of asked) {
      if (!this.questions.contains(label) && !label.contains(document.activeElement)) {
        this.questions.append(label);
      }
    }
    this.questions.hidden = !this.questions.querySelector("label");
    return asked[0]?.input ?? null;
  }
}
