// @ts-check
// This module reads and writes JSON in which a seed may be any integer of 64 bits. A number of JavaScript holds the
// digits of integers up to 2^53 alone; a larger seed is read as a BigInt, and written with all its digits, by every
// JSON.stringify. A browser without source text access of JSON reads and writes the nearest number.

import { numberOf } from "./format.js";

const { rawJSON } = /** @type {any} */ (JSON);
const LARGE_SEED = /seed"\s*:\s*\d{16}/;

if (rawJSON) {
  Object.defineProperty(BigInt.prototype, "toJSON", {
    value() {
      return rawJSON(String(this));
    },
  });
}

const isLarge = (digits) => /^\d+$/.test(digits) && !Number.isSafeInteger(Number(digits));

// Reading with a reviver takes several times as long, so that it is left to texts with a large seed.
/** @param {string} text */
export function readJson(text) {
  return rawJSON && LARGE_SEED.test(text) ? JSON.parse(text, exactSeed) : JSON.parse(text);
}

const exactSeed = /** @type {any} */ (
  (name, value, { source }) =>
    name.endsWith("seed") && typeof value === "number" && isLarge(source) ? BigInt(source) : value
);

// Reads a seed as people type it; the answer is NaN where the text is no number.
/** @param {string} text @returns {number | bigint} */
export const seedOf = (text) => (rawJSON && isLarge(text) ? BigInt(text) : numberOf(text));
