// @ts-check
// The check before the start runs again after each change. It shows the faults of the specification,
// what the data can fix, and the cost of the job.

import { request } from "../shell/api.js";
import { facts, h, quoted } from "../shell/dom.js";
import { assumptionWords, count, number, quantity, words } from "../shell/format.js";

const WAIT_MS = 450;

export function preflightPart(job) {
  const state = h("p", { role: "status", class: "quiet" });
  const content = h("div", {});
  const element = h("div", { class: "panel" }, h("h2", {}, "Before the start"), state, content);
  let timer = null;
  let asking = null;

  const ask = async () => {
    asking?.abort();
    asking = new AbortController();
    const attempt = asking;
    job.view.signal.addEventListener("abort", () => attempt.abort(), { once: true });
    const body = JSON.stringify(job.spec);
    try {
      const { data } = await request("POST", "/v1/jobs?validate_only=true", {
        body,
        signal: attempt.signal,
        headers: { "content-type": "application/json" },
      });
      job.predictions = data.identifiability?.predictions ?? [];
      job.budget = data.budget ?? [];
      job.markFaults([]);
      state.textContent = "The job can start.";
      content.replaceChildren(...outlook(data));
    } catch (error) {
      if (error.name === "AbortError") {
        return;
      }
      job.predictions = [];
      job.markFaults(error.errors ?? []);
      state.textContent = "The job cannot start yet:";
      content.replaceChildren(faults(error));
    }
    job.checking = false;
    job.redraw();
  };
  return {
    element,
    check() {
      clearTimeout(timer);
      if (!job.spec.model || !(job.spec.experiments?.length > 0)) {
        state.textContent = job.spec.experiments?.length
          ? "Choose a model."
          : "Choose a recording, or upload one.";
        content.replaceChildren();
        return;
      }
      job.checking = true;
      state.textContent = "Checking …";
      timer = setTimeout(ask, WAIT_MS);
    },
  };
}

function faults(error) {
  const list = error.errors?.length ? error.errors : [{ detail: error.message }];
  return h(
    "ul",
    { class: "warnings" },
    list.map(({ pointer, detail }) =>
      h("li", {}, pointer && h("strong", {}, `${placeOf(pointer)}: `), detail),
    ),
  );
}

// Writes a pointer in words: `/experiments/0/signals/position` becomes "experiment 1, signals,
// position".
export function placeOf(pointer) {
  return pointer
    .split("/")
    .filter(Boolean)
    .map((part) => (/^\d+$/.test(part) ? String(Number(part) + 1) : words(part)))
    .join(", ")
    .replace(/experiments, (\d+)/, "experiment $1");
}

/** @param {any} checked */
function outlook({ identifiability, findings, predicted_cost: cost, budget }) {
  const flat = identifiability?.flat_directions ?? [];
  const warnings = findings.filter(({ code }) => code !== "not_identifiable");
  const predictions = identifiability?.predictions ?? [];
  const assumptions = mattering(budget ?? [], predictions);
  return [
    flat.length > 0 &&
      h(
        "div",
        { class: "verdict low" },
        h("p", {}, h("strong", {}, "The data do not see:")),
        h(
          "ul",
          {},
          flat.map((text) => h("li", {}, quoted(text))),
        ),
      ),
    warnings.length > 0 &&
      h(
        "ul",
        { class: "warnings" },
        warnings.map(({ pointer, detail }) =>
          h("li", {}, pointer && h("strong", {}, `${placeOf(pointer)}: `), quoted(detail)),
        ),
      ),
    flat.length === 0 && warnings.length === 0 && h("p", {}, "Nothing to warn of."),
    assumptions.length > 0 &&
      h(
        "div",
        {},
        h("p", {}, "What is taken as known and matters most:"),
        h(
          "ul",
          {},
          assumptions.map((text) => h("li", {}, text)),
        ),
      ),
    facts([
      ["Unknowns", unknownsText(cost.unknowns, predictions)],
      ["Measured samples", count(cost.residuals)],
      ["Candidates at the most", count(cost.evaluations)],
      ["Evaluations of the equations per candidate", count(cost.derivatives_per_evaluation)],
    ]),
  ].filter(Boolean);
}

// The form has a row for each parameter and none for an initial state, so the states are told apart.
/**
 * @param {number} unknowns
 * @param {import("page/api").Schemas["Prediction"][]} predictions
 */
export function unknownsText(unknowns, predictions) {
  // A parameter that is an experiment's own has the experiment in its name.
  const states = predictions.filter(
    ({ name, experiment }) => Number.isFinite(experiment) && !name.endsWith("]"),
  ).length;
  const starts = states === 1 ? "1 is the start of a state" : `${count(states)} are the starts of states`;
  return states > 0 ? `${count(unknowns)}, of which ${starts}` : count(unknowns);
}

const ofExperiment = (/** @type {string} */ name) =>
  words(name).replace(/\[(\d+)\]$/, (_, k) => ` in experiment ${Number(k) + 1}`);

const MOST_NAMED = 3;
// An assumption matters where a parameter's error would become smaller than this share of the error at hand.
const LESS = 0.9;

/**
 * Says which assumptions matter: with them five times better known a parameter would be known better. The error at hand
 * is that with an assumption better known that matters least.
 *
 * @param {import("page/api").Schemas["BudgetLine"][]} budget
 * @param {import("page/api").Schemas["Prediction"][]} predictions
 * @returns {string[]}
 */
export function mattering(budget, predictions) {
  const gains = predictions.flatMap(({ name, unit }) => {
    const lines = budget
      .map(({ assumption, contributions }) => ({ assumption, error: contributions[name]?.total_if_better }))
      .filter(({ error }) => Number.isFinite(error))
      .sort((a, b) => a.error - b.error);
    const [first] = lines;
    const last = lines.at(-1);
    return first && first.error < LESS * last.error
      ? [{ ...first, name, unit, present: last.error, ratio: first.error / last.error }]
      : [];
  });
  const error = (value, unit) => `± ${quantity(number(value, 2), unit)}`;
  return gains
    .sort((a, b) => a.ratio - b.ratio)
    .slice(0, MOST_NAMED)
    .map(
      ({ assumption, name, unit, error: better, present }) =>
        `${assumptionWords(assumption)}: known five times better, ${ofExperiment(name)} comes to ${error(better, unit)} in place of ${error(present, unit)}`,
    );
}
