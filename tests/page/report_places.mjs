// This module knows the parts of a report, and tells for each place of a part which fields of the API stand there.
//
// A source is a list of numbers, which stand at the place in this order, or of texts, of which one is the place's. A
// place without a source has no numbers.

import { signedIn } from "./numbers.mjs";
import { bracketed, busiest, chartSource, estimatesOf, inExperiment, unknownsOf } from "./report_charts.mjs";

const present = (values) => values.filter((value) => Number.isFinite(value));
const ends = (interval) => present([interval?.lower, interval?.upper]);
// Names stand between back-ticks, and apart from the words around them in the report.
const parts = (text) => text.split("`").map((part) => part.trim());

// The 99 % point of the normal distribution, two-sided.
const NORMAL_99 = 2.576;

function header(_, { job, result }) {
  const { name, labels, note = "" } = job.spec;
  const finished = job.finished_at.slice(0, 19).replace("T", " ");
  const pairs = Object.entries(labels).map(([label, value]) => `${label}: ${value}`);
  return [
    name,
    `Identification report · model ${result.model}, ${result.job}, finished ${finished} UTC`,
    pairs.join(" · "),
    note,
  ];
}

function verdict(_, { result }) {
  const { summary, reasons } = result.verdict;
  const steps = reasons.flatMap(({ next }) => next.map(({ label, why }) => `${label}. ${why}`));
  return [summary, ...reasons.map(({ detail }) => detail)].flatMap(parts).concat(steps);
}

function estimates({ tag, isTitle, first, column }, { result }) {
  const all = estimatesOf(result);
  if (isTitle) {
    const intervals = Object.values(all).map((entry) => entry.confidence_interval ?? entry.total_interval);
    return [100 * (intervals.find(Boolean)?.level ?? 0.95)];
  }
  if (tag === "LI") {
    return result.flat_directions.flatMap(parts);
  }
  if (tag === "P") {
    const moved = result.parameters.filter(({ output_change: change }) => Object.keys(change).length > 0);
    return [
      100,
      ...moved.flatMap((entry) => [...inExperiment(entry), ...Object.values(entry.output_change)]),
    ];
  }
  const entry = all[first];
  return [
    [first],
    [entry.estimate],
    [entry.unit],
    [entry.standard_error],
    entry.confidence_interval ? ends(entry.confidence_interval) : [entry.confidence_interval_reason],
    [entry.total_standard_error],
    ends(entry.total_interval),
    [],
    ends(entry),
  ][column];
}

function profiles({ tag, text }) {
  // The interval ends where the rise is 1 by the definition of a profile.
  const definition = "The interval ends where the curve reaches 1;";
  return tag === "P" && text.includes(definition) ? [1] : [];
}

function budget({ column, first, text }, { result }) {
  const line = result.budget.find(({ assumption }) => assumption === first);
  const [, name] = /^(.*) -?\d+ %$/.exec(text) ?? [];
  const unknown = unknownsOf(result).find((entry) => entry.name === name);
  const { suggested } = line;
  return [
    [first],
    [line.value],
    [line.tolerance],
    [line.unit],
    [line.score],
    [suggested?.value, suggested?.standard_error],
    [line.unnoticed_up_to],
    [...inExperiment(unknown ?? {}), Math.round(100 * line.contributions[unknown?.key]?.share)],
  ][column];
}

function fit({ tag, table, cells, column, text }, { result }) {
  if (tag === "P") {
    const { aic, aicc, bic, fpe, cost } = result.criteria;
    return present([aic, aicc, bic, fpe, cost]);
  }
  const [output, data] = cells;
  if (table === 0) {
    const fitted = result.fit[data === "held back" ? "validation" : "estimation"][output];
    return [[], [], [fitted.fit_percent], [fitted.rmse], [fitted.max_abs_error], [fitted.samples]][column];
  }
  const residuals = result.residuals[output];
  const [, input] = /^(.*): (?:yes|no) /.exec(text) ?? [];
  return [
    [],
    [text.endsWith(" outliers") ? residuals.outliers : residuals.noise_std],
    [residuals.chi_square_per_sample],
    [residuals.lag_1_autocorrelation],
    [],
    [residuals.ljung_box_p],
    [residuals.inputs[input]?.correlation],
  ][column];
}

