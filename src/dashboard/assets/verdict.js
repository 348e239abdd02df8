// @ts-check
// What a verdict comes to, in few sentences, and the job to run next for each. Pure.
//
// The reasons of a result come ranked, the gravest first. Those that are about the same parameters
// (what the data cannot tell apart, what moves together) become one.

import { changed } from "./job_draft.js";

const TOGETHER = ["not_identifiable", "correlated"];
// What says that the model misses something of the plant, in several ways.
const MISSES = ["misfit", "slight_misfit", "residuals_not_white", "residuals_follow_input"];
const MOST_ACTIONS = 3;

const spaced = (name) => name.replace(/\[(\d+)\]$/, (_, k) => ` in experiment ${Number(k) + 1}`).replaceAll("_", " ");

export function listed(names) {
  const shown = names.map(spaced);
  return shown.length < 2 ? shown.join("") : `${shown.slice(0, -1).join(", ")} and ${shown.at(-1)}`;
}

// [{ codes, text, details, actions: [{ label, spec }] }], the gravest first.
export function conclusions(result, spec, model) {
  const reasons = result.verdict?.reasons ?? [];
  const groups = [];
  for (const reason of reasons) {
    const concerned = reason.concerns ?? [];
    const known = groups.find((group) => (TOGETHER.includes(reason.code) && TOGETHER.includes(group.codes[0])
      ? concerned.some((name) => group.concerned.has(name)) : alike(group.codes[0], reason.code)));
    const group = known ?? { codes: [], concerned: new Set(), details: [] };
    if (!known) {
      groups.push(group);
    }
    group.codes.push(reason.code);
    group.details.push(reason.detail);
    concerned.forEach((name) => group.concerned.add(name));
  }
  return merged(groups).map((group) => {
    const codes = [...new Set(group.codes)];
    const concerned = [...group.concerned];
    return { codes, concerned, details: group.details, text: sentence(codes, concerned, group.details),
      actions: next(codes[0], concerned, { result, spec, model }).slice(0, MOST_ACTIONS) };
  });
}

const alike = (one, other) => !TOGETHER.includes(other) && (one === other || (MISSES.includes(one) && MISSES.includes(other)));

// Groups of the same kind that came to share a parameter are one.
function merged(groups) {
  const kept = [];
  for (const group of groups) {
    const other = TOGETHER.includes(group.codes[0]) &&
      kept.find((known) => TOGETHER.includes(known.codes[0]) && [...group.concerned].some((name) => known.concerned.has(name)));
    if (other) {
      other.codes.push(...group.codes);
      other.details.push(...group.details);
      group.concerned.forEach((name) => other.concerned.add(name));
    } else {
      kept.push(group);
    }
  }
  return kept;
}

