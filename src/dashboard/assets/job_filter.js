// @ts-check
// Which jobs of a list are shown, and in which order. Pure, so that it can be tested without a page.

export const FILTERS = ["text", "status", "trust", "model", "method", "label", "dataset"];
const TRUST = { high: 3, moderate: 2, low: 1 };

// The filter and the order that an address says.
/** @returns {{ [name: string]: string } & { sort: string, descending: any }} */
export function fromQuery(query) {
  /** @type {any} */
  const filter = Object.fromEntries(FILTERS.map((name) => [name, query.get(name) ?? ""]));
  const [sort, direction] = (query.get("sort") ?? "created:down").split(":");
  return { ...filter, sort, descending: direction !== "up" };
}

// What an address says of a filter; what is as usual is left out.
export function toQuery({ sort, descending, ...filter }) {
  const said = Object.entries(filter).filter(([, value]) => value);
  if (sort !== "created" || !descending) {
    said.push(["sort", `${sort}:${descending ? "down" : "up"}`]);
  }
  return said.length ? `?${new URLSearchParams(said)}` : "";
}

export const matches = (job, filter) => matcher(filter)(job);

// Whether a filter lets a job through, every word of its text standing somewhere in what the list shows
// of the job; what is the same for all jobs is done once.
export function matcher(filter) {
  const words = (filter.text ?? "").toLowerCase().split(/\s+/).filter(Boolean);
  return (job) => (!filter.status || job.status === filter.status) && (!filter.trust || (job.trust ?? "none") === filter.trust) &&
    (!filter.model || job.model === filter.model) && (!filter.method || job.method === filter.method) &&
    (!filter.dataset || job.datasets.some(({ id }) => id === filter.dataset)) &&
    (!filter.label || hasLabel(job.labels, filter.label)) && words.every((word) => textOf(job).includes(word));
}

function hasLabel(labels, wanted) {
  const [, name, value] = /^([^:=]*)[:=]?(.*)$/.exec(wanted);
  return name in labels && (!value || labels[name] === value);
}

// What is searched of a job, made once: a job that changes comes as another object.
const searched = new WeakMap();

function textOf(job) {
  let text = searched.get(job);
  if (text === undefined) {
    text = [job.name, job.id, job.model, job.method, job.status, job.trust, ...Object.entries(job.labels).flat(),
      ...job.datasets.map(({ id, name }) => name ?? id)].filter(Boolean).join("\n").toLowerCase();
    searched.set(job, text);
  }
  return text;
}

// Seconds from the first slice to the end, or until now.
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
  trust: (job) => TRUST[job.trust] ?? 0,
  name: (job) => (job.name ?? job.id).toLowerCase(),
  model: (job) => job.model,
  method: (job) => job.method ?? "",
  dataset: (job) => (job.datasets[0]?.name ?? "").toLowerCase(),
  duration: (job, now) => seconds(job, now) ?? -1,
};

// The jobs that a filter lets through, in its order; those that are alike newest first.
export function arranged(jobs, filter, now) {
  const key = KEYS[filter.sort] ?? KEYS.created;
  const sign = filter.descending ? -1 : 1;
  const passes = matcher(filter);
  const kept = [];
  for (const job of jobs) {
    if (passes(job)) {
      kept.push([key(job, now), job]);
    }
  }
  kept.sort(([a, one], [b, other]) => (a < b ? -sign : a > b ? sign : one.id < other.id ? 1 : -1));
  return kept.map(([, job]) => job);
}
