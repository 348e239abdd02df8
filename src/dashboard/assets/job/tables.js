// @ts-check
// This module makes the tables of a result: parameters and initial states, fit, residuals and starts.

import { keyOf } from "../compare/differences.js";
import { intervalBar } from "../compare/jobs.js";
import { h, table } from "../shell/dom.js";
import { count, number, percent, quantity, unitText, withError, words } from "../shell/format.js";
import { unknownWords } from "./unknowns.js";

const ESTIMATE_COLUMNS = [
  { title: "Parameter" },
  { title: "Estimate", numeric: true },
  { title: "±", numeric: true },
  { title: "Unit" },
  { title: "95 % interval" },
  { title: "On its search range" },
  { title: "Trust" },
];

// The level that the title of the column says.
const USUAL_LEVEL = 0.95;

// The truth is known of a demonstration alone.
const TRUE_COLUMN = { title: "True value", numeric: true };

const FIT_COLUMNS = [
  { title: "Data" },
  { title: "Output" },
  { title: "Fit", numeric: true },
  { title: "RMSE", numeric: true },
  { title: "Largest error", numeric: true },
  { title: "Samples", numeric: true },
];

const RESIDUAL_COLUMNS = [
  { title: "Output" },
  { title: "χ² per sample", numeric: true },
  { title: "White" },
  { title: "Ljung–Box p", numeric: true },
  { title: "Lag-1 autocorrelation", numeric: true },
  { title: "Noise level", numeric: true },
  { title: "Outliers", numeric: true },
  { title: "Effective samples", numeric: true },
];

export function described(model, list, name) {
  return (model?.[list] ?? []).find((entry) => entry.name === name) ?? {};
}

/**
 * The table has the parameters of the best candidate of a generation.
 *
 * @param {import("page/api").Schemas["GenerationEvent"]} row
 * @param {any} job
 * @param {import("page/api").Schemas["ModelDescription"] | null} model
 */
export function bestTable(row, job, model) {
  const rows = Object.entries(row.best ?? {}).map(([key, value]) => {
    // `offset[1]` is the offset of the second experiment alone.
    const [, name, experiment] = /^(.*?)(?:\[(\d+)\])?$/.exec(key);
    const about = described(model, "parameters", name);
    const states = (model?.states ?? []).map((state) => state.name);
    const source = experiment === undefined ? job.spec : job.spec?.experiments?.[experiment];
    const { lower, upper, scale } = { ...about, ...source?.parameters?.[name]?.estimate };
    return [
      nameCell(unknownWords(key, states), about.symbol),
      number(value, 6),
      "–",
      unitText(about.unit ?? ""),
      "–",
      onRange({ estimate: value, lower, upper }, scale),
      "",
    ];
  });
  return table("Best parameters so far", ESTIMATE_COLUMNS, rows, { stacked: true });
}

/**
 * The error beside the estimate counts the errors of assumed values; the error of noise alone stands
 * below it.
 *
 * @param {import("page/api").Schemas["ParameterEstimate"][]} parameters
 * @param {any} job
 * @param {import("page/api").Schemas["ModelDescription"] | null} model
 * @param {Record<string, number> | null} [truths]
 */
export function parameterTable(parameters, job, model, truths = null) {
  const scale = (/** @type {any} */ { name, experiment }) => {
    const source =
      experiment === undefined || experiment === null ? job?.spec : job?.spec?.experiments?.[experiment];
    return source?.parameters?.[name]?.estimate?.scale ?? described(model, "parameters", name).scale;
  };
  const rows = parameters.map((parameter) => {
    const row = estimateRow(ofExperiment(parameter.name, parameter.experiment), parameter, scale(parameter));
    return truths ? row.toSpliced(2, 0, number(truths[parameter.name], 5)) : row;
  });
  const columns = truths ? ESTIMATE_COLUMNS.toSpliced(2, 0, TRUE_COLUMN) : ESTIMATE_COLUMNS;
  return table("Estimated parameters", columns, rows, { empty: "No parameter was free.", stacked: true });
}

function ofExperiment(name, experiment) {
  return unknownWords(keyOf({ name, experiment }));
}

/** @param {import("page/api").Schemas["InitialStateEstimate"][]} states */
export function initialStateTable(states) {
  const several = states.some(({ experiment }) => experiment > 0);
  return table(
    "Estimated initial states",
    [{ title: "State" }, ...ESTIMATE_COLUMNS.slice(1)],
    states.map((state) => estimateRow(ofExperiment(state.state, several ? state.experiment : null), state)),
    { stacked: true },
  );
}

