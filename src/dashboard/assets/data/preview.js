// @ts-check
// A preview shows a signal as it was recorded, and as the steps of a recipe leave it, before any recording is made.

import { withGaps } from "../plot/math.js";
import { plot } from "../plot/plot.js";
import { recordedUnit } from "../plot/units.js";
import { get, query, send } from "../shell/api.js";
import { h, warningList } from "../shell/dom.js";
import { count, duration, words } from "../shell/format.js";
import { oddSpans } from "./plots.js";

const POINTS = 2000;

export class Preview {
  /**
   * @param {any} view
   * @param {any} dataset
   * @param {(signal: string) => void} onChoice hears which signal is to be shown
   */
  constructor(view, dataset, onChoice) {
    this.view = view;
    this.dataset = dataset;
    /** @type {ReturnType<typeof plot>[]} */
    this.charts = [];
    this.signal = h("select", { onchange: () => onChoice(this.signal.value) });
    this.body = h("div", { "aria-live": "polite" });
    this.element = h(
      "section",
      { "aria-label": "Preview", hidden: true },
      h("label", { class: "inline" }, "Signal", this.signal),
      this.body,
    );
  }

  /**
   * Asks what the steps would make, and shows a signal of it.
   *
   * @param {any[]} steps
   * @param {string} name
   */
  async show(steps, name) {
    // The address separates the names of signals by commas.
    const wanted = { signals: name.includes(",") ? null : name, max_points: POINTS };
    const recorded = this.dataset.signals.find((signal) => signal.name === name);
    const { signal: abort } = this.view;
    const address = `/v1/datasets/${this.dataset.id}`;
    const [{ data: made }, before] = await Promise.all([
      send(
        "POST",
        `${address}/prepared${query({ validate_only: true, ...wanted })}`,
        { steps },
        { signal: abort },
      ),
      recorded ? get(`${address}/samples${query(wanted)}`, abort) : null,
    ]);
    this.clear();
    this.element.hidden = false;
    this.signal.replaceChildren(
      ...made.signals.map((signal) =>
        h("option", { value: signal.name, selected: signal.name === name }, words(signal.name)),
      ),
    );
    this.body.replaceChildren(
      h("p", {}, `${count(made.samples)} samples over ${duration(made.duration_s)}. Nothing is stored yet.`),
      warningList(made.report.warnings) ?? "",
      before ? this.chart("recorded", this.dataset, name, before.data) : "",
      this.chart("prepared", made, name, made.thinned),
    );
  }

  /** @param {string} state @param {any} recording @param {string} name @param {any} samples */
  chart(state, recording, name, { time_s: time, signals }) {
    const signal = recording.signals.find((entry) => entry.name === name);
    const spans = oddSpans(recording, name);
    const chart = plot({
      title: `${words(name)}, ${state}`,
      height: 180,
      x: { label: "time", unit: "s" },
      y: { label: words(name), unit: signal.unit, recorded: recordedUnit(signal) },
      signal: this.view.signal,
      spans,
      series: [{ name: words(name), look: "first", step: signal.interpolation === "hold" }],
    });
    const gaps = spans.filter(({ kind }) => kind === "missing");
    const [times, values] = withGaps(time, signals[name].values, gaps);
    chart.set(times, [values]);
    this.charts.push(chart);
    return chart.element;
  }

  /** Takes the preview away: it is of other steps than the form has. */
  clear() {
    this.element.hidden = true;
    for (const chart of this.charts.splice(0)) {
      chart.destroy();
    }
  }
}
