// @ts-check
// The correlation of the errors is a picture: a disc for each pair of estimates, whose area is the strength
// of the correlation. A positive correlation is a full disc and a negative one a ring, so that the sign is
// told by colour and by shape.

import { h, svg } from "../shell/dom.js";
import { number } from "../shell/format.js";
import { heatTable } from "./heat.js";
import { readable } from "./reading.js";
import { unknownWords } from "./unknowns.js";

const CELL = 36;
const LARGEST = 0.44 * CELL;
const HEAD = 22;

// Writes a correlation; near one, its distance from one has to be seen.
export function correlationText(value) {
  return value === null || value === undefined ? "–" : number(value, Math.abs(value) > 0.99 ? 4 : 2);
}

/** @param {import("page/api").Schemas["Correlation"]} correlation @param {string[]} states */
export function correlationPart({ names, matrix, condition_number: condition }, states) {
  const inWords = { names: names.map((name) => unknownWords(name, states)), matrix };
  return h(
    "div",
    {},
    picture(inWords),
    h(
      "p",
      { class: "quiet" },
      "The larger a disc, the nearer the correlation is to 1 or −1: the data then fix a combination of the two better than either by itself.",
      Number.isFinite(condition) ? ` Condition number ${number(condition, 3)}, where 1 is best.` : "",
    ),
    h("details", {}, h("summary", {}, "Correlations as a table"), correlationTable(inWords)),
  );
}

function correlationTable({ names, matrix }) {
  return heatTable("Correlation of the errors", names, names, (i, k) => {
    const value = matrix[i]?.[k];
    return { text: i === k ? "1" : correlationText(value), value: i === k ? 0 : value };
  });
}

/** @param {{ names: string[], matrix: (number | null)[][] }} correlation */
function picture({ names, matrix }) {
  const left = HEAD;
  const size = { width: left + CELL * names.length + 2, height: HEAD + CELL * names.length + 2 };
  const readout = h("output", { class: "readout" }, "");
  const cells = names.map((_, i) =>
    names.map((_, k) => disc({ names, value: matrix[i]?.[k], i, k, x: left + k * CELL, y: HEAD + i * CELL })),
  );
  const drawn = svg(
    "svg",
    {
      ...size,
      viewBox: `0 0 ${size.width} ${size.height}`,
      class: "discs",
      role: "group",
      "aria-label": "Correlations of pairs",
    },
    names.map((_, k) =>
      svg(
        "text",
        { x: left + (k + 0.5) * CELL, y: HEAD - 8, class: "tick middle", "aria-hidden": "true" },
        String(k + 1),
      ),
    ),
    names.map((_, i) =>
      svg(
        "text",
        { x: left - 6, y: HEAD + (i + 0.5) * CELL + 4, class: "tick end", "aria-hidden": "true" },
        String(i + 1),
      ),
    ),
    cells,
  );
  readable(cells, readout);
  return h(
    "figure",
    { class: "picture" },
    h(
      "figcaption",
      { class: "legend" },
      h("span", {}, sample(0.8), "rise together"),
      h("span", {}, sample(-0.8), "one rises as the other falls"),
    ),
    h(
      "div",
      { class: "matrix" },
      h(
        "ol",
        {},
        names.map((name) => h("li", {}, name)),
      ),
      drawn,
    ),
    readout,
  );
}

function disc({ names, value, i, k, x, y }) {
  const label = `${names[i]} and ${names[k]}: ${i === k ? "1" : correlationText(value)}`;
  return svg(
    "g",
    { role: "img", "aria-label": label, class: "cell", transform: `translate(${x} ${y})` },
    svg("rect", { width: CELL, height: CELL }),
    i === k ? svg("circle", { cx: CELL / 2, cy: CELL / 2, r: 2, class: "diagonal" }) : shape(value, CELL / 2),
  );
}

// The area of a disc is the strength of the correlation; a ring has the same outline.
function shape(value, middle) {
  const radius = LARGEST * Math.sqrt(Math.min(1, Math.abs(value ?? 0)));
  const outline = Math.min(5, radius);
  return value < 0
    ? svg("circle", {
        cx: middle,
        cy: middle,
        r: radius - outline / 2,
        class: "negative",
        "stroke-width": outline,
      })
    : svg("circle", { cx: middle, cy: middle, r: radius, class: "positive" });
}

function sample(value) {
  return svg(
    "svg",
    { width: CELL, height: CELL, class: "discs", "aria-hidden": "true" },
    shape(value, CELL / 2),
  );
}
