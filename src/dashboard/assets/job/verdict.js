// @ts-check
// This module sums up a verdict in few sentences, with the job to run next for each. Its functions are
// pure.
//
// The reasons of a result are ranked, the gravest first. Reasons about the same parameters (the data
// cannot tell them apart, or they move together) become a single conclusion.

import { changed } from "../new/draft.js";

const TOGETHER = ["not_identifiable", "correlated"];
// Each of these reasons says in its way that the model misses something of the plant.
const MISSES = ["misfit", "slight_misfit", "residuals_not_white", "residuals_follow_input"];
const MOST_ACTIONS = 3;

const spaced = (name) =>
  name.replace(/\[(\d+)\]$/, (_, k) => ` in experiment ${Number(k) + 1}`).replaceAll("_", " ");

export function listed(names) {
  const shown = names.map(spaced);
  return shown.length < 2 ? shown.join("") : `${shown.slice(0, -1).join(", ")} and ${shown.at(-1)}`;
}

// The conclusions have the form [{ codes, text, details, actions: [{ label, why, spec }] }], the
// gravest first.
export function conclusions(result, spec, model) {
  const reasons = result.verdict?.reasons ?? [];
  const groups = [];
  for (const reason of reasons) {
    const concerned = reason.concerns ?? [];
    const match = groups.find((group) =>
      TOGETHER.includes(reason.code) && TOGETHER.includes(group.codes[0])
        ? concerned.some((name) => group.concerned.has(name))
        : alike(group.codes[0], reason.code),
    );
    const group = match ?? { codes: [], concerned: new Set(), details: [] };
    if (!match) {
      groups.push(group);
    }
    group.codes.push(reason.code);
    group.details.push(reason.detail);
    for (const name of concerned) {
      group.concerned.add(name);
    }
  }
  return merged(groups).map((group) => {
    const codes = [...new Set(group.codes)];
    const concerned = [...group.concerned];
    return {
      codes,
      concerned,
      details: group.details,
      text: sentence(codes, concerned, group.details),
      actions: next(codes[0], concerned, { result, spec, model }).slice(0, MOST_ACTIONS),
    };
  });
}

const alike = (code, candidate) =>
  !TOGETHER.includes(candidate) &&
  (code === candidate || (MISSES.includes(code) && MISSES.includes(candidate)));

