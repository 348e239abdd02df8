// @ts-check
// This module makes the specification of a monitor from that of a job, and helps to ask for a selection of
// windows. The functions are pure.

import { windowsBetween } from "../job/windows.js";
import { parameterRows } from "../model/parameters.js";
import { suggestSignals } from "../model/signals.js";
import { number, quantity, words } from "../shell/format.js";
import { secondsOf } from "./instants.js";

// Gives the experiment of a job that a window of a stream is made like.
export function firstEstimated({ experiments = [] }) {
  return experiments.find(({ role }) => role !== "validation") ?? experiments[0] ?? {};
}

// The windows of a stream stand for the recording of the job: what belongs to the recording is left out,
// and so are the seed and the name, which each window gets by itself.
export function templateOf(job, stream, model) {
  const { seed, name, experiments, ...rest } = job;
  const { dataset, version, window, role, exclude, signals, ...kept } = firstEstimated(job);
  const classes = exclude?.classes?.length ? { exclude: { classes: exclude.classes } } : {};
  const experiment = { ...kept, ...classes, signals: signalsIn(stream, signals, model) };
  return { ...rest, experiments: [experiment] };
}

// The signals of a job stay where a stream has them; else those that suit the model best are suggested.
export function signalsIn(stream, signals, model) {
  const names = new Set((stream?.signals ?? []).map(({ name }) => name));
  const entries = Object.entries(signals ?? {});
  if (!stream || (entries.length > 0 && entries.every(([, name]) => names.has(name)))) {
    return Object.fromEntries(entries);
  }
  return model ? suggestSignals(model, stream.signals).signals : {};
}

// A monitor that is made like another begins with the oldest sample of its stream.
export function likeMonitor(spec) {
  const { from, ...window } = spec.window;
  return { ...spec, window };
}

export function searchedNames(model, job) {
  return parameterRows(model, job?.parameters)
    .filter(({ free }) => free)
    .map(({ about }) => about);
}

const DAY_S = 86_400;

// A parameter drifts by a standard deviation in a time, in a day unless another time is said.
export function driftWith(before, std) {
  return std === undefined ? undefined : { per_s: DAY_S, ...before, std };
}

// Jobs that can be done again on other data: a job that a monitor made is one window of many, and a job without a
// method estimates nothing.
export function offeredJobs(jobs) {
  return jobs.filter(({ method, labels }) => method && !labels.monitor);
}

const missing = (needed) => needed.flatMap(([value, words]) => (value ? [] : [words]));

// Names what the specification of a monitor still lacks, in the words of the form.
export function missingParts(spec) {
  return missing([
    [spec.stream, "a stream"],
    [spec.job, "a job"],
    [spec.window?.length_s, "the length of a window"],
  ]);
}

// Names what a selection still lacks, in the words of the form.
export function missingOfSelection(spec) {
  return missing([
    [spec.stream, "a stream"],
    [spec.job, "a job"],
    [spec.window_s, "the length of a window"],
    ...Object.entries(spec.initial_state ?? {}).map(([name, start]) => [
      isWhole(start),
      `where ${words(name)} begins`,
    ]),
    [
      (spec.exclude ?? []).every(({ from, to }) => from && to),
      "the beginning and the end of each time that is left out",
    ],
    [spec.target || spec.budget_samples, "how closely a parameter is to be known, or a number of samples"],
  ]);
}

// Names the way in which a start is said: "estimate", "first_sample" or "value", and "" where none is said.
export function kindOfStart(start) {
  if (start === undefined) {
    return "";
  }
  const kinds = { string: "first_sample", number: "value" };
  return kinds[typeof start] ?? ("estimate" in start ? "estimate" : "value");
}

export const valueOfStart = (start) => (typeof start === "number" ? start : start?.value);

function isWhole(start) {
  const { lower, upper } = start.estimate ?? {};
  const numbers = { estimate: [lower, upper], value: [valueOfStart(start)] }[kindOfStart(start)] ?? [];
  return numbers.every(Number.isFinite);
}

// Gives a start of a kind: the start of the job where that is of the kind, else a start without numbers.
export function startOf(kind, said) {
  const empty = { first_sample: "first_sample", estimate: { estimate: {} }, value: { value: undefined } };
  return kind !== "" && kindOfStart(said) === kind ? said : empty[kind];
}

const USUAL_STARTS = {
  first_sample: (output) => `the first sample of ${output}`,
  estimated_from_output: (output) => `estimated near the first sample of ${output}`,
  estimated_from_slope: (output) => `estimated near the first slope of ${output}`,
};

// Says where a state starts that the job does not mention. The model takes a start from an output only where the
// output is measured.
function usualStartText(model, { initial }, signals) {
  const [[kind, { output: place }]] = typeof initial === "string" ? [["", {}]] : Object.entries(initial);
  const output = model.outputs[place]?.name;
  return output && signals[output] ? USUAL_STARTS[kind](words(output)) : "the model's own start";
}

// Says where a state starts in a finished job.
export function startText(model, state, job) {
  const { initial_state: starts = {}, signals = {} } = firstEstimated(job);
  const start = starts[state.name];
  const text = (value) => quantity(number(value), state.unit);
  switch (kindOfStart(start)) {
    case "estimate":
      return `estimated, from ${text(start.estimate.lower)} to ${text(start.estimate.upper)}`;
    case "first_sample":
      return "the first measured sample";
    case "value":
      return text(valueOfStart(start));
    default:
      return usualStartText(model, state, signals);
  }
}

// Lists the ways to say where a state starts. A state has a measured sample where it is a measured output.
/** @returns {[string, string][]} */
export function startChoices(model, state, job) {
  const isMeasured =
    model.outputs.some(({ name }) => name === state.name) && firstEstimated(job).signals?.[state.name];
  return [
    ["", `as the job says (${startText(model, state, job)})`],
    ["estimate", "estimated, from … to …"],
    ...(isMeasured ? [/** @type {[string, string]} */ (["first_sample", "the first measured sample"])] : []),
    ["value", "a value"],
  ];
}

// Gives the parameters that all experiments of a job share, with their estimates: a selection can ask for these.
export function sharedEstimates(job, { parameters = [] }) {
  const isShared = (name) =>
    "estimate" in (job.parameters?.[name] ?? {}) &&
    !(job.experiments ?? []).some((experiment) => experiment.parameters?.[name]);
  return parameters.filter(({ name }) => isShared(name));
}

const ROUND_LENGTHS = [
  1, 2, 5, 10, 20, 30, 60, 120, 300, 600, 1200, 1800, 3600, 7200, 10_800, 21_600, 43_200, 86_400,
];
// A window that nobody chose the length of is one of about so many.
const WINDOWS_WANTED = 700;

// A round length of windows that divides a stream into a few hundred windows [s].
export function usualLength({ first, last }) {
  const span = secondsOf(last) - secondsOf(first);
  return ROUND_LENGTHS.findLast((length) => span / length >= WINDOWS_WANTED) ?? ROUND_LENGTHS[0];
}

// Counts the windows of a selection, and the samples of a window if samples came evenly; null where the selection
// does not say enough.
export function windowsIn(stream, { from, to, window_s: length }) {
  if (!stream?.first || !(length > 0)) {
    return null;
  }
  const windows = windowsBetween(from ?? stream.first, to ?? stream.last, length);
  const span = secondsOf(stream.last) - secondsOf(stream.first);
  return windows > 0 ? { windows, samples: (stream.samples * length) / Math.max(length, span) } : null;
}
