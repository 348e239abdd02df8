// @ts-check
// The draft of a job is its specification; the form and the JSON are two views of the same
// specification. The functions are pure, so that they can be tested without a page.

import { numberOfVersion } from "../data/marks.js";
import { suggestSignals } from "../model/signals.js";

export function experimentOf(dataset, model) {
  const signals = model ? suggestSignals(model, dataset.signals).signals : {};
  return { dataset: dataset.id, signals };
}

// Gives the recordings of the experiments, each with the places of its windows in the list: experiments of
// the same recording that see the same signals and leave out the same samples are windows of it. A version of the
// marks is a number, or an object in a specification that the server has completed.
/**
 * @param {any[]} experiments
 * @returns {{ dataset: string, places: number[] }[]}
 */
export function recordingsOfDraft(experiments) {
  const groups = new Map();
  experiments.forEach(({ dataset, signals = {}, version = null, exclude = null }, k) => {
    const number = numberOfVersion(version) ?? null;
    const key = JSON.stringify([dataset, Object.entries(signals ?? {}).sort(), number, exclude]);
    const group = groups.get(key);
    group ? group.places.push(k) : groups.set(key, { dataset, places: [k] });
  });
  return [...groups.values()];
}

// What a specification says by the names of its model.
const OF_THE_MODEL = [
  "parameters",
  "outputs",
  "tolerances",
  "process_noise",
  "model_search",
  "constraints",
  "priors",
];

// Gives the specification of the same job for another model. Settings of parameters, outputs and states
// belong to the former model and are left out.
export function withModel(spec, model, datasets) {
  const rest = Object.fromEntries(Object.entries(spec).filter(([name]) => !OF_THE_MODEL.includes(name)));
  const experiments = (spec.experiments ?? []).map((experiment) => {
    const dataset = datasets.get(experiment.dataset);
    const { parameters: parametersOfExperiment, initial_state: states, ...kept } = experiment;
    return { ...kept, signals: dataset ? suggestSignals(model, dataset.signals).signals : {} };
  });
  return { ...rest, model: model.name, experiments };
}

/**
 * Gives the specification whose experiments at some places see a signal of the model in a recorded one, or in none. An
 * output that no experiment measures any more has no noise and no sensor.
 *
 * @param {any} spec
 * @param {number[]} places
 * @param {string} name
 * @param {string | undefined} recorded
 */
export function withSignal(spec, places, name, recorded) {
  const seen = places.reduce((job, k) => changed(job, ["experiments", k, "signals", name], recorded), spec);
  const isSeen = seen.experiments.some(({ signals }) => signals?.[name]);
  return isSeen ? seen : changed(seen, ["outputs", name], undefined);
}

// Gives the specification with another value at a path; `undefined` removes the member at the path, and
// objects that become empty are removed too.
/**
 * @param {any} value
 * @param {(string | number)[]} path
 * @param {any} to
 * @returns {any}
 */
export function changed(value, path, to) {
  const [key, ...rest] = path;
  const base = Array.isArray(value) ? [...value] : { ...value };
  const next = rest.length ? changed(value?.[key] ?? (typeof rest[0] === "number" ? [] : {}), rest, to) : to;
  const isAbsent = next === undefined || (rest.length > 0 && isEmpty(next));
  if (Array.isArray(base)) {
    if (isAbsent && !rest.length) {
      base.splice(Number(key), 1);
    } else {
      base[key] = next;
    }
  } else if (isAbsent) {
    delete base[key];
  } else {
    base[key] = next;
  }
  return base;
}

// Gives the specification with a change of the server (JSON merge patch, RFC 7396).
/**
 * @param {any} value
 * @param {any} patch
 * @returns {any}
 */
export function patched(value, patch) {
  if (patch === null || typeof patch !== "object" || Array.isArray(patch)) {
    return patch;
  }
  const isObject = value !== null && typeof value === "object" && !Array.isArray(value);
  const result = isObject ? { ...value } : {};
  for (const [name, part] of Object.entries(patch)) {
    if (part === null) {
      delete result[name];
    } else {
      result[name] = patched(result[name], part);
    }
  }
  return result;
}

function isEmpty(value) {
  return (
    value !== null && typeof value === "object" && !Array.isArray(value) && Object.keys(value).length === 0
  );
}

// Reads `site=hall 2, rig=4` as labels; labelText writes labels in the same way.
export function labelsOf(text) {
  const pairs = text
    .split(",")
    .map((pair) => pair.trim())
    .filter(Boolean)
    .map((pair) => {
      const [, name, value] = /^([^=:]*)[=:]?(.*)$/.exec(pair);
      return [name.trim(), value.trim()];
    })
    .filter(([name]) => name);
  return pairs.length ? Object.fromEntries(pairs) : undefined;
}

export function labelText(labels) {
  return Object.entries(labels ?? {})
    .map(([name, value]) => (value ? `${name}=${value}` : name))
    .join(", ");
}

// Reads `tau1 < tau2; k1 + k2 <= 1` as conditions; conditionText writes conditions in the same way.
export function conditionsOf(text) {
  const conditions = text
    .split(";")
    .map((condition) => condition.trim())
    .filter(Boolean);
  return conditions.length ? conditions : undefined;
}

export function conditionText(conditions) {
  return (conditions ?? []).join("; ");
}

// The estimates of a result become a prior of all its parameters together; the prior is undefined where
// the result fixed no parameter.
/** @param {{ parameters: any[], correlation?: any }} result */
export function priorOfResult({ parameters, correlation }) {
  const error = (parameter) => parameter.total_standard_error ?? parameter.standard_error;
  const estimates = parameters.filter(
    (parameter) => (parameter.experiment ?? null) === null && error(parameter) > 0,
  );
  if (estimates.length === 0) {
    return undefined;
  }
  const names = estimates.map(({ name }) => name);
  const prior = {
    parameters: names,
    mean: estimates.map(({ estimate }) => estimate),
    std: estimates.map(error),
  };
  const places = names.map((name) => (correlation?.names ?? []).indexOf(name));
  const between = (a, b) => (a === b ? 1 : (correlation?.matrix[a]?.[b] ?? 0));
  return places.includes(-1)
    ? prior
    : { ...prior, correlation: places.map((a) => places.map((b) => between(a, b))) };
}
