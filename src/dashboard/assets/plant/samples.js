// @ts-check
// This module reads the samples of a part of a stream. The functions are pure.

import { secondsOf } from "./instants.js";

// The server gives a signal no value at an instant that only a different signal has. Gives the instants
// and the values of a single signal.
export function columnOf({ start, samples }, name) {
  const times = [];
  const values = [];
  const origin = secondsOf(start);
  (samples?.time_s ?? []).forEach((time, k) => {
    const value = samples.signals[name]?.values[k] ?? null;
    if (value !== null) {
      times.push(origin + time);
      values.push(value);
    }
  });
  return [times, values];
}

// Gives the least, the greatest and the mean value over time of a column between two instants. A mean
// over time weighs a value by how long it holds.
/** @param {number[][]} column @param {number[]} part */
export function summaryOf([times, values], [from, to]) {
  const inside = times.flatMap((time, k) => (time >= from && time <= to ? [k] : []));
  if (inside.length === 0) {
    return { least: null, mean: null, greatest: null };
  }
  let [least, greatest, area] = [Infinity, -Infinity, 0];
  for (const [place, k] of inside.entries()) {
    least = Math.min(least, values[k]);
    greatest = Math.max(greatest, values[k]);
    if (place > 0) {
      area += ((values[k] + values[k - 1]) / 2) * (times[k] - times[k - 1]);
    }
  }
  const length = times[inside[inside.length - 1]] - times[inside[0]];
  return { least, mean: length > 0 ? area / length : values[inside[0]], greatest };
}

const MOST_POINTS = 100_000;
const MOST_VALUES = 2_000_000;

// Every answer has all signals of a stream, so a stream of many signals is asked for fewer instants.
export function pointsFor(signals, pixels) {
  const wanted = Math.max(10_000, 2 * signals * pixels);
  return Math.max(2, Math.min(MOST_POINTS, wanted, Math.floor(MOST_VALUES / Math.max(1, signals))));
}
