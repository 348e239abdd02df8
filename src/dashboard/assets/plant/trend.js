// @ts-check
// This module arranges what a monitor has estimated: each parameter over the windows, and where alarms
// stand. The functions are pure.

import { secondsOf } from "./instants.js";

// Lists the parameters of the windows with their units, in the order in which they first came.
export function parametersOf(windows) {
  const units = new Map();
  for (const { parameters } of windows) {
    for (const { name, unit } of parameters) {
      units.has(name) || units.set(name, unit);
    }
  }
  return [...units].map(([name, unit]) => ({ name, unit }));
}

export const estimateOf = (window, name) => window.parameters.find((parameter) => parameter.name === name);

// The interval with all that was taken as known stands for an estimate; where there is none, the
// interval of the data alone does.
export function intervalOf(estimate) {
  const { lower = null, upper = null } = estimate?.total_interval ?? estimate?.confidence_interval ?? {};
  return [lower, upper];
}

// Gives the middle of each window, and the estimate with the ends of its interval there.
export function trendOf(windows, name) {
  const columns = windows.map((window) => {
    const estimate = estimateOf(window, name);
    return [estimate?.estimate ?? null, ...intervalOf(estimate)];
  });
  const column = (place) => columns.map((values) => values[place]);
  const middles = windows.map(({ from, to }) => (secondsOf(from) + secondsOf(to)) / 2);
  return { times: middles, columns: [column(0), column(1), column(2)] };
}

// An alarm about a parameter stands in the plot of that parameter, an alarm about a window in all plots.
export function alarmSpans(alarms, windows, name) {
  const byNumber = new Map(windows.map((window) => [window.number, window]));
  return alarms.flatMap(({ window: number, change }) => {
    const window = byNumber.get(number);
    return window && (!change || change.parameter === name)
      ? [{ from: secondsOf(window.from), to: secondsOf(window.to), kind: "alarm" }]
      : [];
  });
}

// The range of all windows has a little room at both ends.
export function rangeOfWindows(windows) {
  const from = Math.min(...windows.map((window) => secondsOf(window.from)));
  const to = Math.max(...windows.map((window) => secondsOf(window.to)));
  const room = 0.02 * (to - from);
  return [from - room, to + room];
}

// Puts newer states of windows in the place of former states, the oldest window first.
export function mergedWindows(before, newer) {
  const all = new Map([...before, ...newer].map((window) => [window.number, window]));
  return [...all.values()].sort((a, b) => a.number - b.number);
}
