// @ts-check
// The axes of a chart have ticks with texts.

import { number, power, unitSigns } from "../shell/format.js";

// The range covers the finite numbers of all columns, on a logarithmic axis only the positive numbers.
export function rangeOf(columns, log) {
  let low = Infinity;
  let high = -Infinity;
  for (const column of columns) {
    for (const value of column) {
      if (value !== null && Number.isFinite(value) && (!log || value > 0)) {
        low = Math.min(low, value);
        high = Math.max(high, value);
      }
    }
  }
  return low <= high ? [low, high] : null;
}

// An axis over a range has position(), which maps a value to 0…1, ticks as [value, text], and the
// exponent of the power of ten that the texts leave out.
/** @param {number[]} range */
export function axis(range, { log = false, steps = 5, tight = false } = {}) {
  return log ? logarithmic(range, steps) : linear(range, steps, tight);
}

/** @param {number[]} range */
function linear([low, high], steps, tight) {
  if (low === high) {
    const room = Math.abs(low) * 0.05 || 1;
    [low, high] = [low - room, high + room];
  } else if (!tight) {
    const room = 0.04 * (high - low);
    [low, high] = [low - room, high + room];
  }
  const step = niceStep((high - low) / steps);
  const exponent = engineering(Math.max(Math.abs(low), Math.abs(high)));
  const scale = 10 ** exponent;
  const decimals = Math.min(12, Math.max(0, -Math.floor(Math.log10(step / scale) + 1e-9)));
  const ticks = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k += 1) {
    const text = ((k * step) / scale).toFixed(decimals).replace(/^-(0\.?0*)$/, "$1");
    ticks.push([k * step, text.replace("-", "−")]);
  }
  return { position: (value) => (value - low) / (high - low), ticks, exponent };
}

/** @param {number[]} range @param {number} steps */
function logarithmic([low, high], steps) {
  const spread = Math.max(Math.log10(high / low), 0.02);
  const bottom = Math.log10(low) - 0.05 * spread;
  const top = Math.log10(high) + 0.05 * spread;
  const position = (value) => (Math.log10(value) - bottom) / (top - bottom);
  const inside = ([value]) => position(value) >= 0 && position(value) <= 1;
  let ticks = decades(bottom, top, steps).filter(inside);
  if (ticks.length < 2) {
    ticks = fineTicks(10 ** bottom, 10 ** top, steps).filter(inside);
  }
  return { position, ticks, exponent: 0 };
}

function decades(bottom, top, steps) {
  const every = Math.max(1, Math.ceil((top - bottom) / steps));
  const factors = top - bottom < 3 ? [1, 2, 5] : [1];
  const ticks = [];
  for (let exponent = Math.floor(bottom); exponent <= Math.ceil(top); exponent += 1) {
    if (exponent % every !== 0) {
      continue;
    }
    for (const factor of factors) {
      ticks.push([factor * 10 ** exponent, factor === 1 ? power(exponent) : `${factor}·${power(exponent)}`]);
    }
  }
  return ticks;
}

// A range of less than a factor of two has equal steps, which tell more than powers of ten.
function fineTicks(low, high, steps) {
  const step = niceStep((high - low) / steps);
  const digits = Math.max(2, Math.ceil(Math.log10(high / step)) + 1);
  const ticks = [];
  for (let k = Math.ceil(low / step); k * step <= high; k += 1) {
    ticks.push([k * step, number(k * step, digits)]);
  }
  return ticks;
}

function niceStep(rough) {
  const unit = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].find((factor) => factor * unit >= rough * 0.999) * unit;
}

// The exponent is a multiple of three that leaves numbers between 0.01 and 10 000.
function engineering(magnitude) {
  if (magnitude === 0 || (magnitude >= 0.01 && magnitude < 1e4)) {
    return 0;
  }
  return 3 * Math.floor(Math.log10(magnitude) / 3);
}

const WHOLE_STEPS = [0, 1, 2, 3, 4, 5, 6].flatMap((power) => [1, 2, 5].map((factor) => factor * 10 ** power));

// Gives the steps between the ticks of an axis that counts; another axis leaves them to the plot.
/** @param {{ whole?: boolean }} x */
export const stepsOf = ({ whole }) => (whole ? { incrs: WHOLE_STEPS } : {});

export function axisTitle(label, unit, exponent) {
  const factor = exponent === 0 ? "" : power(exponent);
  const bracket = [factor, unit === "1" ? "" : unitSigns(unit)].filter(Boolean).join("\u00a0");
  return bracket ? `${label} [${bracket}]` : label;
}

// The range leaves room above and below the values, also where all values are the same.
export function paddedRange(_, low, high) {
  if (low === null || high === null) {
    return [0, 1];
  }
  const room = high > low ? 0.05 * (high - low) : Math.abs(low) * 0.05 || 1;
  return [low - room, high + room];
}

export function rangeFromZero(_, low, high) {
  return paddedRange(null, Math.min(0, low ?? 0), Math.max(0, high ?? 1));
}

export function logarithmicSplits(_, __, low, high) {
  return axis([low, high], { log: true, steps: 4 }).ticks.map(([value]) => value);
}

// Large and small ticks of a logarithmic axis are all written with powers of ten.
export function tickText(value) {
  const exponent = Math.floor(Math.log10(value) + 1e-9);
  const factor = number(value / 10 ** exponent, 3);
  return exponent < 4 && exponent > -3
    ? number(value, 3)
    : factor === "1"
      ? power(exponent)
      : `${factor}·${power(exponent)}`;
}

// A logarithmic axis fits the values; whole decades would leave most of it empty.
export function logarithmicRange(_, low, high) {
  if (!(low > 0) || !(high > 0)) {
    return [0.1, 1];
  }
  const factor = Math.max(1.1, (high / low) ** 0.05);
  return [low / factor, high * factor];
}

// Plots below each other begin at the same place: each upright axis is as wide as the widest of them needs.
// `changed` is called when the axes that are drawn already have to be drawn anew.
export class AxisWidths {
  constructor(changed) {
    this.changed = changed;
    this.needs = new Map();
    this.widest = 0;
  }

  // Takes the width that the axis of a plot needs, and gives the width that it gets.
  widthOf(plot, need) {
    this.needs.set(plot, need);
    const widest = Math.max(...this.needs.values());
    if (widest !== this.widest) {
      this.widest = widest;
      this.changed();
    }
    return widest;
  }
}
