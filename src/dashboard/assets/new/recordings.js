// @ts-check
// This part of the form chooses the recordings of a new job, the windows of each with their roles, and the
// signals that the model sees. Each window is an experiment.

import { signalPlots } from "../data/plots.js";
import { uploader } from "../data/upload.js";
import { inputSet, likeness } from "../model/signals.js";
import { WindowChooser } from "../plot/group.js";
import { partWithin, shadedSpans, specifiedWindow } from "../plot/math.js";
import { namesIn } from "../shell/description.js";
import { h, notice } from "../shell/dom.js";
import { count, duration, number, unitText, words } from "../shell/format.js";
import { changed, recordingsOfDraft, withSignal } from "./draft.js";
import { heldBack } from "./search.js";
import { VersionLine } from "./version.js";

const PLOTS_AT_ONCE = 4;
const CLASSES = {
  uncertain: "uncertain by its source",
  substituted: "substituted by its source",
  frozen: "frozen",
  spike: "spikes",
};

export function recordingsPart(job) {
  const list = h("div", {});
  const choice = h("select", { "aria-label": "Stored recordings" });
  const add = h(
    "button",
    {
      type: "button",
      onclick: () => {
        const dataset = job.datasets.get(choice.value);
        dataset && job.addDataset(dataset);
      },
    },
    "Use this recording",
  );
  const upload = h(
    "details",
    {},
    h("summary", {}, "Upload a file"),
    uploader(job.view, (dataset) => {
      job.addDataset(dataset);
      upload.open = false;
    }),
  );
  const element = h(
    "section",
    { "aria-label": "Recordings" },
    h("h2", {}, "1. Recordings"),
    list,
    h("div", { class: "fields" }, h("label", {}, "Stored recordings", choice), add),
    upload,
  );
  const shown = [];
  let started = false;
  return {
    element,
    draw() {
      const options = [...job.datasets.values()].map((dataset) =>
        h(
          "option",
          { value: dataset.id },
          `${dataset.name || "unnamed"} (${count(dataset.samples)} samples, ${duration(dataset.duration_s)})`,
        ),
      );
      const before = choice.value;
      choice.replaceChildren(...options);
      choice.value = before || options[0]?.value || "";
      add.disabled = options.length === 0;
      const experiments = job.spec.experiments ?? [];
      // The upload is open while there is no recording, since it is the first thing to do.
      if (experiments.length === 0 && !started) {
        upload.open = true;
      }
      started = true;
      // A recording keeps its plots as long as it stands at the same place.
      const groups = recordingsOfDraft(experiments);
      groups.forEach(({ dataset, places }, k) => {
        if (shown[k]?.dataset !== dataset) {
          shown[k]?.leave.abort();
          shown[k] = new RecordingPart(job, places, dataset);
        }
        shown[k].draw(places);
      });
      for (const part of shown.splice(groups.length)) {
        part.leave.abort();
      }
      const elements = shown.map((part) => part.element);
      if (
        elements.length !== list.children.length ||
        elements.some((element, k) => element !== list.children[k])
      ) {
        list.replaceChildren(...elements);
      }
    },
  };
}

// The experiments at `places` are windows of a recording, and see the same signals.
class RecordingPart {
  constructor(job, places, dataset) {
    this.job = job;
    this.places = places;
    this.dataset = dataset;
    this.recording = job.datasets.get(dataset);
    this.leave = new AbortController();
    job.view.signal.addEventListener("abort", () => this.leave.abort(), { once: true });
    this.head = h("div", { class: "title" });
    this.outcome = notice();
    this.signals = h("div", { class: "fields" });
    this.leftOut = h("div", { class: "leave-out" });
    this.element = h("div", { class: "panel experiment" }, this.head, this.outcome.place);
    if (!this.recording) {
      this.element.append(h("p", {}, "This recording is not on the server."));
      return;
    }
    this.chooser = new WindowChooser({
      dataset: this.recording,
      signal: this.leave.signal,
      drags: ["estimation", "validation", "leave_out", "look"],
      add: (window) => this.add(window),
      change: (k, window) => this.change(this.places[k], window),
      remove: (k) => this.remove(this.places[k]),
      acts: { leave_out: { take: (part) => this.leaveOut(part) } },
    });
    this.version = new VersionLine(this.recording, {
      signal: this.leave.signal,
      put: (number) => this.put(["version"], number),
      drawn: () => this.shade(),
      failed: (error) => this.outcome.fail(error),
    });
    this.element.append(
      this.chooser.element,
      this.plots(),
      this.version.element,
      this.leftOut,
      h("h3", {}, "What the model sees"),
      this.signals,
    );
  }

