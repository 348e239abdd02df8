// @ts-check
// Likelihood profiles show how far the sum of squares rises as an estimate is held at another value and
// all other estimates are fitted again.

import { profileCurve } from "../plot/math.js";
import { plot } from "../plot/plot.js";
import { h } from "../shell/dom.js";
import { labelOf } from "./unknowns.js";

/**
 * Lists the estimates of a result that have a profile.
 *
 * @param {any} result
 */
export function profiled(result) {
  return [...(result.parameters ?? []), ...(result.initial_states ?? [])].filter(
    ({ profile = [] }) => profile.length > 2,
  );
}

export function profilesPart(view, result) {
  const charts = profiled(result).map((estimate) => {
    const { unit, profile } = estimate;
    const label = labelOf(estimate);
    const chart = plot({
      title: label,
      height: 220,
      signal: view.signal,
      x: { label, unit },
      y: { label: "rise", unit: "" },
      series: [
        { name: "rise of the sum of squares", look: "first" },
        { name: "fits", look: "measured", dots: true },
        { name: "95 %", look: "faint" },
      ],
    });
    const points = profileCurve(profile);
    chart.set(
      points.map(([value]) => value),
      [points.map(([, rise]) => rise), points.map(([, , fit]) => fit), points.map(() => 1)],
    );
    return chart.element;
  });
  return h(
    "div",
    {},
    h(
      "p",
      { class: "quiet" },
      "All other estimates are fitted again while this one is held (dots). The interval ends where the curve reaches 1; a parabola means that it is symmetric, a side that stays low that the data leave it open.",
    ),
    h("div", { class: "multiples" }, charts),
  );
}
