// @ts-check
// The page of a single job shows its state and the actions on it, the progress of the search, and the
// result.

import { versionName } from "../data/marks.js";
import { badge, trustBadge } from "../list/rows.js";
import { get, send } from "../shell/api.js";
import { facts, h, notice, problemBox } from "../shell/dom.js";
import { duration, instant, modelText, timeSpan } from "../shell/format.js";
import { FOLLOWS, specOf } from "../shell/prepared.js";
import { mayWrite } from "../shell/session.js";
import { contentsOf, startTour } from "./contents.js";
import { designPanel } from "./design.js";
import { disturbancePanel } from "./disturbance.js";
import { isFinished, JobFeed } from "./feed.js";
import { livePanel } from "./live.js";
import { wordsForm } from "./naming.js";
import { progressPanel } from "./progress.js";
import { resultPanel } from "./result.js";
import { selectionPanel } from "./selection.js";
import { trajectoryPanel } from "./trajectory.js";
import { streamAddress } from "./windows.js";

export function showJob(view, id) {
  const heading = h("h1", { tabindex: "-1" }, id);
  const parts = {
    state: h("span", {}),
    connection: h("span", { class: "quiet", role: "status" }),
    actions: h("div", { class: "actions" }),
    about: h("div", {}),
    spec: h("div", {}),
  };
  const outcome = notice();
  const panels = {
    live: livePanel(view, id),
    progress: progressPanel(view),
    result: resultPanel(view),
    trajectory: trajectoryPanel(view, id),
    disturbance: disturbancePanel(view, id),
  };
  // A job that estimates nothing has a panel of its kind instead of the panels above.
  const kinds = { design: designPanel(view), selection: selectionPanel(view) };
  const body = h("div", { hidden: true }, parts.actions, parts.about);
  const columns = [h("div", {}), h("div", {})];
  const below = h("div", {});
  const parted = h("div", { class: "parts" }, h("div", { class: "workbench" }, columns), below);
  const contents = contentsOf(parted, view.signal);
  const page = h("div", { class: "with-contents" }, contents.element, parted);
  // The result stands first once there is a result; until then the progress stands first. A wide page has the
  // numbers and the plots beside each other, and what is behind the numbers below, or below the numbers where the
  // column of the plots is long; the plots of several experiments stand beside each other, below the numbers.
  const wide = matchMedia("(min-width: 100rem)");
  let arranged = () => {};
  const arrange = (/** @type {any} */ estimate = null) => {
    arranged = () => arrange(estimate);
    const hasResult = estimate !== null;
    const isWide = hasResult && wide.matches;
    const hasSeveral = isWide && feed.job.spec.experiments.length > 1;
    const { live, progress, result, trajectory, disturbance } = panels;
    const elements = (...shown) => shown.map(({ element }) => element);
    // Parts that stood beside the numbers are taken back.
    result.analysis.prepend(
      ...columns.flatMap((column) => [...column.querySelectorAll(":scope > .analysed")]),
    );
    columns[0].replaceChildren(...elements(...(hasResult ? [result] : [progress])));
    columns[1].replaceChildren(...elements(...(hasSeveral ? [] : hasResult ? [trajectory] : [live, result])));
    below.replaceChildren(
      ...(hasResult
        ? [
            ...(hasSeveral ? elements(trajectory) : []),
            ...elements(disturbance),
            result.analysis,
            ...elements(progress),
            result.searched,
            ...elements(live),
          ]
        : elements(trajectory, disturbance)),
    );
    if (hasSeveral || (isWide && plotsOf(feed.job, estimate) > FEW_PLOTS)) {
      columns[hasSeveral ? 1 : 0].append(...result.analysis.querySelectorAll(":scope > :not(.across)"));
    }
    parted.append(parts.spec);
    body.append(page);
    contents.draw();
  };
  wide.addEventListener("change", () => arranged(), { signal: view.signal });
  const note = h("p", { class: "note", hidden: true });
  const form = h("div", {});
  const edit = h(
    "button",
    { type: "button", class: "small", hidden: true, "aria-label": "Edit the name, the labels and the note" },
    "Edit",
  );
  let writes = false;
  // The form stands in the place of the button and of the note.
  const offerEdit = () => {
    const isOpen = form.hasChildNodes();
    edit.hidden = !writes || !feed.job || isOpen;
    note.hidden = !feed.job?.note || isOpen;
  };
  edit.addEventListener("click", () => {
    form.replaceChildren(
      wordsForm(view, {
        job: feed.job,
        saved: (job) => feed.change(job),
        closed: () => {
          form.replaceChildren();
          offerEdit();
          edit.focus();
        },
      }),
    );
    offerEdit();
    form.querySelector("input").focus();
  });
  view.root.append(
    h("div", { class: "title" }, heading, edit, parts.state, parts.connection),
    note,
    form,
    outcome.place,
    body,
  );

  let shownStatus = null;
  let shownWords = "";
  const feed = new JobFeed(id, view.signal, {
    job: () => {
      const job = feed.job;
      body.hidden = false;
      heading.textContent = job.name || `Unnamed job, ${modelText(job.model)}`;
      document.title = `${heading.textContent} · greybox`;
      note.textContent = job.note ?? "";
      panels.result.named(job);
      offerEdit();
      const words = JSON.stringify([job.name, job.labels, job.note]);
      if (job.status !== shownStatus || words !== shownWords) {
        shownWords = words;
        parts.about.replaceChildren(about(job), job.error ? problemBox(asProblem(job.error)) : "");
        parts.spec.replaceChildren(specification(job));
      }
      const plain = kinds[job.kind];
      if (plain) {
        plain.job(job);
      } else {
        panels.progress.job(job);
        panels.live.job(job);
      }
      if (job.status === shownStatus) {
        return;
      }
      shownStatus = job.status;
      parts.state.replaceChildren(badge(job.status));
      parts.actions.replaceChildren(...buttons(job, feed, outcome));
      if (plain) {
        body.append(plain.element, parts.spec);
        return;
      }
      arrange();
      panels.result.job(job).then((result) => {
        arrange(isFinished(job) ? result : null);
        if (result) {
          // The grade stands beside the state: a job that succeeded may have numbers that must not be used.
          const grade = trust(result);
          parts.state.replaceChildren(badge(job.status), " ", ...grade);
          panels.trajectory.load(job);
          panels.disturbance.load(job, result);
          contents.draw();
          if (job.status === "succeeded" && grade.length > 0) {
            startTour(parted);
          }
        }
      });
    },
    history: () => {
      const plain = kinds[feed.job?.kind];
      if (plain) {
        plain.history(feed.latest);
        return;
      }
      const rows = feed.generations();
      panels.progress.history(rows, feed);
      panels.result.history(rows);
      panels.live.history(rows);
    },
    connection: (text) => {
      parts.connection.textContent = text;
    },
    failed: (error) => outcome.fail(error),
    recovered: () => outcome.clear(),
  });
  feed.start();
  mayWrite(view).then(
    (isAllowed) => {
      writes = isAllowed;
      offerEdit();
    },
    () => {},
  );
}