  // The first signals are plotted at once and further signals on demand: the recording of a plant may
  // have hundreds.
  plots() {
    const names = this.recording.signals.map(({ name }) => name);
    const view = { signal: this.leave.signal };
    const place = h("div", {});
    const more = h("button", { type: "button" });
    const next = () => {
      const part = signalPlots({
        view,
        dataset: this.recording,
        names: names.splice(0, PLOTS_AT_ONCE),
        height: 200,
        onBrush: this.chooser.onBrush,
        failed: (error) => this.outcome.fail(error),
      });
      this.chooser.follow(part);
      place.append(part.element);
      more.hidden = names.length === 0;
      more.textContent = `Show ${Math.min(PLOTS_AT_ONCE, names.length)} more of ${names.length} signals`;
      this.shade();
    };
    more.addEventListener("click", next);
    next();
    return h("div", {}, place, more);
  }

  // The windows of a recording agree in everything that this part shows beside the windows.
  get experiment() {
    return this.job.spec.experiments[this.places[0]] ?? {};
  }

  // Sets a value at a path of every window.
  put(path, value) {
    this.job.set(
      this.places.reduce((spec, k) => changed(spec, ["experiments", k, ...path], value), this.job.spec),
    );
  }

  windows() {
    return this.places.map((k) => {
      const { window, role } = this.job.spec.experiments[k];
      const { from_s: from, to_s: to } = window ?? {};
      return { from: from ?? 0, to: to ?? this.recording.duration_s, role: role ?? "estimation" };
    });
  }

  // A further window sees what the windows before it see; settings of a single experiment stay with it.
  add(window) {
    const { dataset, signals, version, exclude, instants } = this.experiment;
    const shared = JSON.parse(JSON.stringify({ dataset, signals, version, exclude, instants }));
    const experiments = [...this.job.spec.experiments];
    experiments.splice(this.places.at(-1) + 1, 0, this.withWindow(shared, window));
    this.job.set({ ...this.job.spec, experiments });
  }

  change(k, window) {
    this.job.at(["experiments", k], this.withWindow(this.job.spec.experiments[k], window));
  }

  // The last window gives way to the whole recording.
  remove(k) {
    this.places.length > 1
      ? this.job.at(["experiments", k], undefined)
      : this.job.at(["experiments", k, "window"], undefined);
  }

  withWindow({ window: _, role: __, ...rest }, window) {
    const specified = specifiedWindow(window, this.recording.duration_s);
    return {
      ...rest,
      ...(specified ? { window: specified } : {}),
      ...(window.role === "validation" ? { role: "validation" } : {}),
    };
  }

  leaveOut(part) {
    const [from_s, to_s] = partWithin(part, this.recording.duration_s);
    const spans = this.experiment.exclude?.spans ?? [];
    this.put(["exclude", "spans"], [...spans, { from_s, to_s }]);
  }

  // Samples that the source or the quality report doubts, and stretches that were dragged across.
  drawLeftOut() {
    const { job } = this;
    // What did not change stays, so that a click always meets its button.
    const asDrawn = JSON.stringify(this.experiment.exclude ?? null);
    if (asDrawn === this.leftOutDrawn) {
      return;
    }
    this.leftOutDrawn = asDrawn;
    const { classes = [], spans = [] } = this.experiment.exclude ?? {};
    const put = (member, list) => this.put(["exclude", member], list.length ? list : undefined);
    const boxes = namesIn(job.description, "ExcludedClass").map((name) => {
      const onchange = ({ target }) =>
        put("classes", target.checked ? [...classes, name] : classes.filter((kind) => kind !== name));
      const box = h("input", { type: "checkbox", checked: classes.includes(name), onchange });
      return h("label", { class: "inline" }, box, CLASSES[name] ?? words(name));
    });
    const stretches = spans.map((span, place) => {
      const text = `${span.signals ? `${span.signals.join(", ")}, ` : ""}${number(span.from_s)} to ${number(span.to_s)} s`;
      const onclick = () =>
        put(
          "spans",
          spans.filter((_, other) => other !== place),
        );
      return h(
        "button",
        { type: "button", class: "small", "aria-label": `use ${text} again`, onclick },
        `${text} ×`,
      );
    });
    this.leftOut.replaceChildren(h("span", {}, "Leave out:"), ...boxes, ...stretches);
  }

