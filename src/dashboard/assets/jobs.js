// The list of jobs, newest first. The first page is read again every few seconds.

import { get, items, pause, query } from "./api.js";
import { h, notice, table } from "./dom.js";
import { duration, instant, number, words } from "./format.js";

const REFRESH_MS = 3000;
const STATUSES = ["queued", "running", "paused", "succeeded", "failed", "cancelled"];

const COLUMNS = [
  { title: "Status" }, { title: "Job" }, { title: "Model" }, { title: "Progress" },
  { title: "Best cost", numeric: true }, { title: "Created" },
];

export function showJobs(view) {
  const state = { status: view.query.get("status") ?? "", pages: [], next: null };
  const outcome = notice();
  const list = h("div", {});
  const more = h("button", { type: "button", hidden: true, onclick: () => older(view, state, draw, outcome) }, "Older jobs");
  const draw = () => {
    list.replaceChildren(jobTable(state.pages.flat(), state.status));
    more.hidden = !state.next;
  };
  view.root.append(
    h("div", { class: "title" }, h("h1", { tabindex: "-1" }, "Jobs"),
      h("a", { class: "button", href: "#/new" }, "New job")),
    filter(state), outcome.place, list, more);
  refresh(view, state, draw, outcome).catch(() => {});
}

function filter(state) {
  const options = [h("option", { value: "" }, "all"), STATUSES.map((status) =>
    h("option", { value: status, selected: status === state.status }, status))];
  const change = (event) => {
    location.hash = `/jobs${query({ status: event.target.value })}`;
  };
  return h("label", { class: "inline" }, "Status ", h("select", { onchange: change }, options));
}

async function refresh(view, state, draw, outcome) {
  for (;;) {
    try {
      const { data } = await get(`/v1/jobs${query({ status: state.status })}`, view.signal);
      if (state.pages.length <= 1) {
        state.pages = [items(data)];
        state.next = data.next_page_token;
      } else {
        state.pages = merged(items(data), state.pages);
      }
      outcome.clear();
      draw();
    } catch (error) {
      outcome.fail(error);
    }
    await pause(REFRESH_MS, view.signal);
  }
}

// The newest jobs before the pages that are on screen; a job that moved down stands there once.
function merged(first, [shown, ...older]) {
  const fresh = new Set(first.map((job) => job.id));
  const later = new Set(older.flat().map((job) => job.id));
  const kept = shown.filter((job) => !fresh.has(job.id));
  return [[...first.filter((job) => !later.has(job.id)), ...kept], ...older];
}

async function older(view, state, draw, outcome) {
  try {
    const address = `/v1/jobs${query({ status: state.status, page_token: state.next })}`;
    const { data } = await get(address, view.signal);
    state.pages.push(items(data));
    state.next = data.next_page_token;
    draw();
  } catch (error) {
    outcome.fail(error);
  }
}

function jobTable(jobs, status) {
  const rows = jobs.map((job) => [
    badge(job.status),
    h("a", { href: `#/jobs/${job.id}` }, job.name || job.id),
    job.model,
    progressText(job),
    number(job.progress?.best_cost),
    instant(job.created_at),
  ]);
  const empty = status ? `No job is ${status}.` : "No jobs yet. Upload a dataset, then make a new job.";
  return table("Jobs", COLUMNS, rows, { empty });
}

export function badge(status) {
  return h("span", { class: `badge ${status}` }, status);
}

function progressText(job) {
  const progress = job.progress;
  if (!progress || job.status === "queued") {
    return "–";
  }
  if (job.status === "succeeded") {
    return `${progress.generation} generations`;
  }
  const part = Math.round(100 * (progress.fraction ?? 0));
  const left = job.status === "running" && Number.isFinite(progress.eta_s) ? `, ${duration(progress.eta_s)} left` : "";
  return `${words(progress.phase ?? "")} ${part} %${left}`;
}
