// @ts-check
// The page edits the equations of a model as text. The server checks them as the reader types; beside
// the text stand the equations as formulas, the unit of every symbol, and the response of the model.

import { get, items, send } from "../shell/api.js";
import { described } from "../shell/description.js";
import { h, notice, quoted, table } from "../shell/dom.js";
import { unitText, words } from "../shell/format.js";
import { keep } from "../shell/prepared.js";
import { asYaml, columnAt, lineAt, placed, readText } from "../text/document.js";
import { Editor, editorLibrary } from "../text/editor.js";
import { equation } from "./equation.js";
import { describedBy, equationsOf, MODEL_WORDS, namesOf, wordsAt } from "./language.js";
import { trialPart } from "./trial.js";

const WAIT_MS = 300;
const EXAMPLE = `name: my_model
title: First-order lag
inputs:
  drive: {symbol: u, unit: V}
parameters:
  gain: {symbol: K, unit: m/V, default: 0.5, lower: 0.05, upper: 5, scale: log, unknown: true}
  lag: {symbol: T, unit: s, default: 1, lower: 0.1, upper: 10, scale: log, unknown: true}
states:
  travel: {symbol: x, unit: m, derivative: (K*u - x)/T, initial: 0}
outputs:
  position: {unit: m, expression: x}
`;

export function showModelEditor(view) {
  const outcome = notice();
  const place = h("div", {}, h("p", { class: "quiet" }, "Loading …"));
  view.root.append(
    h("h1", { tabindex: "-1" }, "Your own equations"),
    h(
      "p",
      { class: "quiet" },
      "What goes in, what is kept, what comes out, and a rate for each state. The server checks names and units as you type. ",
      h("a", { href: "/docs/equations" }, "The language of equations"),
      ".",
    ),
    outcome.place,
    place,
  );
  const from = view.query.get("from");
  const source = from
    ? get(`/v1/models/${encodeURIComponent(from)}`, view.signal).then(({ data }) => data.document)
    : null;
  Promise.all([editorLibrary(), source, languageWords(view)])
    .then(([library, document, language]) => {
      const text = document ? asYaml(library, document) : EXAMPLE;
      const page = new ModelEditor(view, { library, language }, text, outcome);
      place.replaceChildren(page.element);
      page.soon(0);
    })
    .catch((error) => {
      place.replaceChildren();
      outcome.fail(error);
    });
}

// The server says which functions the language has. Usual units are those of the models that it lists and
// those of recordings.
async function languageWords(view) {
  const [description, models] = await Promise.all([described(), get("/v1/models", view.signal)]);
  const quantities = items(models.data).flatMap(({ inputs, outputs, states, parameters }) => [
    ...parameters,
    ...states,
    ...inputs,
    ...outputs,
  ]);
  const used = quantities.map(({ unit }) => unit).filter(Boolean);
  const units = [...new Set([...used, ...Object.keys(description["x-units"])])].sort();
  return { functions: Object.entries(description["x-functions"]), units };
}

class ModelEditor {
  constructor(view, { library, language }, text, outcome) {
    this.view = view;
    this.library = library;
    this.outcome = outcome;
    this.read = null;
    this.timer = null;
    this.asking = null;
    this.editor = new Editor({
      label: "Equations of the model",
      value: text,
      signal: view.signal,
      changed: () => this.soon(),
      language: MODEL_WORDS,
      words: (before) => wordsAt(before, this.read?.value ?? this.last, language),
    });
    this.state = h("p", { role: "status" });
    this.faults = h("ul", { class: "warnings faults" });
    this.equations = h("div", {
      class: "equations",
      tabindex: "0",
      role: "region",
      "aria-label": "Equations",
    });
    this.symbols = h("div", {});
    this.trial = trialPart(view, () => this.soon());
    this.keep = h(
      "button",
      { type: "button", class: "primary", disabled: true, onclick: () => this.store() },
      "Keep this model, and set up a job",
    );
    this.element = h(
      "div",
      {},
      h(
        "div",
        { class: "pair wide" },
        h("div", {}, this.editor.element, this.state, this.faults, h("div", { class: "actions" }, this.keep)),
        h("div", {}, this.equations, this.symbols),
      ),
      this.trial.element,
    );
  }

