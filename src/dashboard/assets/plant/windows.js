// @ts-check
// This module shows the windows of a monitor: plots of each parameter with its interval and the alarms,
// and a table that leads to the job of each window.

import { trustBadge } from "../list/rows.js";
import { PlotGroup } from "../plot/group.js";
import { plot } from "../plot/plot.js";
import { h, table } from "../shell/dom.js";
import { timeSpan, unitText, withError, words } from "../shell/format.js";
import { stateBadge } from "./head.js";
import { alarmSpans, estimateOf, parametersOf, rangeOfWindows, trendOf } from "./trend.js";

const FIRST_COLUMNS = [
  { title: "Window", numeric: true },
  { title: "Span" },
  { title: "State" },
  { title: "Trust" },
];
const LAST_COLUMNS = [{ title: "Search" }, { title: "Recording" }, { title: "Remark" }];

// A search goes on from the estimate of the window before, or begins anew.
const START_WORDS = { cold: "anew", warm: "went on" };

export class TrendPlots {
  constructor(view) {
    this.view = view;
    this.group = new PlotGroup({ full: null, signal: view.signal });
    this.charts = new Map();
    this.empty = h("p", { class: "quiet" }, "Nothing was estimated yet.");
    this.place = h("div", { class: "pair" });
    this.group.toolbar.hidden = true;
    this.element = h("div", {}, this.empty, this.group.toolbar, this.place);
  }

  show(windows, alarms) {
    const parameters = parametersOf(windows);
    this.empty.hidden = parameters.length > 0;
    this.group.toolbar.hidden = parameters.length === 0;
    if (windows.length > 0) {
      this.group.full = rangeOfWindows(windows);
    }
    for (const { name, unit } of parameters) {
      const chart = this.chart(name, unit);
      const { times, columns } = trendOf(windows, name);
      chart.setSpans(alarmSpans(alarms, windows, name));
      chart.set(times, columns);
    }
  }

  chart(name, unit) {
    if (!this.charts.has(name)) {
      const chart = plot({
        title: words(name),
        height: 240,
        x: { label: "time", clock: true },
        y: { label: words(name), unit },
        group: this.group,
        signal: this.view.signal,
        series: [
          { name: words(name), look: "first", dots: true },
          { name: "from", look: "first", bare: true },
          { name: "to", look: "first", bare: true },
        ],
        whiskers: [{ lower: 1, upper: 2, look: "first" }],
      });
      this.charts.set(name, chart);
      this.place.append(chart.element);
    }
    return this.charts.get(name);
  }
}

// The newest window stands first.
export function windowTable(windows) {
  const parameters = parametersOf(windows);
  const columns = [
    ...FIRST_COLUMNS,
    ...parameters.map(({ name, unit }) => ({
      title: unit === "1" ? words(name) : `${words(name)} [${unitText(unit)}]`,
      numeric: true,
    })),
    ...LAST_COLUMNS,
  ];
  return h(
    "div",
    { class: "on-a-line" },
    table(
      "Windows",
      columns,
      windows.toReversed().map((window) => windowRow(window, parameters)),
      { empty: "No window was worked yet.", stacked: true },
    ),
  );
}

// The number of a window leads to its job, where it has one.
export function windowLink({ number, job }) {
  return job
    ? h("a", { href: `#/jobs/${job}`, title: `Job of window ${number}` }, `job ${number}`)
    : String(number);
}

function windowRow(window, parameters) {
  const { number, from, to, status, reason, dataset, trust, doubts, start } = window;
  return [
    windowLink(window),
    timeSpan(from, to),
    stateBadge(status),
    trust ? trustBadge(trust) : "–",
    ...parameters.map(({ name }) => estimateText(estimateOf(window, name))),
    START_WORDS[start] ?? "–",
    dataset
      ? h(
          "a",
          { href: `#/datasets/${dataset}`, title: `Recording of window ${number}` },
          `recording ${number}`,
        )
      : "–",
    [reason, ...doubts.map(words)].filter(Boolean).join(", "),
  ];
}

// The error counts what was taken as known, where that is told.
function estimateText(estimate) {
  if (!estimate) {
    return "–";
  }
  const error = estimate.total_standard_error ?? estimate.standard_error;
  return withError(estimate.estimate, error ?? NaN).join(" ± ");
}
