// @ts-check
// The samples of a recording are plotted over a common time, shaded where they are odd.

import { clockOf } from "../plot/clock.js";
import { PlotGroup } from "../plot/group.js";
import { withGaps } from "../plot/math.js";
import { plot } from "../plot/plot.js";
import { recordedUnit } from "../plot/units.js";
import { get, query } from "../shell/api.js";
import { h } from "../shell/dom.js";
import { words } from "../shell/format.js";
import { isAbsence } from "./marks.js";

// Plots signals over a common time and shades what the quality report says about them. `onBrush` hears of what is
// dragged and clicked with the name of the signal.
export function signalPlots({ view, dataset, names, failed, onBrush = null, height = 220 }) {
  // The address separates the names of signals by commas, so a name with a comma in it can only be had
  // by asking for all signals.
  const signals = names.some((name) => name.includes(",")) ? null : names.join(",");
  const group = new PlotGroup({
    full: [0, dataset.duration_s],
    clock: clockOf(dataset),
    signal: view.signal,
    failed,
    load: async (from, to, pixels, abort) => {
      const points = { max_points: Math.min(100_000, 2 * names.length * pixels) };
      return (
        await get(`/v1/datasets/${dataset.id}/samples${query({ signals, from, to, ...points })}`, abort)
      ).data;
    },
  });
  const drawn = names.map((name) => {
    const signal = dataset.signals.find((signal) => signal.name === name);
    const chart = plot({
      title: words(name),
      height,
      x: { label: "time", unit: "s" },
      y: { label: words(name), unit: signal.unit, recorded: recordedUnit(signal) },
      onBrush: onBrush && {
        active: onBrush.active,
        take: (part) => onBrush.take(part, name),
        sample: (x) => onBrush.sample(x, name),
        end: (side, x) => onBrush.end(side, x, name),
      },
      group,
      signal: view.signal,
      spans: oddSpans(dataset, name),
      series: [{ name: words(name), look: "first", step: signal.interpolation === "hold" }],
    });
    const gaps = oddSpans(dataset, name).filter(({ kind }) => kind === "missing");
    group.feed(chart, ({ time_s: time, signals: columns }) => {
      const [times, values] = withGaps(time, columns[name].values, gaps);
      return [times, [values]];
    });
    return { name, chart };
  });
  return {
    group,
    drawn,
    ready: group.start(),
    element: h(
      "div",
      {},
      group.toolbar,
      drawn.map(({ chart }) => chart.element),
    ),
  };
}

// Gives the spans in which the quality report finds a signal odd.
export function oddSpans(dataset, name) {
  const about = (dataset.report?.warnings ?? []).filter(
    ({ signal }) => signal === null || signal === undefined || signal === name,
  );
  return about.flatMap(({ code, spans }) =>
    (spans ?? []).map(({ from_s, to_s }) => ({
      from: from_s,
      to: to_s,
      kind: isAbsence(code) ? "missing" : "bad",
    })),
  );
}