  soon(wait = WAIT_MS) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.check(), wait);
    this.keep.disabled = true;
  }

  async check() {
    const text = this.editor.value;
    const read = readText(this.library, text);
    this.read = read;
    if (
      read.faults.length === 0 &&
      (read.value === null || typeof read.value !== "object" || Array.isArray(read.value))
    ) {
      read.faults.push({
        from: 0,
        to: text.length,
        message: "A model is a list of names with what they are: name, inputs, parameters, states, outputs.",
      });
    }
    if (read.faults.length > 0) {
      this.say(
        "This cannot be read yet:",
        read.faults.map((fault) => ({
          ...fault,
          line: lineAt(text, fault.from),
          column: columnAt(text, fault.from),
        })),
      );
      return;
    }
    this.last = read.value;
    this.show(read.value);
    this.asking?.abort();
    this.asking = new AbortController();
    const { asking } = this;
    this.view.signal.addEventListener("abort", () => asking.abort(), { once: true });
    try {
      await this.trial.run(read.value, asking.signal);
      this.say("No fault: every name is known, and the units agree.", []);
      this.keep.disabled = false;
    } catch (error) {
      if (error.name === "AbortError") {
        return;
      }
      const faults = (error.errors ?? []).filter(({ pointer }) => pointer?.startsWith("/model"));
      if (faults.length > 0) {
        this.say("The server says:", placed(read, text, faults, "/model"));
      } else {
        // The document is in order, but its excitation is not.
        this.say("No fault: every name is known, and the units agree.", []);
        this.keep.disabled = false;
        this.trial.fail(error);
      }
    }
  }

  say(words, faults) {
    this.state.textContent = words;
    this.state.className = faults.length ? "bad" : "good";
    this.editor.mark(faults);
    const parted = faults.some(({ message }) => /^`[^`]*[()][^`]*` is not a field/.test(message));
    const hint = parted
      ? [
          h(
            "li",
            {},
            'Within { } a comma begins the next field: an expression with commas stands in quotes, "soft_sign(v, 0.001)".',
          ),
        ]
      : [];
    this.faults.replaceChildren(
      ...hint,
      ...faults.map(({ from, to, message, line, column }) =>
        h(
          "li",
          {},
          h(
            "button",
            { type: "button", class: "small", onclick: () => this.editor.go(from, to) },
            `line ${line}, column ${column}`,
          ),
          " ",
          quoted(message),
        ),
      ),
    );
  }

  show(document) {
    this.equations.replaceChildren(...equationsOf(document).map((line) => equation(line)));
    const seen = new Map();
    for (const { name, kind, unit, entry } of namesOf(document).filter(
      (symbol) => !["pi", "sample_time"].includes(symbol.entry),
    )) {
      seen.set(entry, { ...seen.get(entry), kind, unit, ...(name === entry ? {} : { symbol: name }) });
    }
    for (const { name, unit } of describedBy(document).outputs) {
      seen.set(`${name} `, { kind: "output", unit });
    }
    this.symbols.replaceChildren(
      table(
        "Unit of every symbol",
        [{ title: "Name" }, { title: "Symbol" }, { title: "Unit" }, { title: "Is" }],
        [...seen].map(([name, { symbol, kind, unit }]) => [
          words(name.trim()),
          h("span", { class: "symbol" }, symbol ?? ""),
          unit ? unitText(unit) : h("span", { class: "quiet" }, "not said"),
          kind,
        ]),
      ),
    );
  }

  async store() {
    this.keep.disabled = true;
    try {
      const { data } = await send("POST", "/v1/models", this.read.value, { signal: this.view.signal });
      // A job that the reader has begun goes on with this model; without it a job begins with the
      // recording in use.
      const draft = this.view.query.get("prepared");
      const experiment = this.trial.experiment();
      const prepared = draft ?? (experiment && keep({ model: data.name, experiments: [experiment] }));
      location.hash = `/new?${new URLSearchParams({ model: data.name, ...(prepared ? { prepared } : {}) })}`;
    } catch (error) {
      this.outcome.fail(error);
      this.keep.disabled = false;
    }
  }
}
