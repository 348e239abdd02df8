// @ts-check
// This module has the units that people read values in. All values from the server are SI; a reader may
// choose another unit for a quantity, and the choice then holds for every plot and is kept in the
// browser.

const STORED = "greybox.units";

// Each SI unit has the units that can be chosen for it, as [name, factor, offset]: a value in SI is the
// factor times the value in the unit, plus the offset.
const CHOICES = {
  Pa: [
    ["Pa", 1],
    ["kPa", 1e3],
    ["bar", 1e5],
    ["MPa", 1e6],
    ["psi", 6894.757293168],
  ],
  K: [
    ["K", 1],
    ["°C", 1, 273.15],
  ],
  m: [
    ["m", 1],
    ["cm", 1e-2],
    ["mm", 1e-3],
    ["µm", 1e-6],
  ],
  "m/s": [
    ["m/s", 1],
    ["mm/s", 1e-3],
    ["m/min", 1 / 60],
    ["km/h", 1 / 3.6],
  ],
  m2: [
    ["m²", 1],
    ["cm²", 1e-4],
    ["mm²", 1e-6],
  ],
  m3: [
    ["m³", 1],
    ["l", 1e-3],
    ["cm³", 1e-6],
  ],
  "m3/s": [
    ["m³/s", 1],
    ["l/s", 1e-3],
    ["l/min", 1e-3 / 60],
    ["m³/h", 1 / 3600],
  ],
  "kg/s": [
    ["kg/s", 1],
    ["kg/min", 1 / 60],
    ["kg/h", 1 / 3600],
    ["t/h", 1 / 3.6],
  ],
  rad: [
    ["rad", 1],
    ["°", Math.PI / 180],
    ["rev", 2 * Math.PI],
  ],
  "rad/s": [
    ["rad/s", 1],
    ["°/s", Math.PI / 180],
    ["rpm", Math.PI / 30],
  ],
  N: [
    ["N", 1],
    ["kN", 1e3],
  ],
  W: [
    ["W", 1],
    ["kW", 1e3],
    ["MW", 1e6],
  ],
  V: [
    ["V", 1],
    ["mV", 1e-3],
  ],
  A: [
    ["A", 1],
    ["mA", 1e-3],
  ],
  s: [
    ["s", 1],
    ["ms", 1e-3],
    ["min", 60],
    ["h", 3600],
  ],
};

// Writes a unit in a single form: `m^3/s`, `m³/s` and `m3/s` are the same unit.
export function plain(unit) {
  return (unit ?? "").replaceAll("²", "2").replaceAll("³", "3").replaceAll("^", "").replaceAll("·", "*");
}

// Gives the units that a quantity can be shown in, SI first. A difference of temperatures has no zero,
// so it stays in kelvin.
export function choices(unit, difference = false) {
  const units = CHOICES[plain(unit)] ?? [[unit ?? "", 1]];
  return units
    .filter(([, , offset]) => !(difference && offset))
    .map(([name, factor, offset = 0]) => ({ name, factor, offset }));
}

// A gap (null) stays a gap, and a missing sample (undefined) stays missing.
export const toShown = (value, { factor, offset }) =>
  value === null || value === undefined ? value : (value - offset) / factor;
export const toSi = (value, { factor, offset }) => value * factor + offset;

let preferred = read();
const watchers = new Set();

function read() {
  try {
    return JSON.parse(localStorage.getItem(STORED)) ?? {};
  } catch {
    return {};
  }
}

// Gives the unit that the reader has chosen, SI where there is no choice.
export function shownUnit(unit, difference = false) {
  const possible = choices(unit, difference);
  return possible.find(({ name }) => name === preferred[plain(unit)]) ?? possible[0];
}

export function prefer(unit, name) {
  preferred = { ...preferred, [plain(unit)]: name };
  try {
    localStorage.setItem(STORED, JSON.stringify(preferred));
  } catch {
    // A browser that stores nothing still shows the choice until the reader leaves the page.
  }
  for (const watcher of watchers) {
    watcher();
  }
}

// Calls `watcher` at every choice until the signal is aborted.
export function onUnits(watcher, signal) {
  watchers.add(watcher);
  signal?.addEventListener("abort", () => watchers.delete(watcher), { once: true });
}
