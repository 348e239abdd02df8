// @ts-check
// The panel shows the estimate: the verdict with its reasons, the parameters and the fit. While the
// search runs, the panel shows the parameters of the best candidate so far.

import { keyOf } from "../compare/differences.js";
import { patched } from "../new/draft.js";
import { download } from "../plot/save.js";
import { get, query } from "../shell/api.js";
import { facts, h, notice, quoted } from "../shell/dom.js";
import { count, number, words } from "../shell/format.js";
import { prepare, specOf } from "../shell/prepared.js";
import { ancestryPart, followed } from "./ancestry.js";
import { budgetPart } from "./budget.js";
import { correlationPart } from "./correlation.js";
import { effectsPart } from "./effects.js";
import { isAtRest, isFinished } from "./feed.js";
import { influencePart } from "./influence.js";
import { unknownsOf } from "./moves.js";
import { posteriorPart } from "./posterior.js";
import { profiled, profilesPart } from "./profiles.js";
import { residualsPart, startsPart } from "./residuals.js";
import { bestTable, fitTable, initialStateTable, parameterTable } from "./tables.js";
import { statesOf, unknownWords } from "./unknowns.js";
import { conclusions } from "./verdict.js";

export function resultPanel(view) {
  const outcome = notice();
  const content = h("div", {});
  const state = {
    view,
    job: null,
    model: null,
    rules: null,
    truths: null,
    result: null,
    last: null,
    turn: 0,
  };
  const element = h(
    "section",
    { "aria-label": "Estimate", "data-part": "Estimate" },
    h("h2", {}, "Estimate"),
    outcome.place,
    content,
  );
  const analysis = h("div", { class: "analysis" });
  const searched = h("div", {});

  const drawBest = () => {
    if (state.job && !state.result) {
      const none = isFinished(state.job) ? "There is no estimate." : "No estimate yet.";
      content.replaceChildren(state.last ? bestSoFar(state) : h("p", { class: "quiet" }, none));
    }
  };
  return {
    element,
    // The pictures and tables behind the numbers of the estimate.
    analysis,
    // How the search and the refinement came to the estimate.
    searched,
    // Answers the result, or null while there is none.
    async job(job) {
      state.job = job;
      state.turn += 1;
      const turn = state.turn;
      state.model ??= await get(`/v1/models/${job.model}`, view.signal).then(
        ({ data }) => data,
        () => null,
      );
      state.rules ??= await get("/v1/verdict-rules", view.signal).then(
        ({ data }) => data.items,
        () => null,
      );
      state.truths ??= await truthsOf(job, view);
      const result = isAtRest(job) ? await read(job, view, outcome) : null;
      if (turn !== state.turn) {
        return null;
      }
      state.result = result;
      if (result) {
        content.replaceChildren(...numbers(result, state).filter(Boolean));
        analysis.replaceChildren(...analyses(result, state).filter(Boolean));
        searched.replaceChildren(...searches(result, state).filter(Boolean));
      } else {
        drawBest();
      }
      return result;
    },
    // Takes the job under another name.
    named(job) {
      state.job = job;
    },
    history(rows) {
      state.last = rows.at(-1) ?? null;
      drawBest();
    },
  };
}

// The parameters that the recording of a demonstration was made with; null for every other job.
async function truthsOf({ labels }, view) {
  const letter = labels?.demonstration;
  return letter
    ? get(`/v1/demonstration${query({ recording: letter })}`, view.signal).then(
        ({ data }) => data.true_parameters,
        () => null,
      )
    : null;
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
  return h(
    "div",
    {},
    h(
      "p",
      { class: "quiet" },
      `Best candidate of generation ${last.generation}, without uncertainty${later}.`,
    ),
    bestTable(last, job, model),
  );
}

/** @param {any} result */
function numbers(result, state) {
  const { job, model, truths, view } = state;
  const part = job.status === "succeeded" ? "" : " (best so far)";
  const { initial_states: states = [] } = result;
  return [
    verdictBox(result, state),
    ancestryPart(view, job, result, model),
    result.model_search && effectsPart(result.model_search),
    h("h3", { "data-part": "Parameters" }, `Parameters${part}`),
    parameterTable(result.parameters ?? [], job, model, truths),
    states.length > 0 && h("div", {}, h("h3", {}, "Initial states"), initialStateTable(states)),
    h("h3", { "data-part": "Fit" }, "Fit"),
    fitTable(result.fit, model),
    downloads(result, job),
  ];
}

/** @param {any} result */
function analyses(result, { job, model, view }) {
  const { correlation, budget = [] } = result;
  const isWide = matchMedia("(min-width: 100rem)").matches;
  return [
    budget.length > 0 && analysed("Uncertainty budget", () => budgetPart(result), true),
    correlation?.names.length > 1 &&
      analysed("Correlation of the errors", () => correlationPart(correlation, statesOf(result)), true),
    profiled(result).length > 0 &&
      analysed("Likelihood profiles", () => profilesPart(view, result), true, "across"),
    unknownsOf(result).length > 0 &&
      analysed("What each unknown moves", () => influencePart(view, job, result), false, "across"),
    Object.keys(result.residuals ?? {}).length > 0 &&
      analysed("Residuals", () => residualsPart(view, job, result, model), isWide, "across"),
    result.posterior && analysed("Draws from the posterior", () => posteriorPart(job, result)),
  ];
}

/** @param {any} result */
function searches(result, { view }) {
  const { starts = [] } = result;
  return [
    starts.length > 1 &&
      analysed("Starts of the refinement", () => startsPart(view, starts, statesOf(result))),
    analysed("The search in numbers", () => search(result)),
  ];
}

