// Measured against simulated outputs and their residuals, an experiment after the other.

import { get } from "./api.js";
import { lineChart } from "./chart.js";
import { h, notice } from "./dom.js";
import { words } from "./format.js";

const POINTS = 2000;

export function trajectoryPanel(view, id) {
  const outcome = notice();
  const charts = h("div", {});
  const element = h("section", { "aria-label": "Outputs", hidden: true },
    h("h2", {}, "Measured and simulated"), outcome.place, charts,
    h("p", {}, h("a", { href: `/v1/jobs/${id}/report` }, "The report on one page, for the file")));
  return {
    element,
    async load() {
      element.hidden = false;
      try {
        const { data } = await get(`/v1/jobs/${id}/trajectory?max_points=${POINTS}`, view.signal);
        const experiments = data.experiments ?? [data];
        charts.replaceChildren();
        experiments.forEach((experiment, k) => draw(charts, experiment, k, experiments.length));
      } catch (error) {
        outcome.fail(error);
      }
    },
  };
}

function draw(place, experiment, k, of) {
  if (of > 1) {
    place.append(h("h3", {}, `Experiment ${k + 1}: ${experiment.dataset}`));
  }
  for (const [name, output] of Object.entries(experiment.outputs)) {
    const time = { label: "time", unit: "s" };
    const value = { label: words(name), unit: output.unit };
    const compared = lineChart({
      title: `${words(name)}, measured and simulated`, x: time, y: value, height: 260,
      series: [{ name: "measured", look: "measured" }, { name: "simulated", look: "simulated" }],
    });
    const residual = lineChart({
      title: `${words(name)}, residual (measured − simulated)`, x: time,
      y: { label: "residual", unit: output.unit }, height: 160,
      series: [{ name: "residual", look: "second" }],
    });
    place.append(compared.element, residual.element);
    compared.set(experiment.time_s, [output.measured, output.simulated]);
    residual.set(experiment.time_s, [output.residual]);
  }
}
