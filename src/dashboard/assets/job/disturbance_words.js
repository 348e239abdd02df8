// @ts-check
// This module says in words how a disturbance moves a plant. Its functions are pure.

import { number, percent, quantity, withError, words } from "../shell/format.js";

/** @typedef {import("page/api").Schemas["DisturbanceReport"]} DisturbanceReport */

// Writes `m/s/s` as `m/s²`.
export function plainUnit(unit) {
  return unit.replace(/\/s\/s$/, "/s²");
}

/** @param {DisturbanceReport["acts_on"]} actsOn */
export function actedOn(actsOn) {
  const [[kind, name]] = Object.entries(actsOn);
  return {
    parameter: words(name),
    state: `rate of ${words(name)}`,
    sampled: `computed ${words(name)}`,
    output: `sensor of ${words(name)}`,
  }[kind];
}

/** @param {import("page/api").Schemas["NoiseNumberReport"]} number @param {string} unit */
function measure({ estimate, standard_error: error }, unit) {
  const [value, spread] = withError(estimate, error);
  return quantity(spread === "–" ? number(estimate, 3) : `${value} ± ${spread}`, unit);
}

/** The disturbance in a sentence: its size, its memory and its share.
 * @param {DisturbanceReport} disturbance
 */
export function sentence({ acts_on: actsOn, kind, unit, std, strength, time_constant_s: memory, ...rest }) {
  const shown = plainUnit(unit);
  const size = {
    white: () => `by white noise of ${measure(strength, `${shown}·√s`)}`,
    walk: () => `by ${measure(strength, `${shown}/√s`)}, without coming back`,
    memory: () => `by ${measure(std ?? strength, shown)} (one standard deviation)`,
  }[kind]();
  const subject = `The ${actedOn(actsOn)}`;
  const verb = "output" in actsOn ? "drifts" : "wanders";
  const remembers = memory ? ` and forgets within ${measure(memory, "s")}` : "";
  const shares = Object.entries(rest.share_of_output).map(
    ([output, share]) =>
      `${percent(Number((100 * share).toPrecision(2)))} of the variance of ${words(output)}`,
  );
  const makes = shares.length ? ` This makes ${shares.join(" and ")}.` : "";
  return `${subject} ${verb} ${size}${remembers}.${makes}`;
}
