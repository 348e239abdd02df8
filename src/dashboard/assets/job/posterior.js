// @ts-check
// Draws from the posterior distribution show each unknown over each other one (a corner plot), and how
// well the chains that drew them have converged.

import { h, svg, table } from "../shell/dom.js";
import { count, number } from "../shell/format.js";
import { labelOf, statesOf, unknownWords } from "./unknowns.js";

const MOST_UNKNOWNS = 6;
const BARS = 20;
const PANEL = 130;
const GAP = 8;
const MARGIN = 34;
// A panel shows this share of the draws in each direction: a single draw far out would hide the rest.
const SHOWN = [0.002, 0.998];

export function posteriorPart(job, result) {
  const described = [...(result.parameters ?? []), ...(result.initial_states ?? [])].filter(
    ({ posterior }) => posterior,
  );
  const { posterior: draws } = result;
  const more =
    draws.names.length > MOST_UNKNOWNS ? ` The plot shows the first ${MOST_UNKNOWNS} unknowns.` : "";
  return h(
    "div",
    {},
    h(
      "p",
      { class: "quiet" },
      `The likelihood with the priors, drawn by ${count(described[0]?.posterior.chains)} chains of ${count(draws.generations)} generations. An R̂ below 1.01 and more than 400 effective draws say that the chains have seen the distribution.${more}`,
    ),
    table("Draws from the posterior", COLUMNS, described.map(row), { stacked: true }),
    corner(draws, statesOf(result)),
    h(
      "a",
      { class: "button", href: `/v1/jobs/${job.id}/posterior`, download: `${job.id}-draws.json` },
      "Draws as JSON",
    ),
  );
}

const COLUMNS = [
  { title: "Unknown" },
  { title: "Unit" },
  { title: "Mean", numeric: true },
  { title: "Standard deviation", numeric: true },
  { title: "2.5 %", numeric: true },
  { title: "50 %", numeric: true },
  { title: "97.5 %", numeric: true },
  { title: "R̂", numeric: true },
  { title: "Effective draws, middle", numeric: true },
  { title: "Tails", numeric: true },
];

function row(estimate) {
  const { unit, posterior } = estimate;
  return [
    labelOf(estimate),
    unit,
    number(posterior.mean),
    number(posterior.standard_deviation, 3),
    ...posterior.quantiles.map(({ value }) => number(value)),
    number(posterior.r_hat, 4),
    number(posterior.ess_bulk, 3),
    number(posterior.ess_tail, 3),
  ];
}

/**
 * The value below which a share of sorted values lies.
 *
 * @param {number[]} sorted
 * @param {number} share
 */
function quantile(sorted, share) {
  return sorted[Math.round(share * (sorted.length - 1))];
}

/**
 * Where each draw of an unknown is within its panel, 0 to 1, and the range that the panel shows. An unknown
 * whose draws are all one number has none.
 *
 * @param {{ names: string[], units: string[], rows: number[][] }} draws
 * @param {number} index
 * @param {string[]} [states]
 */
export function cornerColumn({ names, units, rows }, index, states = []) {
  const values = rows.map((draw) => draw[index]);
  const sorted = [...values].sort((a, b) => a - b);
  const [low, high] = SHOWN.map((share) => quantile(sorted, share));
  if (!(low < high)) {
    return null;
  }
  return {
    label: `${unknownWords(names[index], states)} [${units[index]}]`,
    low,
    high,
    places: values.map((value) => (value - low) / (high - low)),
  };
}

/**
 * How many places from 0 to 1 fall into each of the bars of a histogram.
 *
 * @param {number[]} places
 */
export function barCounts(places) {
  const counts = new Array(BARS).fill(0);
  for (const place of places.filter((place) => place >= 0 && place <= 1)) {
    counts[Math.min(BARS - 1, Math.floor(place * BARS))] += 1;
  }
  return counts;
}

function corner(draws, states) {
  const indices = draws.names.map((_, index) => index).slice(0, MOST_UNKNOWNS);
  const columns = indices
    .map((index) => cornerColumn(draws, index, states))
    .filter((column) => column !== null);
  const size = 2 * MARGIN + columns.length * (PANEL + GAP);
  const at = (place) => place * (PANEL + GAP);
  const panels = columns.flatMap((up, row) => [
    ...columns.slice(0, row).map((across, column) => dots(across, up, MARGIN + at(column), GAP + at(row))),
    histogram(up, MARGIN + at(row), GAP + at(row)),
    ...labels(up, row, MARGIN + at(row), GAP + at(columns.length - 1) + PANEL, GAP + at(row)),
  ]);
  return h(
    "figure",
    { class: "chart" },
    svg(
      "svg",
      {
        viewBox: `0 0 ${size} ${size}`,
        class: "scatter",
        role: "img",
        "aria-label": "Draws from the posterior, each unknown over each other one",
      },
      panels,
    ),
  );
}

function frame(x, y) {
  return svg("rect", { x, y, width: PANEL, height: PANEL, fill: "none", stroke: "var(--rule)" });
}

function dots(across, up, x, y) {
  const inside = (place) => place >= 0 && place <= 1;
  const shown = across.places
    .map((along, k) => [along, up.places[k]])
    .filter(([along, above]) => inside(along) && inside(above));
  return svg(
    "g",
    {},
    frame(x, y),
    shown.map(([along, above]) =>
      svg("circle", {
        cx: (x + along * PANEL).toFixed(1),
        cy: (y + (1 - above) * PANEL).toFixed(1),
        r: 1.2,
        fill: "var(--first)",
        "fill-opacity": 0.5,
      }),
    ),
  );
}

function histogram(column, x, y) {
  const counts = barCounts(column.places);
  const most = Math.max(1, ...counts);
  const width = PANEL / BARS;
  return svg(
    "g",
    {},
    frame(x, y),
    counts.map((bar, k) => {
      const height = (0.95 * PANEL * bar) / most;
      return svg("rect", {
        x: x + k * width,
        y: y + PANEL - height,
        width,
        height,
        fill: "var(--first)",
      });
    }),
  );
}

// An unknown is named along the bottom and, where it stands above others, along the left.
function labels({ label, low, high }, row, x, bottom, top) {
  const text = (attributes, words) => svg("text", { class: "tick", ...attributes }, words);
  const below = bottom + 14;
  const middle = top + PANEL / 2;
  return [
    text({ x, y: below }, number(low, 3)),
    text({ x: x + PANEL, y: below, class: "tick end" }, number(high, 3)),
    text({ x: x + PANEL / 2, y: below + 14, class: "tick middle" }, label),
    row > 0 &&
      text({ class: "tick middle", transform: `translate(${MARGIN - 12} ${middle}) rotate(-90)` }, label),
  ];
}
