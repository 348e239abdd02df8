// @ts-check
// This module has the units that people read values in. All values from the server are SI; a reader may
// choose another unit for a quantity, and the choice then holds for every plot and is kept in the
// browser.

import { described } from "../shell/description.js";

const STORED = "greybox.units";

// The server says which units each SI unit can be read in, as { name, factor, offset }: a value in SI is
// the factor times the value in the unit, plus the offset. SI alone can be chosen until it has answered.
let table = {};
let isAsked = false;

function readTable() {
  if (isAsked) {
    return;
  }
  isAsked = true;
  described().then(
    (description) => {
      const units = Object.entries(description["x-units"]);
      table = Object.fromEntries(units.map(([unit, choices]) => [plain(unit), choices]));
      tell();
    },
    () => {
      isAsked = false;
    },
  );
}

// Writes a unit in a single form: `m^3/s`, `m³/s` and `m3/s` are the same unit.
export function plain(unit) {
  return (unit ?? "").replaceAll("²", "2").replaceAll("³", "3").replaceAll("^", "").replaceAll("·", "*");
}

// Gives the units that a quantity can be shown in: the one that it was recorded in, then SI and what else
// the server offers. A difference of temperatures has no zero, so it stays in kelvin.
export function choices(unit, { difference = false, recorded = null } = {}) {
  const offered = table[plain(unit)] ?? [{ name: unit ?? "", factor: 1, offset: 0 }];
  const same = ({ factor, offset }) => factor === recorded?.factor && offset === recorded?.offset;
  const first = offered.find(same) ?? recorded;
  const units = first ? [first, ...offered.filter((other) => other !== first)] : offered;
  return units.filter(({ offset }) => !(difference && offset));
}

// The unit that a signal was recorded in; null where the server does not say how it is converted.
export function recordedUnit(signal) {
  const { recorded_unit: name, conversion } = signal ?? {};
  return name && conversion ? { name, ...conversion } : null;
}

// A gap (null) stays a gap, and a missing sample (undefined) stays missing.
export const toShown = (value, { factor, offset }) =>
  value === null || value === undefined ? value : (value - offset) / factor;

let preferred = read();
const watchers = new Set();

function read() {
  try {
    return JSON.parse(localStorage.getItem(STORED)) ?? {};
  } catch {
    return {};
  }
}

// Gives the unit that the reader has chosen, and where there is no choice the unit of the recording or SI.
export function shownUnit(unit, options = {}) {
  const possible = choices(unit, options);
  return possible.find(({ name }) => name === preferred[plain(unit)]) ?? possible[0];
}

export function prefer(unit, name) {
  preferred = { ...preferred, [plain(unit)]: name };
  try {
    localStorage.setItem(STORED, JSON.stringify(preferred));
  } catch {
    // A browser that stores nothing still shows the choice until the reader leaves the page.
  }
  tell();
}

const CLOCK = "time axis";

// Whether time axes show the clock of the recording, where it has one, and not the seconds since its first
// sample.
export const showsClock = () => preferred[CLOCK] !== "seconds";

export const preferClock = (clock) => prefer(CLOCK, clock ? "clock" : "seconds");

function tell() {
  for (const watcher of watchers) {
    watcher();
  }
}

// Calls `watcher` at every choice, and when the server has said what can be chosen, until the signal is
// aborted.
export function onUnits(watcher, signal) {
  readTable();
  watchers.add(watcher);
  signal?.addEventListener("abort", () => watchers.delete(watcher), { once: true });
}
