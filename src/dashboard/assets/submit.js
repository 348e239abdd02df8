// A new job: a dataset, a model and the specification as JSON, which can be checked first.

import { get, items, request } from "./api.js";
import { facts, h, notice, table, warningList } from "./dom.js";
import { count, duration, number, unitText, words } from "./format.js";

const SIGNAL_COLUMNS = [{ title: "Signal" }, { title: "Unit" }, { title: "Meaning" }];
const PARAMETER_COLUMNS = [
  { title: "Parameter" }, { title: "Unit" }, { title: "Default", numeric: true },
  { title: "Search range", numeric: true }, { title: "Meaning" },
];

export function showSubmit(view) {
  const outcome = notice();
  const form = h("div", {}, h("p", { class: "quiet" }, "Loading …"));
  view.root.append(h("h1", { tabindex: "-1" }, "New job"), form);
  load(view).then((known) => form.replaceChildren(submitForm(view, known, outcome)))
    .catch((error) => {
      form.replaceChildren(outcome.place);
      outcome.fail(error);
    });
}

async function load(view) {
  const from = view.query.get("from");
  const wanted = view.query.get("dataset");
  const [models, datasets, template, dataset] = await Promise.all([
    get("/v1/models", view.signal),
    get("/v1/datasets", view.signal),
    from ? get(`/v1/jobs/${from}`, view.signal) : null,
    wanted ? get(`/v1/datasets/${wanted}`, view.signal) : null,
  ]);
  const listed = items(datasets.data);
  if (dataset && !listed.some((entry) => entry.id === wanted)) {
    listed.unshift(dataset.data);
  }
  return { models: items(models.data), datasets: listed, template: template?.data.spec ?? null };
}

function submitForm(view, { models, datasets, template }, outcome) {
  const options = (entries, value, chosen) => entries.map((entry) =>
    h("option", { value: value(entry), selected: value(entry) === chosen }, entry.title || entry.name || entry.id));
  const first = template?.experiments?.[0]?.dataset ?? view.query.get("dataset");
  const dataset = h("select", {}, options(datasets, (entry) => entry.id, first));
  const model = h("select", {}, options(models, (entry) => entry.name, template?.model ?? view.query.get("model")));
  const text = h("textarea", { rows: "16", spellcheck: "false", required: true });
  const about = h("div", {});
  const chosen = () => ({
    model: models.find((entry) => entry.name === model.value),
    dataset: datasets.find((entry) => entry.id === dataset.value),
  });
  const describe = () => about.replaceChildren(...explained(chosen()));
  const prefill = () => {
    text.value = JSON.stringify(starter(chosen()), null, 2);
    describe();
  };
  model.addEventListener("change", prefill);
  dataset.addEventListener("change", prefill);
  if (template) {
    text.value = JSON.stringify(template, null, 2);
    describe();
  } else {
    prefill();
  }
  const poster = new Poster(view, text, outcome);
  return h("form", { onsubmit: (event) => poster.submit(event) },
    h("div", { class: "panel fields" },
      h("label", {}, "Dataset", dataset), h("label", {}, "Model", model),
      datasets.length === 0 && h("p", {}, "There is no dataset yet: ", h("a", { href: "#/datasets" }, "upload one"), ".")),
    h("label", { class: "block" }, "Specification (JSON; everything left out has a default)", text),
    h("div", { class: "actions" }, h("button", { class: "primary" }, "Submit"),
      h("button", { type: "button", onclick: () => poster.check() }, "Check only")),
    outcome.place, about);
}

// The least that makes a job: model and dataset, and names to map where they are not the same.
function starter({ model, dataset }) {
  const experiment = { dataset: dataset?.id ?? "" };
  const recorded = (dataset?.signals ?? []).map((signal) => signal.name);
  const inputs = driving(model, recorded);
  const outputs = (model?.outputs ?? []).map((signal) => signal.name);
  const measured = outputs.filter((name) => recorded.includes(name));
  const complete = inputs.every((name) => recorded.includes(name)) && measured.length > 0;
  if (dataset && !complete) {
    const names = [...inputs, ...(measured.length ? measured : outputs.slice(0, 1))];
    experiment.signals = Object.fromEntries(names.map((name) => [name, recorded.includes(name) ? name : ""]));
  }
  return { model: model?.name ?? "", experiments: [experiment] };
}

