// @ts-check
// This module has the columns that the list of jobs can show, what stands in them, and how wide they are.
// Its functions are pure.

import {
  count,
  duration,
  methodText,
  modelText,
  number,
  quantity,
  withError,
  words,
} from "../shell/format.js";
import { FOLLOWS } from "../shell/prepared.js";
import { ESTIMATE, LABEL, seconds } from "./filter.js";

/**
 * `text` gives what stands in the cell of a job, `widest` a text that is as wide as any, where the text of a
 * job does not tell. A phone shows the `narrow` columns alone. A `numeric` column has its texts at the right, and
 * `estimate` names the estimate that a column shows with its trust.
 *
 * @typedef {{
 *   key: string,
 *   title: string,
 *   text?: (job: any, now: number) => string,
 *   widest?: string,
 *   narrow?: boolean,
 *   numeric?: boolean,
 *   fixed?: boolean,
 *   estimate?: string,
 * }} Column
 */

const WIDEST_TRUST = "moderate____";

/** @type {Column[]} */
export const COLUMNS = [
  { key: "status", title: "Status", widest: "succeeded____", narrow: true },
  { key: "trust", title: "Trust", widest: WIDEST_TRUST, narrow: true },
  { key: "name", title: "Job", text: titleOf, narrow: true, fixed: true },
  { key: "dataset", title: "Recording", text: ({ datasets }) => recordingsOf(datasets) },
  { key: "model", title: "Model", text: ({ model }) => modelText(model) },
  { key: "method", title: "Method", text: ({ method }) => methodText(method ?? "") },
  { key: "labels", title: "Labels", text: ({ labels }) => labelsText(labels) },
  { key: "duration", title: "Duration", text: durationOf, numeric: true },
  {
    key: "generations",
    title: "Generations",
    text: ({ progress }) => count(progress?.generation),
    numeric: true,
  },
  {
    key: "evaluations",
    title: "Evaluations",
    text: ({ progress }) => count(progress?.evaluations),
    numeric: true,
  },
  { key: "cost", title: "Best cost", text: ({ progress }) => number(progress?.best_cost, 4), numeric: true },
  { key: "created", title: "Created", widest: "Sept 30, 2026, 10:00 PM GMT+2" },
  { key: "started", title: "Started", widest: "Sept 30, 2026, 10:00 PM GMT+2" },
  { key: "finished", title: "Finished", widest: "Sept 30, 2026, 10:00 PM GMT+2" },
];

export const USUAL = [
  "status",
  "trust",
  "name",
  "dataset",
  "model",
  "method",
  "labels",
  "duration",
  "created",
];

export function titleOf(job) {
  return job.name || `unnamed, ${modelText(job.model)}`;
}

function recordingsOf(datasets) {
  return datasets.map(({ name }) => name || "unnamed").join(", ");
}

function labelsText(labels) {
  return Object.entries(labels)
    .filter(([name]) => name !== FOLLOWS)
    .map(([name, value]) => `${name}: ${value}`)
    .join(", ");
}

function durationOf(job, now) {
  const took = seconds(job, now);
  return took === null ? "–" : duration(took);
}

// Writes the value with its total error to the digits that the error leaves, as the page of a result does.
/** @param {{ value: number, unit: string | null, total_error: number | null } | undefined} estimate */
export function estimateText(estimate) {
  if (!estimate) {
    return "";
  }
  const [value, error] = withError(estimate.value, estimate.total_error);
  return quantity(error === "–" ? value : `${value} ± ${error}`, estimate.unit);
}

// Lists the columns that can be chosen: those of every job, and one for each label and each estimate.
/** @param {Iterable<string>} labels @param {Iterable<string>} [estimates] @returns {Column[]} */
export function columnsOffered(labels, estimates = []) {
  const named = [...labels].filter((name) => name !== FOLLOWS).sort();
  return [
    ...COLUMNS,
    ...named.map((name) => ({
      key: `${LABEL}${name}`,
      title: name,
      text: (/** @type {any} */ job) => job.labels[name] ?? "",
    })),
    ...[...estimates].sort().map((name) => ({
      key: `${ESTIMATE}${name}`,
      title: words(name).replace(/\[(\d+)\]$/, (_, k) => `, experiment ${Number(k) + 1}`),
      text: (/** @type {any} */ job) => estimateText(job.estimates?.[name]),
      widest: WIDEST_TRUST,
      narrow: true,
      numeric: true,
      estimate: name,
    })),
  ];
}

// The columns with the keys, in the order in which they are offered; the name of a job is always there.
/** @param {string[]} keys @returns {Column[]} */
export function columnsShown(keys) {
  const named = (prefix) =>
    keys.filter((key) => key.startsWith(prefix)).map((key) => key.slice(prefix.length));
  return columnsOffered(named(LABEL), named(ESTIMATE)).filter(
    ({ key, fixed }) => fixed || keys.includes(key),
  );
}

// On a phone characters and paddings are smaller. The digits of a number are all as wide as the widest of them.
const SIZES = {
  wide: { character: 7.1, digit: 8, padding: 22 },
  tight: { character: 6.7, digit: 7.6, padding: 10 },
};
// A text that is longer is written in two lines, with room for words that do not part.
const MOST_IN_A_LINE = 46;
const UNPARTED = 12;
const MOST_WANTED = 76;
const LEAST_OF_A_TEXT = 12;
const SORT_MARK = 2;
const MEASURED = 1000;

/**
 * How wide a column has to be for its title, and would be for the longest text of the jobs. A number is never cut.
 *
 * @param {Column} column
 * @param {any[]} jobs
 * @param {number} now
 */
export function widthNeeded({ title, text, widest = "", key, numeric }, jobs, now, isTight = false) {
  const size = isTight ? SIZES.tight : SIZES.wide;
  const { padding } = size;
  const character = numeric ? size.digit : size.character;
  const longest = text
    ? jobs.slice(0, MEASURED).reduce((most, job) => Math.max(most, text(job, now).length), 0)
    : widest.length;
  const inLines =
    longest > MOST_IN_A_LINE ? Math.max(MOST_IN_A_LINE, Math.ceil(longest / 2) + UNPARTED) : longest;
  const least = Math.max(
    title.length + (isTight ? 0 : SORT_MARK),
    widest.length,
    numeric ? longest : key === "name" ? 16 : Math.min(Math.ceil(longest / 2), LEAST_OF_A_TEXT),
  );
  const wanted = Math.max(least, Math.min(inLines, MOST_WANTED));
  return { least: padding + character * least, wanted: padding + character * wanted };
}

/**
 * Shares the room out among columns: each gets what it wants where the room suffices, with the spare room in
 * proportion. Where it does not, the columns give way down to the least that they need.
 *
 * @param {{ least: number, wanted: number }[]} needs
 * @param {number} room
 */
export function widthsIn(needs, room) {
  const wanted = needs.reduce((sum, need) => sum + need.wanted, 0);
  if (wanted <= room) {
    return needs.map((need) => (need.wanted * room) / wanted);
  }
  const least = needs.reduce((sum, need) => sum + need.least, 0);
  const share = Math.max(0, (room - least) / (wanted - least));
  return needs.map((need) => need.least + share * (need.wanted - need.least));
}