  // What is held back to check is the end of each window that is estimated from.
  shade() {
    const excluded = shadedSpans([...(this.experiment.exclude?.spans ?? []), ...this.version.marks]);
    const share = heldBack(this.job);
    const held = this.windows()
      .filter(({ role }) => share > 0 && role === "estimation")
      .map(({ from, to }) => ({ from: to - share * (to - from), to, kind: "held" }));
    this.chooser.shade([...held, ...excluded]);
  }

  draw(places) {
    this.places = places;
    const { job } = this;
    const title = this.recording?.name || this.dataset;
    const numbers = places.map((k) => k + 1);
    const takeOut = () =>
      job.set(places.reduceRight((spec, k) => changed(spec, ["experiments", k], undefined), job.spec));
    this.head.replaceChildren(
      h("h3", {}, this.recording ? title : `Experiment ${numbers.join(", ")}: ${title}`),
      h(
        "button",
        { type: "button", class: "small", "aria-label": `Take out ${title}`, onclick: takeOut },
        "Take out",
      ),
    );
    if (!this.recording) {
      return;
    }
    this.chooser.draw(this.windows(), (k) => `Experiment ${numbers[k]}`);
    this.version.draw(this.experiment.version);
    this.shade();
    this.drawLeftOut();
    this.drawSignals();
  }

  drawSignals() {
    const { job, experiment } = this;
    const { model } = job;
    if (!model) {
      this.signals.replaceChildren(
        h("p", { class: "quiet" }, "Choose a model below; its signals are then found here by name and unit."),
      );
      return;
    }
    const inputs = inputSet(model, experiment.signals);
    const signals = [
      ...model.inputs.filter(({ name }) => inputs.includes(name)).map((signal) => [signal, "input"]),
      ...model.outputs.map((signal) => [signal, "measured output"]),
    ];
    const sets = model.input_sets ?? [];
    const chooser =
      sets.length > 1 &&
      h(
        "label",
        {},
        "Driven by",
        h(
          "select",
          { onchange: (event) => this.drive(sets[event.target.value]) },
          sets.map((set, n) =>
            h(
              "option",
              { value: String(n), selected: set.join() === inputs.join() },
              set.map(words).join(" and "),
            ),
          ),
        ),
      );
    const choose = ([signal, kind]) => {
      const options = [...this.recording.signals].sort((a, b) => likeness(signal, b) - likeness(signal, a));
      const missing = kind === "input" ? "– choose –" : "not measured";
      return h(
        "label",
        { title: signal.meaning ?? "" },
        `${words(signal.name)} [${unitText(signal.unit)}], ${kind}`,
        h(
          "select",
          {
            onchange: ({ target }) =>
              job.set(withSignal(job.spec, this.places, signal.name, target.value || undefined)),
            "aria-invalid": kind === "input" && !experiment.signals?.[signal.name] ? "true" : null,
          },
          h("option", { value: "" }, missing),
          options.map(({ name, unit }) =>
            h(
              "option",
              { value: name, selected: experiment.signals?.[signal.name] === name },
              `${words(name)}${unit ? ` [${unitText(unit)}]` : ""}`,
            ),
          ),
        ),
      );
    };
    this.signals.replaceChildren(...[chooser, ...signals.map(choose)].filter(Boolean));
  }

  drive(set) {
    const { experiment, job } = this;
    const outputs = job.model.outputs.map(({ name }) => name);
    const kept = Object.fromEntries(
      Object.entries(experiment.signals ?? {}).filter(
        ([name]) => outputs.includes(name) || set.includes(name),
      ),
    );
    for (const name of set) {
      const signal = job.model.inputs.find((input) => input.name === name);
      kept[name] ??= [...this.recording.signals].sort(
        (a, b) => likeness(signal, b) - likeness(signal, a),
      )[0]?.name;
    }
    this.put(["signals"], kept);
  }
}
