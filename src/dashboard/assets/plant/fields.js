// @ts-check
// These parts of the form say what a new monitor does: the job and the stream, the signals, the windows,
// the drift of parameters, and the alarms.

import { inputSet, likeness } from "../model/signals.js";
import { defaultAt } from "../shell/description.js";
import { h } from "../shell/dom.js";
import { pointed } from "../shell/faults.js";
import { instantText, modelText, number, numberOf, unitText, words, zoneName } from "../shell/format.js";
import { fieldSeconds, fieldText, isoBefore, secondsOf } from "./instants.js";
import { driftWith, searchedNames } from "./plan.js";

export function part(title, hint, draw) {
  const place = h("div", {});
  const element = h(
    "section",
    { "aria-label": title },
    h("h2", {}, title),
    hint && h("p", { class: "quiet" }, hint),
    place,
  );
  return { element, draw: () => place.replaceChildren(...draw().filter(Boolean)) };
}

const valueAt = (spec, path) => path.reduce((value, key) => value?.[key], spec);

// The field has the value at a path of the specification; `scale` turns it to the unit of the field, and
// `put` takes a typed value where the path alone is not enough, and `value` is the value where the path has none.
export function numberField(page, title, path, options = {}) {
  const { hint = "", scale = 1, put = null, value = valueAt(page.spec, path) } = options;
  const input = h("input", {
    type: "text",
    inputmode: "decimal",
    size: "9",
    value: Number.isFinite(value) ? String(Number((scale * value).toPrecision(12))) : "",
    placeholder: hint,
    onchange: () => {
      const typed = numberOf(input.value);
      const wrong = input.value.trim() !== "" && Number.isNaN(typed);
      wrong ? input.setAttribute("aria-invalid", "true") : input.removeAttribute("aria-invalid");
      if (!wrong) {
        const typedValue = Number.isNaN(typed) ? undefined : typed / scale;
        put ? put(typedValue) : page.at(path, typedValue);
      }
    },
  });
  return pointed(h("label", {}, title, input), path);
}

