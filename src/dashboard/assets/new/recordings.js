// @ts-check
// This part of the form chooses the recordings of a new job, the part of each that is used, its role,
// and the signals that the model sees.

import { signalPlots } from "../data/datasets.js";
import { uploader } from "../data/upload.js";
import { inputSet, likeness } from "../model/signals.js";
import { namesIn } from "../shell/description.js";
import { h, notice } from "../shell/dom.js";
import { count, duration, number, numberOf, words } from "../shell/format.js";
import { heldBack } from "./search.js";

const PLOTS_AT_ONCE = 4;
// What dragging across a plot does.
const DRAGS = [
  ["window", "chooses what is used"],
  ["leave_out", "leaves a stretch out"],
  ["look", "only looks closer"],
];
const CLASSES = {
  uncertain: "uncertain by its source",
  substituted: "substituted by its source",
  frozen: "frozen",
  spike: "spikes",
};
const round = (value) => Number(value.toPrecision(6));

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
    draw(from) {
      const options = [...job.datasets.values()].map((dataset) =>
        h(
          "option",
          { value: dataset.id },
          `${dataset.name || dataset.id} (${count(dataset.samples)} samples, ${duration(dataset.duration_s)})`,
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
      // An experiment keeps its plots as long as it has the same recording.
      experiments.forEach((experiment, k) => {
        if (shown[k]?.dataset !== experiment.dataset) {
          shown[k]?.leave.abort();
          shown[k] = new ExperimentPart(job, k, experiment.dataset);
        }
        shown[k].draw(from);
      });
      for (const part of shown.splice(experiments.length)) {
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

class ExperimentPart {
  constructor(job, k, dataset) {
    this.job = job;
    this.k = k;
    this.dataset = dataset;
    this.recording = job.datasets.get(dataset);
    this.leave = new AbortController();
    job.view.signal.addEventListener("abort", () => this.leave.abort(), { once: true });
    this.head = h("div", { class: "title" });
    this.outcome = notice();
    this.from = h("input", {
      type: "text",
      size: "10",
      placeholder: "first",
      onchange: () => this.takeWindow(),
    });
    this.to = h("input", {
      type: "text",
      size: "10",
      placeholder: "last",
      onchange: () => this.takeWindow(),
    });
    this.signals = h("div", { class: "fields" });
    this.leftOut = h("div", { class: "leave-out" });
    this.brushing = h(
      "select",
      {},
      DRAGS.map(([name, text]) => h("option", { value: name }, text)),
    );
    this.element = h("div", { class: "panel experiment" }, this.head, this.outcome.place);
    if (!this.recording) {
      this.element.append(h("p", {}, "This recording is not on the server."));
      return;
    }
    this.element.append(
      h(
        "div",
        { class: "fields" },
        h("label", {}, "Use from, s", this.from),
        h("label", {}, "to, s", this.to),
        h("button", { type: "button", onclick: () => this.window(null) }, "All of it"),
        h("label", {}, "Dragging across a plot", this.brushing),
      ),
      this.plots(),
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
    const onBrush = {
      active: () => this.brushing.value !== "look",
      take: (part) => (this.brushing.value === "leave_out" ? this.leaveOut(part) : this.window(part)),
      end: (side, x) => {
        const [from, to] = this.chosen();
        this.window(side === 0 ? [x, to] : [from, x]);
      },
    };
    const place = h("div", {});
    this.drawn = [];
    const more = h("button", { type: "button" });
    const next = () => {
      const part = signalPlots({
        view,
        dataset: this.recording,
        names: names.splice(0, PLOTS_AT_ONCE),
        height: 200,
        onBrush,
        failed: (error) => this.outcome.fail(error),
      });
      this.drawn.push(...part.drawn);
      place.append(part.element);
      more.hidden = names.length === 0;
      more.textContent = `Show ${Math.min(PLOTS_AT_ONCE, names.length)} more of ${names.length} signals`;
      this.shade();
    };
    more.addEventListener("click", next);
    next();
    return h("div", {}, place, more);
  }

  get experiment() {
    return this.job.spec.experiments[this.k] ?? {};
  }

  chosen() {
    const { from_s: from, to_s: to } = this.experiment.window ?? {};
    return [from ?? 0, to ?? this.recording.duration_s];
  }

  // The stretch that was dragged across, within the recording.
  stretch(part) {
    return [Math.max(0, Math.min(...part)), Math.min(this.recording.duration_s, Math.max(...part))];
  }

  leaveOut(part) {
    const [from_s, to_s] = this.stretch(part).map(round);
    const spans = this.experiment.exclude?.spans ?? [];
    this.job.at(["experiments", this.k, "exclude", "spans"], [...spans, { from_s, to_s }]);
  }

  // Samples that the source or the quality report doubts, and stretches that were dragged across.
  drawLeftOut() {
    const { job, k } = this;
    const { classes = [], spans = [] } = this.experiment.exclude ?? {};
    const put = (member, list) =>
      job.at(["experiments", k, "exclude", member], list.length ? list : undefined);
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

  window(part) {
    const [from, to] = part ? this.stretch(part) : [0, Infinity];
    const window = {};
    if (from > 0) {
      window.from_s = round(from);
    }
    if (to < this.recording.duration_s) {
      window.to_s = round(to);
    }
    this.job.at(["experiments", this.k, "window"], Object.keys(window).length ? window : undefined);
  }

  takeWindow() {
    const [from, to] = [numberOf(this.from.value), numberOf(this.to.value)];
    this.window([Number.isFinite(from) ? from : 0, Number.isFinite(to) ? to : this.recording.duration_s]);
  }

  shade() {
    const [from, to] = this.chosen();
    const whole = from <= 0 && to >= this.recording.duration_s;
    const excluded = (this.experiment.exclude?.spans ?? []).map(({ from_s, to_s }) => ({
      from: from_s,
      to: to_s,
      kind: "excluded",
    }));
    const isChecked = this.experiment.role === "validation";
    const share = isChecked ? 1 : heldBack(this.job);
    const held = share > 0 ? [{ from: to - share * (to - from), to, kind: "held" }] : [];
    this.drawn?.forEach(({ chart }) => {
      const odd = chart.spans.filter(({ kind }) => kind === "bad" || kind === "missing");
      chart.setSpans([...(whole ? [] : [{ from, to, kind: "window" }]), ...held, ...excluded, ...odd]);
    });
  }

  draw() {
    const { experiment, job, k } = this;
    const title = this.recording?.name || this.dataset;
    const role = h(
      "select",
      {
        "aria-label": `What ${title} is for`,
        onchange: (event) =>
          job.at(["experiments", k, "role"], event.target.value === "validation" ? "validation" : undefined),
      },
      [
        ["estimation", "to estimate from"],
        ["validation", "only to check the estimate"],
      ].map(([value, text]) =>
        h("option", { value, selected: value === (experiment.role ?? "estimation") }, text),
      ),
    );
    this.head.replaceChildren(
      h("h3", {}, `Experiment ${k + 1}: ${title}`),
      role,
      h(
        "button",
        { type: "button", class: "small", onclick: () => job.at(["experiments", k], undefined) },
        "Take out",
      ),
    );
    if (!this.recording) {
      return;
    }
    const { from_s: from, to_s: to } = experiment.window ?? {};
    this.from.value = from === undefined || from === null ? "" : String(from);
    this.to.value = to === undefined || to === null ? "" : String(to);
    this.shade();
    this.drawLeftOut();
    this.drawSignals();
  }

  drawSignals() {
    const { job, k, experiment } = this;
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
        `${words(signal.name)} [${signal.unit}], ${kind}`,
        h(
          "select",
          {
            onchange: (event) =>
              job.at(["experiments", k, "signals", signal.name], event.target.value || undefined),
            "aria-invalid": kind === "input" && !experiment.signals?.[signal.name] ? "true" : null,
          },
          h("option", { value: "" }, missing),
          options.map(({ name, unit }) =>
            h(
              "option",
              { value: name, selected: experiment.signals?.[signal.name] === name },
              `${name}${unit ? ` [${unit}]` : ""}`,
            ),
          ),
        ),
      );
    };
    this.signals.replaceChildren(...[chooser, ...signals.map(choose)].filter(Boolean));
  }

  drive(set) {
    const { experiment, job, k } = this;
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
    job.at(["experiments", k, "signals"], kept);
  }
}
