// @ts-check
// The trial shows the response of a model under a step or a recording while its text is edited, with a
// slider for each parameter.

import { get, items, query, send } from "../shell/api.js";
import { h, notice } from "../shell/dom.js";
import { numberOf, unitText, words } from "../shell/format.js";
import { excitationOf, STEP_SAMPLES, stepOf } from "./excitation.js";
import { describedBy } from "./language.js";
import { parameterRows } from "./parameters.js";
import { suggestSignals } from "./signals.js";
import { ComparedPlots, comparedWith } from "./simulation.js";
import { slider, start } from "./sliders.js";

export function trialPart(view, changed) {
  const outcome = notice();
  const source = h(
    "select",
    {
      "aria-label": "Driven by",
      onchange: () => {
        state.shape = "";
        changed();
      },
    },
    h("option", { value: "" }, "a step of each input"),
  );
  const duration = h("input", { type: "text", inputmode: "decimal", size: "6", onchange: () => changed() });
  const wiring = h("div", { class: "fields" });
  const sliders = h("div", { class: "sliders" });
  const compared = new ComparedPlots(view.signal);
  const state = {
    shape: "",
    rows: "",
    levels: /** @type {Record<string, number>} */ ({}),
    signals: {},
    values: {},
    datasets: new Map(),
    drawn: "",
  };
  const length = h("label", {}, "Duration, s", duration);
  const element = h(
    "section",
    { "aria-label": "Response" },
    h("h2", {}, "Response"),
    h("div", { class: "fields" }, h("label", {}, "Driven by", source), length),
    wiring,
    sliders,
    outcome.place,
    compared.element,
  );
  get("/v1/datasets?limit=200", view.signal)
    .then(({ data }) => {
      for (const dataset of items(data)) {
        state.datasets.set(dataset.id, dataset);
        source.append(h("option", { value: dataset.id }, dataset.name || dataset.id));
      }
      const dataset = view.query.get("dataset");
      if (state.datasets.has(dataset)) {
        source.value = dataset;
        changed();
      }
    })
    .catch((error) => outcome.fail(error));

  // The fields follow the names of the document, and stay as they are while the names do.
  const wire = (about) => {
    const dataset = state.datasets.get(source.value);
    length.hidden = Boolean(dataset);
    const shape = JSON.stringify([source.value, about.inputs, dataset ? about.outputs : []]);
    if (shape === state.shape) {
      return;
    }
    state.shape = shape;
    if (!dataset) {
      const { inputs, seconds, after } = excitationOf(about);
      duration.value ||= String(seconds);
      wiring.replaceChildren(
        ...inputs.map(({ name, unit }) =>
          h(
            "label",
            {},
            `${words(name)}, ${unitText(unit)}`,
            h("input", {
              type: "text",
              inputmode: "decimal",
              size: "8",
              value: String(state.levels[name] ?? after[name]),
              onchange: (event) => {
                const level = numberOf(event.target.value);
                state.levels[name] = Number.isFinite(level) ? level : after[name];
                changed();
              },
            }),
          ),
        ),
      );
      return;
    }
    state.signals = suggestSignals(about, dataset.signals).signals;
    wiring.replaceChildren(
      ...[...about.inputs, ...about.outputs].map(({ name }) =>
        h(
          "label",
          {},
          `Signal for ${words(name)}`,
          h(
            "select",
            {
              onchange: (event) => {
                const { [name]: _, ...rest } = state.signals;
                state.signals = event.target.value ? { ...rest, [name]: event.target.value } : rest;
                changed();
              },
            },
            h("option", { value: "" }, "–"),
            dataset.signals.map((signal) =>
              h(
                "option",
                { value: signal.name, selected: state.signals[name] === signal.name },
                `${words(signal.name)} [${unitText(signal.unit)}]`,
              ),
            ),
          ),
        ),
      ),
    );
  };
  const slide = (about) => {
    const rows = parameterRows(about).filter(({ lower, upper }) => lower < upper);
    const key = JSON.stringify(
      rows.map(({ about: parameter, lower, upper, scale }) => [
        parameter.name,
        parameter.default,
        lower,
        upper,
        scale,
      ]),
    );
    if (key !== state.rows) {
      state.rows = key;
      state.values = Object.fromEntries(rows.map((row) => [row.about.name, start(row)]));
      sliders.replaceChildren(...rows.map((row) => slider(row, state.values, () => changed())));
    }
  };
  return {
    element,
    // The experiment has the recording that drives the model, and its signals; the next job begins with
    // it.
    experiment: () => (source.value ? { dataset: source.value, signals: state.signals } : null),
    fail: (error) => outcome.fail(error),
    // Simulates a document, or a model by its name; a refusal of the server is thrown.
    async run(model, signal, about = describedBy(model)) {
      wire(about);
      slide(about);
      // A model whose inputs the recording does not all drive is simulated under a step.
      const undriven = source.value
        ? excitationOf(about)
            .inputs.filter(({ name }) => !state.signals[name])
            .map(({ name }) => words(name))
        : [];
      const shown =
        source.value && undriven.length === 0
          ? await comparedWith(
              { model, parameters: {}, experiments: [{ dataset: source.value, signals: state.signals }] },
              0,
              state.values,
              signal,
            )
          : await stepped(model, about, signal);
      const drawn = JSON.stringify(shown.map(({ name, unit, columns }) => [name, unit, columns.length]));
      if (drawn !== state.drawn) {
        state.drawn = drawn;
        compared.clear();
      }
      compared.show(shown);
      undriven.length
        ? outcome.show(
            h(
              "p",
              { class: "quiet" },
              `Choose the signal for ${undriven.join(", ")}; until then each input is a step.`,
            ),
          )
        : outcome.clear();
    },
  };

  async function stepped(model, about, signal) {
    const excitation = excitationOf(about);
    const seconds = numberOf(duration.value);
    const inputs = stepOf({
      ...excitation,
      after: { ...excitation.after, ...state.levels },
      seconds: seconds > 0 ? seconds : excitation.seconds,
    });
    const parameters = Object.fromEntries(
      Object.entries(state.values).map(([name, value]) => [name, { value }]),
    );
    const { data } = await send(
      "POST",
      `/v1/simulations${query({ max_points: STEP_SAMPLES })}`,
      { model, inputs, parameters, initial_state: excitation.state },
      { signal },
    );
    return Object.entries(data.outputs).map(([name, { unit, values }]) => ({
      name,
      unit,
      xs: data.time_s,
      columns: [values],
    }));
  }
}
