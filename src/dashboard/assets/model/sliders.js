// @ts-check
// The sliders set parameters within their ranges.

import { h } from "../shell/dom.js";
import { number, quantity, words } from "../shell/format.js";

const STEPS = 1000;

// A slider rounds its value to four digits.
export const rounded = (value) => Number(value.toPrecision(4));

// The slider of a row begins at the default where that lies in the range, else in the middle of the
// range.
export function start({ about, lower, upper }) {
  return about.default >= lower && about.default <= upper
    ? about.default
    : lower > 0
      ? Math.sqrt(lower * upper)
      : (lower + upper) / 2;
}

// The slider puts the value of a row's parameter among `values` and then calls `moved`.
export function slider({ about, lower, upper, scale }, values, moved) {
  const log = scale === "log" && lower > 0;
  const place = (value) =>
    STEPS * (log ? Math.log(value / lower) / Math.log(upper / lower) : (value - lower) / (upper - lower));
  const value = (at) =>
    log ? lower * (upper / lower) ** (at / STEPS) : lower + (upper - lower) * (at / STEPS);
  const shown = h("output", {});
  const say = () => {
    shown.textContent = quantity(number(values[about.name], 4), about.unit);
    input.setAttribute("aria-valuetext", shown.textContent);
  };
  const input = h("input", {
    type: "range",
    min: "0",
    max: String(STEPS),
    value: String(Math.round(place(values[about.name]))),
    oninput: () => {
      values[about.name] = rounded(value(Number(input.value)));
      say();
      moved();
    },
  });
  say();
  return h("label", {}, h("span", {}, words(about.name), " ", shown), input);
}
