// @ts-check
// This module writes lines that are left out of a text: single lines and ranges of lines, from 1, such as
// 3-5, 7, 22-. A range without an end goes to the end of the text.

/** @typedef {{ first: number, last: number }} LineRange */

// Reads the ranges of a text, in the order of their lines; a part that names no lines is passed over.
/**
 * @param {string | undefined} text
 * @returns {LineRange[]}
 */
export function rangesIn(text) {
  const parts = (text ?? "").split(",").map((part) => /^\s*(\d+)\s*(?:(-)\s*(\d*)\s*)?$/.exec(part));
  return parts
    .flatMap((part) => {
      if (!part) {
        return [];
      }
      const [, first, dash, last] = part;
      return [
        { first: Number(first), last: dash ? Number(last || Number.POSITIVE_INFINITY) : Number(first) },
      ];
    })
    .sort((a, b) => a.first - b.first);
}

/** @param {LineRange[]} ranges */
const textOf = (ranges) =>
  ranges
    .map(({ first, last }) => {
      const end = Number.isFinite(last) ? String(last) : "";
      return first === last ? String(first) : `${first}-${end}`;
    })
    .join(", ");

// Answers whether a line is left out.
/**
 * @param {string | undefined} text
 * @param {number} line
 */
export const isLeftOut = (text, line) =>
  rangesIn(text).some(({ first, last }) => first <= line && line <= last);

// Gives the text of the ranges with a line that is left out too; neighbours become one range.
/**
 * @param {string | undefined} text
 * @param {number} line
 */
export function withLine(text, line) {
  const all = [...rangesIn(text), { first: line, last: line }].sort((a, b) => a.first - b.first);
  /** @type {LineRange[]} */
  const merged = [];
  for (const range of all) {
    const before = merged.at(-1);
    if (before && range.first <= before.last + 1) {
      before.last = Math.max(before.last, range.last);
    } else {
      merged.push({ ...range });
    }
  }
  return textOf(merged);
}

// Gives the text of the ranges without a line, which is read again.
/**
 * @param {string | undefined} text
 * @param {number} line
 */
export function withoutLine(text, line) {
  const parts = rangesIn(text).flatMap(({ first, last }) =>
    line < first || line > last
      ? [{ first, last }]
      : [
          { first, last: line - 1 },
          { first: line + 1, last },
        ],
  );
  return textOf(parts.filter(({ first, last }) => first <= last));
}
