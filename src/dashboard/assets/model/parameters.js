// @ts-check
// This module writes the parameters of a model as rows of a form, and a row as an entry of a
// specification. Its functions are pure, so that they can be tested without a page.

import { numberOf } from "../shell/format.js";

// A row has the entry of the specification for a parameter, and the values of the model where there is
// no entry.
export function parameterRows(model, entries = {}) {
  return model.parameters.map((about) => {
    const entry = entries[about.name];
    const free = entry ? "estimate" in entry : about.unknown_by_default;
    return {
      about,
      isSpecified: entry !== undefined,
      free,
      value: entry?.value ?? about.default,
      tolerance: entry?.tolerance ?? "",
      lower: entry?.estimate?.lower ?? about.lower,
      upper: entry?.estimate?.upper ?? about.upper,
      scale: entry?.estimate?.scale ?? about.scale,
      start: entry?.estimate?.start ?? null,
      prior: entry?.prior ?? null,
    };
  });
}

// The entry of a row is undefined where the row says the same as the model.
export function entryOf(row) {
  const { about } = row;
  if (!row.free) {
    const tolerance = toleranceOf(row.tolerance);
    const entry = tolerance === undefined ? { value: row.value } : { value: row.value, tolerance };
    const usual = !about.unknown_by_default && row.value === about.default && tolerance === undefined;
    return usual ? undefined : entry;
  }
  const estimate = {};
  for (const side of ["lower", "upper", "scale"]) {
    if (row[side] !== about[side]) {
      estimate[side] = row[side];
    }
  }
  if (row.start !== null) {
    estimate.start = row.start;
  }
  const entry = row.prior ? { estimate, prior: row.prior } : { estimate };
  const usual = about.unknown_by_default && Object.keys(estimate).length === 0 && !row.prior;
  return usual ? undefined : entry;
}

// The middle of a row's range, on its scale.
export function middleOf({ lower, upper, scale }) {
  const middle = scale === "log" ? Math.sqrt(lower * upper) : (lower + upper) / 2;
  return Number(middle.toPrecision(3));
}

// A tolerance of `1 %` stays a share; `0.5` becomes a number in the unit of what is known, and an empty
// text is no tolerance.
export function toleranceOf(text) {
  const bare = String(text ?? "").trim();
  const number = numberOf(bare);
  return bare === "" ? undefined : Number.isNaN(number) ? bare : number;
}
