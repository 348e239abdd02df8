// A new job, from a recording to the submission: recordings and windows, the model, its signals, its
// parameters, how to look for them. The same specification as JSON is one tab away, and in step.

import { get, items, request } from "./api.js";
import { h, keepingFocus, notice } from "./dom.js";
import { changed, experimentOf, labelText, labelsOf, numberOf, withModel } from "./job_draft.js";
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
  if (spec.model && !listed.has(spec.model)) {
    const shown = await get(`/v1/models/${encodeURIComponent(spec.model)}`, view.signal).catch(() => null);
    shown && listed.set(spec.model, shown.data);
  }
  const model = listed.get(spec.model ?? view.query.get("model") ?? "");
  if (model) {
    spec = { ...spec, model: model.name };
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
  const key = `prepared-${Date.now().toString(36)}`;
  sessionStorage.setItem(key, JSON.stringify(spec));
  location.hash = `/new?prepared=${key}`;
}

// A completed specification as a template: a seed of its own is drawn for the new job.
function asAsked({ seed, ...spec }) {
  return spec;
}

class NewJob {
  constructor(view, { models, datasets, spec }, outcome) {
    Object.assign(this, { view, models, datasets, spec, outcome, key: null, keyed: null });
    this.text = h("textarea", { rows: "24", spellcheck: "false", "aria-label": "Specification as JSON", oninput: () => this.typed() });
    this.parts = [recordingsPart(this), modelPart(this), parametersPart(this), tryPart(this)];
    this.preflight = preflightPart(this);
    this.search = h("div", {});
    this.guided = h("div", { class: "steps" }, this.parts.map(({ element }) => element),
      h("section", {}, h("h2", {}, "How to look, and what to call it"), this.search));
    this.json = h("div", { hidden: true }, this.text);
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
      this.text.removeAttribute("aria-invalid");
    }
    this.redraw(from);
    this.button.disabled = !this.spec.model || !(this.spec.experiments?.length > 0);
    this.preflight.check();
  }

  // Once the focus has come to rest: a field that is left says its change before the next one has
  // the focus.
  redraw(from = null) {
    clearTimeout(this.redrawing);
    this.redrawing = setTimeout(() => keepingFocus(this.guided, () => {
      this.parts.forEach((part) => part.draw());
      if (from !== "search") {
        this.drawSearch();
      }
    }), 0);
  }

  typed() {
    try {
      const spec = JSON.parse(this.text.value);
      if (spec === null || typeof spec !== "object" || Array.isArray(spec)) {
        throw new SyntaxError("a job is an object");
      }
      this.text.removeAttribute("aria-invalid");
      this.outcome.clear();
      this.set({ ...spec, experiments: Array.isArray(spec.experiments) ? spec.experiments : [] }, "json");
    } catch (error) {
      this.text.setAttribute("aria-invalid", "true");
      this.outcome.fail({ title: "Not JSON", message: error.message });
    }
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
        size: "6", hint: "0", read: (value) => (Number.isFinite(numberOf(value)) ? numberOf(value) / 100 : undefined) })),
    h("details", { open: this.open }, h("summary", { onclick: () => { this.open = !this.open; } }, "Settings of the search"), h("div", { class: "fields" },
      h("label", {}, "Method", h("select", { onchange: put(["method", "name"]) }, METHODS.map(([name, title]) =>
        h("option", { value: name, selected: name === (spec.method?.name ?? "icra_genetic") }, title)))),
      field("Candidates", ["method", "population"], spec.method?.population, { read: whole, size: "8", hint: "30" }),
      field("Generations at the most", ["method", "generations"], spec.method?.generations, { read: whole, size: "8", hint: "1000" }),
      field("Searches", ["method", "restarts"], spec.method?.restarts, { read: whole, size: "6", hint: "1" }),
      h("label", {}, "Intervals", h("select", { onchange: put(["uncertainty", "intervals"]) }, [["", "as usual"], ["profile", "likelihood profile"], ["bootstrap", "bootstrap"]].map(([name, title]) =>
        h("option", { value: name, selected: name === (spec.uncertainty?.intervals ?? "") }, title)))),
      field("Longest time, s", ["limits", "max_duration_s"], spec.limits?.max_duration_s, { read: whole, size: "8", hint: "3600" }),
      field("Seed", ["seed"], spec.seed, { read: whole, size: "10", hint: "drawn" }))));
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
