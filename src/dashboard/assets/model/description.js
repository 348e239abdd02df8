// @ts-check
// The description of a model is a diagram, its equations, its symbols and its signals.

import { h, svg, table } from "../shell/dom.js";
import { number, quantity, unitText, words } from "../shell/format.js";
import { equation } from "./equation.js";

// A letter of the diagram is about so wide.
const LETTER = 6.4;

// The diagram shows the inputs of a model, its states and its outputs.
/** @param {import("page/api").Schemas["ModelDescription"]} model */
export function diagram(model) {
  const side = (names, x, anchor) =>
    names.slice(0, 4).map((name, k) => [
      svg("text", { x, y: 18 + 16 * k, class: `caption ${anchor}` }, words(name).slice(0, 26)),
      svg("path", {
        class: "arrow",
        d: anchor === "end" ? `M162 ${14 + 16 * k}h10` : `M250 ${14 + 16 * k}h10`,
      }),
    ]);
  const inputs = [...new Set(model.input_sets?.[0] ?? model.inputs.map(({ name }) => name))];
  const states = model.states
    .map(({ name }) => name)
    .slice(0, 8)
    .join(" ");
  const isShort = states.length <= 12;
  // The picture is as wide as its names need.
  const room = (/** @type {string[]} */ names) =>
    LETTER * Math.max(...names.slice(0, 4).map((name) => Math.min(26, name.length)), 4);
  const left = 158 - room(inputs);
  const right = 264 + room(model.outputs.map(({ name }) => name));
  return svg(
    "svg",
    { viewBox: `${left} 0 ${right - left} 76`, class: "diagram", "aria-hidden": "true" },
    side(inputs, 158, "end"),
    svg("rect", { x: 172, y: 4, width: 78, height: 68, rx: 6 }),
    svg("text", { x: 211, y: 34, class: "caption middle" }, isShort ? states : ""),
    svg(
      "text",
      { x: 211, y: isShort ? 52 : 42, class: "caption middle faint" },
      model.states.length === 1 ? "1 state" : `${model.states.length} states`,
    ),
    side(
      model.outputs.map(({ name }) => name),
      264,
      "start",
    ),
  );
}

// Gives all parts of the description of a model.
/** @param {import("page/api").Schemas["ModelDescription"]} model */
export function described(model) {
  const signals = (title, list) => [
    h("p", {}, h("strong", {}, title)),
    table(
      title,
      [{ title: "Signal" }, { title: "Unit" }, { title: "Meaning" }],
      list.map((entry) => [words(entry.name), unitText(entry.unit), entry.meaning ?? ""]),
      { stacked: true },
    ),
  ];
  return [
    diagram(model),
    h(
      "div",
      { class: "equations", tabindex: "0", role: "region", "aria-label": "Equations" },
      model.equations.map((line) => equation(line)),
    ),
    h(
      "details",
      {},
      h("summary", {}, "Symbols, inputs and outputs"),
      table(
        "Symbols",
        [
          { title: "Name" },
          { title: "Symbol" },
          { title: "Unit" },
          { title: "Usual value", numeric: true },
          { title: "Known" },
          { title: "Range to look in" },
          { title: "Meaning" },
        ],
        model.parameters.map((entry) => [
          words(entry.name),
          entry.symbol,
          unitText(entry.unit),
          number(entry.default),
          entry.unknown_by_default ? "unknown" : toleranceText(entry),
          h(
            "span",
            { class: "range" },
            entry.unknown_by_default
              ? h("strong", {}, `${number(entry.lower)} … ${number(entry.upper)}`)
              : `${number(entry.lower)} … ${number(entry.upper)}`,
          ),
          entry.meaning,
        ]),
        { stacked: true },
      ),
      ...signals("Inputs", model.inputs),
      ...signals("Outputs that can be measured", model.outputs),
      model.source && h("p", { class: "quiet" }, model.source),
    ),
  ];
}

// The tolerance tells how well a parameter is known where a job does not say: it is a standard
// deviation.
/** @param {import("page/api").Schemas["ParameterDescription"]} parameter */
export function toleranceText({ tolerance, tolerance_source: source, unit }) {
  if (tolerance === undefined || tolerance === null) {
    return "exactly";
  }
  return h(
    "span",
    { title: source ?? null },
    typeof tolerance === "number" ? `± ${quantity(number(tolerance, 3), unit)}` : `± ${tolerance}`,
  );
}