// The first set of inputs that the dataset has whole, else the first.
function driving(model, recorded) {
  const sets = model?.input_sets ?? [(model?.inputs ?? []).map((signal) => signal.name)];
  return sets.find((set) => set.every((name) => recorded.includes(name))) ?? sets[0] ?? [];
}

function explained({ model, dataset }) {
  if (!model) {
    return [];
  }
  const signal = (entry) => [entry.name, unitText(entry.unit), entry.meaning ?? ""];
  const unknown = model.parameters.filter((parameter) => parameter.unknown_by_default);
  const others = model.parameters.filter((parameter) => !parameter.unknown_by_default);
  const parameter = (entry) => [
    entry.name, unitText(entry.unit), number(entry.default), `${number(entry.lower)} … ${number(entry.upper)}`, entry.meaning];
  const recorded = (dataset?.signals ?? []).map((entry) => `${entry.name}${entry.unit ? ` [${entry.unit}]` : ""}`);
  return [
    h("h2", {}, model.title ?? model.name), h("p", {}, model.summary),
    facts([["The dataset has", recorded.join(", ")]]),
    h("h3", {}, "Inputs"), table("Inputs", SIGNAL_COLUMNS, model.inputs.map(signal)),
    h("h3", {}, "Outputs"), table("Outputs", SIGNAL_COLUMNS, model.outputs.map(signal)),
    h("h3", {}, "Estimated unless the job says otherwise"), table("Unknown parameters", PARAMETER_COLUMNS, unknown.map(parameter)),
    h("details", {}, h("summary", {}, `${others.length} more parameters`),
      table("Other parameters", PARAMETER_COLUMNS, others.map(parameter))),
  ];
}

class Poster {
  constructor(view, text, outcome) {
    Object.assign(this, { view, text, outcome, key: null, keyed: null });
  }

  // The specification as it stands, or null when it is not JSON, which is said.
  body() {
    try {
      JSON.parse(this.text.value);
      this.text.removeAttribute("aria-invalid");
      return this.text.value;
    } catch (error) {
      this.text.setAttribute("aria-invalid", "true");
      this.text.focus();
      this.outcome.fail({ title: "Not JSON", message: error.message });
      return null;
    }
  }

  // The same text is the same job, however often the button is pressed.
  keyFor(body) {
    if (body !== this.keyed) {
      this.keyed = body;
      const bytes = crypto.getRandomValues(new Uint8Array(16));
      this.key = Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
    }
    return this.key;
  }

  post(body, address, headers) {
    const options = { body, signal: this.view.signal, headers: { "content-type": "application/json", ...headers } };
    return request("POST", address, options);
  }

  async submit(event) {
    event.preventDefault();
    const body = this.body();
    if (body === null) {
      return;
    }
    try {
      const { data } = await this.post(body, "/v1/jobs", { "idempotency-key": this.keyFor(body) });
      location.hash = `/jobs/${data.id}`;
    } catch (error) {
      this.outcome.fail(error);
    }
  }

  async check() {
    const body = this.body();
    if (body === null) {
      return;
    }
    try {
      const { data } = await this.post(body, "/v1/jobs?validate_only=true", {});
      this.outcome.show(checked(data));
    } catch (error) {
      this.outcome.fail(error);
    }
  }
}

function prediction(name, value) {
  if (name.endsWith("_s")) {
    return [words(name.slice(0, -2)), duration(value)];
  }
  return [words(name), Number.isInteger(value) ? count(value) : number(value)];
}

// The completed specification, what it will cost, and what the pre-flight check found.
function checked(answer) {
  const { findings = [], spec, ...rest } = answer;
  const predictions = Object.values(rest).filter((value) => value && typeof value === "object" && !Array.isArray(value));
  const numbers = Object.entries(Object.assign({}, rest, ...predictions))
    .filter(([, value]) => typeof value === "number")
    .map(([name, value]) => prediction(name, value));
  return h("div", { class: "panel" },
    h("p", {}, h("strong", {}, "The specification is valid."), " Nothing was created."),
    facts(numbers),
    findings.length ? warningList(findings) : h("p", { class: "quiet" }, "The check before the start found nothing to warn of."),
    spec && h("details", {}, h("summary", {}, "Completed specification"), h("pre", { tabindex: "0" }, JSON.stringify(spec, null, 2))));
}
