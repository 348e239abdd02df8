// @ts-check
// The page makes a new job, from a recording to the submission: recordings and windows, the model, its
// signals, its parameters, and the settings of the search. A tab beside the form shows the same
// specification as JSON and follows it.

import { MODEL_WORDS } from "../model/language.js";
import { get, items, repeatKey, request } from "../shell/api.js";
import { described } from "../shell/description.js";
import { h, keepingFocus, notice } from "../shell/dom.js";
import { readJson } from "../shell/json.js";
import { prepared, specOf } from "../shell/prepared.js";
import { placed, readText } from "../text/document.js";
import { Editor, editorLibrary } from "../text/editor.js";
import { changed, experimentOf, withModel } from "./draft.js";
import { measurementPart } from "./measurement.js";
import { modelPart } from "./model.js";
import { parametersPart } from "./parameters.js";
import { preflightPart } from "./preflight.js";
import { recordingsPart } from "./recordings.js";
import { searchPart } from "./search.js";
import { tryPart } from "./trial.js";

export function showNewJob(view) {
  const place = h("div", {}, h("p", { class: "quiet" }, "Loading …"));
  const outcome = notice();
  view.root.append(h("h1", { tabindex: "-1" }, "New job"), place);
  load(view)
    .then((start) => {
      const page = new NewJob(view, start, outcome);
      place.replaceChildren(...page.elements());
      page.changed();
    })
    .catch((error) => {
      place.replaceChildren(outcome.place);
      outcome.fail(error);
    });
}

async function load(view) {
  const from = view.query.get("from");
  const chosenDataset = view.query.get("dataset");
  const [models, datasets, template, description] = await Promise.all([
    get("/v1/models", view.signal),
    get("/v1/datasets?limit=200", view.signal),
    from ? get(`/v1/jobs/${from}`, view.signal) : null,
    described(),
  ]);
  const recordings = new Map(items(datasets.data).map((dataset) => [dataset.id, dataset]));
  let spec = prepared(view) ?? (template ? asAsked(specOf(template.data)) : { experiments: [] });
  const needed = new Set(
    [chosenDataset, ...(spec.experiments ?? []).map(({ dataset }) => dataset)].filter(
      (id) => id && !recordings.has(id),
    ),
  );
  for (const id of needed) {
    const answer = await get(`/v1/datasets/${id}`, view.signal).catch(() => null);
    if (answer) {
      recordings.set(id, answer.data);
    }
  }
  const listed = new Map(items(models.data).map((model) => [model.name, model]));
  const modelName = view.query.get("model") ?? spec.model;
  if (modelName && !listed.has(modelName)) {
    const answer = await get(`/v1/models/${encodeURIComponent(modelName)}`, view.signal).catch(() => null);
    answer && listed.set(modelName, answer.data);
  }
  const model = listed.get(modelName ?? "");
  if (model && model.name !== spec.model) {
    spec = withModel(spec, model, recordings);
  }
  if (chosenDataset && recordings.has(chosenDataset) && spec.experiments.length === 0) {
    spec = { ...spec, experiments: [experimentOf(recordings.get(chosenDataset), model)] };
  }
  return { models: listed, datasets: recordings, spec, description };
}

// A completed specification becomes a template without its seed, so that the server draws a new seed.
/** @param {{ [field: string]: any }} spec */
function asAsked({ seed, ...spec }) {
  return spec;
}

// The fault is where the text stops being JSON, as far as the browser says.
function faultOf({ message }, text) {
  const at = Number(/position (\d+)/.exec(message)?.[1] ?? text.length);
  return { from: Math.max(0, Math.min(at, text.length - 1)), to: Math.min(at + 1, text.length), message };
}

class NewJob {
  constructor(view, { models, datasets, spec, description }, outcome) {
    this.view = view;
    this.models = models;
    this.datasets = datasets;
    this.spec = spec;
    this.description = description;
    this.outcome = outcome;
    this.keyOf = repeatKey();
    this.text = new Editor({
      label: "Specification as JSON",
      signal: view.signal,
      changed: () => this.takeText(),
      language: MODEL_WORDS,
      words: (before) => this.words(before),
    });
    this.parts = [
      recordingsPart(this),
      modelPart(this),
      parametersPart(this),
      tryPart(this),
      measurementPart(this),
      searchPart(this),
    ];
    this.preflight = preflightPart(this);
    this.reports = new WeakMap();
    this.guided = h(
      "div",
      { class: "steps", onchange: ({ target }) => this.reports.set(target, target.value) },
      // A very wide page has the recordings and the model beside what is asked of them.
      [this.parts.slice(0, 2), this.parts.slice(2)].map((column) =>
        h(
          "div",
          {},
          column.map(({ element }) => element),
        ),
      ),
    );
    this.json = h("div", { hidden: true }, this.text.element);
    this.button = h(
      "button",
      { type: "button", class: "primary", onclick: () => this.submit() },
      "Start the job",
    );
    // With the keyboard the button is a hundred fields away.
    this.skip = h(
      "button",
      { type: "button", class: "skip", onclick: () => this.button.focus() },
      "Go to the start of the job",
    );
  }