const withError = (number) => present([number?.estimate, number?.standard_error]);

function disturbed(place, { result, disturbance }) {
  const { tag, table, row, column, text } = place;
  const { disturbances, compared } = result.process_noise;
  const paths = disturbance.experiments.flatMap(({ experiment, disturbances: of }) =>
    of.filter(({ events }) => events.length > 0).map(({ events }) => ({ experiment, events })),
  );
  if (tag === "FIGCAPTION") {
    // The ends of the band are where the axis of the chart has them for 95 %.
    return [95];
  }
  if (tag === "P" && text.startsWith("Events in ")) {
    // The sentence stands before the table of its events.
    return [paths[table - 1].experiment + 1, paths[table - 1].events.length];
  }
  if (tag === "P") {
    const unknowns = Object.fromEntries(unknownsOf(result).map((entry) => [entry.key, entry]));
    const free = Object.entries(result.output_error);
    return free.flatMap(([key, { estimate }]) => [...inExperiment(unknowns[key]), estimate]);
  }
  if (table === 0) {
    const { std, strength, time_constant_s: memory, share_of_output: shares } = disturbances[row];
    const percents = Object.values(shares).map((share) => 100 * share);
    return [[], [], withError(std), withError(strength), withError(memory), percents][column];
  }
  if (table === 1) {
    const { name, log_likelihood: likelihood, bic } = compared[row];
    return [[name.replaceAll("`", "")], [likelihood], [bic]][column];
  }
  const {
    start_s: from,
    end_s: to,
    size,
    t,
  } = paths[table - 2].events.toSorted((a, b) => Math.abs(b.t) - Math.abs(a.t))[row];
  return [[from], [to], [size], [t]][column];
}

function effects({ table, row, column }, { result }) {
  const { compared_on: data, tried } = result.model_search;
  if (table < 0) {
    return [data];
  }
  return [[], [tried[row].unknowns], [tried[row].cost], [tried[row].bic]][column];
}

function model({ tag, equation }, { model: { title, summary, equations, inputs, outputs } }) {
  if (tag === "mn") {
    return equations.includes(equation) ? equation.match(/\d+(?:\.\d+)?/g) : [];
  }
  const signals = [...inputs, ...outputs].flatMap(({ name, unit, meaning }) => [name, unit, meaning]);
  // Equations that are not in the language of model documents stand together.
  return [title, `). ${summary}`, ...equations, equations.join("\n"), ...signals];
}

// The numbers of the sentences on samples that are left out: of each kind, of each span and of each mark.
function leftOut({ experiments }) {
  const ofSpan = ({ from_s: from, to_s: to }) => (from === to ? [from] : [from, to]);
  return experiments.flatMap(({ exclude, version }, k) => [
    ...(exclude?.classes ?? []).map(() => [k + 1]),
    ...(exclude?.spans ?? []).map((span) => [k + 1, ...ofSpan(span)]),
    ...(version?.marks ?? []).map((mark) => {
      const reason = signedIn(mark.reason).map(({ written }) => Number(written));
      return [k + 1, ...ofSpan(mark), ...reason, version.number];
    }),
  ]);
}

function recordings({ tag, row, column, sentence }, { job, datasets }) {
  if (tag === "P") {
    return leftOut(job.spec)[sentence];
  }
  const { dataset, window } = job.spec.experiments[row];
  const { name, start, zone, samples, duration_s: duration } = datasets[dataset];
  const place = zone ? ` (${zone})` : "";
  return [
    [row + 1],
    [name],
    [`${start}${place}`],
    [samples],
    [window?.from_s ?? 0, window?.to_s ?? duration],
  ][column];
}

function fixed({ column, first }, { job, model: { parameters } }) {
  const about = parameters.find(({ name, symbol }) => `${name} (${symbol})` === first);
  const spec = job.spec.parameters[about.name];
  const tolerance = spec.tolerance ?? about.tolerance;
  // A tolerance is a number, or a share such as "50 %".
  return [[], [spec.value ?? about.default], [Number.parseFloat(tolerance)], [about.unit]][column];
}

