// @ts-check
// This module simulates a model under a recording, and plots the outputs, measured and simulated over
// each other.

import { PlotGroup } from "../plot/group.js";
import { nearest } from "../plot/math.js";
import { plot } from "../plot/plot.js";
import { get, query, send } from "../shell/api.js";
import { h } from "../shell/dom.js";
import { words } from "../shell/format.js";
import { simulationOf } from "./request.js";

const POINTS = 1500;

// Gives the measured outputs beside the simulated outputs, at the instants of the measured samples.
export async function comparedWith(spec, k, values, signal, states = {}) {
  const { dataset, signals = {}, window } = spec.experiments[k];
  const { data: simulated } = await send(
    "POST",
    `/v1/simulations${query({ max_points: POINTS })}`,
    simulationOf(spec, k, values, states),
    { signal },
  );
  const outputs = Object.keys(simulated.outputs).filter(
    (name) => signals[name] && !signals[name].includes(","),
  );
  const names = [...new Set(outputs.map((name) => signals[name]))];
  const part = { signals: names.join(","), from: window?.from_s, to: window?.to_s, max_points: POINTS };
  const { data: measured } = names.length
    ? await get(`/v1/datasets/${dataset}/samples${query(part)}`, signal)
    : { data: null };
  return outputs.map((name) => {
    const { unit, values: column } = simulated.outputs[name];
    const at = measured.time_s.map((time) => column[nearest(simulated.time_s, time)]);
    return { name, unit, xs: measured.time_s, columns: [measured.signals[signals[name]].values, at] };
  });
}

// The plots are made once; later outputs only change their columns.
export class ComparedPlots {
  constructor(signal) {
    this.signal = signal;
    this.plots = new Map();
    // The outputs have the same cursor, and begin at the same place.
    this.group = new PlotGroup({ full: null, signal });
    this.element = h("div", { class: "multiples broad" });
  }

  clear() {
    for (const chart of this.plots.values()) {
      chart.destroy();
    }
    this.plots.clear();
    this.group = new PlotGroup({ full: null, signal: this.signal });
    this.element.replaceChildren();
  }

  show(compared) {
    for (const { name, unit, xs, columns } of compared) {
      let drawn = this.plots.get(name);
      if (!drawn) {
        const measured = columns.length > 1;
        drawn = plot({
          title: `${words(name)}, ${measured ? "measured and " : ""}simulated`,
          height: 240,
          group: this.group,
          signal: this.signal,
          x: { label: "time", unit: "s" },
          y: { label: words(name), unit },
          series: [
            ...(measured ? [{ name: "measured", look: "measured" }] : []),
            { name: "simulated", look: "simulated" },
          ],
        });
        this.plots.set(name, drawn);
        this.element.append(drawn.element);
      }
      drawn.set(xs, columns);
    }
  }
}
