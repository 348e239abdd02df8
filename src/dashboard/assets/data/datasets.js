// @ts-check
// These pages show datasets: the list with an upload, and a single dataset with its quality report and
// plots, where windows of the recording are chosen for a new job.

import { clockOf } from "../plot/clock.js";
import { WindowChooser } from "../plot/group.js";
import { specifiedWindow } from "../plot/math.js";
import { download } from "../plot/save.js";
import { recordedUnit, toShown } from "../plot/units.js";
import { get, items, query, request, send } from "../shell/api.js";
import { facts, h, notice, table } from "../shell/dom.js";
import { count, duration, instant, number, quantity, unitText, words } from "../shell/format.js";
import { prepare } from "../shell/prepared.js";
import { Marking } from "./marking.js";
import { partAround } from "./marks.js";
import { signalPlots } from "./plots.js";
import { origin, Preparing } from "./preparing.js";
import { qualityList } from "./quality.js";
import { uploader } from "./upload.js";

const PLOTS_AT_ONCE = 8;

const COLUMNS = [
  { title: "Dataset" },
  { title: "Samples", numeric: true },
  { title: "Duration", numeric: true },
  { title: "Sample time", numeric: true },
  { title: "Signals" },
  { title: "Warnings" },
  { title: "Marks" },
  { title: "Created" },
];

const SIGNAL_COLUMNS = [
  { title: "Signal" },
  { title: "Unit" },
  { title: "Missing", numeric: true },
  { title: "Least", numeric: true },
  { title: "Mean", numeric: true },
  { title: "Greatest", numeric: true },
];

export function showDatasets(view) {
  const outcome = notice();
  const list = h("div", {});
  const state = { rows: [], next: null };
  const more = h("button", { type: "button", hidden: true, onclick: () => read() }, "Older datasets");
  const read = async (fresh = false) => {
    try {
      const page = query({ page_token: fresh ? null : state.next });
      const { data } = await get(`/v1/datasets${page}`, view.signal);
      state.rows = fresh ? items(data) : [...state.rows, ...items(data)];
      state.next = data.next_page_token;
      more.hidden = !state.next;
      list.replaceChildren(
        table("Datasets", COLUMNS, state.rows.map(datasetRow), { empty: "No datasets yet.", stacked: true }),
      );
    } catch (error) {
      outcome.fail(error);
    }
  };
  view.root.append(
    h("h1", { tabindex: "-1" }, "Datasets"),
    uploader(view, () => read(true)),
    outcome.place,
    list,
    more,
  );
  read(true);
}

function datasetRow(dataset) {
  const warnings = dataset.report?.warnings?.length ?? 0;
  return [
    h("a", { href: `#/datasets/${dataset.id}`, title: dataset.id }, dataset.name || "unnamed"),
    count(dataset.samples),
    duration(dataset.duration_s),
    sampleTime(dataset),
    (dataset.signals ?? []).map((signal) => words(signal.name)).join(", "),
    warnings ? String(warnings) : "none",
    dataset.version > 0 ? `version ${dataset.version}` : "none",
    instant(dataset.created_at),
  ];
}

function sampleTime(dataset) {
  const text = quantity(number(dataset.sample_time_s, 6), "s");
  return dataset.uniform === false ? `${text} (irregular)` : text;
}

export function showDataset(view, id) {
  const heading = h("h1", { tabindex: "-1" }, id);
  const outcome = notice();
  const content = h("div", {});
  view.root.append(heading, outcome.place, content);
  get(`/v1/datasets/${id}`, view.signal)
    .then(({ data }) => {
      heading.textContent = data.name || "Unnamed dataset";
      document.title = `${heading.textContent} · greybox`;
      content.append(...datasetParts(view, data, outcome));
    })
    .catch((error) => outcome.fail(error));
}

function datasetParts(view, dataset, outcome) {
  const warnings = dataset.report?.warnings ?? [];
  const marking = new Marking(view, dataset);
  const windows = windowsOfNewJob(view, dataset, marking);
  const samples = samplesPart(view, dataset, outcome, windows.chooser);
  marking.join(windows.chooser, samples);
  const preparing = new Preparing(view, dataset);
  return [
    h(
      "div",
      { class: "actions" },
      windows.start,
      preparing.button,
      h("button", { type: "button", onclick: () => saveCsv(dataset, outcome) }, "Download CSV"),
      h("button", { type: "button", class: "danger", onclick: () => remove(dataset, outcome) }, "Delete"),
    ),
    preparing.element,
    facts([
      ...origin(dataset),
      ["Samples", count(dataset.samples)],
      ["Duration", duration(dataset.duration_s)],
      ["Sample time", sampleTime(dataset)],
      ["First sample", clockOf(dataset)?.text(0) ?? "not dated by its source"],
      ["Time zone", dataset.start ? dataset.zone || "UTC" : null],
      ["Created", instant(dataset.created_at)],
      ["Digest", h("code", { class: "digest" }, dataset.digest)],
    ]),
    h("div", { class: "workbench" }, h("div", {}, ...about(dataset, warnings, marking)), samples.element),
  ];
}

