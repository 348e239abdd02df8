// The estimate: the verdict with its reasons, the parameters, the fit. While the search runs, the
// parameters of its best candidate so far.

import { get } from "./api.js";
import { facts, h, notice } from "./dom.js";
import { count, number, words } from "./format.js";
import { isFinished } from "./job_feed.js";
import {
  bestTable, correlationTable, fitTable, initialStateTable, parameterTable, residualTable, startTable,
} from "./job_tables.js";

const WITH_RESULT = ["succeeded", "cancelled", "paused", "failed"];

export function resultPanel(view) {
  const outcome = notice();
  const content = h("div", {});
  const state = { job: null, model: null, result: null, last: null, wanted: 0 };
  const element = h("section", { "aria-label": "Estimate" }, h("h2", {}, "Estimate"), outcome.place, content);

  const drawBest = () => {
    if (state.job && !state.result) {
      const none = isFinished(state.job) ? "There is no estimate." : "No estimate yet.";
      content.replaceChildren(state.last ? bestSoFar(state) : h("p", { class: "quiet" }, none));
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
        content.replaceChildren(...report(result, state).filter(Boolean));
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

function bestSoFar({ last, job, model }) {
  const later = isFinished(job) ? "" : ", which comes with the result";
  return h("div", {},
    h("p", { class: "quiet" }, `Best candidate of generation ${last.generation}, without uncertainty${later}.`),
    bestTable(last, job, model));
}

function report(result, { job, model }) {
  const part = job.status === "succeeded" ? "" : " (best so far)";
  const { initial_states: states = [], residuals = {}, starts = [], correlation } = result;
  return [
    verdict(result),
    h("h3", {}, `Parameters${part}`),
    parameterTable(result.parameters ?? []),
    states.length > 0 && h("div", {}, h("h3", {}, "Initial states"), initialStateTable(states)),
    h("h3", {}, "Fit"),
    fitTable(result.fit, model),
    Object.keys(residuals).length > 0 && h("div", {}, h("h3", {}, "Residuals"), residualTable(residuals, model)),
    h("h3", {}, "Search"),
    search(result),
    correlation?.names.length > 1 && folded("Correlation of the errors", correlationTable(correlation)),
    starts.length > 0 && folded(`${starts.length} starts of the refinement, best first`, startTable(starts)),
    download(result, job),
  ];
}

function folded(title, content) {
  return h("details", {}, h("summary", {}, title), content);
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

function search(result) {
  const { search: made = {}, criteria = {}, engine = {} } = result;
  const failed = Object.entries(made.failed_evaluations ?? {}).map(([cause, n]) => `${count(n)} ${words(cause)}`);
  const criterion = [criteria.aic, criteria.aicc, criteria.bic].map((value) => number(value, 6)).join(" · ");
  return facts([
    ["Generations", count(made.generations)],
    ["Best found in generation", Number.isFinite(made.best_generation) ? count(made.best_generation) : null],
    ["Evaluations", `${count(made.evaluations)}, ${count(made.distinct_evaluations)} of them distinct`],
    ["Failed evaluations", failed.join(", ")],
    ["Best credit", number(made.best_credit, 3)],
    ["Cost", number(criteria.cost, 6)],
    ["AIC · AICc · BIC", criterion],
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