/** @param {string} name @param {any} estimate @param {string} [scale] */
function estimateRow(name, estimate, scale) {
  const total = estimate.total_standard_error ?? estimate.standard_error;
  const [value, error] = withError(estimate.estimate, total);
  const alone =
    estimate.total_standard_error !== null && estimate.total_standard_error !== undefined
      ? withError(estimate.estimate, estimate.standard_error)[1]
      : "–";
  const interval = estimate.total_interval ?? estimate.confidence_interval;
  const { monte_carlo: drawn } = estimate;
  const reasons = new Set(
    [estimate.standard_error_reason, estimate.confidence_interval_reason].filter(Boolean),
  );
  return [
    nameCell(name, estimate.symbol),
    value,
    [error, alone !== "–" && alone !== error && h("div", { class: "quiet fine" }, `noise alone ${alone}`)],
    unitText(estimate.unit),
    [
      interval ? intervalText(interval) : "–",
      h("div", { class: "quiet fine" }, [...reasons].join("; ")),
      drawn &&
        h(
          "div",
          { class: "quiet fine" },
          `${number(drawn.lower, 4)} … ${number(drawn.upper, 4)} over ${count(drawn.samples)} fits with noise drawn anew`,
        ),
    ],
    [onRange(estimate, scale), h("div", { class: "quiet fine" }, bounds(estimate.lower, estimate.upper))],
    [
      estimate.trust && h("span", { class: `badge trust-${estimate.trust}` }, estimate.trust),
      " ",
      estimate.at_bound && h("span", { class: "badge failed" }, "at bound"),
      " ",
      estimate.identifiable === false && h("span", { class: "badge failed" }, "not identifiable"),
    ],
  ];
}

// Draws the interval of an estimate on the range of the search.
function onRange(estimate, scale) {
  const { lower, upper } = estimate;
  if (!Number.isFinite(lower) || !Number.isFinite(upper) || lower >= upper) {
    return "–";
  }
  return intervalBar(estimate, { log: scale === "log" && lower > 0, low: lower, high: upper });
}

function nameCell(name, symbol) {
  return [name, symbol && symbol !== name && h("span", { class: "symbol" }, lowered(symbol))];
}

// Writes `K_m` with a lowered m.
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
  return h(
    "span",
    { class: "interval-text", title: method ? `method: ${words(method)}` : null },
    `${low} … ${high}`,
    level !== USUAL_LEVEL && h("span", { class: "quiet" }, ` (${percent(100 * level)})`),
  );
}

/**
 * @param {import("page/api").Schemas["Fit"]} fit
 * @param {import("page/api").Schemas["ModelDescription"] | null} model
 */
export function fitTable(fit, model) {
  const rows = ["estimation", "validation"].flatMap((data) =>
    Object.entries(fit?.[data] ?? {}).map(([output, values]) => {
      const { unit } = described(model, "outputs", output);
      return [
        data,
        words(output),
        percent(values.fit_percent),
        quantity(number(values.rmse), unit),
        quantity(number(values.max_abs_error), unit),
        count(values.samples),
      ];
    }),
  );
  return table("Fit of the outputs", FIT_COLUMNS, rows, { stacked: true });
}

/**
 * @param {Record<string, import("page/api").Schemas["ResidualReport"]>} residuals
 * @param {import("page/api").Schemas["ModelDescription"] | null} model
 */
export function residualTable(residuals, model) {
  const white = { true: "yes", false: "no" };
  const rows = Object.entries(residuals).map(([output, report]) => {
    const { unit } = described(model, "outputs", output);
    return [
      words(output),
      number(report.chi_square_per_sample),
      white[report.white] ?? "–",
      number(report.ljung_box_p, 2),
      number(report.lag_1_autocorrelation, 3),
      `${quantity(number(report.noise_std, 3), unit)} (${report.noise_std_source ?? "–"})`,
      count(report.outliers ?? NaN),
      count(Math.round(report.effective_samples ?? NaN)),
    ];
  });
  return table("Residuals of the outputs", RESIDUAL_COLUMNS, rows, { stacked: true });
}

/** @param {import("page/api").Schemas["StartReport"][]} starts @param {string[]} states */
export function startTable(starts, states) {
  const names = Object.keys(starts[0].parameters);
  const columns = [
    { title: "Cost at the start", numeric: true },
    { title: "Cost at the end", numeric: true },
    ...names.map((name) => ({ title: unknownWords(name, states), numeric: true })),
  ];
  const rows = starts.map((start) => [
    number(start.initial_cost, 6),
    number(start.cost, 6),
    ...names.map((name) => number(start.parameters[name], 5)),
  ]);
  return table("Starts of the refinement", columns, rows);
}
