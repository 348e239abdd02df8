// @ts-check
// This module says of each compared job what kind of job it is, and what of it can be compared. Its functions are
// pure.

export const KINDS = {
  identification: { name: "estimation", about: "an estimation" },
  design: { name: "design of an experiment", about: "the design of an experiment" },
  selection: { name: "selection of windows", about: "a selection of windows" },
};

const FORETOLD = {
  design: "The errors beside the estimates are those that its best experiment would leave",
  selection: "The errors beside the estimates are those that an estimation from its windows would leave",
};

const UNFINISHED = {
  queued: "waits for its turn",
  running: "is still at work",
  paused: "is paused",
  failed: "failed",
  cancelled: "was cancelled",
};

/**
 * What is to be known of a job beside others: nothing of an estimation with a result.
 *
 * @param {{ job: any, result: any, k: number }} run
 * @returns {string | null}
 */
export function remark({ job: { kind, status, error }, result, k }) {
  const name = `Job ${k + 1}`;
  const isEstimation = kind === "identification";
  const about = isEstimation ? name : `${name} is ${KINDS[kind].about}, which estimates nothing`;
  if (result) {
    return isEstimation ? null : `${about}. ${FORETOLD[kind]}.`;
  }
  const state = `${UNFINISHED[status] ?? status} and has no result${error?.detail ? `: ${error.detail}` : ""}`;
  return `${about}${isEstimation ? "" : "; it"} ${state}.`;
}

/**
 * The jobs of each kind by themselves, since jobs of different kinds are asked for different things.
 *
 * @template {{ job: any }} Run
 * @param {Run[]} runs
 * @returns {[string, Run[]][]}
 */
export function byKind(runs) {
  return Object.keys(KINDS)
    .map((kind) => /** @type {[string, Run[]]} */ ([kind, runs.filter(({ job }) => job.kind === kind)]))
    .filter(([, members]) => members.length > 0);
}

// Lists the numbers of jobs: "1, 2 and 4".
/** @param {{ k: number }[]} runs */
export function numbersOf(runs) {
  const numbers = runs.map(({ k }) => String(k + 1));
  return [numbers.slice(0, -1).join(", "), numbers.at(-1)].filter(Boolean).join(" and ");
}
