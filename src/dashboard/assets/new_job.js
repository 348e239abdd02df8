// @ts-check
// A new job, from a recording to the submission: recordings and windows, the model, its signals, its
// parameters, how to look for them. The same specification as JSON is one tab away, and in step.

import { get, items, request } from "./api.js";
import { h, keepingFocus, notice } from "./dom.js";
import { changed, conditionsOf, conditionText, experimentOf, keep, labelsOf, labelText, numberOf, priorOfResult, withModel } from "./job_draft.js";
import { placed, readText } from "./document_text.js";
import { Editor, editorLibrary } from "./editor.js";
import { modelPart } from "./new_model.js";
import { parametersPart } from "./new_parameters.js";
import { recordingsPart } from "./new_recordings.js";
import { preflightPart } from "./preflight.js";
import { tryPart } from "./try_model.js";

const METHODS = [["icra_genetic", "ICRA credits and a genetic search"], ["differential_evolution", "differential evolution"],
  ["cma_es", "CMA-ES"], ["multistart_lm", "least squares from many starts"]];

export function showNewJob(view) {
  const place = h("div", {}, h("p", { class: "quiet" }, "Loading …"));
  const outcome = notice();
  view.root.append(h("h1", { tabindex: "-1" }, "New job"), place);
  load(view).then((known) => {
    const page = new NewJob(view, known, outcome);
    place.replaceChildren(...page.elements());
    page.changed();
  }).catch((error) => {
    place.replaceChildren(outcome.place);
    outcome.fail(error);
  });
}

async function load(view) {
  const from = view.query.get("from");
  const wanted = view.query.get("dataset");
  const [models, datasets, template] = await Promise.all([
    get("/v1/models", view.signal), get("/v1/datasets?limit=200", view.signal), from ? get(`/v1/jobs/${from}`, view.signal) : null]);
  const known = new Map(items(datasets.data).map((dataset) => [dataset.id, dataset]));
  let spec = prepared(view) ?? (template ? asAsked(template.data.spec) : { experiments: [] });
  const needed = new Set([wanted, ...(spec.experiments ?? []).map(({ dataset }) => dataset)].filter((id) => id && !known.has(id)));
  for (const id of needed) {
    const found = await get(`/v1/datasets/${id}`, view.signal).catch(() => null);
    if (found) {
      known.set(id, found.data);
    }
  }
  const listed = new Map(items(models.data).map((model) => [model.name, model]));
  const wantedModel = view.query.get("model") ?? spec.model;
  if (wantedModel && !listed.has(wantedModel)) {
    const shown = await get(`/v1/models/${encodeURIComponent(wantedModel)}`, view.signal).catch(() => null);
    shown && listed.set(wantedModel, shown.data);
  }
  const model = listed.get(wantedModel ?? "");
  if (model && model.name !== spec.model) {
    spec = withModel(spec, model, known);
  }
  if (wanted && known.has(wanted) && spec.experiments.length === 0) {
    spec = { ...spec, experiments: [experimentOf(known.get(wanted), model)] };
  }
  return { models: listed, datasets: known, spec };
}

// A job that another page has prepared, once.
function prepared(view) {
  const key = view.query.get("prepared");
  const text = key && sessionStorage.getItem(key);
  return text ? JSON.parse(text) : null;
}

export function prepare(spec) {
  location.hash = `/new?prepared=${keep(spec)}`;
}

// A completed specification as a template: a seed of its own is drawn for the new job.
/** @param {{ [field: string]: any }} spec */
function asAsked({ seed, ...spec }) {
  return spec;
}

// Where JSON stops being JSON, as far as the browser says.
function faultOf({ message }, text) {
  const at = Number(/position (\d+)/.exec(message)?.[1] ?? text.length);
  return { from: Math.max(0, Math.min(at, text.length - 1)), to: Math.min(at + 1, text.length), message };
}

class NewJob {
  constructor(view, { models, datasets, spec }, outcome) {
    this.view = view;
    this.models = models;
    this.datasets = datasets;
    this.spec = spec;
    this.outcome = outcome;
    this.key = null;
    this.keyed = null;
    this.text = new Editor({ label: "Specification as JSON", signal: view.signal, changed: () => this.typed(), words: (before) => this.words(before) });
    this.parts = [recordingsPart(this), modelPart(this), parametersPart(this), tryPart(this)];
    this.preflight = preflightPart(this);
    this.search = h("div", {});
    this.said = new WeakMap();
    this.guided = h("div", { class: "steps", onchange: ({ target }) => this.said.set(target, target.value) }, this.parts.map(({ element }) => element),
      h("section", {}, h("h2", {}, "How to look, and what to call it"), this.search));
    this.json = h("div", { hidden: true }, this.text.element);
    this.button = h("button", { type: "button", class: "primary", onclick: () => this.submit() }, "Start the job");
  }

