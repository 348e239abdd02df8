// @ts-check
// This part of the form simulates the model under the first recording before any job runs, with a
// slider for each unknown, and plots measured and simulated outputs over each other.

import { parameterRows } from "../model/parameters.js";
import { ComparedPlots, comparedWith } from "../model/simulation.js";
import { rounded, slider, start } from "../model/sliders.js";
import { h, notice } from "../shell/dom.js";

const WAIT_MS = 200;

export function tryPart(job) {
  const sliders = h("div", { class: "sliders" });
  const outcome = notice();
  const state = {
    model: null,
    values: {},
    timer: null,
    asking: null,
    compared: new ComparedPlots(job.view.signal),
    drawn: new Map(),
  };
  const take = h(
    "button",
    { type: "button", onclick: () => adopt() },
    "Look within a factor of three of these values",
  );
  const details = h(
    "details",
    { ontoggle: () => details.open && soon() },
    h("summary", {}, "Try values before the job: sliders"),
    h(
      "p",
      { class: "quiet" },
      "The model is simulated under the first experiment with the values of the sliders. Bring it near, then let the job do the rest.",
    ),
    sliders,
    h("div", { class: "actions" }, take),
    outcome.place,
    state.compared.element,
  );

  const soon = () => {
    clearTimeout(state.timer);
    state.timer = setTimeout(run, WAIT_MS);
  };
  const run = async () => {
    if (!details.open || !job.model || !job.spec.experiments?.length) {
      return;
    }
    state.asking?.abort();
    state.asking = new AbortController();
    job.view.signal.addEventListener("abort", () => state.asking.abort(), { once: true });
    try {
      state.compared.show(await comparedWith(job.spec, 0, state.values, state.asking.signal));
      outcome.clear();
    } catch (error) {
      outcome.fail(error);
    }
  };
  const adopt = () => {
    let { parameters = {} } = job.spec;
    for (const row of parameterRows(job.model, parameters).filter(({ free }) => free)) {
      const value = state.values[row.about.name];
      if (value > 0) {
        const estimate = {
          lower: rounded(Math.max(value / 3, row.about.minimum ?? 0)),
          upper: rounded(Math.min(value * 3, row.about.maximum ?? Infinity)),
          scale: row.scale,
        };
        parameters = {
          ...parameters,
          [row.about.name]: { ...(row.prior ? { prior: row.prior } : {}), estimate },
        };
      }
    }
    job.set({ ...job.spec, parameters });
  };
  return {
    element: details,
    draw() {
      const { model } = job;
      details.hidden = !model || !job.spec.experiments?.length;
      if (!model) {
        return;
      }
      if (state.model !== model.name) {
        Object.assign(state, { model: model.name, values: {}, drawn: new Map() });
        state.compared.clear();
      }
      const rows = parameterRows(model, job.spec.parameters).filter(({ free }) => free);
      const key = JSON.stringify(
        rows.map(({ about, lower, upper, scale }) => [about.name, lower, upper, scale]),
      );
      if (state.key !== key) {
        state.key = key;
        state.values = Object.fromEntries(
          rows.map((row) => [row.about.name, state.values[row.about.name] ?? start(row)]),
        );
        sliders.replaceChildren(...rows.map((row) => slider(row, state.values, soon)));
      }
      soon();
    },
  };
}
