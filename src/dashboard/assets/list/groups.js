// @ts-check
// This module puts the jobs of a list into groups: those of the same state, model, recording or label stand
// below each other, under a heading that can be closed. Its functions are pure.

import { methodText, modelText } from "../shell/format.js";
import { LABEL } from "./filter.js";

const KEYS = {
  status: ({ status }) => status,
  trust: ({ trust }) => trust ?? "",
  model: ({ model }) => modelText(model),
  method: ({ method }) => methodText(method ?? ""),
  dataset: ({ datasets }) => datasets.map(({ id, name }) => name || id).join(", "),
};

export const GROUPINGS = [
  { key: "status", title: "Status" },
  { key: "trust", title: "Trust" },
  { key: "model", title: "Model" },
  { key: "method", title: "Method" },
  { key: "dataset", title: "Recording" },
];

// Lists what jobs can be grouped by: what every job has, and each label.
/** @param {Iterable<string>} labels */
export function groupingsOffered(labels) {
  return [
    ...GROUPINGS,
    ...[...labels].sort().map((name) => ({ key: `${LABEL}${name}`, title: `Label ${name}` })),
  ];
}

/** @typedef {{ id: string, title: string, size: number, isOpen: boolean }} GroupHeading */

/** @param {any} entry */
export const isHeading = (entry) => "isOpen" in entry;

/**
 * The entries of a list: jobs in their order, and before the jobs of each group its heading. Groups come by
 * their names, with numbers in the names by size, and jobs that belong to no group come last. Without a
 * grouping, all entries are jobs.
 *
 * @param {any[]} jobs
 * @param {string} by
 * @param {Set<string>} closed The ids of the groups whose jobs are hidden.
 * @returns {any[]}
 */
export function entriesOf(jobs, by, closed) {
  const key = by.startsWith(LABEL) ? ({ labels }) => labels[by.slice(LABEL.length)] ?? "" : KEYS[by];
  if (!key) {
    return jobs;
  }
  /** @type {Map<string, any[]>} */
  const groups = new Map();
  for (const job of jobs) {
    const name = key(job);
    const members = groups.get(name);
    members ? members.push(job) : groups.set(name, [job]);
  }
  const names = [...groups.keys()].sort((a, b) => Number(a === "") - Number(b === "") || byName(a, b));
  return names.flatMap((name) => {
    const members = groups.get(name);
    const id = `group ${name}`;
    const isOpen = !closed.has(id);
    /** @type {GroupHeading} */
    const heading = { id, title: name || "none", size: members.length, isOpen };
    return isOpen ? [heading, ...members] : [heading];
  });
}

/** @type {Intl.Collator | null} */
let collator = null;

// A collator takes milliseconds to make, so that it is made when the first groups are ordered.
function byName(a, b) {
  collator ??= new Intl.Collator("en", { numeric: true });
  return collator.compare(a, b);
}