  elements() {
    const tabs = [["guided", "Guided", this.guided], ["json", "JSON", this.json]];
    const buttons = tabs.map(([name, title]) => h("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`,
      "aria-selected": String(name === "guided"), onclick: () => show(name), onkeydown: (event) => {
        if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
          const other = buttons.find((button) => button !== event.target);
          other.click();
          other.focus();
        }
      } }, title));
    const show = (name) => tabs.forEach(([other, , panel], k) => {
      panel.hidden = other !== name;
      buttons[k].setAttribute("aria-selected", String(other === name));
      buttons[k].tabIndex = other === name ? 0 : -1;
    });
    tabs.forEach(([name, , panel]) => {
      panel.id = `panel-${name}`;
      panel.setAttribute("role", "tabpanel");
      panel.setAttribute("aria-labelledby", `tab-${name}`);
    });
    show("guided");
    return [h("div", { role: "tablist", "aria-label": "How to say it", class: "tabs" }, buttons),
      h("div", { class: "with-side" }, h("div", {}, this.guided, this.json),
        h("aside", { "aria-label": "Before the start" }, this.preflight.element, h("div", { class: "actions" }, this.button), this.outcome.place))];
  }

  get model() {
    return this.models.get(this.spec.model) ?? null;
  }

  // Another specification, from whatever part of the page; all parts follow.
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
    this.redraw(from);
    this.button.disabled = !this.spec.model || !(this.spec.experiments?.length > 0);
    this.preflight.check();
  }

  // Once the focus has come to rest: a field that is left says its change before the next one has
  // the focus.
  redraw(from = null) {
    clearTimeout(this.redrawing);
    this.redrawing = setTimeout(() => {
      const typed = this.beingTyped();
      if (typed) {
        typed.addEventListener("blur", () => this.redraw(), { once: true });
        return;
      }
      keepingFocus(this.guided, () => {
        this.parts.forEach((part) => part.draw());
        if (from !== "search") {
          this.drawSearch();
        }
      });
    }, 0);
  }

  // A field with text in it that it has not said yet: drawn anew it would lose the text.
  beingTyped() {
    const field = document.activeElement;
    const inside = field instanceof HTMLInputElement && field.type === "text" && this.guided.contains(field);
    return inside && field.value !== (this.said.get(field) ?? field.defaultValue) ? field : null;
  }

  typed() {
    try {
      const spec = JSON.parse(this.text.value);
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

  // What the server says of the specification, at its places in the text.
  async told(faults) {
    const library = await editorLibrary();
    const text = this.text.value;
    this.text.mark(placed(readText(library, text), text, faults));
  }

  // The names that the specification may use.
  words(before) {
    const from = before.length - /[\p{L}\p{N}_.-]*$/u.exec(before)[0].length;
    const of = (list, type) => list.map((label) => ({ label, type }));
    const options = [...of((this.model?.parameters ?? []).map(({ name }) => name), "parameter"), ...of([...this.models.keys()], "model"),
      ...of([...(this.model?.inputs ?? []), ...(this.model?.outputs ?? [])].map(({ name }) => name), "signal"),
      ...[...this.datasets.values()].flatMap(({ id, name, signals }) => [{ label: id, type: "dataset", detail: name ?? "" }, ...signals.map((signal) => ({ label: signal.name, type: "signal", detail: name ?? "" }))])];
    return { from, options: [...new Map(options.map((option) => [option.label, option])).values()] };
  }

  chooseModel(name) {
    this.set(withModel(this.spec, this.models.get(name), this.datasets));
  }

  addDataset(dataset) {
    this.datasets.set(dataset.id, dataset);
    this.set({ ...this.spec, experiments: [...(this.spec.experiments ?? []), experimentOf(dataset, this.model)] });
  }

  drawSearch() {
    const { spec } = this;
    const put = (path, read = (value) => value || undefined) => (event) => this.at(path, read(event.target.value), "search");
    const whole = (value) => (value.trim() === "" ? undefined : Number.isFinite(numberOf(value)) ? numberOf(value) : value);
    const field = (title, path, value, options = {}) => h("label", {}, title,
      h("input", { type: "text", value: value ?? "", onchange: put(path, options.read), placeholder: options.hint, size: options.size ?? "12" }));
    const share = spec.validation?.fraction;
    this.search.replaceChildren(h("div", { class: "fields" },
      field("Name of the job", ["name"], spec.name, { size: "24", hint: "rig 4, commissioning" }),
      field("Labels", ["labels"], labelText(spec.labels), { read: labelsOf, size: "20", hint: "site=hall 2, rig=4" }),
      field("Held back to check, %", ["validation", "fraction"], share === undefined || share === null ? "" : 100 * share, {
        size: "6", hint: "0", read: (value) => (Number.isFinite(numberOf(value)) ? numberOf(value) / 100 : undefined) }),
      field("Conditions", ["constraints"], conditionText(spec.constraints), { read: conditionsOf, size: "28", hint: "tau1 < tau2; k1 + k2 <= 1" }),
      this.knownFromJob()),
    h("details", { open: this.open }, h("summary", { onclick: () => { this.open = !this.open; } }, "Settings of the search"), h("div", { class: "fields" },
      h("label", {}, "Method", h("select", { onchange: put(["method", "name"]) }, METHODS.map(([name, title]) =>
        h("option", { value: name, selected: name === (spec.method?.name ?? "icra_genetic") }, title)))),
      field("Candidates", ["method", "population"], spec.method?.population, { read: whole, size: "8", hint: "30" }),
      field("Generations at the most", ["method", "generations"], spec.method?.generations, { read: whole, size: "8", hint: "1000" }),
      field("Searches", ["method", "restarts"], spec.method?.restarts, { read: whole, size: "6", hint: "1" }),
      h("label", {}, "Intervals", h("select", { onchange: put(["uncertainty", "intervals"]) }, [["", "as usual"], ["profile", "likelihood profile"], ["bootstrap", "bootstrap"]].map(([name, title]) =>
        h("option", { value: name, selected: name === (spec.uncertainty?.intervals ?? "") }, title)))),
      field("Fits of a Monte Carlo analysis", ["uncertainty", "monte_carlo_samples"], spec.uncertainty?.monte_carlo_samples, { read: whole, size: "8", hint: "none" }),
      field("Longest time, s", ["limits", "max_duration_s"], spec.limits?.max_duration_s, { read: whole, size: "8", hint: "3600" }),
      field("Seed", ["seed"], spec.seed, { read: whole, size: "10", hint: "drawn" }))));
  }

  // What an earlier job found, with its correlations, is a prior of this one.
  knownFromJob() {
    const priors = this.spec.priors ?? [];
    if (priors.length > 0) {
      const names = priors.flatMap(({ parameters }) => parameters).map((name) => name.replaceAll("_", " ")).join(", ");
      return h("p", {}, `Known beforehand: ${names} `,
        h("button", { type: "button", onclick: () => this.at(["priors"], undefined) }, "Forget"));
    }
    const take = async ({ target }) => {
      const id = target.value.trim();
      if (id === "") {
        return;
      }
      try {
        /** @type {{ data: any }} */
        const { data } = await get(`/v1/jobs/${encodeURIComponent(id)}/result`, this.view.signal);
        const known = new Set((this.model?.parameters ?? []).map(({ name }) => name));
        const prior = priorOfResult({ ...data, parameters: (data.parameters ?? []).filter(({ name }) => known.has(name)) });
        this.outcome.clear();
        this.at(["priors"], prior && [prior]);
      } catch (error) {
        this.outcome.fail(error);
      }
    };
    return h("label", {}, "Known from a job", h("input", { type: "text", size: "28", placeholder: "job_…", onchange: take }));
  }

  // The same text is the same job, however often the button is pressed.
  keyFor(body) {
    if (body !== this.keyed) {
      this.keyed = body;
      this.key = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
    }
    return this.key;
  }

  async submit() {
    const body = JSON.stringify(this.spec);
    this.button.disabled = true;
    try {
      const { data } = await request("POST", "/v1/jobs", { body, signal: this.view.signal,
        headers: { "content-type": "application/json", "idempotency-key": this.keyFor(body) } });
      location.hash = `/jobs/${data.id}`;
    } catch (error) {
      this.outcome.fail(error);
    }
    this.button.disabled = false;
  }
}
