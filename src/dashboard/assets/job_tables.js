// The tables of a result: parameters and initial states, fit, residuals, correlation, starts.

import { h, table } from "./dom.js";
import { count, number, percent, quantity, unitText, withError, words } from "./format.js";

const ESTIMATE_COLUMNS = [
  { title: "Parameter" }, { title: "Estimate", numeric: true }, { title: "± standard error", numeric: true },
  { title: "Confidence interval", numeric: true }, { title: "Unit" }, { title: "Bounds", numeric: true },
  { title: "Remarks" },
];

const FIT_COLUMNS = [
  { title: "Data" }, { title: "Output" }, { title: "Fit", numeric: true }, { title: "RMSE", numeric: true },
  { title: "Largest error", numeric: true }, { title: "Samples", numeric: true },
];

const RESIDUAL_COLUMNS = [
  { title: "Output" }, { title: "χ² per sample", numeric: true }, { title: "White" },
  { title: "Lag-1 autocorrelation", numeric: true }, { title: "Noise level", numeric: true },
  { title: "Outliers", numeric: true }, { title: "Effective samples", numeric: true },
];

export function described(model, list, name) {
  return (model?.[list] ?? []).find((entry) => entry.name === name) ?? {};
}

// The parameters of the best candidate of a generation.
export function bestTable(row, job, model) {
  const rows = Object.entries(row.best ?? {}).map(([key, value]) => {
    // `offset[1]` is the offset of the second experiment alone.
    const [, name, experiment] = /^(.*?)(?:\[(\d+)\])?$/.exec(key);
    const about = described(model, "parameters", name);
    const said = experiment === undefined ? job.spec : job.spec?.experiments?.[experiment];
    const { lower, upper } = { ...about, ...said?.parameters?.[name]?.estimate };
    return [nameCell(ofExperiment(name, experiment), about.symbol), number(value, 6), "–", "–", unitText(about.unit ?? ""),
      bounds(lower, upper), ""];
  });
  return table("Best parameters so far", ESTIMATE_COLUMNS, rows);
}

export function parameterTable(parameters) {
  return table("Estimated parameters", ESTIMATE_COLUMNS,
    parameters.map((parameter) => estimateRow(ofExperiment(parameter.name, parameter.experiment), parameter)),
    { empty: "No parameter was free." });
}

function ofExperiment(name, experiment) {
  return experiment === undefined ? words(name) : `${words(name)}, experiment ${Number(experiment) + 1}`;
}

export function initialStateTable(states) {
  return table("Estimated initial states", ESTIMATE_COLUMNS,
    states.map((state) => estimateRow(ofExperiment(state.state, state.experiment), state)));
}

function estimateRow(name, estimate) {
  const [value, error] = withError(estimate.estimate, estimate.standard_error);
  const interval = estimate.confidence_interval;
  const reasons = new Set([estimate.standard_error_reason, estimate.confidence_interval_reason].filter(Boolean));
  return [
    nameCell(name, estimate.symbol), value, error, interval ? intervalText(interval) : "–",
    unitText(estimate.unit), bounds(estimate.lower, estimate.upper),
    [
      estimate.at_bound && h("span", { class: "badge failed" }, "at bound"), " ",
      estimate.identifiable === false && h("span", { class: "badge failed" }, "not identifiable"), " ",
      h("span", { class: "quiet" }, [...reasons].join("; ")),
    ],
  ];
}

function nameCell(name, symbol) {
  return [name, symbol && h("span", { class: "symbol" }, lowered(symbol))];
}

// `K_m` with a lowered m.
function lowered(symbol) {
  const [base, ...index] = symbol.split("_");
  return index.length ? [base, h("sub", {}, index.join(" ").replace(/[{}]/g, ""))] : symbol;
}

function bounds(lower, upper) {
  return `${number(lower)} … ${number(upper)}`;
}

function intervalText({ level, lower, upper, method }) {
  const deviation = Number.isFinite(lower) && Number.isFinite(upper) ? (upper - lower) / 4 : null;
  const [low, high] = [lower, upper].map((end) => {
    if (!Number.isFinite(end)) {
      return "open";
    }
    return deviation === null ? number(end) : withError(end, deviation)[0];
  });
  return h("span", { title: method ? `method: ${words(method)}` : null },
    `${low} … ${high}`, h("span", { class: "quiet" }, ` (${percent(100 * level)})`));
}

export function fitTable(fit, model) {
  const rows = ["estimation", "validation"].flatMap((data) =>
    Object.entries(fit?.[data] ?? {}).map(([output, values]) => {
      const { unit } = described(model, "outputs", output);
      return [data, words(output), percent(values.fit_percent), quantity(number(values.rmse), unit),
        quantity(number(values.max_abs_error), unit), count(values.samples)];
    }));
  return table("Fit of the outputs", FIT_COLUMNS, rows);
}

export function residualTable(residuals, model) {
  const white = { true: "yes", false: "no" };
  const rows = Object.entries(residuals).map(([output, report]) => {
    const { unit } = described(model, "outputs", output);
    return [words(output), number(report.chi_square_per_sample), white[report.white] ?? "–",
      number(report.lag_1_autocorrelation, 3),
      `${quantity(number(report.noise_std, 3), unit)} (${report.noise_std_source ?? "–"})`,
      count(report.outliers ?? NaN), count(Math.round(report.effective_samples ?? NaN))];
  });
  return table("Residuals of the outputs", RESIDUAL_COLUMNS, rows);
}

export function correlationTable({ names, matrix }) {
  const columns = [{ title: "" }, ...names.map((name) => ({ title: words(name), numeric: true }))];
  const rows = matrix.map((row, k) => [words(names[k]), ...row.map((value) => number(value, 3))]);
  return table("Correlation of the errors", columns, rows);
}

export function startTable(starts) {
  const names = Object.keys(starts[0].parameters);
  const columns = [{ title: "Cost at the start", numeric: true }, { title: "Cost at the end", numeric: true },
    ...names.map((name) => ({ title: words(name), numeric: true }))];
  const rows = starts.map((start) => [number(start.initial_cost, 6), number(start.cost, 6),
    ...names.map((name) => number(start.parameters[name], 5))]);
  return table("Starts of the refinement", columns, rows);
}
