// @ts-check
// Marks say which samples of a recording are bad, and why. They stand beside the recording in versions, each of which
// is a whole list. The functions are pure.

import { number, words } from "../shell/format.js";

/**
 * A mark without signals is about all of them.
 *
 * @typedef {{ from_s: number, to_s: number, signals?: string[] | null, reason: string }} Mark
 * @typedef {{ number: number, marks: Mark[], created_at?: string, made_by?: string | null }} Version
 * @typedef {{ code: string, signal?: string | null, detail: string, spans?: { from_s: number, to_s: number }[] }} Warning
 */

// The form suggests these reasons.
export const REASONS = ["spike", "sensor frozen", "sensor unplugged", "plant in another mode", "maintenance"];

// The version of a recording as it came, where nothing is marked.
/** @type {Version} */
export const UNMARKED = { number: 0, marks: [] };

const REASON_OF = {
  spikes: "spike",
  frozen_signal: "sensor frozen",
  uncertain_samples: "uncertain by its source",
  substituted_samples: "substituted by its source",
};

// Gives the reason that a warning of the quality report is for a mark.
/** @param {Warning} warning */
export const reasonOf = ({ code }) => REASON_OF[code] ?? words(code);

// Answers whether a warning is about samples that are not there.
/** @param {string} code */
export const isAbsence = (code) => /missing|gap/.test(code);

// Answers whether marking leaves anything out: a warning has a place, and samples stand there.
/** @param {Warning} warning */
export const canBeMarked = ({ code, spans = [] }) =>
  spans.length > 0 && !isAbsence(code) && code !== "bad_samples";

// The server lists so many spans of a warning at the most.
const SPANS_LISTED = 100;

// Says where the list of a warning's spans may be cut short; the text is empty elsewhere.
/** @param {Warning} warning */
export const cutShort = ({ spans = [] }) =>
  spans.length === SPANS_LISTED ? `The report lists the first ${SPANS_LISTED} places alone.` : "";

/** @param {{ from_s: number, to_s: number }} span */
export const spanText = ({ from_s, to_s }) =>
  from_s === to_s ? `${number(from_s, 7)} s` : `${number(from_s, 7)} to ${number(to_s, 7)} s`;

/** @param {{ signals?: string[] | null }} mark */
export const signalsText = ({ signals }) => (signals ? signals.map(words).join(", ") : "all signals");

/** @param {Mark} mark */
export const markText = (mark) => `${signalsText(mark)}, ${spanText(mark)}, ${mark.reason}`;

/** @param {number} count @param {string} noun */
export const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

// Names a version by its number and how many marks it has, where these are at hand.
/** @param {{ number: number, marks?: Mark[] | null }} version */
export const versionName = ({ number, marks }) =>
  number === 0
    ? "nothing that is marked"
    : `version ${number}${marks ? ` (${counted(marks.length, "mark")})` : ""}`;

// A message names so many marks of someone else.
const MARKS_NAMED = 3;

// Says what a version brought that came from elsewhere while marks were made from those `before`.
/** @param {Version} version @param {Mark[]} before */
export function overtakenText({ number, marks, made_by: by }, before) {
  const texts = before.map((mark) => JSON.stringify(mark));
  const added = marks.filter((mark) => !texts.includes(JSON.stringify(mark)));
  const list = added.slice(0, MARKS_NAMED).map(markText).join("; ");
  const rest = added.length > MARKS_NAMED ? `; and ${counted(added.length - MARKS_NAMED, "mark")} more` : "";
  return (
    `Version ${number}${by ? ` by ${by}` : ""} is the newest now, with ${counted(marks.length, "mark")}. ` +
    `${list ? `New there: ${list}${rest}. ` : ""}Your change is not stored yet: repeat it if it is still wanted.`
  );
}

// Gives the number of the version that an experiment takes, which a specification has as a number, or as an object
// once the server has completed the specification; undefined stands for the newest version.
/** @param {number | { number: number } | null | undefined} version @returns {number | undefined} */
export const numberOfVersion = (version) =>
  typeof version === "number" ? version : (version?.number ?? undefined);

// The part of a recording to show around a span.
/**
 * @param {{ from_s: number, to_s: number }} span
 * @param {number} sampleTime
 * @returns {[number, number]}
 */
export function partAround({ from_s, to_s }, sampleTime) {
  const room = Math.max(0.5 * (to_s - from_s), 25 * sampleTime);
  return [from_s - room, to_s + room];
}

// The ends of a part that was dragged across a plot, in their order, within the recording, and written no finer than
// a hundredth of the time between samples.
/** @param {number[]} ends @param {{ duration_s: number, sample_time_s: number }} dataset */
export function draggedSpan(ends, { duration_s: duration, sample_time_s: sampleTime }) {
  const decimals = Math.min(12, Math.max(0, 2 - Math.floor(Math.log10(sampleTime || 1))));
  const within = ends.map((end) => Number(Math.min(duration, Math.max(0, end)).toFixed(decimals)));
  return { from_s: Math.min(...within), to_s: Math.max(...within) };
}

// The form has several spans, which share their signals and the reason.
/** @typedef {{ spans: { from_s: number, to_s: number }[], signals: string[] | null, reason: string }} MarkDraft */

// Gives the marks that a form describes.
/** @param {MarkDraft} draft @returns {Mark[]} */
export const marksOf = ({ spans, signals, reason }) =>
  spans.map(({ from_s, to_s }) => ({ from_s, to_s, ...(signals && { signals }), reason: reason.trim() }));

// Lists what a form cannot send.
/** @param {MarkDraft} draft @returns {import("../shell/faults.js").Fault[]} */
export function faultsOfDraft({ spans, signals }) {
  const faults = spans.flatMap((span, k) =>
    ["from_s", "to_s"]
      .filter((end) => !Number.isFinite(span[end]))
      .map((end) => ({ pointer: `/spans/${k}/${end}`, detail: "a number of seconds is needed here" })),
  );
  if (spans.length === 0) {
    faults.push({ pointer: "", detail: "no stretch is given" });
  }
  if (signals?.length === 0) {
    faults.push({ pointer: "/signals", detail: "choose the signals that are bad, or all" });
  }
  return faults;
}

// Gives the faults that the server finds in a list of marks with the places that they have in the form, whose marks
// stand behind `before` marks in the list.
/** @param {import("../shell/faults.js").Fault[]} faults @param {number} before */
export function faultsInForm(faults, before) {
  return faults.map((fault) => {
    const [, place, member] = /^\/marks\/(\d+)(?:\/(\w+))?/.exec(fault.pointer ?? "") ?? [];
    const k = Number(place) - before;
    if (!(k >= 0)) {
      return fault;
    }
    const isShared = member === "reason" || member === "signals";
    return { ...fault, pointer: isShared ? `/${member}` : `/spans/${k}/${member ?? "from_s"}` };
  });
}
