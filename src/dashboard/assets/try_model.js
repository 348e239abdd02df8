// @ts-check
// A model under a recording before any job runs: a slider for each unknown, measured and simulated
// over each other.

import { get, query, send } from "./api.js";
import { h, notice } from "./dom.js";
import { number, words } from "./format.js";
import { parameterRows } from "./job_draft.js";
import { plot } from "./plot.js";
import { nearest } from "./plot_math.js";

const WAIT_MS = 200;
const STEPS = 1000;
const POINTS = 1500;

// What is simulated for an experiment with these values.
export function simulationOf(spec, k, values) {
  const { dataset, signals, window, initial_state: states = {} } = spec.experiments[k];
  const known = Object.fromEntries(Object.entries(states).filter(([, state]) => !(typeof state === "object" && "estimate" in state)));
  const said = { ...spec.parameters, ...spec.experiments[k].parameters };
  const fixed = Object.entries(said).filter(([, entry]) => "value" in entry).map(([name, { value }]) => [name, { value }]);
  const free = Object.entries(values).map(([name, value]) => [name, { value }]);
  return { model: spec.model, dataset, signals, ...(window ? { window } : {}), parameters: Object.fromEntries([...fixed, ...free]), initial_state: known };
}

// Measured outputs beside simulated ones, on the instants of what was measured.
export async function comparedWith(spec, k, values, signal) {
  const { dataset, signals = {}, window } = spec.experiments[k];
  const { data: simulated } = await send("POST", `/v1/simulations${query({ max_points: POINTS })}`, simulationOf(spec, k, values), { signal });
  const outputs = Object.keys(simulated.outputs).filter((name) => signals[name] && !signals[name].includes(","));
  const names = [...new Set(outputs.map((name) => signals[name]))];
  const part = { signals: names.join(","), from: window?.from_s, to: window?.to_s, max_points: POINTS };
  const { data: measured } = names.length ? await get(`/v1/datasets/${dataset}/samples${query(part)}`, signal) : { data: null };
  return outputs.map((name) => {
    const { unit, values: column } = simulated.outputs[name];
    const at = measured.time_s.map((time) => column[nearest(simulated.time_s, time)]);
    return { name, unit, xs: measured.time_s, columns: [measured.signals[signals[name]].values, at] };
  });
}

// Plots of what was compared, made once and then only given other numbers.
export class ComparedPlots {
  constructor(signal) {
    this.signal = signal;
    this.plots = new Map();
    this.element = h("div", {});
  }

  clear() {
    this.plots.forEach((drawn) => drawn.destroy());
    this.plots.clear();
    this.element.replaceChildren();
  }

  show(compared) {
    for (const { name, unit, xs, columns } of compared) {
      let drawn = this.plots.get(name);
      if (!drawn) {
        const measured = columns.length > 1;
        drawn = plot({ title: `${words(name)}, ${measured ? "measured and " : ""}simulated`, height: 200, signal: this.signal, x: { label: "time", unit: "s" },
          y: { label: words(name), unit }, series: [...(measured ? [{ name: "measured", look: "measured" }] : []), { name: "simulated", look: "simulated" }] });
        this.plots.set(name, drawn);
        this.element.append(drawn.element);
      }
      drawn.set(xs, columns);
    }
  }
}

export function tryPart(job) {
  const sliders = h("div", { class: "sliders" });
  const outcome = notice();
  const state = { model: null, values: {}, timer: null, asking: null, compared: new ComparedPlots(job.view.signal), drawn: new Map() };
  const take = h("button", { type: "button", onclick: () => adopt() }, "Look within a factor of three of these values");
  const details = h("details", { ontoggle: () => details.open && soon() }, h("summary", {}, "Try values before the job: sliders"),
    h("p", { class: "quiet" }, "The model is simulated under the first experiment with the values of the sliders. Bring it near, then let the job do the rest."),
    sliders, h("div", { class: "actions" }, take), outcome.place, state.compared.element);

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
        const estimate = { lower: rounded(Math.max(value / 3, row.about.minimum ?? 0)), upper: rounded(Math.min(value * 3, row.about.maximum ?? Infinity)), scale: row.scale };
        parameters = { ...parameters, [row.about.name]: { ...(row.prior ? { prior: row.prior } : {}), estimate } };
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
      const key = JSON.stringify(rows.map(({ about, lower, upper, scale }) => [about.name, lower, upper, scale]));
      if (state.key !== key) {
        state.key = key;
        state.values = Object.fromEntries(rows.map((row) => [row.about.name, state.values[row.about.name] ?? start(row)]));
        sliders.replaceChildren(...rows.map((row) => slider(row, state.values, soon)));
      }
      soon();
    },
  };
}

const rounded = (value) => Number(value.toPrecision(4));

// Where the slider of a row begins.
export function start({ about, lower, upper }) {
  return about.default >= lower && about.default <= upper ? about.default : lower > 0 ? Math.sqrt(lower * upper) : (lower + upper) / 2;
}

// A slider over a row's range that puts its value among `values`.
export function slider({ about, lower, upper, scale }, values, moved) {
  const log = scale === "log" && lower > 0;
  const place = (value) => STEPS * (log ? Math.log(value / lower) / Math.log(upper / lower) : (value - lower) / (upper - lower));
  const value = (at) => (log ? lower * (upper / lower) ** (at / STEPS) : lower + (upper - lower) * (at / STEPS));
  const shown = h("output", {});
  const say = () => {
    shown.textContent = `${number(values[about.name], 4)} ${about.unit === "1" ? "" : about.unit}`;
    input.setAttribute("aria-valuetext", shown.textContent);
  };
  const input = h("input", { type: "range", min: "0", max: String(STEPS), value: String(Math.round(place(values[about.name]))), oninput: () => {
    values[about.name] = rounded(value(Number(input.value)));
    say();
    moved();
  } });
  say();
  return h("label", {}, h("span", {}, words(about.name), " ", shown), input);
}
