// @ts-check
// This module computes how an output moves as each unknown of a result moves up by a step: which values are
// simulated, and how the simulated outputs differ. Its functions are pure.

import { labelOf } from "./unknowns.js";

/**
 * @typedef {{
 *   label: string,
 *   unit: string,
 *   kind: "values" | "states",
 *   name: string,
 *   estimate: number,
 *   error: number | null,
 * }} Unknown
 * @typedef {"error" | "percent"} StepKind
 * @typedef {{ time_s: number[], outputs: Record<string, { unit: string, values: (number | null)[] }> }} Simulated
 */

const PERCENT = 0.01;
// Lines count as lines of the same shape from this cosine between them.
const SAME_SHAPE = 0.99;
const MOST_PAIRS = 6;
// A line that is smaller than the output by this factor is a line of rounding errors.
const ROUNDING = 1e-10;

/**
 * Lists the unknowns of a result that move an experiment: parameters that experiments share unless the experiment has
 * its own, its own parameters, and its initial states; those of all experiments where none is named.
 *
 * @param {{ parameters?: any[], initial_states?: any[] }} result
 * @param {number | null} [experiment]
 * @param {Record<string, any>} [ownParameters] What the specification says of the experiment's own parameters.
 * @returns {Unknown[]}
 */
export function unknownsOf(
  { parameters = [], initial_states: states = [] },
  experiment = null,
  ownParameters = {},
) {
  const concerns = ({ experiment: k = null, name = "" }) =>
    experiment === null || k === experiment || (k === null && !(name in ownParameters));
  const unknown = (estimate, kind, name) => ({
    label: labelOf(estimate),
    unit: estimate.unit,
    kind,
    name,
    estimate: estimate.estimate,
    error: estimate.total_standard_error ?? estimate.standard_error ?? null,
  });
  return [
    ...parameters.filter(concerns).map((parameter) => unknown(parameter, "values", parameter.name)),
    ...states.filter(concerns).map((state) => unknown(state, "states", state.state)),
  ].filter(({ estimate }) => Number.isFinite(estimate));
}

/**
 * The states of an experiment that only checks, which were fitted to its first samples.
 *
 * @param {{ validation_starts?: any[] }} result
 * @param {number} experiment
 * @returns {Record<string, number>}
 */
export function fittedStarts({ validation_starts: starts = [] }, experiment) {
  return Object.fromEntries(
    starts.filter(({ experiment: k }) => k === experiment).map(({ state, value }) => [state, value]),
  );
}

/**
 * The values of a candidate of the search in an experiment. The columns say what each value stands for.
 *
 * @param {import("page/api").Schemas["CandidateColumn"][]} columns
 * @param {Record<string, number>} candidate
 * @param {number} experiment
 */
export function valuesOfCandidate(columns, candidate, experiment) {
  const ofExperiment = columns.filter(({ experiment: k }) => k === experiment);
  const shared = columns.filter(({ experiment: k }) => k === null || k === undefined);
  /** @type {{ values: Record<string, number>, states: Record<string, number> }} */
  const all = { values: {}, states: {} };
  for (const { name, state } of [...shared, ...ofExperiment]) {
    if (state) {
      all.states[state] = candidate[name];
    } else {
      all.values[name.replace(/\[\d+\]$/, "")] = candidate[name];
    }
  }
  return all;
}

/**
 * The step by which an unknown is moved up, or why it cannot be moved so.
 *
 * @param {Unknown} unknown
 * @param {StepKind} kind
 * @returns {{ size: number, reason?: undefined } | { size: null, reason: string }}
 */
export function stepOf({ estimate, error }, kind) {
  const size = kind === "error" ? (error ?? 0) : PERCENT * Math.abs(estimate);
  if (size > 0) {
    return { size };
  }
  const reason =
    kind === "error"
      ? "not moved: it has no standard error"
      : "not moved: the estimate is 0, and so is 1 % of it";
  return { size: null, reason };
}

/**
 * The values of all unknowns, in which one of them may have been moved by a step.
 *
 * @param {Unknown[]} unknowns
 * @param {Unknown | null} [moved]
 * @param {number} [size]
 */
export function valuesOf(unknowns, moved = null, size = 0) {
  /** @type {{ values: Record<string, number>, states: Record<string, number> }} */
  const all = { values: {}, states: {} };
  for (const unknown of unknowns) {
    all[unknown.kind][unknown.name] = unknown.estimate + (unknown === moved ? size : 0);
  }
  return all;
}

/**
 * The difference of an output between two simulations, at the instants of the first. An instant that the second does
 * not have is left out (undefined), and a value that one of them lacks is a gap (null).
 *
 * @param {Simulated} before
 * @param {Simulated} after
 * @param {string} output
 */
export function movement(before, after, output) {
  const values = new Map(after.time_s.map((time, k) => [time, after.outputs[output].values[k]]));
  return before.time_s.map((time, k) => {
    const [from, to] = [before.outputs[output].values[k], values.get(time)];
    return to === undefined ? undefined : from === null || to === null ? null : to - from;
  });
}

/** @typedef {(number | null | undefined)[]} Line */

/** @param {Line} line @returns {number[]} */
const numbersOf = (line) =>
  /** @type {number[]} */ (line.filter((value) => value !== null && value !== undefined));

/** @param {Line} line */
export function rms(line) {
  const numbers = numbersOf(line);
  return Math.sqrt(numbers.reduce((sum, value) => sum + value * value, 0) / Math.max(1, numbers.length));
}

/**
 * Ranks unknowns by how far each moves an output: by the root mean square of the lines, the largest first. A line of
 * rounding errors counts as zero. The shares are those of the mean squares, and sum to 1 where anything moves.
 *
 * @template {{ line: Line }} Moved
 * @param {Moved[]} moved
 * @param {Line} base The output with all unknowns at their estimates.
 */
export function ranked(moved, base) {
  const least = ROUNDING * rms(base);
  const rows = moved.map((entry) => {
    const size = rms(entry.line);
    return { ...entry, rms: size > least ? size : 0 };
  });
  const total = rows.reduce((sum, entry) => sum + entry.rms ** 2, 0);
  return rows
    .map((entry) => ({ ...entry, share: total > 0 ? entry.rms ** 2 / total : 0 }))
    .sort((a, b) => b.rms - a.rms);
}

/**
 * The cosine between two lines: 1 where they have the same shape, −1 where either is the other turned over.
 *
 * @param {Line} left
 * @param {Line} right
 */
export function likeness(left, right) {
  const product = (/** @type {Line} */ a, /** @type {Line} */ b) =>
    a.reduce((/** @type {number} */ sum, value, k) => sum + (value ?? 0) * (b[k] ?? 0), 0);
  const size = Math.sqrt(product(left, left)) * Math.sqrt(product(right, right));
  return size > 0 ? product(left, right) / size : 0;
}

/**
 * The pairs of unknowns whose lines have the same shape, the most alike first. A line at zero has no shape.
 *
 * @param {{ label: string, line: Line, rms: number }[]} moved
 */
export function alikePairs(moved) {
  const shaped = moved.filter((entry) => entry.rms > 0);
  const pairs = shaped.flatMap(({ label, line }, k) =>
    shaped
      .slice(k + 1)
      .map((entry) => ({ labels: [label, entry.label], cosine: likeness(line, entry.line) })),
  );
  return pairs
    .filter(({ cosine }) => Math.abs(cosine) >= SAME_SHAPE)
    .sort((a, b) => Math.abs(b.cosine) - Math.abs(a.cosine))
    .slice(0, MOST_PAIRS);
}