function sentence(codes, concerned, details) {
  if (TOGETHER.includes(codes[0]) && concerned.length > 1) {
    const flat = codes.includes("not_identifiable");
    return flat
      ? `The data cannot tell ${listed(concerned)} apart: only a combination of them is known. Give the value of one, or record an experiment that moves them separately.`
      : `${capital(listed(concerned))} move together: a combination of them is known better than each alone. The value of one from a data sheet settles the others.`;
  }
  const [first, ...others] = details;
  return others.length ? `${first} (${others.length} more like this below)` : first;
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

const ACTIONS = {
  not_identifiable: fixOne, correlated: fixOne, at_bound: widen, misfit: freeEffects, slight_misfit: freeEffects, residuals_not_white: freeEffects,
  residuals_follow_input: freeEffects, assumption_contradicted: freeAssumption, noise_unknown: giveNoise, worse_on_validation: useAll,
  starts_disagree: searchOn, plateau: searchOn, twin_minima: excludeTwin, prior_contradicted: forgetPrior, not_finished: longer, no_budget: shorter,
  drift: shorter,
  assumptions_dominate: sayBetter,
};

function next(code, concerned, context) {
  const { spec } = context;
  return spec && ACTIONS[code] ? ACTIONS[code](context, concerned).filter(Boolean) : [];
}

function estimateOf(result, name) {
  return result.parameters.find((one) => one.name === name && (one.experiment === undefined || one.experiment === null));
}

function fixOne({ result, spec }, concerned) {
  return concerned.map((name) => {
    const known = estimateOf(result, name);
    return known && { label: `Fix ${spaced(name)}`, why: "Put the value of the data sheet in the place of the estimate.",
      spec: changed(spec, ["parameters", name], { value: rounded(known.estimate) }) };
  });
}

function rounded(value) {
  return Number(value.toPrecision(4));
}

function widen({ result, spec, model }) {
  return result.parameters.filter((one) => one.at_bound && !one.experiment).map((one) => {
    const about = model?.parameters.find(({ name }) => name === one.name) ?? {};
    const scale = spec.parameters?.[one.name]?.estimate?.scale ?? about.scale;
    const high = one.upper - one.estimate < one.estimate - one.lower;
    const width = one.upper - one.lower;
    const wanted = high ? (scale === "log" ? one.upper * 10 : one.upper + 2 * width) : (scale === "log" ? one.lower / 10 : one.lower - 2 * width);
    const limit = high ? about.maximum ?? Infinity : about.minimum ?? -Infinity;
    const end = high ? Math.min(wanted, limit) : Math.max(wanted, limit);
    if (end === (high ? one.upper : one.lower)) {
      return null;
    }
    const said = spec.parameters?.[one.name]?.estimate ?? {};
    return { label: `Widen the range of ${spaced(one.name)}`, why: `${high ? "Upper" : "Lower"} bound ${rounded(end)} ${one.unit}.`,
      spec: changed(spec, ["parameters", one.name, "estimate"], { lower: one.lower, upper: one.upper, scale: said.scale ?? about.scale ?? "linear", [high ? "upper" : "lower"]: rounded(end) }) };
  });
}

// The effects that the model has and the job leaves out, those that the residuals ask for most first.
function freeEffects({ result, spec }) {
  const absent = (result.budget ?? []).filter(({ kind }) => kind === "absent_effect")
    .sort((a, b) => Math.abs(b.score ?? 0) - Math.abs(a.score ?? 0)).map(({ assumption }) => assumption);
  if (absent.length === 0) {
    return [];
  }
  const several = absent.slice(0, 4);
  const { parameters = {} } = spec;
  const without = Object.fromEntries(Object.entries(parameters).filter(([name]) => !several.includes(name)));
  return [
    { label: "Let the data choose the effects", why: `Tries ${listed(several)} and keeps what the data support.`,
      spec: { ...spec, parameters: without, model_search: { effects: several } } },
    { label: `Free ${spaced(absent[0])}`, why: "The effect that the residuals ask for most.", spec: changed(spec, ["parameters", absent[0]], { estimate: {} }) },
  ];
}

function freeAssumption({ result, spec }) {
  return (result.budget ?? []).filter(({ score }) => Math.abs(score ?? 0) > 4).sort((a, b) => Math.abs(b.score) - Math.abs(a.score)).slice(0, 3)
    .map(({ assumption, suggested, unit }) => ({ label: `Free ${spaced(assumption)}`,
      why: suggested ? `${rounded(suggested.value)} ${unit} would explain what is left.` : "The residuals contradict its value.",
      spec: changed(spec, ["parameters", assumption], { estimate: {} }) }));
}

function giveNoise({ result, spec }) {
  return Object.entries(result.residuals ?? {}).filter(([, { noise_std_source: source }]) => source !== "given").map(([output, { noise_std: noise }]) =>
    ({ label: `Give the noise of ${spaced(output)}`, why: "From the sensor's data sheet; what is left over stands there to begin with.",
      spec: changed(spec, ["outputs", output, "noise_std"], rounded(noise)) }));
}

function useAll({ spec }) {
  const experiments = spec.experiments.map(({ window, ...experiment }) => experiment);
  return spec.experiments.some(({ window }) => window) ? [{ label: "Use the whole recordings", why: "Without windows.", spec: { ...spec, experiments } }] : [];
}

function searchOn({ spec }) {
  const method = { ...spec.method, population: 2 * (spec.method?.population ?? 30), further_searches: Math.max(8, 2 * (spec.method?.further_searches ?? 4)) };
  return [{ label: "Search longer", why: `${method.population} candidates, up to ${method.further_searches} further searches.`, spec: { ...spec, method } }];
}

// The range of what differs most between the two minima ends half way to the other.
function excludeTwin({ result, spec, model }) {
  const [twin] = result.floor?.twins ?? [];
  const apart = Object.entries(twin ?? {}).map(([name, value]) => ({ value, of: estimateOf(result, name) })).filter(({ of }) => of)
    .map(({ value, of }) => ({ value, of, share: Math.abs(value - of.estimate) / (of.upper - of.lower) })).sort((a, b) => b.share - a.share)[0];
  if (!apart) {
    return [];
  }
  const { of, value } = apart;
  const middle = rounded((of.estimate + value) / 2);
  const about = model?.parameters.find(({ name }) => name === of.name);
  const scale = spec.parameters?.[of.name]?.estimate?.scale ?? about?.scale ?? "linear";
  const range = value > of.estimate ? { lower: of.lower, upper: middle, scale } : { lower: middle, upper: of.upper, scale };
  const other = value > of.estimate ? { lower: middle, upper: of.upper, scale } : { lower: of.lower, upper: middle, scale };
  return [{ which: "this minimum", estimate: range }, { which: "the other minimum", estimate: other }].map(({ which, estimate }) => ({ label: `Keep ${which} of ${spaced(of.name)}`,
    why: `${estimate.lower} … ${estimate.upper} ${of.unit}.`, spec: changed(spec, ["parameters", of.name, "estimate"], estimate) }));
}

function forgetPrior({ spec }, concerned) {
  return concerned.filter((name) => spec.parameters?.[name]?.prior).map((name) =>
    ({ label: `Forget the prior of ${spaced(name)}`, why: "To see what the data alone say.", spec: changed(spec, ["parameters", name, "prior"], undefined) }));
}

function longer({ spec }) {
  const seconds = 3 * (spec.limits?.max_duration_s ?? 3600);
  return [{ label: "Run it longer", why: `Up to ${seconds} s.`, spec: changed(spec, ["limits", "max_duration_s"], seconds) }];
}

function shorter({ spec }) {
  const experiments = spec.experiments.map((experiment) => ({ ...experiment, window: { ...experiment.window, to_s: undefined } }));
  return [{ label: "Choose a window", why: "A shorter part of the recording leaves time for the budget.", spec: { ...spec, experiments } }];
}

// The assumption that contributes most to any parameter, five times better known.
function sayBetter({ result, spec }, concerned) {
  const worst = (result.budget ?? []).map((line) => ({ line, share: Math.max(0, ...Object.entries(line.contributions ?? {})
    .filter(([name]) => concerned.length === 0 || concerned.includes(name)).map(([, { share }]) => share)) })).sort((a, b) => b.share - a.share)[0];
  if (!worst || worst.share <= 0) {
    return [];
  }
  const { assumption, value, tolerance, unit } = worst.line;
  return [{ label: `Know ${spaced(assumption)} better`, why: `Measured to ± ${rounded(tolerance / 5)} ${unit} instead of ± ${rounded(tolerance)}.`,
    spec: changed(spec, ["parameters", assumption], { value, tolerance: rounded(tolerance / 5) }) }];
}
