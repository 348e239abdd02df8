// The estimate: the verdict with its reasons, the parameters, the fit. While the search runs, the
// parameters of its best candidate so far.

import { get } from "./api.js";
import { facts, h, notice, table } from "./dom.js";
import { count, number, percent, quantity, unitText, withError, words } from "./format.js";
import { isFinished } from "./job_feed.js";

const WITH_RESULT = ["succeeded", "cancelled", "paused", "failed"];

const PARAMETER_COLUMNS = [
  { title: "Parameter" }, { title: "Estimate", numeric: true }, { title: "± standard error", numeric: true },
  { title: "Confidence interval", numeric: true }, { title: "Unit" }, { title: "Bounds", numeric: true },
  { title: "Remarks" },
];

const FIT_COLUMNS = [
  { title: "Data" }, { title: "Output" }, { title: "Fit", numeric: true }, { title: "RMSE", numeric: true },
  { title: "Largest error", numeric: true }, { title: "Samples", numeric: true },
];

export function resultPanel(view) {
  const outcome = notice();
  const content = h("div", {});
  const state = { job: null, model: null, result: null, last: null, wanted: 0 };
  const element = h("section", { "aria-label": "Estimate" }, h("h2", {}, "Estimate"), outcome.place, content);

  const drawBest = () => {
    if (state.job && !state.result) {
      const none = isFinished(state.job) ? "There is no estimate." : "No estimate yet.";
      content.replaceChildren(state.last ? bestSoFar(state.last, state) : h("p", { class: "quiet" }, none));
    }
  };
  return {
    element,
    // Whether there is a result now.
    async job(job) {
      state.job = job;
      state.wanted += 1;
      const turn = state.wanted;
      state.model ??= await get(`/v1/models/${job.model}`, view.signal).then(({ data }) => data, () => null);
      const result = WITH_RESULT.includes(job.status) ? await read(job, view, outcome) : null;
      if (turn !== state.wanted) {
        return false;
      }
      state.result = result;
      if (result) {
        content.replaceChildren(...report(result, state));
      } else {
        drawBest();
      }
      return result !== null;
    },
    history(rows) {
      state.last = rows.at(-1) ?? null;
      drawBest();
    },
  };
}

async function read(job, view, outcome) {
  try {
    return (await get(`/v1/jobs/${job.id}/result`, view.signal)).data;
  } catch (error) {
    if (error.status !== 409 && error.status !== 404) {
      outcome.fail(error);
    }
    return null;
  }
}

function described(model, list, name) {
  return (model?.[list] ?? []).find((entry) => entry.name === name) ?? {};
}

function nameCell(name, symbol) {
  return [words(name), symbol && h("span", { class: "symbol" }, plainSymbol(symbol))];
}

// `K_m` with a lowered m.
function plainSymbol(symbol) {
  const [base, ...index] = symbol.split("_");
  return index.length ? [base, h("sub", {}, index.join(" ").replace(/[{}]/g, ""))] : symbol;
}

function bounds(lower, upper) {
  return `${number(lower)} … ${number(upper)}`;
}

function bestSoFar(row, { job, model }) {
  const rows = Object.entries(row.best ?? {}).map(([name, value]) => {
    const about = described(model, "parameters", name);
    const free = job.spec?.parameters?.[name]?.estimate ?? about;
    return [nameCell(name, about.symbol), number(value, 6), "–", "–", unitText(about.unit ?? ""),
      bounds(free.lower, free.upper), ""];
  });
  return h("div", {},
    h("p", { class: "quiet" }, `Best candidate of generation ${row.generation}, without uncertainty${isFinished(job) ? "" : ", which comes with the result"}.`),
    table("Best parameters so far", PARAMETER_COLUMNS, rows));
}

function report(result, { job, model }) {
  const part = job.status === "succeeded" ? "" : " (best so far)";
  return [
    verdict(result),
    h("h3", {}, `Parameters${part}`),
    table("Estimated parameters", PARAMETER_COLUMNS, (result.parameters ?? []).map(parameterRow)),
    h("h3", {}, "Fit"),
    table("Fit of the outputs", FIT_COLUMNS, fitRows(result.fit, model)),
    h("h3", {}, "Search"),
    search(result),
    download(result, job),
  ];
}

function verdict(result) {
  const { trust, reasons = [] } = result.verdict ?? {};
  if (!trust) {
    return h("p", { class: "quiet" }, "No verdict: the job did not get as far as the analysis.");
  }
  return h("div", { class: `verdict ${trust}` },
    h("p", {}, h("strong", {}, `Trust: ${words(trust)}`), ` · stopped by ${words(result.stop_reason ?? "–")}`),
    reasons.length > 0 && h("ul", {}, reasons.map((reason) =>
      h("li", {}, typeof reason === "string" ? reason : reason.detail ?? reason.code))));
}

function parameterRow(parameter) {
  const [estimate, error] = withError(parameter.estimate, parameter.standard_error);
  const interval = parameter.confidence_interval;
  const remarks = [
    parameter.at_bound && h("span", { class: "badge failed" }, "at bound"),
    parameter.identifiable === false && h("span", { class: "badge failed" }, "not identifiable"),
  ].filter(Boolean);
  return [
    nameCell(parameter.name, parameter.symbol), estimate, error, interval ? intervalText(interval) : "–",
    unitText(parameter.unit), bounds(parameter.lower, parameter.upper),
    remarks,
  ];
}

function intervalText({ level, lower, upper, method }) {
  const [low, high] = [lower, upper].map((end) =>
    Number.isFinite(end) ? withError(end, Math.abs(upper - lower) / 4)[0] : "open");
  return h("span", { title: method ? `method: ${words(method)}` : null },
    `${low} … ${high}`, h("span", { class: "quiet" }, ` (${percent(100 * level)})`));
}

function fitRows(fit, model) {
  return ["estimation", "validation"].flatMap((data) =>
    Object.entries(fit?.[data] ?? {}).map(([output, values]) => {
      const { unit } = described(model, "outputs", output);
      return [data, words(output), percent(values.fit_percent), quantity(number(values.rmse), unit),
        quantity(number(values.max_abs_error), unit), count(values.samples)];
    }));
}

function search(result) {
  const { search: made = {}, criteria = {}, engine = {} } = result;
  const failed = Object.entries(made.failed_evaluations ?? {}).map(([cause, n]) => `${count(n)} ${words(cause)}`);
  return facts([
    ["Generations", count(made.generations)],
    ["Best found in generation", made.best_generation === undefined ? null : count(made.best_generation)],
    ["Evaluations", `${count(made.evaluations)}, ${count(made.distinct_evaluations)} of them distinct`],
    ["Failed evaluations", failed.join(", ")],
    ["Best credit", number(made.best_credit, 3)],
    ["Cost", number(criteria.cost, 6)],
    ["AIC · AICc · BIC", [criteria.aic, criteria.aicc, criteria.bic].map((value) => number(value, 6)).join(" · ")],
    ["FPE", number(criteria.fpe)],
    ["Seed", engine.seed === undefined ? null : String(engine.seed)],
    ["Version", engine.version],
  ]);
}

function download(result, job) {
  const save = () => {
    const address = URL.createObjectURL(new Blob([JSON.stringify(result, null, 2)], { type: "application/json" }));
    h("a", { href: address, download: `${job.id}-result.json` }).click();
    URL.revokeObjectURL(address);
  };
  return h("p", {}, h("button", { type: "button", onclick: save }, "Download the result as JSON"));
}
