// @ts-check
// This module turns the rules of a mapping into those of a form and back, and makes rules of the series that no
// rule names. The functions are pure.

import { faultsOfNames } from "../shell/faults.js";
import { words } from "../shell/format.js";
import { namesOnTheWay } from "../text/document.js";

const STREAM_CHARACTERS = 100;

/**
 * In a form the tags and the fields of a rule have an order, and two of them may have the same name.
 *
 * @typedef {{ name: string, value: string }} Tag
 * @typedef {{ field: string, signal: string, unit?: string, interpolation?: string }} MappedField
 * @typedef {{ fields: string[], codes?: string }} Quality
 * @typedef {{
 *   measurement: string,
 *   tags: Tag[],
 *   stream: string,
 *   fields: MappedField[],
 *   quality: Quality,
 *   isOpen?: boolean,
 * }} Rule
 * @typedef {{ measurement: string, tags: Record<string, string>, field: string, last_value?: unknown }} Series
 * @typedef {import("../shell/faults.js").Fault} Fault
 */

const tagsOf = (tags) => Object.entries(tags).map(([name, value]) => ({ name, value }));

/** @returns {Rule} */
export const emptyRule = () => ({
  measurement: "",
  tags: [],
  stream: "",
  fields: [emptyField()],
  quality: noQuality(),
});

/** @returns {MappedField} */
export const emptyField = () => ({ field: "", signal: "" });

/** @returns {Quality} */
const noQuality = () => ({ fields: [] });

// Gives the rules of a mapping as a form has them.
/** @returns {Rule[]} */
export function formOf(rules) {
  return rules.map(({ measurement, tags = {}, stream, signals, quality }) => ({
    measurement,
    tags: tagsOf(tags),
    stream,
    fields: Object.entries(signals).map(([field, mapped]) => ({ field, ...mapped })),
    quality: { ...noQuality(), ...quality },
  }));
}

// Gives the rules of a form as a mapping has them: a unit that is left empty is left out, and so is a quality that
// says nothing.
/** @param {Rule[]} rules */
export function rulesOf(rules) {
  return rules.map(({ measurement, tags, stream, fields, quality }) => ({
    measurement,
    tags: Object.fromEntries(tags.map(({ name, value }) => [name, value])),
    stream,
    signals: Object.fromEntries(
      fields.map(({ field, signal, unit, interpolation }) => [
        field,
        { signal, ...(unit && { unit }), ...(interpolation && { interpolation }) },
      ]),
    ),
    ...((quality.fields.length > 0 || quality.codes) && {
      quality: {
        ...(quality.fields.length > 0 && { fields: quality.fields }),
        ...(quality.codes && { codes: quality.codes }),
      },
    }),
  }));
}

// Writes the rules of a form without what only the form knows, so that two forms can be compared.
/** @param {Rule[]} rules */
export function textOf(rules) {
  return JSON.stringify(
    rules.map(({ measurement, tags, stream, fields, quality }) => [
      measurement,
      stream,
      tags.map(({ name, value }) => [name, value]),
      fields.map(({ field, signal, unit = "", interpolation = "" }) => [field, signal, unit, interpolation]),
      quality.fields,
      quality.codes ?? "",
    ]),
  );
}

// Lists what the rules of a mapping cannot say: a tag or a field without a name, and a name that stands twice.
/**
 * @param {Rule[]} rules
 * @returns {Fault[]}
 */
export function nameFaults(rules) {
  return rules.flatMap(({ tags, fields }, k) => [
    ...faultsOfNames(
      tags.map(({ name }) => name),
      "tag",
      "rule",
      (place) => `/rules/${k}/tags/${place}/name`,
    ),
    ...faultsOfNames(
      fields.map(({ field }) => field),
      "field",
      "rule",
      (place) => `/rules/${k}/fields/${place}/field`,
    ),
  ]);
}

// Gives the faults that the server finds in a mapping with the places that they have in the form.
/**
 * @param {Rule[]} rules
 * @param {Fault[]} faults
 */
export const faultsInForm = (rules, faults) =>
  faults.map((fault) => ({ ...fault, pointer: pointerInForm(rules, fault.pointer ?? "") }));