// The field has the instant at a path of the specification.
export function instantField(page, title, path) {
  const value = valueAt(page.spec, path);
  const input = h("input", {
    type: "datetime-local",
    step: "0.001",
    value: value ? fieldText(secondsOf(value)) : "",
    onchange: () => {
      const seconds = fieldSeconds(input.value);
      page.at(path, Number.isFinite(seconds) ? isoBefore(seconds) : undefined);
    },
  });
  const [about, note = ""] = title.split(/(?= \()/);
  return pointed(h("label", {}, `${about}, ${zoneName()}${note}`, input), path);
}

export function choice(title, options, chosen, act) {
  return h(
    "label",
    {},
    title,
    h(
      "select",
      { onchange: (event) => act(event.target.value) },
      options.map(([value, text]) => h("option", { value, selected: value === (chosen ?? "") }, text)),
    ),
  );
}

export function choicePart(page) {
  return part("1. Stream and job", "Any job can be done again on each window of a stream.", () => {
    const streams = [...page.streams.keys()].map((name) => [name, name]);
    const jobs = page.jobs.map((job) => [job.id, jobText(job)]);
    const kept = page.spec.job && !page.job ? `as it is (${modelText(page.spec.job.model)})` : "– choose –";
    const name = h("input", {
      type: "text",
      size: "28",
      maxlength: "200",
      value: page.spec.name ?? "",
      placeholder: "rig 4, air in the oil",
      onchange: () => page.at(["name"], name.value.trim() || undefined),
    });
    return [
      h(
        "div",
        { class: "fields" },
        choice("Stream", [["", "– choose –"], ...streams], page.spec.stream, (value) =>
          page.chooseStream(value),
        ),
        choice("Job to do", [["", kept], ...jobs], page.job, (value) => value && page.chooseJob(value)),
        h("label", {}, "Name of the monitor", name),
      ),
      streams.length === 0 && h("p", {}, "There is no stream yet: the plant has to append samples first."),
      jobs.length === 0 &&
        h("p", {}, "There is no job yet. ", h("a", { href: "#/new" }, "Make the first one"), "."),
    ];
  });
}

export function jobText({ id, name, model, created_at: created }) {
  return `${name || id} (${modelText(model)}, ${instantText(new Date(created))})`;
}

export function signalsPart(page) {
  return part("2. What the model sees", null, () => {
    const { model, stream } = page;
    if (!model || !stream) {
      return [h("p", { class: "quiet" }, "Choose a stream and a job first.")];
    }
    const experiment = page.spec.job?.experiments?.[0] ?? {};
    const inputs = inputSet(model, experiment.signals);
    const signals = [
      ...model.inputs.filter(({ name }) => inputs.includes(name)).map((signal) => [signal, "input"]),
      ...model.outputs.map((signal) => [signal, "measured output"]),
    ];
    return [
      h(
        "div",
        { class: "fields" },
        signals.map((entry) => signalChoice(page, experiment, entry)),
      ),
    ];
  });
}

function signalChoice(page, experiment, [signal, kind]) {
  const recorded = [...page.stream.signals].sort((a, b) => likeness(signal, b) - likeness(signal, a));
  const options = recorded.map(({ name, unit }) => [
    name,
    unit ? `${words(name)} [${unitText(unit)}]` : words(name),
  ]);
  const none = kind === "input" ? "– choose –" : "not measured";
  const path = ["job", "experiments", 0, "signals", signal.name];
  return choice(
    `${words(signal.name)} [${unitText(signal.unit)}], ${kind}`,
    [["", none], ...options],
    experiment.signals?.[signal.name],
    (value) => page.at(path, value || undefined),
  );
}

export function windowsPart(page) {
  return part("3. Windows", "Windows follow the time of the stream.", () => [
    h(
      "div",
      { class: "fields" },
      numberField(page, "Length of a window, s", ["window", "length_s"], { hint: "60" }),
      numberField(page, "One begins every, s", ["window", "every_s"], { hint: "its length" }),
      numberField(page, "Wait for late samples, s", ["window", "delay_s"], { hint: "0" }),
      instantField(page, "The first begins (empty: with the oldest sample)", ["window", "from"]),
    ),
    movementFields(page),
  ]);
}

// A window is worth a job when something moves in it.
function movementFields(page) {
  const movement = page.spec.only_when;
  const signals = (page.stream?.signals ?? []).map(({ name }) => [name, words(name)]);
  const choose = (value) =>
    page.at(
      ["only_when"],
      value ? { signal: value, moves_more_than: movement?.moves_more_than ?? 0.2 } : undefined,
      true,
    );
  return h(
    "div",
    { class: "fields" },
    choice(
      "Worked only when",
      [["", "it says something of a parameter"], ...signals],
      movement?.signal,
      choose,
    ),
    movement &&
      numberField(page, "moves by more than, % of its range so far", ["only_when", "moves_more_than"], {
        scale: 100,
      }),
  );
}

export function driftPart(page) {
  const hint =
    "How far a parameter may wander in a time: the estimate of a window is then the prior of the next. Left empty, each window speaks for itself.";
  return part("4. Drift", hint, () => {
    const searched = page.model && page.spec.job ? searchedNames(page.model, page.spec.job) : [];
    return searched.length
      ? [
          h(
            "div",
            { class: "drifts" },
            searched.map((about) => driftFields(page, about)),
          ),
        ]
      : [h("p", { class: "quiet" }, "Choose a job first.")];
  });
}

// The time is written into its field in place: the reader may be on the way to that field.
function driftFields(page, { name, unit }) {
  const time = numberField(page, "in this time, s", ["drift", name, "per_s"], { hint: "a day" });
  const put = (std) => {
    const drift = driftWith(page.spec.drift?.[name], std);
    page.at(["drift", name], drift);
    time.querySelector("input").value = drift ? String(drift.per_s) : "";
  };
  const title = unit === "1" ? "Standard deviation" : `Standard deviation, ${unitText(unit)}`;
  return h(
    "fieldset",
    { class: "fields drift" },
    h("legend", {}, words(name)),
    numberField(page, title, ["drift", name, "std"], { hint: "none", put }),
    time,
  );
}

export function alarmsPart(page) {
  return part("5. Alarms, and what is kept", null, () => {
    const usual = defaultAt(page.description, "MonitorSpec", ["alarms", "false_alarm_rate"]);
    return [
      h(
        "div",
        { class: "fields" },
        numberField(page, "False alarms, % of windows at the most", ["alarms", "false_alarm_rate"], {
          scale: 100,
          hint: number(100 * usual),
        }),
        numberField(page, "Data have stopped after, s", ["alarms", "data_stopped_after_s"], {
          hint: "3 periods",
        }),
        numberField(page, "Windows whose jobs are kept", ["keep_jobs"], { hint: "100" }),
      ),
    ];
  });
}