// A part of the analysis can be closed. Its content is made when it is first open.
function analysed(title, make, isOpen = false, look = "") {
  const details = h(
    "details",
    { class: `analysed ${look}`, "data-part": title },
    h("summary", {}, h("h3", {}, title)),
  );
  const fill = () => details.open && details.children.length === 1 && details.append(make());
  details.addEventListener("toggle", fill);
  details.open = isOpen;
  fill();
  return details;
}

const GRADES = {
  high: "High trust: nothing speaks against the numbers.",
  moderate: "Moderate trust: use the numbers with this in mind.",
  low: "Low trust: do not use the numbers before this is settled.",
};
const POINTS_SHOWN = 4;
// A path of the API in the verdict leads to the guide about it.
const withGuide = (text, said) =>
  quoted(text, said).flatMap((part) =>
    typeof part === "string"
      ? part
          .split(/(POST \/v1\/designs)/)
          .map((words, k) => (k % 2 ? h("a", { href: "/docs/designs" }, words) : words))
      : [part],
  );
const NO_STEP =
  "No change of this job is left that promises more: what is missing has to come from the plant, as another recording, a declared noise or another model.";

const capital = (/** @type {string} */ text) => text.charAt(0).toUpperCase() + text.slice(1);

// Names of unknowns and of outputs are written in words; other names stay as a specification has them.
function namesSaid(result) {
  const states = statesOf(result);
  const names = new Set([
    ...(result.parameters ?? []).map(keyOf),
    ...(result.correlation?.names ?? []),
    ...states.flatMap((state) => [state, `initial_${state}`]),
    ...Object.keys(result.fit?.estimation ?? {}),
  ]);
  return (/** @type {string} */ name) => (names.has(name) ? h("em", {}, unknownWords(name, states)) : null);
}

function verdictBox(result, state) {
  const rules = state.rules ?? [];
  const { trust, summary, reasons = [] } = result.verdict ?? {};
  if (!trust) {
    return h("p", { class: "quiet" }, "No verdict: the job did not get as far as the analysis.");
  }
  const points = conclusions(result, rules);
  const said = namesSaid(result);
  const item = ({ text, next }) =>
    h(
      "li",
      {},
      withGuide(capital(text), said),
      next.length > 0 &&
        h(
          "ul",
          { class: "next" },
          next.map(({ label, why, patch }) => {
            const onclick = () => prepare(followed(patched(specOf(state.job), patch), label, state.job.id));
            return h(
              "li",
              {},
              h("button", { type: "button", class: "small", onclick }, label),
              " ",
              h("span", { class: "quiet" }, quoted(why)),
            );
          }),
        ),
    );
  const rest = points.slice(POINTS_SHOWN);
  return h(
    "div",
    { class: `verdict ${trust}` },
    h("p", { class: "grade" }, h("strong", {}, GRADES[trust])),
    summary && h("p", {}, quoted(capital(summary), said)),
    points.length > 0 && h("ol", {}, points.slice(0, POINTS_SHOWN).map(item)),
    points.length > 0 && !points.some(({ next }) => next.length) && h("p", {}, NO_STEP),
    rest.length > 0 &&
      h(
        "details",
        {},
        h("summary", {}, `${rest.length} more`),
        h("ol", { start: String(POINTS_SHOWN + 1) }, rest.map(item)),
      ),
    reasons.length > points.length &&
      h(
        "details",
        {},
        h("summary", {}, `All ${reasons.length} reasons, one by one`),
        h(
          "ul",
          {},
          reasons.map(({ code, detail }) => {
            const title = rules.find((rule) => rule.code === code)?.title ?? code;
            const chapter = h("a", { href: `/docs/verdicts#${code}`, title: code }, title);
            return h("li", {}, withGuide(capital(detail), said), " ", chapter);
          }),
        ),
      ),
  );
}

function search(result) {
  const { search: made = {}, criteria = {}, engine = {} } = result;
  const failed = Object.entries(made.failed_evaluations ?? {}).map(
    ([cause, n]) => `${count(n)} ${words(cause)}`,
  );
  const criterion = [criteria.aic, criteria.aicc, criteria.bic].map((value) => number(value, 6)).join(" · ");
  return facts([
    ["Stopped by", words(result.stop_reason ?? "–")],
    ["Generations", count(made.generations)],
    ["Best found in generation", Number.isFinite(made.best_generation) ? count(made.best_generation) : null],
    ["Evaluations", `${count(made.evaluations)}, ${count(made.distinct_evaluations)} of them distinct`],
    ["Failed evaluations", failed.join(", ")],
    ["Best credit", Number.isFinite(made.best_credit) ? number(made.best_credit, 3) : null],
    ["Cost of the estimate", number(criteria.cost, 6)],
    ["AIC · AICc · BIC", criterion],
    ["FPE", number(criteria.fpe)],
    ["Seed", engine.seed === undefined ? null : String(engine.seed)],
    ["Version", engine.version],
  ]);
}

function downloads(result, job) {
  const save = () =>
    download(
      new Blob([JSON.stringify(result, null, 2)], { type: "application/json" }),
      `${job.id}-result.json`,
    );
  const report = `/v1/jobs/${job.id}/report`;
  return h(
    "div",
    { class: "actions" },
    h("a", { class: "button", href: report, target: "_blank" }, "Report for the file"),
    h(
      "a",
      { class: "button", href: `${report}?format=markdown`, download: `${job.id}.md` },
      "Report as Markdown",
    ),
    h("button", { type: "button", onclick: save }, "Result as JSON"),
  );
}