// So many plots are as high as the numbers of an estimate.
const FEW_PLOTS = 3;

// The plots of measured and simulated outputs: two for each output and one for the inputs of each experiment.
/** @param {any} job @param {any} result */
function plotsOf({ spec }, { fit }) {
  return spec.experiments.length * (2 * Object.keys(fit?.estimation ?? {}).length + 1);
}

/** @param {any} result */
function trust({ verdict }) {
  return verdict?.trust ? [h("span", { class: "quiet" }, "trust "), trustBadge(verdict.trust)] : [];
}

function asProblem(error) {
  return { title: error.title, detail: error.detail ?? error.title, errors: error.errors };
}

// A link to a recording or to a job has its name once the name has been read.
/** @param {"datasets" | "jobs"} list @param {string} id */
function linkNamed(list, id) {
  const link = h("a", { href: `#/${list}/${id}` }, id);
  get(`/v1/${list}/${id}`).then(
    ({ data }) => {
      link.textContent = data.name || id;
      link.title = id;
    },
    () => {},
  );
  return link;
}

function about(job) {
  const experiments = job.spec?.experiments ?? [];
  const ids = [...new Set(experiments.map(({ dataset }) => dataset))];
  const versions = experiments.flatMap(({ version }) => (version ? [versionName(version)] : []));
  const datasets = ids.map((id) => linkNamed("datasets", id));
  const { selection, from, to } = job.spec ?? {};
  // The job that this one follows stands with the result.
  const labels = Object.entries(job.labels ?? {})
    .filter(([name]) => name !== FOLLOWS)
    .map(([name, value]) => `${name}: ${value}`)
    .join(", ");
  return facts([
    ["Job", h("code", { class: "digest" }, job.id)],
    [
      "Model",
      h("a", { href: `#/models/${encodeURIComponent(job.model)}`, title: job.model }, modelText(job.model)),
    ],
    [
      datasets.length > 1 ? "Datasets" : "Dataset",
      datasets.length ? datasets.flatMap((link) => [link, " "]) : null,
    ],
    ["Marks left out", [...new Set(versions)].join(", ")],
    ["Stream", selection && h("a", { href: streamAddress(selection.stream) }, selection.stream)],
    ["For the job", selection && linkNamed("jobs", selection.job)],
    ["Time", selection && timeSpan(from, to)],
    ["Length of a window", selection && duration(selection.window_s)],
    ["Labels", labels],
    ["Created", instant(job.created_at)],
    ["Started", job.started_at && instant(job.started_at)],
    ["Finished", job.finished_at && instant(job.finished_at)],
    ["Attempt", job.attempt > 1 ? job.attempt : null],
  ]);
}