// The lags of white residuals that stay between the dashed lines, and the stretch that is drawn beside.
function caption(place, api) {
  const { text, title } = place;
  if (/ s: of all stretches of /.test(text)) {
    return busiest(place, api);
  }
  const { white_within: within, samples } = api.residuals.find(({ output }) => output === title);
  const isNormal = Math.abs(within * Math.sqrt(samples) - NORMAL_99) < 1e-3;
  return isNormal ? [99, 100] : [];
}

function experiment(place, api) {
  const { tag, section } = place;
  const { experiments } = api.trajectory;
  if (tag === "H2") {
    return experiments.map((entry) => `Experiment ${entry.experiment + 1}`);
  }
  const shown = experiments[Number(section.slice("Experiment ".length)) - 1];
  if (tag === "FIGCAPTION") {
    return caption(place, api);
  }
  if (tag === "P") {
    const { time_s: times, estimation_until_s: until } = shown;
    const used = times.filter((time) => time < until || until === null);
    // The paragraph has the samples before the recording's name, and those that are used after it.
    return [place.text.includes("estimated from") ? used.length : times.length];
  }
  return [];
}

function correlation({ tag, isTitle, row, column }, { result }) {
  const { names: keys, matrix, condition_number: condition } = result.correlation;
  const names = unknownsOf(result)
    .filter(({ key }) => keys.includes(key))
    .map(({ name }) => name);
  if (tag === "P") {
    return [condition];
  }
  // The unit of a correlation is 1.
  const entry = matrix[row]?.[column - 1];
  return isTitle || column === 0 ? ["correlation [1]", ...names] : [entry && Number(entry.toFixed(2))];
}

function posterior({ tag, isTitle, first, column }, { result, draws }) {
  const all = estimatesOf(result);
  if (tag === "P") {
    return [draws.generations];
  }
  const described = isTitle ? Object.values(all).find((entry) => entry.posterior) : all[first];
  const { mean, standard_deviation: deviation, quantiles, ...chains } = described.posterior;
  const levels = quantiles.map(({ probability, value }) => [isTitle ? 100 * probability : value]);
  const { r_hat: rHat, ess_bulk: middle, ess_tail: tails } = chains;
  return [[first], [mean], [deviation], ...levels, [rHat], [middle], [tails]][column];
}

function search({ tag }, { result }) {
  const { generations, evaluations, distinct_evaluations: distinct } = result.search;
  return tag === "P" ? [generations, evaluations, distinct] : [];
}

function starts({ isTitle, row, column }, { result }) {
  const sorted = result.starts.toSorted((a, b) => (a.cost ?? Infinity) - (b.cost ?? Infinity));
  const { cost, initial_cost: initial, parameters: values } = sorted[Math.max(row, 0)];
  if (isTitle) {
    return unknownsOf(result).map(({ name, unit }) => bracketed(name, unit));
  }
  return [[cost], [initial], ...Object.values(values).map((value) => [value])][column];
}

function origin({ tag }, { result: { engine } }) {
  return tag === "P" ? [`greybox ${engine.version}, seed ${engine.seed}, specification`] : [];
}

const SECTIONS = {
  "": header,
  Estimates: estimates,
  "Likelihood profiles": profiles,
  "What was taken as known": budget,
  Fit: fit,
  "What acted on the plant": disturbed,
  Effects: effects,
  Model: model,
  Recordings: recordings,
  "Taken as fixed": fixed,
  "Correlation of the estimates": correlation,
  "Draws from the posterior": posterior,
  "How it was found": search,
  "Starts of the refinement": starts,
  "What made it": origin,
};

/**
 * The source of a place; none where the report should have no number.
 *
 * @returns {(number | string | null | undefined)[]}
 */
export function sourceOf(place, api) {
  if (place.chart) {
    return chartSource(place, api);
  }
  const part = SECTIONS[place.section] ?? (place.section.startsWith("Experiment ") ? experiment : null);
  return (part ?? (place.section.includes(" trust: ") ? verdict : () => []))(place, api) ?? [];
}
