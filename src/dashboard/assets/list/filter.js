// @ts-check
// This module chooses which jobs of a list are shown, and in which order. Its functions are pure, so
// that they can be tested without a page.

export const FILTERS = ["text", "status", "trust", "model", "method", "label", "dataset"];

// A column or an order whose key begins with one of these is of the label, or of the estimate, that the rest names.
export const LABEL = "label:";
export const ESTIMATE = "estimate:";
// The API gives so many estimates of a job at the most.
export const MOST_ESTIMATES = 20;

// Lists the names of the estimates that a list with these columns and this order has to have.
/** @param {{ columns: string[], sort: string }} filter @returns {string[]} */
export const estimatesAsked = ({ columns, sort }) =>
  [...new Set([...columns, sort])]
    .filter((key) => key.startsWith(ESTIMATE))
    .map((key) => key.slice(ESTIMATE.length))
    .slice(0, MOST_ESTIMATES);

// Reads the filter, the order, the grouping and the columns from the query of an address. An address that
// names no grouping or no columns leaves them to `usual`.
/**
 * @param {URLSearchParams} query
 * @param {{ group?: string, columns?: string[] }} [usual]
 * @returns {any}
 */
export function fromQuery(query, { group = "", columns = [] } = {}) {
  const filter = Object.fromEntries(FILTERS.map((name) => [name, query.get(name) ?? ""]));
  const [, sort, direction] = /^(.*?)(?::(up|down))?$/.exec(query.get("sort") ?? "created:down");
  const named = query.get("columns");
  return {
    ...filter,
    sort,
    descending: direction !== "up",
    group: query.get("group") ?? group,
    columns: named === null ? columns : named.split(",").filter(Boolean),
  };
}

// Writes the filter, the order, the grouping and the columns as the query of an address. What is usual is left
// out, unless the query is to say `all`.
/**
 * @param {any} filter
 * @param {{ group?: string, columns?: string[] }} [usual]
 */
export function toQuery(
  { sort, descending, group, columns, ...filter },
  { group: usualGroup = "", columns: usualColumns = [] } = {},
  all = false,
) {
  const parameters = FILTERS.filter((name) => filter[name]).map((name) => [name, filter[name]]);
  if (sort !== "created" || !descending) {
    parameters.push(["sort", `${sort}:${descending ? "down" : "up"}`]);
  }
  if (all || group !== usualGroup) {
    parameters.push(["group", group]);
  }
  if (all || String(columns) !== String(usualColumns)) {
    parameters.push(["columns", String(columns)]);
  }
  return parameters.length ? `?${new URLSearchParams(parameters)}` : "";
}

export const matches = (job, filter) => matcher(filter)(job);

// A matcher answers whether a filter lets a job through. Every word of the filter's text has to stand
// somewhere in what the list shows of the job, or in its note; a word that begins with `job_` is an id, or the beginning of
// one. The words are split once for all jobs.
export function matcher(filter) {
  const words = (filter.text ?? "").toLowerCase().split(/\s+/).filter(Boolean);
  return (job) =>
    (!filter.status || job.status === filter.status) &&
    (!filter.trust || (job.trust ?? "none") === filter.trust) &&
    (!filter.model || job.model === filter.model) &&
    (!filter.method || job.method === filter.method) &&
    (!filter.dataset || job.datasets.some(({ id }) => id === filter.dataset)) &&
    (!filter.label || hasLabel(job.labels, filter.label)) &&
    words.every((word) => (word.startsWith("job_") ? job.id.startsWith(word) : textOf(job).includes(word)));
}

function hasLabel(labels, text) {
  const [, name, value] = /^([^:=]*)[:=]?(.*)$/.exec(text);
  return name in labels && (!value || labels[name] === value);
}

// The searched text of a job is made once: a job that changes comes as another object.
const searched = new WeakMap();

export function textOf(job) {
  let text = searched.get(job);
  if (text === undefined) {
    text = [
      job.name,
      job.note,
      job.model,
      job.method,
      job.status,
      job.trust,
      ...Object.entries(job.labels).flat(),
      ...job.datasets.map(({ id, name }) => name ?? id),
    ]
      .filter(Boolean)
      .join("\n")
      .toLowerCase();
    searched.set(job, text);
  }
  return text;
}

// Counts the seconds from the first slice of a job to its end, or until now.
export function seconds(job, now) {
  if (!job.started_at) {
    return null;
  }
  const end = job.finished_at ? Date.parse(job.finished_at) : now;
  return Math.max(0, (end - Date.parse(job.started_at)) / 1000);
}

const KEYS = {
  created: (job) => job.id,
  status: (job) => job.status,
  trust: (job, { trusts }) => trusts.indexOf(job.trust),
  name: (job) => (job.name ?? job.id).toLowerCase(),
  model: (job) => job.model,
  method: (job) => job.method ?? "",
  dataset: (job) => (job.datasets[0]?.name ?? "").toLowerCase(),
  duration: (job, { now }) => seconds(job, now) ?? -1,
  started: (job) => job.started_at ?? "",
  finished: (job) => job.finished_at ?? "",
  generations: (job) => job.progress?.generation ?? -1,
  evaluations: (job) => job.progress?.evaluations ?? -1,
  cost: (job) => job.progress?.best_cost ?? null,
};

// Jobs are sorted by a column, by a label, or by the value of an estimate. A job without a value has null.
function keyOfColumn(sort) {
  if (sort.startsWith(ESTIMATE)) {
    return ({ estimates }) => estimates?.[sort.slice(ESTIMATE.length)]?.value ?? null;
  }
  return sort.startsWith(LABEL)
    ? ({ labels }) => (labels[sort.slice(LABEL.length)] ?? "").toLowerCase()
    : (KEYS[sort] ?? KEYS.created);
}

// Gives the jobs that a filter lets through, in its order; of jobs with equal keys the newest comes
// first, and jobs without a key come last in either direction. The `trusts` of the filter are the grades of a verdict from the lowest on.
export function arranged(jobs, filter, now) {
  const key = keyOfColumn(filter.sort);
  const sign = filter.descending ? -1 : 1;
  const passes = matcher(filter);
  const kept = [];
  for (const job of jobs) {
    if (passes(job)) {
      kept.push([key(job, { now, trusts: filter.trusts ?? [] }), job]);
    }
  }
  kept.sort(
    ([a, first], [b, second]) =>
      Number(a === null) - Number(b === null) ||
      (a < b ? -sign : a > b ? sign : first.id < second.id ? 1 : -1),
  );
  return kept.map(([, job]) => job);
}
