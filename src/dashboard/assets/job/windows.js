// @ts-check
// This module arranges the windows of a selection: where each window is, how much each window says by itself,
// and what came out, in words. Its functions are pure.

import { isoText, secondsOf } from "../plot/clock.js";
import { query } from "../shell/api.js";
import { count, number, quantity, words } from "../shell/format.js";
import { listed } from "./verdict.js";

const REASONS = {
  excluded: "to be left out, as was asked",
  no_samples: "no samples",
  gaps: "no samples in more than a tenth of it",
  too_many_samples: "more samples than can be looked at",
  inputs_stood_still: "no input moved",
  output_stood_still: "a sensor stood still",
  starts_elsewhere: "the model starts elsewhere than the first samples",
  not_usable: "the job cannot be worked on it",
  not_simulated: "the model cannot be simulated over it",
};

// Says why a window was left out.
export const reasonText = (reason) => REASONS[reason] ?? words(reason);

// The address of a stream's page, which shows the part between two instants first where these are given.
export function streamAddress(stream, from = null, to = null) {
  return `#/plant/streams/${encodeURIComponent(stream)}${query({ from, to })}`;
}

// How many windows of a length there are between two instants. The last window may be shorter.
export const windowsBetween = (from, to, length) =>
  Math.ceil((secondsOf(to) - secondsOf(from)) / length - 1e-9);

// Where a window begins and ends, in seconds since 1970.
/** @returns {[number, number]} */
export function spanOf({ from, to, window_s: length }, window) {
  const begin = secondsOf(from) + window * length;
  return [begin, Math.min(begin + length, secondsOf(to))];
}

// The window that has an instant, or the window that is nearest to the instant.
export function windowAt({ from, window_s: length, windows }, seconds) {
  const window = Math.floor((seconds - secondsOf(from)) / length + 1e-9);
  return Math.max(0, Math.min(windows.count - 1, window));
}

export function addressOfWindow(selection, window) {
  const [from, to] = spanOf(selection, window);
  return streamAddress(selection.stream, isoText(from), isoText(to));
}

// The least error that a single window leaves, or null where none fixes the parameter.
/** @param {(number | null)[]} errors @returns {number | null} */
function bestAlone(errors) {
  return errors.reduce((best, error) => (error > 0 && (best === null || error < best) ? error : best), null);
}

// How much each window says of a parameter by itself, as a share of what the best window says: information is
// the inverse of the squared error. A window that does not fix the parameter has the share 0.
/** @param {(number | null)[]} errors */
export function sharesOf(errors) {
  const best = bestAlone(errors);
  return errors.map((error) => (error > 0 ? (best / error) ** 2 : 0));
}

// Where one shade of the ribbon ends and the next begins, as shares of the best window's information.
export const SHADE_ENDS = [0.01, 0.1, 0.25, 0.5, 0.75];

export const shadeOf = (share) => SHADE_ENDS.filter((end) => share >= end).length;

export const LEFT_OUT = -1;

/**
 * The shades of a lane, pixel by pixel, over a range of seconds since 1970. A pixel that has many windows has the
 * shade of the window that says most; the pixel counts as left out where all its windows were left out. Gives
 * stretches of pixels of a single shade: `{ from, to, shade }`.
 *
 * @param {any} selection
 * @param {number[]} shares
 * @param {[number, number]} range
 * @param {number} pixels
 */
export function stretchesOf(selection, shares, [from, to], pixels) {
  const reasons = selection.windows.left_out;
  const step = (to - from) / pixels;
  /** @type {{ from: number, to: number, shade: number }[]} */
  const stretches = [];
  for (let pixel = 0; pixel < pixels; pixel += 1) {
    const [first, last] = windowsReaching(selection, from + pixel * step, from + (pixel + 1) * step);
    let shade = LEFT_OUT;
    for (let window = first; window <= last; window += 1) {
      if (!reasons[window]) {
        shade = Math.max(shade, shadeOf(shares[window]));
      }
    }
    const before = stretches.at(-1);
    if (before?.shade === shade) {
      before.to = pixel + 1;
    } else {
      stretches.push({ from: pixel, to: pixel + 1, shade });
    }
  }
  return stretches;
}

// The first and the last window that reach into a span of time.
function windowsReaching(selection, from, to) {
  const first = windowAt(selection, from);
  const reach = 1e-6 * selection.window_s;
  return [first, Math.max(first, windowAt(selection, to - reach))];
}

// The window that a pixel stands for, which may have many: a chosen window if there is one, else the window that
// says most.
/** @param {any} selection @param {number[]} shares @param {[number, number]} span */
export function windowUnder(selection, shares, [from, to]) {
  const [first, last] = windowsReaching(selection, from, to);
  const chosen = selection.chosen.find(({ window }) => window >= first && window <= last);
  if (chosen) {
    return chosen.window;
  }
  let strongest = first;
  for (let window = first; window <= last; window += 1) {
    strongest = shares[window] > shares[strongest] ? window : strongest;
  }
  return strongest;
}

