// @ts-check
// The form sends a recording to the server, in any format that the server takes. The server asks for
// what it cannot know (the zone, the order of a date, a unit), and the form puts the question beside
// the file. The first rows of a text are shown as the server reads them.

import { query, request } from "../shell/api.js";
import { described, namesOfParameter } from "../shell/description.js";
import { h, notice, warningList } from "../shell/dom.js";
import { count, duration, words } from "../shell/format.js";
import { LayoutPart } from "./layout.js";
import { isText, LAYOUT_OPTIONS } from "./roles.js";

// Each option tells the server something about a file; it has a title and either a hint or a list of
// choices. The server says which choices the options of NAMED have.
const NAMED = ["format", "quality_scheme"];
const OPTIONS = {
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

// The server asks for an option in a refusal by naming it, in the words of a fault or as the parameter
// of a fault.
export function askedFor(faults) {
  const named = faults.flatMap(({ detail = "", parameter }) => [
    parameter,
    ...[...detail.matchAll(/`([a-z_]+)`/g)].map(([, name]) => name),
  ]);
  return [...new Set(named)].filter((name) => name in OPTIONS);
}

// The media type of a file follows from its name; the server tells the format from the first lines of
// the file.
export function mediaType(name) {
  const extension = /\.([a-z0-9]+)(?:\.gz)?$/i.exec(name)?.[1]?.toLowerCase();
  const types = {
    json: "application/json",
    csv: "text/csv",
    tsv: "text/csv",
    parquet: "application/vnd.apache.parquet",
    xlsx: "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
  };
  return types[extension] ?? "text/plain";
}

// The uploader is the form to choose or drop a file; `stored(dataset)` is called with the dataset that
// the server kept.
export function uploader(view, stored) {
  const outcome = notice();
  const state = { file: null, fields: new Map() };
  const file = h("input", { type: "file", onchange: () => choose(file.files[0]) });
  const name = h("input", { type: "text", maxlength: "200", placeholder: "name of the file" });
  const heading = h("strong", {});
  const change = () => layout.soon();
  const questions = h("div", { class: "fields", onchange: change, hidden: true });
  const rest = h("div", { class: "fields", onchange: change });
  const chosen = h("span", { class: "quiet" });
  const button = h("button", { type: "submit", class: "primary", disabled: true }, "Upload");

  const choose = (choice) => {
    state.file = choice ?? null;
    button.disabled = !state.file;
    chosen.textContent = state.file ? `${state.file.name}, ${count(state.file.size)} bytes` : "";
    rest.append(...labels);
    questions.hidden = true;
    outcome.clear();
    const isShown = state.file && isText(state.file.name);
    layout.choose(isShown ? state.file : null, mediaType(state.file?.name ?? ""));
  };
  const labels = Object.keys(OPTIONS).map((option) => field(option, state.fields));
  // A field that is asked for stays among the questions until another file is chosen, and so does the focus.
  const ask = (options, words) => {
    heading.textContent = options.length ? words : "The file left this open:";
    for (const { label } of options.map((option) => state.fields.get(option))) {
      if (!questions.contains(label) && !label.contains(document.activeElement)) {
        questions.append(label);
      }
    }
    questions.hidden = !questions.querySelector("label");
  };
  const layout = new LayoutPart(
    {
      values: () => valuesOf(state.fields),
      put: (option, text) => {
        state.fields.get(option).input.value = text;
      },
      // What the rows are is said at the rows themselves.
      answered: (faults) => {
        const options = askedFor(faults).filter((option) => !LAYOUT_OPTIONS.includes(option));
        ask(options, "The file leaves this open:");
      },
    },
    view.signal,
  );
  questions.append(h("p", {}, heading));
  rest.append(...labels);
  described().then(
    (description) => {
      for (const option of NAMED) {
        const names = namesOfParameter(description, "/v1/datasets", "post", option);
        const choices = names.map((value) => h("option", { value }, words(value)));
        state.fields.get(option).input.append(...choices);
      }
    },
    (error) => outcome.fail(error),
  );

  const submit = async (event) => {
    event.preventDefault();
    if (!state.file) {
      return;
    }
    let openField = null;
    button.disabled = true;
    outcome.show(h("p", { role: "status" }, `Uploading ${state.file.name} …`));
    try {
      const answer = await send(view, state, name.value.trim());
      outcome.show(receipt(answer));
      stored(answer.data);
    } catch (error) {
      outcome.fail(error);
      const options = askedFor(error.errors ?? []);
      ask(options, "The file leaves this open; say it and upload again:");
      openField = options.length ? state.fields.get(options[0]).input : null;
    }
    button.disabled = false;
    openField ? openField.focus() : outcome.place.scrollIntoView({ block: "nearest" });
  };
  const drop = (event) => {
    event.preventDefault();
    form.classList.remove("over");
    choose(event.dataTransfer.files[0]);
  };
  const over = (on) => (event) => {
    event.preventDefault();
    form.classList.toggle("over", on);
  };
  const form = h(
    "form",
    { class: "panel drop", onsubmit: submit, ondrop: drop, ondragover: over(true), ondragleave: over(false) },
    h(
      "div",
      { class: "fields" },
      h("label", {}, "Recording: choose a file, or drop it here", file),
      h("label", {}, "Name", name),
      button,
      chosen,
    ),
    outcome.place,
    layout.element,
    questions,
    h("details", {}, h("summary", {}, "What the file does not say"), rest),
    h(
      "p",
      { class: "quiet" },
      "CSV with units in the header such as ",
      h("code", {}, "time [s],position [mm]"),
      ", an Excel workbook, Apache Parquet, or what a historian gives: PI, AVEVA, Canary, OPC UA, Cognite, InfluxDB, Ignition, Simulink, pandas. Values become SI; an empty field is a missing sample.",
    ),
  );
  return form;
}

function field(option, fields) {
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
        choices.map(([value, text]) => h("option", { value }, text)),
      )
    : h("input", { type: "text", placeholder: hint, list: suggestions ? suggestions.id : null });
  const label = h("label", {}, title, input, suggestions);
  fields.set(option, { label, input });
  return label;
}

const valuesOf = (fields) =>
  Object.fromEntries([...fields].map(([option, { input }]) => [option, input.value.trim()]));

function send(view, { file, fields }, name) {
  const json = mediaType(file.name) === "application/json";
  const values = valuesOf(fields);
  const label = name || file.name.replace(/(\.[a-z0-9]+)+$/i, "") || file.name;
  return request(
    "POST",
    `/v1/datasets${query({ name: label, ...values, time: json ? null : values.time })}`,
    {
      body: file,
      signal: view.signal,
      headers: {
        "content-type": mediaType(file.name),
        ...(file.name.endsWith(".gz") ? { "content-encoding": "gzip" } : {}),
      },
    },
  );
}

function receipt({ data, status }) {
  const warnings = data.report?.warnings ?? [];
  return h(
    "div",
    {},
    h(
      "p",
      {},
      status === 200 ? "The same recording was stored before: " : "Stored: ",
      h("a", { href: `#/datasets/${data.id}` }, data.name || data.id),
      `, ${count(data.samples)} samples over ${duration(data.duration_s)}.`,
    ),
    warnings.length
      ? warningList(warnings)
      : h("p", { class: "quiet" }, "The quality report warns of nothing."),
  );
}
