// @ts-check
// This module makes the specification of a monitor from that of a job. The functions are pure.

import { parameterRows } from "../model/parameters.js";
import { suggestSignals } from "../model/signals.js";

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

// Names what a specification still lacks, in the words of the form.
export function missingParts(spec) {
  return [
    [spec.stream, "a stream"],
    [spec.job, "a job"],
    [spec.window?.length_s, "the length of a window"],
  ].flatMap(([value, words]) => (value ? [] : [words]));
}