// The window that a key leads to from another window; null where the key leads nowhere.
export function windowAfter({ windows, chosen }, window, key) {
  const places = chosen.map((entry) => entry.window);
  const last = windows.count - 1;
  const next = {
    ArrowRight: window + 1,
    ArrowLeft: window - 1,
    Home: 0,
    End: last,
    PageDown: places.find((place) => place > window),
    PageUp: places.findLast((place) => place < window),
  }[key];
  return next === undefined || next < 0 || next > last ? null : next;
}

// An error as a share of a value, or as a number where the value is zero.
/** @param {number | null} error @param {any} parameter */
export function errorText(error, { value, unit } = {}) {
  if (!(error > 0)) {
    return "not fixed";
  }
  return value ? `±\u00a0${shareText(error / value)}` : `±\u00a0${quantity(number(error, 2), unit)}`;
}

// Whole percents are written where a share is large.
function shareText(share) {
  const value = 100 * Math.abs(share);
  return `${value >= 100 ? count(Math.round(value)) : number(value, 2)}\u00a0%`;
}

// What is expected of a parameter: its estimate, and the errors with the chosen windows, with random windows and
// with all windows, in words.
export function expectationOf({ with_chosen: chosen, with_random: random, with_all: all }, name) {
  const entries = [chosen, random, all].map((parameters) =>
    parameters.find((parameter) => parameter.name === name),
  );
  const parameter = entries.find(Boolean);
  const [withChosen, withRandom, withAll] = entries.map((entry) =>
    errorText(entry?.total_standard_error ?? null, parameter),
  );
  return { parameter, chosen: withChosen, random: withRandom, all: withAll };
}

export const windowsText = (n, kind = "") =>
  `${count(n)} ${kind && `${kind} `}${n === 1 ? "window" : "windows"}`;

// How far a selection came. The last event has been sent a while ago, or there is none yet.
export function lookedText({ progress, spec }, latest) {
  const windows = latest?.windows ?? windowsBetween(spec.from, spec.to, spec.selection.window_s);
  const looked = Math.max(latest?.looked ?? 0, progress?.evaluations ?? 0);
  return `${count(looked)} of ${windowsText(windows)}`;
}

// The sentence that says what came out.
/** @param {any} selection */
export function conclusion(selection) {
  const { wanted, chosen, windows } = selection;
  const looked = windowsText(windows.count);
  return chosen.length === 0
    ? `None of ${looked} says enough of ${listed(wanted.map(({ name }) => name))}.`
    : `${count(chosen.length)} of ${looked} ${chosen.length === 1 ? "fixes" : "fix"} ${whatIsFixed(selection)}.`;
}

// Numbers of more parameters than these stand in the table alone.
const MOST_COMPARED = 3;

function whatIsFixed(selection) {
  const { wanted, chosen, reached, samples } = selection;
  const rows = wanted.map(({ name }) => ({ name, ...expectationOf(selection, name) }));
  const isFixed = ({ chosen: text }) => text.startsWith("±");
  const fixed = rows.filter(isFixed).map(({ name, chosen: text }) => `${words(name)} to ${text}`);
  const others = rows.filter((row) => !isFixed(row)).map(({ name }) => name);
  const judged =
    reached === null
      ? `, with ${count(samples)} samples`
      : `, ${reached ? "" : "not "}as closely as was asked`;
  const compared = (kind) => listed(rows.map((row) => row[kind]));
  return [
    fixed.length ? listed(fixed) : "nothing",
    others.length ? ` but not ${listed(others)}` : "",
    judged,
    rows.length > MOST_COMPARED
      ? ""
      : `; ${windowsText(chosen.length, "random")}: ${compared("random")}; all windows: ${compared("all")}`,
  ].join("");
}

// The title of a lane says how closely the best window fixes the parameter by itself.
export function laneTitle(selection, name) {
  const best = bestAlone(selection.windows.alone[name] ?? []);
  return best === null
    ? `${words(name)}: no window fixes it by itself`
    : `${words(name)}: the best window by itself ${errorText(best, expectationOf(selection, name).parameter)}`;
}

// What the picture says of a window in words.
export function windowText(selection, window, { text }) {
  const { windows, wanted, chosen } = selection;
  const [from, to] = spanOf(selection, window);
  const reason = windows.left_out[window];
  const errors = wanted.map(({ name }) => {
    const error = errorText(windows.alone[name]?.[window] ?? null, expectationOf(selection, name).parameter);
    return `${words(name)} ${error}`;
  });
  return [
    `${text(from)} to ${text(to)}`,
    `window ${count(window + 1)} of ${count(windows.count)}`,
    chosen.some((entry) => entry.window === window) && "chosen",
    reason ? `left out: ${reasonText(reason)}` : `by itself ${listed(errors)}`,
  ]
    .filter(Boolean)
    .join(" · ");
}
