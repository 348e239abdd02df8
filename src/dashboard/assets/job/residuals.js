// @ts-check
// The plots show how the residuals are spread, how they follow themselves and at which frequencies they
// are large, and where each start of the refinement ended.

import { plot } from "../plot/plot.js";
import { get } from "../shell/api.js";
import { h, notice } from "../shell/dom.js";
import { words } from "../shell/format.js";
import { residualTable, startTable } from "./tables.js";

export function residualsPart(view, job, result, model) {
  const outcome = notice();
  const place = h("div", {}, h("p", { class: "quiet" }, "Loading …"));
  get(`/v1/jobs/${job.id}/report?format=json`, view.signal)
    .then(({ data }) => {
      place.replaceChildren(
        ...data.residuals.map((series) => pictures(view, series, data.residuals.length > 1)),
      );
    })
    .catch((error) => {
      place.replaceChildren();
      outcome.fail(error);
    });
  return h("div", {}, residualTable(result.residuals, model), outcome.place, place);
}

function pictures(view, residual, several) {
  const title = `${words(residual.output)}${several ? `, experiment ${residual.experiment + 1}` : ""}`;
  const { signal } = view;
  const { from, width, counts } = residual.histogram;
  const spread = plot({
    title: `${title}: spread of the residuals`,
    height: 240,
    signal,
    x: { label: "measured − simulated", unit: residual.unit },
    y: { label: "residuals", unit: "" },
    series: [{ name: "residuals", look: "first", bars: true }],
  });
  const memory = plot({
    title: `${title}: autocorrelation`,
    height: 240,
    signal,
    x: { label: "lag", unit: "samples" },
    y: { label: "correlation", unit: "" },
    series: [
      { name: "correlation", look: "first", bars: true },
      { name: "white up to", legend: "limits of white", look: "faint" },
      { name: "and down to", legend: null, look: "faint" },
    ],
  });
  const spectrum = plot({
    title: `${title}: spectrum`,
    height: 240,
    signal,
    x: { label: "frequency", unit: "Hz" },
    y: { label: "power density", unit: `${residual.unit}²/Hz`, log: true },
    series: [{ name: "power density", look: "second" }],
  });
  spread.set(
    counts.map((_, k) => from + (k + 0.5) * width),
    [counts],
  );
  const lags = residual.autocorrelation.map((_, k) => k + 1);
  memory.set(lags, [
    residual.autocorrelation,
    lags.map(() => residual.white_within),
    lags.map(() => -residual.white_within),
  ]);
  spectrum.set(
    residual.spectrum.map(([hz]) => hz),
    [residual.spectrum.map(([, power]) => power)],
  );
  return h(
    "div",
    {},
    h("div", { class: "multiples" }, spread.element, memory.element, spectrum.element),
    h(
      "p",
      { class: "quiet" },
      "White residuals have no memory and a flat spectrum. A peak in the spectrum is where the model misses dynamics.",
    ),
  );
}

export function startsPart(view, starts, states) {
  const ended = starts.filter(({ cost }) => Number.isFinite(cost)).sort((a, b) => a.cost - b.cost);
  const waterfall = plot({
    title: "Cost where each start of the refinement ended",
    height: 240,
    signal: view.signal,
    x: { label: "start, best first", unit: "" },
    y: { label: "cost", unit: "", log: ended.every(({ cost }) => cost > 0) },
    series: [
      { name: "at the end", look: "first", dots: true },
      { name: "at the start", look: "measured", dots: true },
    ],
  });
  waterfall.set(
    ended.map((_, k) => k + 1),
    [ended.map(({ cost }) => cost), ended.map(({ initial_cost: cost }) => cost)],
  );
  return h(
    "div",
    {},
    waterfall.element,
    h(
      "p",
      { class: "quiet" },
      "A step at the left that several starts share is a minimum that was found more than once; a single point below the others is one that may not be the lowest.",
    ),
    startTable(starts, states),
  );
}
