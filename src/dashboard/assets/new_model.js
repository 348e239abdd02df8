// @ts-check
// The model of a new job: a gallery of those that there are, with their equations.

import { h, svg, table } from "./dom.js";
import { equation } from "./equation.js";
import { count, number, unitText, words } from "./format.js";
import { responsePicture } from "./model_picture.js";
import { keep } from "./job_draft.js";

export function modelPart(job) {
  const search = h("input", { type: "search", placeholder: "servo, tank, heat …", oninput: () => draw(), "aria-label": "Search the models" });
  const cards = h("div", { class: "cards", role: "radiogroup", "aria-label": "Model" });
  const about = h("div", {});
  const all = h("button", { type: "button", hidden: true, onclick: () => {
    opened = true;
    draw();
  } }, "Choose another model");
  const write = h("button", { type: "button", onclick: () => {
    location.hash = `/equations?prepared=${keep(job.spec)}${job.spec.experiments?.length ? `&dataset=${job.spec.experiments[0].dataset}` : ""}`;
  } }, "Write your own equations");
  const element = h("section", { "aria-label": "Model" }, h("h2", {}, "2. Model"), h("div", { class: "actions" }, search, write), cards, all, about);
  let opened = false;
  let shown = null;

  const draw = () => {
    const { model } = job;
    const closed = model && !opened && !search.value;
    search.hidden = closed;
    all.hidden = !closed;
    const text = search.value.toLowerCase();
    const listed = [...job.models.values()].filter((one) => (closed ? one === model
      : `${one.name} ${one.title} ${one.summary}`.toLowerCase().includes(text)));
    cards.replaceChildren(...listed.map((one) => card(job, one, () => {
      opened = false;
      search.value = "";
    })));
    if (shown !== model) {
      shown = model;
      about.replaceChildren(...(model ? described(model) : []));
    }
  };
  return { element, draw };
}

function card(job, model, chosen) {
  const current = job.spec.model === model.name;
  const unknown = model.parameters.filter((parameter) => parameter.unknown_by_default).length;
  return h("button", { type: "button", role: "radio", "aria-checked": String(current), class: "card", onclick: () => {
    chosen();
    job.chooseModel(model.name);
  } }, responsePicture(model), h("strong", {}, model.title || model.name), h("span", {}, model.summary),
  h("span", { class: "quiet" }, `${count(model.parameters.length)} parameters, ${count(unknown)} of them unknown as a rule`));
}

// What goes in, what the model keeps, and what comes out.
/** @param {import("page/api").Schemas["ModelDescription"]} model */
export function diagram(model) {
  const side = (names, x, anchor) => names.slice(0, 4).map((name, k) => [
    svg("text", { x, y: 18 + 16 * k, class: `caption ${anchor}` }, words(name).slice(0, 26)),
    svg("path", { class: "arrow", d: anchor === "end" ? `M162 ${14 + 16 * k}h10` : `M250 ${14 + 16 * k}h10` })]);
  const inputs = [...new Set((model.input_sets?.[0] ?? model.inputs.map(({ name }) => name)))];
  const states = model.states.map(({ name }) => name).slice(0, 8).join(" ");
  return svg("svg", { viewBox: "0 0 422 76", class: "diagram", "aria-hidden": "true" },
    side(inputs, 158, "end"), svg("rect", { x: 172, y: 4, width: 78, height: 68, rx: 6 }),
    svg("text", { x: 211, y: 34, class: "caption middle" }, states.length <= 12 ? states : ""),
    svg("text", { x: 211, y: 52, class: "caption middle faint" }, model.states.length === 1 ? "1 state" : `${model.states.length} states`),
    side(model.outputs.map(({ name }) => name), 264, "start"));
}

// All that a model says of itself.
/** @param {import("page/api").Schemas["ModelDescription"]} model */
export function described(model) {
  const signals = (title, list) => [h("p", {}, h("strong", {}, title)), table(title, [{ title: "Signal" }, { title: "Unit" }, { title: "Meaning" }],
    list.map((entry) => [words(entry.name), unitText(entry.unit), entry.meaning ?? ""]))];
  return [
    diagram(model),
    h("div", { class: "equations", tabindex: "0", role: "region", "aria-label": "Equations" }, model.equations.map((line) => equation(line))),
    h("details", {}, h("summary", {}, "Symbols, inputs and outputs"),
      table("Symbols", [{ title: "Symbol" }, { title: "Name" }, { title: "Unit" }, { title: "Usual value", numeric: true }, { title: "Known to" }, { title: "Range to look in" }, { title: "Meaning" }],
        model.parameters.map((entry) => [entry.symbol, words(entry.name), unitText(entry.unit), number(entry.default), toleranceText(entry),
          h("span", { class: "range" }, entry.unknown_by_default ? h("strong", {}, `${number(entry.lower)} … ${number(entry.upper)}`) : `${number(entry.lower)} … ${number(entry.upper)}`), entry.meaning])),
      ...signals("Inputs", model.inputs), ...signals("Outputs that can be measured", model.outputs),
      model.source && h("p", { class: "quiet" }, model.source)),
  ];
}

// How well a parameter is known where a job does not say: one standard deviation.
/** @param {import("page/api").Schemas["ParameterDescription"]} parameter */
export function toleranceText({ tolerance, tolerance_source: source, unit }) {
  if (tolerance === undefined || tolerance === null) {
    return "exactly";
  }
  return h("span", { title: source ?? null }, typeof tolerance === "number" ? `± ${number(tolerance, 3)} ${unit === "1" ? "" : unit}` : `± ${tolerance}`);
}
