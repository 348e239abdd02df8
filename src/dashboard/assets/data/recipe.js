// @ts-check
// A recipe makes another recording of one, step by step. The functions are pure: the kinds of steps with their fields,
// and the steps that drafts of a form stand for.

import { numberOf } from "../shell/format.js";

/**
 * A field of a step: a number, a text, or one of several words. Signals are chosen where `signals` names the member
 * that has them; a step without them is about all signals where `all` says so.
 *
 * @typedef {{ member: string, title: string, kind?: "number" | "text", choices?: [string, string][], optional?: boolean, wide?: boolean }} StepField
 * @typedef {{ title: string, fields: StepField[], signals?: string, signalsTitle?: string, all?: boolean, optionalSignals?: boolean }} StepKind
 * @typedef {{ step: string, texts: Record<string, string>, signals: string[] }} StepDraft
 */

const CUTOFF = { member: "cutoff_hz", title: "cutoff, Hz", kind: /** @type {const} */ ("number") };
const OF_ALL = { signals: "signals", signalsTitle: "Signals; all where none is chosen", all: true };
const OF_CHOSEN = { signals: "signals", signalsTitle: "Signals" };

/** @type {Record<string, StepKind>} */
export const KINDS = {
  cut: {
    title: "Cut to a part",
    fields: [
      { member: "from_s", title: "from, s", kind: "number", optional: true },
      { member: "to_s", title: "to, s", kind: "number", optional: true },
    ],
  },
  calculate: {
    title: "Calculate a signal",
    fields: [
      { member: "signal", title: "name" },
      { member: "unit", title: "unit", optional: true },
      { member: "equation", title: "equation, in SI", wide: true },
    ],
  },
  resample: {
    title: "Another sample time",
    fields: [{ member: "sample_time_s", title: "sample time, s", kind: "number" }],
    signals: "held",
    signalsTitle: "Signals that keep their value between samples, such as commands",
    optionalSignals: true,
  },
  median: {
    title: "Median, against spikes",
    fields: [{ member: "samples", title: "samples, odd", kind: "number" }],
    ...OF_ALL,
  },
  low_pass: { title: "Low pass", fields: [CUTOFF], ...OF_ALL },
  high_pass: { title: "High pass", fields: [CUTOFF], ...OF_ALL },
  detrend: {
    title: "Subtract a trend",
    fields: [
      {
        member: "trend",
        title: "trend",
        choices: [
          ["mean", "the mean"],
          ["slope", "the slope; the mean stays"],
          ["line", "the straight line"],
        ],
      },
    ],
    ...OF_ALL,
  },
  shift: {
    title: "Move in time",
    fields: [{ member: "by_s", title: "later by, s", kind: "number" }],
    ...OF_CHOSEN,
  },
  remove: { title: "Leave signals out", fields: [], ...OF_CHOSEN },
};

// The language of equations can write such names, and these words mean something else in it.
const WRITABLE = /^[A-Za-z_][A-Za-z0-9_]*$/;
const WORDS = ["pi", "sample_time", "and", "or", "not"];

/**
 * Gives the names that equations have for signals: the signal's own, or `s2` for the second signal of a name that the
 * language cannot write.
 *
 * @param {string[]} signals
 * @returns {Map<string, string>} the signals by the names in equations
 */
export function equationNames(signals) {
  const names = new Map();
  signals.forEach((signal, k) => {
    const isWritable = WRITABLE.test(signal) && !WORDS.includes(signal);
    let name = isWritable ? signal : `s${k + 1}`;
    while (!isWritable && signals.includes(name)) {
      name += "_";
    }
    names.set(name, signal);
  });
  return names;
}

/**
 * Gives the signals that are there at a step: those of the recording as the steps before left them.
 *
 * @param {string[]} recorded
 * @param {StepDraft[]} before
 */
export function signalsAt(recorded, before) {
  let signals = [...recorded];
  for (const { step, texts, signals: chosen } of before) {
    const name = texts.signal?.trim();
    if (step === "calculate" && name && !signals.includes(name)) {
      signals.push(name);
    }
    if (step === "remove") {
      signals = signals.filter((signal) => !chosen.includes(signal));
    }
  }
  return signals;
}

/**
 * Gives the signal that a preview begins with: the last that a step makes or is about, else the first that is left.
 *
 * @param {string[]} recorded
 * @param {StepDraft[]} drafts
 */
export function signalToShow(recorded, drafts) {
  const left = signalsAt(recorded, drafts);
  const named = drafts.flatMap(({ texts, signals }) => [texts.signal?.trim() ?? "", ...signals]);
  return named.filter((name) => left.includes(name)).at(-1) ?? left[0] ?? recorded[0];
}

/**
 * Gives the step that a draft stands for, with the names that its equation uses and cannot write.
 *
 * @param {StepDraft} draft
 * @param {string[]} signals the signals at the step
 */
export function stepOf({ step, texts, signals: chosen }, signals) {
  const kind = KINDS[step];
  const written = kind.fields.map(({ member, kind: type }) => {
    const text = (texts[member] ?? "").trim();
    return [member, type === "number" && text !== "" ? numberOf(text) : text];
  });
  const members = Object.fromEntries(written.filter(([, value]) => value !== ""));
  if (kind.signals && (chosen.length || !(kind.all || kind.optionalSignals))) {
    members[kind.signals] = chosen;
  }
  if (step === "calculate") {
    const used = [...equationNames(signals)].filter(
      ([name, signal]) => name !== signal && new RegExp(`\\b${name}\\b`).test(members.equation ?? ""),
    );
    Object.assign(members, used.length && { names: Object.fromEntries(used) });
  }
  return { step, ...members };
}

/**
 * Gives the drafts that steps are shown as. Names of signals in an equation become those of the form.
 *
 * @param {any[]} steps
 * @param {string[]} recorded
 * @returns {StepDraft[]}
 */
export function draftsOf(steps, recorded) {
  /** @type {StepDraft[]} */
  const drafts = [];
  for (const { step, names = {}, ...members } of steps) {
    const kind = KINDS[step];
    const texts = Object.fromEntries(
      kind.fields.map(({ member }) => [member, String(members[member] ?? "")]),
    );
    const shown = [...equationNames(signalsAt(recorded, drafts))];
    for (const [name, signal] of Object.entries(names)) {
      const written = shown.find(([, of]) => of === signal)?.[0] ?? name;
      texts.equation = texts.equation.replace(new RegExp(`\\b${name}\\b`, "g"), written);
    }
    drafts.push({ step, texts, signals: kind.signals ? (members[kind.signals] ?? []) : [] });
  }
  return drafts;
}

/**
 * Lists the numbers of a form that are none.
 *
 * @param {StepDraft[]} drafts
 * @returns {import("../shell/faults.js").Fault[]}
 */
export const faultsOfDrafts = (drafts) =>
  drafts.flatMap(({ step, texts }, k) =>
    KINDS[step].fields
      .filter(({ kind, member }) => kind === "number" && (texts[member] ?? "").trim() !== "")
      .filter(({ member }) => !Number.isFinite(numberOf(texts[member])))
      .map(({ member }) => ({ pointer: `/steps/${k}/${member}`, detail: "a number is needed here" })),
  );

/**
 * Gives what a prepared recording was made of; nothing for other recordings.
 *
 * @param {{ source?: { format: string, options: Record<string, string> } }} dataset
 */
export function recipeOf({ source }) {
  if (source?.format !== "prepared") {
    return null;
  }
  const { dataset, version, steps } = source.options;
  return { dataset, version: Number(version), steps: JSON.parse(steps) };
}