function pointerInForm(rules, pointer) {
  const [top, k, member, name, ...rest] = namesOnTheWay(pointer);
  const rule = rules[k];
  if (!rule || name === undefined) {
    return pointer;
  }
  if (member === "tags") {
    const place = rule.tags.findIndex((tag) => tag.name === name);
    return place < 0 ? pointer : `/${top}/${k}/tags/${place}/value`;
  }
  if (member !== "signals") {
    return pointer;
  }
  const place = rule.fields.findIndex(({ field }) => field === name);
  return place < 0 ? pointer : ["", top, k, "fields", place, ...rest].join("/");
}

/** @param {Series} series */
export const isText = ({ last_value: value }) => typeof value === "string";

// Answers whether a rule fits the lines of a series and names its field, as a signal or as a quality.
/**
 * @param {Rule[]} rules
 * @param {Series} series
 */
export function isNamed(rules, { measurement, tags, field }) {
  return rules.some(
    (rule) =>
      rule.measurement === measurement &&
      rule.tags.every(({ name, value }) => tags[name] === value) &&
      (rule.fields.some((mapped) => mapped.field === field) || rule.quality.fields.includes(field)),
  );
}

// Gives the rules with a place for each series that has none yet. Series of the same measurement and tags go into
// the same rule. A series of texts gets no place: a stream has numbers.
/**
 * @param {Rule[]} rules
 * @param {Series[]} list
 */
export const withPlaces = (rules, list) =>
  list.reduce(
    (all, series) => (isText(series) || isNamed(all, series) ? all : withPlace(all, series)),
    rules,
  );

/**
 * @param {Rule[]} rules
 * @param {Series} series
 * @returns {Rule[]}
 */
function withPlace(rules, series) {
  const { measurement, tags, field } = series;
  const place = rules.findIndex((rule) => rule.measurement === measurement && areTags(rule.tags, tags));
  if (place < 0) {
    const stream = freeName(streamName(series), new Set(rules.map((rule) => rule.stream)), STREAM_CHARACTERS);
    const rule = { ...emptyRule(), measurement, tags: tagsOf(tags), stream };
    return [...rules, { ...rule, fields: [{ field, signal: field }] }];
  }
  const rule = rules[place];
  const signals = rules
    .filter(({ stream }) => stream === rule.stream)
    .flatMap(({ fields }) => fields.map(({ signal }) => signal));
  const signal = freeName(field, new Set(signals));
  return rules.with(place, { ...rule, fields: [...rule.fields, { field, signal }] });
}

const areTags = (list, tags) =>
  list.length === Object.keys(tags).length && list.every(({ name, value }) => tags[name] === value);

// Makes the name of a stream of a measurement and the values of the tags, in the characters that a stream may have.
/** @param {Series} series */
export function streamName({ measurement, tags }) {
  return [measurement, ...Object.values(tags)]
    .join("-")
    .normalize("NFKD")
    .replace(/\p{M}/gu, "")
    .replace(/[^A-Za-z0-9._-]+/g, "_")
    .slice(0, STREAM_CHARACTERS);
}

// Gives the name, with a number behind it where the name is taken.
function freeName(name, taken, length = Number.POSITIVE_INFINITY) {
  for (let number = 1; ; number += 1) {
    const end = number === 1 ? "" : `-${number}`;
    const candidate = `${name.slice(0, length - end.length)}${end}`;
    if (!taken.has(candidate)) {
      return candidate;
    }
  }
}

/** @param {Tag[]} tags */
export const tagText = (tags) => tags.map(({ name, value }) => `${name}=${value}`).join(", ");

/** @param {Series} series */
export const tagsText = ({ tags }) => tagText(tagsOf(tags));

// Says which fields tell how good the others are, and what their codes mean.
/** @param {Quality} quality */
export function qualityText({ fields, codes }) {
  return [fields.join(", "), codes && words(codes)].filter(Boolean).join(": ");
}

// Says in a line what a rule does.
/** @param {Rule} rule */
export function ruleText({ measurement, tags, stream, fields }) {
  const lines = [measurement || "–", tagText(tags)].filter(Boolean).join(", ");
  return `${lines} → ${stream || "–"}: ${fields.map(({ field }) => field || "–").join(", ")}`;
}
