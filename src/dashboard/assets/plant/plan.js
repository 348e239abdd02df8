// @ts-check
// This module makes the specification of a monitor from that of a job, and helps to ask for a selection of
// windows. The functions are pure.

import { windowsBetween } from "../job/windows.js";
import { parameterRows } from "../model/parameters.js";
import { suggestSignals } from "../model/signals.js";
import { secondsOf } from "./instants.js";

// The windows of a stream stand for the recording of the job: what belongs to the recording is left out,
// and so are the seed and the name, which each window gets by itself.
export function templateOf(job, stream, model) {
  const { seed, name, experiments = [], ...rest } = job;
  const estimated = experiments.find(({ role }) => role !== "validation") ?? experiments[0] ?? {};
  const { dataset, window, role, exclude, signals, ...kept } = estimated;
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
    [spec.target || spec.budget_samples, "how closely a parameter is to be known, or a number of samples"],
  ]);
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
