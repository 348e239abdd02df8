// Datasets: the list with an upload, and one dataset with its quality report and plots.

import { get, items, query, request, send } from "./api.js";
import { lineChart } from "./chart.js";
import { facts, h, notice, table, warningList } from "./dom.js";
import { count, duration, instant, number, quantity, unitText, words } from "./format.js";

const POINTS = 1500;
const PLOTTED_AT_ONCE = 8;

const COLUMNS = [
  { title: "Dataset" }, { title: "Samples", numeric: true }, { title: "Duration", numeric: true },
  { title: "Sample time", numeric: true }, { title: "Signals" }, { title: "Warnings", numeric: true }, { title: "Created" },
];

const SIGNAL_COLUMNS = [
  { title: "Signal" }, { title: "Unit" }, { title: "Recorded in" }, { title: "Missing", numeric: true },
  { title: "Least", numeric: true }, { title: "Mean", numeric: true }, { title: "Greatest", numeric: true },
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
      list.replaceChildren(table("Datasets", COLUMNS, state.rows.map(datasetRow), { empty: "No datasets yet." }));
    } catch (error) {
      outcome.fail(error);
    }
  };
  view.root.append(h("h1", { tabindex: "-1" }, "Datasets"), upload(view, outcome, () => read(true)), outcome.place, list, more);
  read(true);
}

function datasetRow(dataset) {
  const warnings = dataset.report?.warnings?.length ?? 0;
  return [
    h("a", { href: `#/datasets/${dataset.id}` }, dataset.name || dataset.id), count(dataset.samples),
    duration(dataset.duration_s), sampleTime(dataset),
    (dataset.signals ?? []).map((signal) => words(signal.name)).join(", "),
    warnings ? String(warnings) : "none", instant(dataset.created_at),
  ];
}

function sampleTime(dataset) {
  const text = quantity(number(dataset.sample_time_s, 6), "s");
  return dataset.uniform === false ? `${text} (irregular)` : text;
}

function upload(view, outcome, stored) {
  const file = h("input", { type: "file", required: true, accept: ".csv,.txt,.tsv,.json,text/csv,application/json" });
  const name = h("input", { type: "text", maxlength: "200", placeholder: "name of the file" });
  const time = h("input", { type: "text", maxlength: "200", placeholder: "first column" });
  const button = h("button", {}, "Upload");
  const submit = async (event) => {
    event.preventDefault();
    button.disabled = true;
    outcome.show(h("p", {}, `Uploading ${file.files[0].name} …`));
    try {
      const answer = await store(view, file.files[0], name.value.trim(), time.value.trim());
      outcome.show(receipt(answer));
      event.target.reset();
      stored();
    } catch (error) {
      outcome.fail(error);
    }
    button.disabled = false;
  };
  return h("form", { class: "panel fields", onsubmit: submit },
    h("label", {}, "Recording (CSV, or JSON)", file),
    h("label", {}, "Name", name), h("label", {}, "Time column", time), button,
    h("p", { class: "quiet" }, "CSV: a header row such as ", h("code", {}, "time [s],reference [m],position [mm]"),
      ". Values are converted to SI units; empty fields are missing samples."));
}

function store(view, file, name, time) {
  const json = file.name.toLowerCase().endsWith(".json");
  const label = name || file.name.replace(/\.[^.]+$/, "");
  return request("POST", `/v1/datasets${query({ name: label, time: json ? null : time })}`, {
    body: file, signal: view.signal, headers: { "content-type": json ? "application/json" : "text/csv" },
  });
}

function receipt({ data, status }) {
  const warnings = data.report?.warnings ?? [];
  return h("div", { class: "panel" },
    h("p", {}, status === 200 ? "The same recording was stored before: " : "Stored: ",
      h("a", { href: `#/datasets/${data.id}` }, data.name || data.id),
      `, ${count(data.samples)} samples over ${duration(data.duration_s)}.`),
    warnings.length ? warningList(warnings) : h("p", { class: "quiet" }, "No warnings."));
}

export function showDataset(view, id) {
  const heading = h("h1", { tabindex: "-1" }, id);
  const outcome = notice();
  const content = h("div", {});
  view.root.append(heading, outcome.place, content);
  get(`/v1/datasets/${id}`, view.signal).then(({ data }) => {
    heading.textContent = data.name || data.id;
    document.title = `${heading.textContent} · greybox`;
    content.append(...datasetParts(view, data, outcome));
  }).catch((error) => outcome.fail(error));
}

function datasetParts(view, dataset, outcome) {
  const warnings = dataset.report?.warnings ?? [];
  return [
    h("div", { class: "actions" },
      h("a", { class: "button", href: `#/new?dataset=${dataset.id}` }, "New job with this dataset"),
      h("button", { type: "button", onclick: () => saveCsv(dataset, outcome) }, "Download CSV"),
      h("button", { type: "button", class: "danger", onclick: () => remove(dataset, outcome) }, "Delete")),
    facts([
      ["Samples", count(dataset.samples)], ["Duration", duration(dataset.duration_s)],
      ["Sample time", sampleTime(dataset)], ["Created", instant(dataset.created_at)],
      ["Digest", h("code", { class: "digest" }, dataset.digest)],
    ]),
    h("h2", {}, "Quality"),
    warnings.length ? warningList(warnings) : h("p", {}, "No warnings."),
    h("h2", {}, "Signals"),
    table("Signals", SIGNAL_COLUMNS, dataset.signals.map((signal) => [
      words(signal.name), unitText(signal.unit), signal.recorded_unit ?? "", count(signal.missing),
      number(signal.min), number(signal.mean), number(signal.max)])),
    plots(view, dataset, outcome),
  ];
}

function plots(view, dataset, outcome) {
  const place = h("div", {});
  const names = dataset.signals.map((signal) => signal.name);
  const more = h("button", { type: "button", hidden: true }, "Plot more signals");
  const draw = async () => {
    const batch = names.splice(0, PLOTTED_AT_ONCE);
    more.hidden = names.length === 0;
    try {
      const drawn = await Promise.all(batch.map((name) => plot(view, dataset.id, name)));
      drawn.forEach(([chart, time, values]) => {
        place.append(chart.element);
        chart.set(time, [values]);
      });
    } catch (error) {
      outcome.fail(error);
    }
  };
  more.addEventListener("click", draw);
  draw();
  return h("div", {}, place, more);
}

async function plot(view, id, name) {
  // A list of names is separated by commas; a name with a comma in it can only be had with all.
  const signals = name.includes(",") ? null : name;
  const address = `/v1/datasets/${id}/samples${query({ signals, max_points: POINTS })}`;
  const { data } = await get(address, view.signal);
  const { unit, values } = data.signals[name];
  const chart = lineChart({
    title: words(name), height: 170, x: { label: "time", unit: "s" }, y: { label: words(name), unit },
    series: [{ name: words(name), look: "first" }],
  });
  return [chart, data.time_s, values];
}

async function saveCsv(dataset, outcome) {
  try {
    const { data } = await request("GET", `/v1/datasets/${dataset.id}/samples`, { headers: { accept: "text/csv" } });
    const address = URL.createObjectURL(new Blob([data], { type: "text/csv" }));
    h("a", { href: address, download: `${dataset.name || dataset.id}.csv` }).click();
    URL.revokeObjectURL(address);
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