  elements() {
    const tabs = [
      ["guided", "Guided", this.guided],
      ["json", "JSON", this.json],
    ];
    const buttons = tabs.map(([name, title]) =>
      h(
        "button",
        {
          type: "button",
          role: "tab",
          id: `tab-${name}`,
          "aria-controls": `panel-${name}`,
          "aria-selected": String(name === "guided"),
          onclick: () => show(name),
          onkeydown: (event) => {
            if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
              const neighbour = buttons.find((button) => button !== event.target);
              neighbour.click();
              neighbour.focus();
            }
          },
        },
        title,
      ),
    );
    const show = (name) =>
      tabs.forEach(([tab, , panel], k) => {
        panel.hidden = tab !== name;
        buttons[k].setAttribute("aria-selected", String(tab === name));
        buttons[k].tabIndex = tab === name ? 0 : -1;
      });
    tabs.forEach(([name, , panel]) => {
      panel.id = `panel-${name}`;
      panel.setAttribute("role", "tabpanel");
      panel.setAttribute("aria-labelledby", `tab-${name}`);
    });
    show("guided");
    return [
      this.skip,
      h("div", { role: "tablist", "aria-label": "How to say it", class: "tabs" }, buttons),
      h(
        "div",
        { class: "with-side" },
        h("div", {}, this.guided, this.json),
        h(
          "aside",
          { "aria-label": "Before the start" },
          this.preflight.element,
          h("div", { class: "actions" }, this.button),
          this.outcome.place,
        ),
      ),
    ];
  }

  get model() {
    return this.models.get(this.spec.model) ?? null;
  }

  // Any part of the page may set another specification; all parts follow.
  set(spec, from = null) {
    this.spec = spec;
    this.changed(from);
  }

  at(path, value, from = null) {
    this.set(changed(this.spec, path, value), from);
  }

  changed(from = null) {
    if (from !== "json") {
      this.text.value = JSON.stringify(this.spec, null, 2);
      this.text.mark([]);
    }
    this.redraw();
    this.button.disabled = !this.spec.model || !(this.spec.experiments?.length > 0);
    this.skip.hidden = this.button.disabled;
    this.preflight.check();
  }

  // The form is drawn once the focus has come to rest: a field that loses the focus reports its change
  // before the next field has the focus.
  redraw() {
    clearTimeout(this.redrawing);
    this.redrawing = setTimeout(() => {
      const typed = this.beingTyped();
      if (typed) {
        typed.addEventListener("blur", () => this.redraw(), { once: true });
        return;
      }
      keepingFocus(this.guided, () => {
        for (const part of this.parts) {
          part.draw();
        }
      });
    }, 0);
  }

  // The field that is being edited has text that it has not reported yet; drawing the form anew would
  // lose the text.
  beingTyped() {
    const field = document.activeElement;
    const inside = field instanceof HTMLInputElement && field.type === "text" && this.guided.contains(field);
    return inside && field.value !== (this.reports.get(field) ?? field.defaultValue) ? field : null;
  }

  takeText() {
    try {
      const spec = readJson(this.text.value);
      if (spec === null || typeof spec !== "object" || Array.isArray(spec)) {
        throw new SyntaxError("a job is an object");
      }
      this.text.mark([]);
      this.outcome.clear();
      this.set({ ...spec, experiments: Array.isArray(spec.experiments) ? spec.experiments : [] }, "json");
    } catch (error) {
      this.text.mark([faultOf(error, this.text.value)]);
      this.outcome.fail({ title: "Not JSON", message: error.message });
    }
  }

  // The faults that the server finds in the specification are marked at their places in the text.
  async markFaults(faults) {
    const library = await editorLibrary();
    const text = this.text.value;
    this.text.mark(placed(readText(library, text), text, faults));
  }

  // Completes the text of the specification with the names that it may use.
  words(before) {
    const from = before.length - /[\p{L}\p{N}_.-]*$/u.exec(before)[0].length;
    const completions = (list, type) => list.map((label) => ({ label, type }));
    const options = [
      ...completions(
        (this.model?.parameters ?? []).map(({ name }) => name),
        "parameter",
      ),
      ...completions([...this.models.keys()], "model"),
      ...completions(
        [...(this.model?.inputs ?? []), ...(this.model?.outputs ?? [])].map(({ name }) => name),
        "signal",
      ),
      ...[...this.datasets.values()].flatMap(({ id, name, signals }) => [
        { label: id, type: "dataset", detail: name ?? "" },
        ...signals.map((signal) => ({ label: signal.name, type: "signal", detail: name ?? "" })),
      ]),
    ];
    return { from, options: [...new Map(options.map((option) => [option.label, option])).values()] };
  }

  chooseModel(name) {
    this.set(withModel(this.spec, this.models.get(name), this.datasets));
  }

  addDataset(dataset) {
    this.datasets.set(dataset.id, dataset);
    this.set({
      ...this.spec,
      experiments: [...(this.spec.experiments ?? []), experimentOf(dataset, this.model)],
    });
  }

  async submit() {
    const body = JSON.stringify(this.spec);
    this.button.disabled = true;
    try {
      const { data } = await request("POST", "/v1/jobs", {
        body,
        signal: this.view.signal,
        headers: { "content-type": "application/json", "idempotency-key": this.keyOf(body) },
      });
      location.hash = `/jobs/${data.id}`;
    } catch (error) {
      this.outcome.fail(error);
    }
    this.button.disabled = false;
  }
}
