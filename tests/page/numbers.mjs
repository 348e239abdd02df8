// This module reads numbers as the page and the report write them, and tells which numbers of the API a written number
// may be.

import assert from "node:assert/strict";

/** Reads the first number of a text as the page writes numbers. */
export function numberIn(text) {
  const plain = text
    .replace(
      /·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)/,
      (_, digits) =>
        `e${[...digits]
          .map((digit) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹".indexOf(digit))
          .map((k) => (k === 0 ? "-" : k - 1))
          .join("")}`,
    )
    .replaceAll("−", "-")
    .replaceAll("\u202f", "");
  return Number(/-?\d+\.?\d*(e-?\d+)?/.exec(plain)?.[0] ?? NaN);
}

const format = await import(new URL("../../src/dashboard/assets/shell/format.js", import.meta.url));

const DIGITS = "\\d[\\d\u202f]*(?:\\.\\d+)?(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?";
// A number stands by itself: digits within a name, an id or a date are none. Its sign is read apart, since a range
// and a difference are written with the same stroke.
const WRITTEN = new RegExp(`(?<![\\p{L}\\d_.:/@#-]|\\d\u202f)${DIGITS}(?![\\p{L}\\d_:]|-\\d|\\.\\d)`, "gu");
const INSTANT = /\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:Z|[+-]\d\d:\d\d)?)?/g;

/**
 * Lists the numbers that a text has, as they are written, and whether each is a share in percent.
 *
 * @param {string} text
 */
export const writtenIn = (text) => {
  const plain = text.replace(INSTANT, (instant) => " ".repeat(instant.length));
  return [...plain.matchAll(WRITTEN)].map(({ 0: written, index }) => ({
    written,
    isShare: /^(?: to \S+)?\s%/.test(plain.slice(index + written.length)),
  }));
};

