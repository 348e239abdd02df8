// @ts-check
// This module sums up a verdict in few sentences, with the jobs to run next. Its functions are pure.
//
// The server ranks the reasons, the gravest first, says which of them belong to one family, and gives
// each its next steps. Reasons of one family about the same parameters become a single conclusion.

import { unknownWords } from "./unknowns.js";

const MOST_STEPS = 3;

export function listed(names) {
  const shown = names.map((name) => unknownWords(name));
  return shown.length < 2 ? shown.join("") : `${shown.slice(0, -1).join(", ")} and ${shown.at(-1)}`;
}

// The conclusions have the form [{ codes, concerned, details, text, next: [{ label, why, patch }] }], the
// gravest first. `rules` is what the server says of each rule.
/**
 * @param {any} result
 * @param {any[]} rules
 */
export function conclusions(result, rules) {
  const entries = new Map(rules.map((rule) => [rule.code, rule]));
  const familyOf = (code) => entries.get(code)?.family ?? code;
  let groups = [];
  for (const { code, detail, concerns = [], next = [] } of result.verdict?.reasons ?? []) {
    const group = { family: familyOf(code), codes: [code], concerned: concerns, details: [detail], next };
    const same = groups.filter((other) => other.family === group.family && shareParameters(other, group));
    // The group that came first keeps its place, with all that belongs to it.
    const [first, ...others] = [...same, group];
    for (const other of others) {
      join(first, other);
    }
    groups = [...new Set([...groups, first])].filter((other) => !others.includes(other));
  }
  return groups.map(({ family, next, ...group }) => ({
    ...group,
    text: sentence(group, entries.get(group.codes.includes(family) ? family : group.codes[0])),
    next: next.slice(0, MOST_STEPS),
  }));
}

// A reason without parameters is about all of them.
function shareParameters(a, b) {
  const isGeneral = a.concerned.length === 0 && b.concerned.length === 0;
  return isGeneral || a.concerned.some((name) => b.concerned.includes(name));
}

function join(group, other) {
  const united = (a, b) => [...new Set([...a, ...b])];
  group.codes = united(group.codes, other.codes);
  group.concerned = united(group.concerned, other.concerned);
  group.details = [...group.details, ...other.details];
  const labels = group.next.map(({ label }) => label);
  group.next = [...group.next, ...other.next.filter(({ label }) => !labels.includes(label))];
}

function sentence({ concerned, details }, rule) {
  const [first, ...rest] = details;
  if (rest.length && concerned.length > 1 && rule) {
    return `${rule.title}: ${listed(concerned)}. ${rule.advice}`;
  }
  return rest.length ? `${first} (${rest.length} more like this below)` : first;
}
