// @ts-check
// The form sends a recording to the server, in any format that the server takes. The server asks for
// what it cannot know (the zone, the order of a date, a unit), and the form puts the question beside
// the file. The first rows of a text are shown as the server reads them.

import { query, request } from "../shell/api.js";
import { h, notice, warningList } from "../shell/dom.js";
import { count, duration } from "../shell/format.js";
import { LayoutPart } from "./layout.js";
import { parametersOf, SavedLayouts } from "./layouts.js";
import { askedFor, OptionFields } from "./options.js";
import { isTable, LAYOUT_OPTIONS } from "./roles.js";

// The media type of a file follows from its name; the server tells the format from the first lines of
// the file.
export function mediaType(name) {
  const extension = /\.([a-z0-9]+)(?:\.gz)?$/i.exec(name)?.[1]?.toLowerCase();
  const types = {
    json: "application/json",
    csv: "text/csv",
    tsv: "text/csv",
    parquet: "application/vnd.apache.parquet",
    xlsx: "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
  };
  return types[extension] ?? "text/plain";
}

// The uploader is the form to choose or drop a file; `stored(dataset)` is called with the dataset that
// the server kept.
export function uploader(view, stored) {
  const outcome = notice();
  const state = { file: null };
  const file = h("input", { type: "file", onchange: () => choose(file.files[0]) });
  const name = h("input", { type: "text", maxlength: "200", placeholder: "name of the file" });
  const chosen = h("span", { class: "quiet" });
  const button = h("button", { type: "submit", class: "primary", disabled: true }, "Upload");

  const changed = () => {
    saved.draw();
    layout.soon();
  };
  const options = new OptionFields(changed);
  const put = (values) => {
    options.put(values);
    changed();
  };
  const saved = new SavedLayouts(
    {
      values: () => options.values(),
      put,
      refused: (faults) =>
        options.ask(askedFor(faults), "The server does not take this; say it otherwise and save again:"),
    },
    view.signal,
  );
  const layout = new LayoutPart(
    {
      values: () => options.values(),
      saved: () => saved.chosen,
      put,
      // What the rows are is said at the rows themselves.
      answered: (faults) => {
        const asked = askedFor(faults).filter((option) => !LAYOUT_OPTIONS.includes(option));
        options.ask(asked, "The file leaves this open:");
      },
    },
    view.signal,
  );
  options.offerNamed().catch((error) => outcome.fail(error));

  const choose = (choice) => {
    state.file = choice ?? null;
    button.disabled = !state.file;
    chosen.textContent = state.file ? `${state.file.name}, ${count(state.file.size)} bytes` : "";
    options.settle();
    outcome.clear();
    const isShown = state.file && isTable(state.file.name);
    layout.choose(isShown ? state.file : null, mediaType(state.file?.name ?? ""));
  };
  const submit = async (event) => {
    event.preventDefault();
    if (!state.file) {
      return;
    }
    let openField = null;
    button.disabled = true;
    outcome.show(h("p", { role: "status" }, `Uploading ${state.file.name} …`));
    try {
      const answer = await send(view, state.file, {
        name: name.value.trim(),
        values: options.values(),
        layout: saved.chosen,
      });
      outcome.show(receipt(answer));
      stored(answer.data);
    } catch (error) {
      outcome.fail(error);
      const asked = askedFor(error.errors ?? []);
      openField = options.ask(asked, "The file leaves this open; say it and upload again:");
    }
    button.disabled = false;
    openField ? openField.focus() : outcome.place.scrollIntoView({ block: "nearest" });
  };
  const drop = (event) => {
    event.preventDefault();
    form.classList.remove("over");
    choose(event.dataTransfer.files[0]);
  };
  const over = (on) => (event) => {
    event.preventDefault();
    form.classList.toggle("over", on);
  };
  const form = h(
    "form",
    {
      class: "panel drop for-writers",
      onsubmit: submit,
      ondrop: drop,
      ondragover: over(true),
      ondragleave: over(false),
    },
    h(
      "div",
      { class: "fields" },
      h("label", {}, "Recording: choose a file, or drop it here", file),
      h("label", {}, "Name", name),
      saved.choice,
      button,
      chosen,
    ),
    outcome.place,
    layout.element,
    options.questions,
    saved.saving,
    h("details", {}, h("summary", {}, "What the file does not say"), options.rest),
    saved.list,
    h(
      "p",
      { class: "quiet" },
      "CSV with units in the header such as ",
      h("code", {}, "time [s],position [mm]"),
      ", an Excel workbook, Apache Parquet, or what a historian gives: PI, AVEVA, Canary, OPC UA, Cognite, InfluxDB, Ignition, Simulink, pandas. Values become SI; an empty field is a missing sample.",
    ),
  );
  return form;
}

function send(view, file, { name, values, layout }) {
  const isJson = mediaType(file.name) === "application/json";
  const parameters = parametersOf({ ...values, time: isJson ? "" : values.time }, layout);
  const label = name || file.name.replace(/(\.[a-z0-9]+)+$/i, "") || file.name;
  return request("POST", `/v1/datasets${query({ name: label, ...parameters })}`, {
    body: file,
    signal: view.signal,
    headers: {
      "content-type": mediaType(file.name),
      ...(file.name.endsWith(".gz") ? { "content-encoding": "gzip" } : {}),
    },
  });
}

function receipt({ data, status }) {
  const warnings = data.report?.warnings ?? [];
  return h(
    "div",
    {},
    h(
      "p",
      {},
      status === 200 ? "The same recording was stored before: " : "Stored: ",
      h("a", { href: `#/datasets/${data.id}` }, data.name || data.id),
      `, ${count(data.samples)} samples over ${duration(data.duration_s)}.`,
    ),
    warnings.length
      ? warningList(warnings)
      : h("p", { class: "quiet" }, "The quality report warns of nothing."),
  );
}
