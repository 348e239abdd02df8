// @ts-check
// The units that people read values in. Everything that comes from the server is SI; a reader may
// choose another unit for a quantity, which then holds for every plot and is kept in the browser.

const STORED = "greybox.units";

// By SI unit: what can be chosen instead, as [name, SI value of one, SI value of zero].
const CHOICES = {
  "Pa": [["Pa", 1], ["kPa", 1e3], ["bar", 1e5], ["MPa", 1e6], ["psi", 6894.757293168]],
  "K": [["K", 1], ["°C", 1, 273.15]],
  "m": [["m", 1], ["cm", 1e-2], ["mm", 1e-3], ["µm", 1e-6]],
  "m/s": [["m/s", 1], ["mm/s", 1e-3], ["m/min", 1 / 60], ["km/h", 1 / 3.6]],
  "m2": [["m²", 1], ["cm²", 1e-4], ["mm²", 1e-6]],
  "m3": [["m³", 1], ["l", 1e-3], ["cm³", 1e-6]],
  "m3/s": [["m³/s", 1], ["l/s", 1e-3], ["l/min", 1e-3 / 60], ["m³/h", 1 / 3600]],
  "kg/s": [["kg/s", 1], ["kg/min", 1 / 60], ["kg/h", 1 / 3600], ["t/h", 1 / 3.6]],
  "rad": [["rad", 1], ["°", Math.PI / 180], ["rev", 2 * Math.PI]],
  "rad/s": [["rad/s", 1], ["°/s", Math.PI / 180], ["rpm", Math.PI / 30]],
  "N": [["N", 1], ["kN", 1e3]],
  "W": [["W", 1], ["kW", 1e3], ["MW", 1e6]],
  "V": [["V", 1], ["mV", 1e-3]],
  "A": [["A", 1], ["mA", 1e-3]],
  "s": [["s", 1], ["ms", 1e-3], ["min", 60], ["h", 3600]],
};

// The same unit however it is written: `m^3/s`, `m³/s` and `m3/s` are one.
export function plain(unit) {
  return (unit ?? "").replaceAll("²", "2").replaceAll("³", "3").replaceAll("^", "").replaceAll("·", "*");
}

// The units that a quantity can be shown in, SI first. A difference of temperatures has no zero of
// its own, so that it stays in kelvin.
export function choices(unit, difference = false) {
  const known = CHOICES[plain(unit)] ?? [[unit ?? "", 1]];
  return known.filter(([, , zero]) => !(difference && zero)).map(([name, one, zero = 0]) => ({ name, one, zero }));
}

// A gap (null) stays one, and so does what another line alone has a sample of (undefined).
export const toShown = (value, { one, zero }) => (value === null || value === undefined ? value : (value - zero) / one);
export const toSi = (value, { one, zero }) => value * one + zero;

let preferred = read();
const watchers = new Set();

function read() {
  try {
    return JSON.parse(localStorage.getItem(STORED)) ?? {};
  } catch {
    return {};
  }
}

// The unit that the reader wants, SI where none was chosen.
export function shownUnit(unit, difference = false) {
  const possible = choices(unit, difference);
  return possible.find(({ name }) => name === preferred[plain(unit)]) ?? possible[0];
}

export function prefer(unit, name) {
  preferred = { ...preferred, [plain(unit)]: name };
  try {
    localStorage.setItem(STORED, JSON.stringify(preferred));
  } catch {
    // A browser that keeps nothing still shows what was chosen until the page is left.
  }
  watchers.forEach((watcher) => watcher());
}

// Calls `watcher` at every choice until the signal is aborted.
export function onUnits(watcher, signal) {
  watchers.add(watcher);
  signal?.addEventListener("abort", () => watchers.delete(watcher), { once: true });
}