// The sign stands before a number, and a power of ten behind it, as programs write them.
const SIGNED = /(?<![\p{L}\d_.:/@#^-])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\p{L}\d_]|[-.:]\d)/gu;

/**
 * Lists the instants and the signed numbers that a text has, as they are written and where they begin.
 *
 * @param {string} text
 */
export function signedIn(text) {
  const instants = [...text.matchAll(INSTANT)];
  const plain = text.replace(INSTANT, (instant) => " ".repeat(instant.length));
  const entries = [...instants, ...plain.matchAll(SIGNED)].map(({ 0: written, index }) => ({
    written,
    index,
  }));
  return entries.sort((a, b) => a.index - b.index);
}

/**
 * Whether a written number is a value that is rounded to two digits or more.
 *
 * @param {string} written
 * @param {number | null | undefined} value
 */
export function isRounded(written, value) {
  const [, decimals = "", exponent = "0"] = /^-?\d+(?:\.(\d+))?(?:e(-?\d+))?$/.exec(written) ?? [];
  const step = 10 ** (Number(exponent) - decimals.length);
  const isExact = digitsOf({ written }) < 2;
  const room = isExact ? 1e-5 * Math.abs(value ?? NaN) : 0.5 * step * (1 + 1e-6);
  return Math.abs(Number(written) - (value ?? NaN)) <= room;
}

// A longer list is one of samples or of candidates, of which a page tells the extremes, the ends and the number.
const LONGEST_LIST = 64;

/**
 * Calls `take` with every number of a document, and `read` with every text. Of a long list these are the extremes and
 * the ends of each column.
 *
 * @param {any} value
 * @param {(value: number) => void} take
 * @param {(text: string) => void} read
 */
export function eachLeaf(value, take, read) {
  if (typeof value === "number") {
    take(value);
  } else if (typeof value === "string") {
    read(value);
  } else if (Array.isArray(value) && value.length > LONGEST_LIST) {
    take(value.length);
    for (const column of columnsOf(value)) {
      for (const extreme of [Math.min(...column), Math.max(...column), column[0], column.at(-1)]) {
        take(extreme);
      }
    }
  } else if (value !== null && typeof value === "object") {
    take(Object.keys(value).length);
    for (const [name, entry] of Object.entries(value)) {
      read(name);
      eachLeaf(entry, take, read);
    }
  }
}

// The numbers of a list of entries that are alike, by their place in an entry.
function columnsOf(list, place = "", columns = new Map()) {
  for (const [name, entry] of Object.entries(list)) {
    const column = Array.isArray(list) && place === "" ? "entry" : `${place}/${name}`;
    if (typeof entry === "number") {
      columns.get(column)?.push(entry) ?? columns.set(column, [entry]);
    } else if (entry !== null && typeof entry === "object") {
      columnsOf(entry, column, columns);
    }
  }
  return columns.values();
}

/**
 * The numbers that a page may write: those of documents, to two to seven digits, as shares in percent, as counts, as
 * durations, and in the units that signals were recorded in.
 */
export class Explained {
  constructor() {
    this.texts = new Set();
    this.shares = new Set();
    this.values = new Set();
  }

  /** @param {number} value @param {Set<string>} texts */
  write(value, texts = this.texts) {
    const size = Math.abs(value);
    for (let digits = 2; digits <= 7; digits += 1) {
      texts.add(format.number(size, digits)).add(format.number(size, digits, true));
    }
    texts.add(format.count(Math.round(size))).add(String(size));
  }

  /** Takes a share, which is written in percent, and by one digit below a tenth of a percent. @param {number} share */
  takeShare(share) {
    this.write(100 * share, this.shares);
    Math.abs(share) < 0.001 && this.shares.add(format.number(Math.abs(100 * share), 1));
  }

  /** @param {number} value */
  take(value) {
    if (!Number.isFinite(value) || this.values.has(value)) {
      return;
    }
    this.values.add(value);
    this.write(value);
    this.write(value, this.shares);
    this.takeShare(value);
  }

  /** Takes all numbers of documents, and those of their texts. */
  add(...documents) {
    for (const document of documents) {
      eachLeaf(
        document,
        (value) => this.take(value),
        (text) => this.addText(text),
      );
    }
    return this;
  }

  /** @param {string} text */
  addText(text) {
    for (const { written, isShare } of writtenIn(text)) {
      (isShare ? this.shares : this.texts).add(written);
    }
  }

  /** Takes all values so far in another unit too, and as differences in that unit. */
  convert({ factor, offset }) {
    for (const value of [...this.values]) {
      this.write((value - offset) / factor);
      this.write(value / factor);
    }
  }

  has({ written, isShare }) {
    return (isShare ? this.shares : this.texts).has(written);
  }
}

/** The number with its last digit moved by one: no page writes it, unless another number explains it. */
export function neighbourOf({ written, isShare }) {
  const [, before, last, after] = /^(.*?)(\d)((?:·10.*|e-?\d+|Z)?)$/.exec(written);
  return { written: `${before}${(Number(last) + 1) % 10}${after}`, isShare };
}

/** The digits of a written number without the zeros before them. */
export const digitsOf = ({ written }) =>
  written
    .replace(/·10.*|e.*/, "")
    .replaceAll(/[-.\u202f]/g, "")
    .replace(/^0+/, "").length;

/**
 * Asserts that all numbers of pages are explained, and that few of them would be with another last digit: a check that
 * lets most wrong numbers pass would say little.
 *
 * @param {{count: number, long: number, neighbours: number, unexplained: string[]}[]} pages
 * @param {number} mostNeighbours
 */
export function judge(pages, mostNeighbours) {
  assert.deepEqual(
    pages.flatMap(({ unexplained }) => unexplained),
    [],
  );
  const sum = (member) => pages.reduce((total, page) => total + page[member], 0);
  assert.ok(
    sum("neighbours") <= mostNeighbours * sum("long"),
    `${sum("neighbours")} of ${sum("long")} numbers`,
  );
  return `${sum("count")} numbers, of which ${sum("long")} have three digits or more; with another last digit ${sum("neighbours")} pass`;
}