// The facts about a dataset beside its samples.
function about(dataset, warnings, marking) {
  return [
    h("h2", {}, "Quality"),
    warnings.length ? qualityList(warnings, marking) : h("p", {}, "No warnings."),
    marking.versions.element,
    h("h2", {}, "Signals"),
    table(
      "Signals",
      SIGNAL_COLUMNS,
      dataset.signals.map((signal) => {
        const unit = recordedUnit(signal) ?? { name: signal.unit, factor: 1, offset: 0 };
        const values = [signal.min, signal.mean, signal.max];
        return [
          words(signal.name),
          unitText(unit.name),
          count(signal.missing),
          ...values.map((value) => number(toShown(value, unit))),
        ];
      }),
      { stacked: true },
    ),
  ];
}

// The windows that are chosen on the page of a recording become the experiments of a new job.
function windowsOfNewJob(view, dataset, marking) {
  const windows = [];
  const start = h("a", { class: "button primary for-writers", href: `#/new?dataset=${dataset.id}` });
  const draw = () => {
    chooser.draw(windows, (k) => `Window ${k + 1}`);
    chooser.shade();
    const what = windows.length === 1 ? "this window" : `these ${windows.length} windows`;
    start.textContent = `New job with ${windows.length ? what : "this dataset"}`;
  };
  const replace = (k, ...by) => {
    windows.splice(k, 1, ...by);
    draw();
  };
  const chooser = new WindowChooser({
    dataset,
    signal: view.signal,
    drags: ["look", "estimation", "validation", "mark"],
    acts: { mark: marking.drags },
    add: (window) => replace(windows.length, window),
    change: (k, window) => replace(k, window),
    remove: (k) => replace(k),
  });
  start.addEventListener("click", (event) => {
    if (windows.length) {
      event.preventDefault();
      const experiments = windows.map((window) => ({
        dataset: dataset.id,
        window: specifiedWindow(window, dataset.duration_s),
        role: window.role === "validation" ? "validation" : undefined,
      }));
      prepare({ experiments });
    }
  });
  draw();
  return { start, chooser };
}

// The plots of the samples. `show(span, name)` shows a place on all of them, and comes to the plot of the signal.
function samplesPart(view, dataset, outcome, chooser) {
  const place = h("div", {});
  const parts = [];
  const names = dataset.signals.map((signal) => signal.name);
  const more = h("button", { type: "button", hidden: true }, "Plot more signals");
  const draw = () => {
    const batch = names.splice(0, PLOTS_AT_ONCE);
    more.hidden = names.length === 0;
    const failed = (error) => outcome.fail(error);
    const part = signalPlots({ view, dataset, names: batch, failed, onBrush: chooser.onBrush });
    parts.push(part);
    chooser.follow(part);
    place.append(part.element);
  };
  more.addEventListener("click", draw);
  draw();
  const chartOf = (name) => {
    while (names.includes(name)) {
      draw();
    }
    const drawn = parts.flatMap((part) => part.drawn);
    return (drawn.find((entry) => entry.name === name) ?? drawn[0]).chart;
  };
  return {
    chartOf,
    show(span, name) {
      const { element } = chartOf(name);
      for (const { group } of parts) {
        group.show(partAround(span, dataset.sample_time_s));
      }
      element.scrollIntoView({ block: "center" });
    },
    element: h(
      "section",
      { "aria-label": "Samples" },
      h("h2", {}, "Samples"),
      h(
        "p",
        { class: "quiet" },
        "Windows that are chosen here become the experiments of a new job, which leave out what is marked as bad.",
      ),
      chooser.element,
      place,
      more,
    ),
  };
}

async function saveCsv(dataset, outcome) {
  try {
    const { data } = await request("GET", `/v1/datasets/${dataset.id}/samples`, {
      headers: { accept: "text/csv" },
    });
    download(new Blob([data], { type: "text/csv" }), `${dataset.name || dataset.id}.csv`);
  } catch (error) {
    outcome.fail(error);
  }
}

async function remove(dataset, outcome) {
  if (!confirm("Delete this dataset?")) {
    return;
  }
  try {
    await send("DELETE", `/v1/datasets/${dataset.id}`);
    location.hash = "/datasets";
  } catch (error) {
    outcome.fail(error);
  }
}
