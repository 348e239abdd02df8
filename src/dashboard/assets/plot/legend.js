// @ts-check
// The legend of a plot names its lines and its shaded spans.

import { h, svg } from "../shell/dom.js";

const SPAN_WORDS = {
  held: "held back",
  bad: "odd by the quality report",
  missing: "missing",
  window: "used",
  check: "only checked",
  excluded: "left out",
  marked: "marked as bad",
  event: "event",
  alarm: "alarm",
};

// Gives the legend, or null where there is nothing to tell apart.
/** @param {any[]} series @param {{ kind: string }[]} shaded */
export function legendOf(series, shaded) {
  const drawn = series.filter(({ bare, legend }) => !bare && legend !== null);
  const lines =
    drawn.length > 1
      ? drawn.map(({ name, look, legend, dots }) => h("span", {}, swatch(look, dots), legend ?? name))
      : [];
  const kinds = [...new Set(shaded.map(({ kind }) => kind))];
  const spans = kinds.map((kind) =>
    h("span", {}, h("i", { class: `swatch ${kind}` }), SPAN_WORDS[kind] ?? kind),
  );
  return lines.length + spans.length ? h("span", { class: "legend" }, lines, spans) : null;
}

function swatch(look, isDotted = false) {
  return svg(
    "svg",
    { width: 22, height: 10, "aria-hidden": "true" },
    isDotted
      ? svg("circle", { cx: 11, cy: 5, r: 2, class: `line ${look}` })
      : svg("line", { x1: 0, x2: 22, y1: 5, y2: 5, class: `line ${look}` }),
  );
}