function buttons(job, feed, outcome) {
  const button = (label, act, look) => h("button", { type: "button", class: look, onclick: act }, label);
  const act = (action) => async (event) => {
    event.target.disabled = true;
    try {
      outcome.clear();
      await send("POST", `/v1/jobs/${job.id}/${action}`);
      await feed.refresh();
    } catch (error) {
      outcome.fail(error);
    }
    event.target.disabled = false;
  };
  const remove = async () => {
    if (!confirm("Delete this job and its result?")) {
      return;
    }
    try {
      await send("DELETE", `/v1/jobs/${job.id}`);
      location.hash = "/jobs";
    } catch (error) {
      outcome.fail(error);
    }
  };
  const name = (action) => action[0].toUpperCase() + action.slice(1);
  const link = (label, href) => h("a", { class: "button for-writers", href }, label);
  const estimates = job.kind === "identification";
  return [
    ...job.actions.map((action) => button(name(action), act(action), "for-writers")),
    estimates && link("Use as template", `#/new?from=${job.id}`),
    estimates && link("Watch a stream", `#/plant/monitors/new?job=${job.id}`),
    estimates && isFinished(job) && link("Find windows in a stream", `#/plant/windows/new?job=${job.id}`),
    estimates &&
      isFinished(job) &&
      button("Compare methods", () => compareMethods(feed.job, outcome), "for-writers"),
    isFinished(job) && button("Delete", remove, "danger"),
  ].filter(Boolean);
}

const SEEDS = 5;

// A comparison runs the same job by each method with several seeds, which takes its time.
async function compareMethods(job, outcome) {
  if (!confirm(`Run this job by every method, ${SEEDS} times each?`)) {
    return;
  }
  try {
    const { data } = await send("POST", "/v1/comparisons", { job: specOf(job), seeds: SEEDS });
    location.hash = `/comparisons/${data.id}`;
  } catch (error) {
    outcome.fail(error);
  }
}

function specification(job) {
  return h(
    "details",
    { class: "analysed" },
    h("summary", {}, h("h3", {}, "Complete specification")),
    h("pre", { tabindex: "0" }, JSON.stringify(job.spec, null, 2)),
  );
}
