// @ts-check
// This module shows what the data said of the effects that a job left open.

import { h, table } from "../shell/dom.js";
import { count, number, percent, words } from "../shell/format.js";
import { criterionWords } from "./ancestry.js";

/** @typedef {import("page/api").Schemas["ModelSearchReport"]} ModelSearchReport */

// Lists every effect with the change of the criterion that it brings: the best model with the effect
// against the best model without it; null where one of the two could not be fitted.
/** @param {ModelSearchReport} search */
export function judged({ supported, tried }) {
  const names = [...new Set(tried.flatMap(({ effects }) => effects))];
  const best = (wanted) => Math.min(...tried.filter(wanted).map(({ bic }) => bic ?? Infinity));
  return names.map((name) => {
    const change =
      best(({ effects }) => effects.includes(name)) - best(({ effects }) => !effects.includes(name));
    return { name, supported: supported.includes(name), change: Number.isFinite(change) ? change : null };
  });
}

/** @param {ModelSearchReport} search */
export function effectsPart(search) {
  const lines = judged(search).map(({ name, supported, change }) =>
    h(
      "li",
      {},
      h("strong", {}, words(name)),
      supported ? ": supported" : ": not supported",
      change === null ? "" : ` (Schwarz's criterion ${criterionWords(change)})`,
    ),
  );
  const lowest = search.tried[0]?.bic ?? NaN;
  const outputs = Object.keys(search.tried[0]?.estimation ?? {});
  const columns = [
    { title: "Effects in the model" },
    { title: "Unknowns", numeric: true },
    { title: "Criterion above the best", numeric: true },
    ...outputs.map((output) => ({ title: `Fit of ${words(output)}`, numeric: true })),
  ];
  const rows = search.tried.map(({ effects, unknowns, bic, estimation, validation }) => [
    effects.map(words).join(", ") || "none of them",
    count(unknowns),
    bic === null || bic === undefined ? "could not be fitted" : number(bic - lowest, 3),
    ...outputs.map((output) => percent((validation[output] ?? estimation[output])?.fit_percent)),
  ]);
  return h(
    "div",
    {},
    h("h3", {}, "Effects that the data decided about"),
    h("ul", {}, lines),
    h(
      "details",
      {},
      h("summary", {}, `${count(rows.length)} models, compared on the ${search.compared_on} data`),
      table("Models that were fitted", columns, rows),
    ),
  );
}