// Groups of the same kind that share a parameter are merged.
function merged(groups) {
  const kept = [];
  for (const group of groups) {
    const partner =
      TOGETHER.includes(group.codes[0]) &&
      kept.find(
        (candidate) =>
          TOGETHER.includes(candidate.codes[0]) &&
          [...group.concerned].some((name) => candidate.concerned.has(name)),
      );
    if (partner) {
      partner.codes.push(...group.codes);
      partner.details.push(...group.details);
      for (const name of group.concerned) {
        partner.concerned.add(name);
      }
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
  const [first, ...rest] = details;
  return rest.length ? `${first} (${rest.length} more like this below)` : first;
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

const ACTIONS = {
  not_identifiable: fixOne,
  correlated: fixOne,
  at_bound: widen,
  misfit: freeEffects,
  slight_misfit: freeEffects,
  residuals_not_white: freeEffects,
  residuals_follow_input: freeEffects,
  assumption_contradicted: freeAssumption,
  noise_unknown: giveNoise,
  worse_on_validation: useAll,
  starts_disagree: searchOn,
  plateau: searchOn,
  twin_minima: excludeTwin,
  prior_contradicted: forgetPrior,
  not_finished: longer,
  no_budget: shorter,
  drift: shorter,
  assumptions_dominate: sayBetter,
};

function next(code, concerned, context) {
  const { spec } = context;
  return spec && ACTIONS[code] ? ACTIONS[code](context, concerned).filter(Boolean) : [];
}

function estimateOf(result, name) {
  return result.parameters.find(
    (parameter) =>
      parameter.name === name && (parameter.experiment === undefined || parameter.experiment === null),
  );
}

function fixOne({ result, spec }, concerned) {
  return concerned.map((name) => {
    const parameter = estimateOf(result, name);
    return (
      parameter && {
        label: `Fix ${spaced(name)}`,
        why: "Put the value of the data sheet in the place of the estimate.",
        spec: changed(spec, ["parameters", name], { value: rounded(parameter.estimate) }),
      }
    );
  });
}

function rounded(value) {
  return Number(value.toPrecision(4));
}

function widen({ result, spec, model }) {
  return result.parameters
    .filter((parameter) => parameter.at_bound && !parameter.experiment)
    .map((parameter) => {
      const about = model?.parameters.find(({ name }) => name === parameter.name) ?? {};
      const scale = spec.parameters?.[parameter.name]?.estimate?.scale ?? about.scale;
      const high = parameter.upper - parameter.estimate < parameter.estimate - parameter.lower;
      const width = parameter.upper - parameter.lower;
      const goal = high
        ? scale === "log"
          ? parameter.upper * 10
          : parameter.upper + 2 * width
        : scale === "log"
          ? parameter.lower / 10
          : parameter.lower - 2 * width;
      const limit = high ? (about.maximum ?? Infinity) : (about.minimum ?? -Infinity);
      const end = high ? Math.min(goal, limit) : Math.max(goal, limit);
      if (end === (high ? parameter.upper : parameter.lower)) {
        return null;
      }
      const estimate = spec.parameters?.[parameter.name]?.estimate ?? {};
      return {
        label: `Widen the range of ${spaced(parameter.name)}`,
        why: `${high ? "Upper" : "Lower"} bound ${rounded(end)} ${parameter.unit}.`,
        spec: changed(spec, ["parameters", parameter.name, "estimate"], {
          lower: parameter.lower,
          upper: parameter.upper,
          scale: estimate.scale ?? about.scale ?? "linear",
          [high ? "upper" : "lower"]: rounded(end),
        }),
      };
    });
}

// The absent effects are effects that the model has and the job leaves out; the effect that the
// residuals ask for most comes first.
function freeEffects({ result, spec }) {
  const absent = (result.budget ?? [])
    .filter(({ kind }) => kind === "absent_effect")
    .sort((a, b) => Math.abs(b.score ?? 0) - Math.abs(a.score ?? 0))
    .map(({ assumption }) => assumption);
  if (absent.length === 0) {
    return [];
  }
  const several = absent.slice(0, 4);
  const { parameters = {} } = spec;
  const without = Object.fromEntries(Object.entries(parameters).filter(([name]) => !several.includes(name)));
  return [
    {
      label: "Let the data choose the effects",
      why: `Tries ${listed(several)} and keeps what the data support.`,
      spec: { ...spec, parameters: without, model_search: { effects: several } },
    },
    {
      label: `Free ${spaced(absent[0])}`,
      why: "The effect that the residuals ask for most.",
      spec: changed(spec, ["parameters", absent[0]], { estimate: {} }),
    },
  ];
}

function freeAssumption({ result, spec }) {
  return (result.budget ?? [])
    .filter(({ score }) => Math.abs(score ?? 0) > 4)
    .sort((a, b) => Math.abs(b.score) - Math.abs(a.score))
    .slice(0, 3)
    .map(({ assumption, suggested, unit }) => ({
      label: `Free ${spaced(assumption)}`,
      why: suggested
        ? `${rounded(suggested.value)} ${unit} would explain what is left.`
        : "The residuals contradict its value.",
      spec: changed(spec, ["parameters", assumption], { estimate: {} }),
    }));
}

function giveNoise({ result, spec }) {
  return Object.entries(result.residuals ?? {})
    .filter(([, { noise_std_source: source }]) => source !== "given")
    .map(([output, { noise_std: noise }]) => ({
      label: `Give the noise of ${spaced(output)}`,
      why: "From the sensor's data sheet; what is left over stands there to begin with.",
      spec: changed(spec, ["outputs", output, "noise_std"], rounded(noise)),
    }));
}

function useAll({ spec }) {
  const experiments = spec.experiments.map(({ window, ...experiment }) => experiment);
  return spec.experiments.some(({ window }) => window)
    ? [{ label: "Use the whole recordings", why: "Without windows.", spec: { ...spec, experiments } }]
    : [];
}

function searchOn({ spec }) {
  const method = {
    ...spec.method,
    population: 2 * (spec.method?.population ?? 30),
    further_searches: Math.max(8, 2 * (spec.method?.further_searches ?? 4)),
  };
  return [
    {
      label: "Search longer",
      why: `${method.population} candidates, up to ${method.further_searches} further searches.`,
      spec: { ...spec, method },
    },
  ];
}

// The parameter that differs most between the two minima gets a range that ends half way to the other
// minimum.
function excludeTwin({ result, spec, model }) {
  const [twin] = result.floor?.twins ?? [];
  const apart = Object.entries(twin ?? {})
    .map(([name, value]) => ({ value, parameter: estimateOf(result, name) }))
    .filter(({ parameter }) => parameter)
    .map(({ value, parameter }) => ({
      value,
      parameter,
      share: Math.abs(value - parameter.estimate) / (parameter.upper - parameter.lower),
    }))
    .sort((a, b) => b.share - a.share)[0];
  if (!apart) {
    return [];
  }
  const { parameter, value } = apart;
  const middle = rounded((parameter.estimate + value) / 2);
  const about = model?.parameters.find(({ name }) => name === parameter.name);
  const scale = spec.parameters?.[parameter.name]?.estimate?.scale ?? about?.scale ?? "linear";
  const range =
    value > parameter.estimate
      ? { lower: parameter.lower, upper: middle, scale }
      : { lower: middle, upper: parameter.upper, scale };
  const twinRange =
    value > parameter.estimate
      ? { lower: middle, upper: parameter.upper, scale }
      : { lower: parameter.lower, upper: middle, scale };
  return [
    { which: "this minimum", estimate: range },
    { which: "the other minimum", estimate: twinRange },
  ].map(({ which, estimate }) => ({
    label: `Keep ${which} of ${spaced(parameter.name)}`,
    why: `${estimate.lower} … ${estimate.upper} ${parameter.unit}.`,
    spec: changed(spec, ["parameters", parameter.name, "estimate"], estimate),
  }));
}

function forgetPrior({ spec }, concerned) {
  return concerned
    .filter((name) => spec.parameters?.[name]?.prior)
    .map((name) => ({
      label: `Forget the prior of ${spaced(name)}`,
      why: "To see what the data alone say.",
      spec: changed(spec, ["parameters", name, "prior"], undefined),
    }));
}

function longer({ spec }) {
  const seconds = 3 * (spec.limits?.max_duration_s ?? 3600);
  return [
    {
      label: "Run it longer",
      why: `Up to ${seconds} s.`,
      spec: changed(spec, ["limits", "max_duration_s"], seconds),
    },
  ];
}

function shorter({ spec }) {
  const experiments = spec.experiments.map((experiment) => ({
    ...experiment,
    window: { ...experiment.window, to_s: undefined },
  }));
  return [
    {
      label: "Choose a window",
      why: "A shorter part of the recording leaves time for the budget.",
      spec: { ...spec, experiments },
    },
  ];
}

// The assumption that contributes most to any parameter gets a tolerance that is five times smaller.
function sayBetter({ result, spec }, concerned) {
  const worst = (result.budget ?? [])
    .map((line) => ({
      line,
      share: Math.max(
        0,
        ...Object.entries(line.contributions ?? {})
          .filter(([name]) => concerned.length === 0 || concerned.includes(name))
          .map(([, { share }]) => share),
      ),
    }))
    .sort((a, b) => b.share - a.share)[0];
  if (!worst || worst.share <= 0) {
    return [];
  }
  const { assumption, value, tolerance, unit } = worst.line;
  return [
    {
      label: `Know ${spaced(assumption)} better`,
      why: `Measured to ± ${rounded(tolerance / 5)} ${unit} instead of ± ${rounded(tolerance)}.`,
      spec: changed(spec, ["parameters", assumption], { value, tolerance: rounded(tolerance / 5) }),
    },
  ];
}
