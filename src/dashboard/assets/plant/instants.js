// @ts-check
// This module goes between the instants of the server, the seconds since 1970 that plots show, and the
// fields in which people choose an instant. The functions are pure.

import { secondsOf } from "../plot/clock.js";

export { secondsOf };

// The texts name the millisecond before and after an instant, so that a part between them is whole.
export const isoBefore = (seconds) => new Date(Math.floor(1000 * seconds + 1e-3)).toISOString();
export const isoAfter = (seconds) => new Date(Math.ceil(1000 * seconds - 1e-3)).toISOString();

// Gives the value of a field of the type datetime-local, which has the clock of the reader.
export function fieldText(seconds) {
  const date = new Date(Math.round(1000 * seconds));
  const local = new Date(date.getTime() - 60_000 * date.getTimezoneOffset());
  return local.toISOString().replace("Z", "");
}

// Reads a field of the type datetime-local; the answer is NaN where the field is empty.
export const fieldSeconds = (text) => new Date(text).getTime() / 1000;

// The part that the query of an address names with `from` and `to`; null where it names none.
/** @param {URLSearchParams} query @returns {[number, number] | null} */
export function partNamed(query) {
  const [from, to] = ["from", "to"].map((name) => secondsOf(query.get(name) ?? ""));
  return from < to ? [from, to] : null;
}

// The part has every sample of a stream: a part ends before the instant that it names as its end.
export function wholeOf({ first, last }) {
  return [Math.floor(1000 * secondsOf(first)) / 1000, (Math.floor(1000 * secondsOf(last)) + 1) / 1000];
}
