// @ts-check
// The page of a job that selects windows of a stream shows how many windows were looked at; in the end it shows
// which windows fix the parameters best, what they fix, and what was left out.

import { repeatKey, send } from "../shell/api.js";
import { h, notice, table, warningList } from "../shell/dom.js";
import { count, duration, instant, number, percent, unitText, words } from "../shell/format.js";
import { isFinished } from "./feed.js";
import { plainPanel } from "./plain.js";
import { Ribbon } from "./ribbon.js";
import {
  conclusion,
  errorText,
  expectationOf,
  lookedText,
  reasonText,
  streamAddress,
  windowsText,
} from "./windows.js";

const CHOSEN_COLUMNS = [
  { title: "From" },
  { title: "To" },
  { title: "Samples", numeric: true },
  { title: "What moved" },
];

const LEFT_OUT_COLUMNS = [
  { title: "Why" },
  { title: "Windows", numeric: true },
  { title: "Together", numeric: true },
];

const ADDS =
  "What a window adds is the share of what is known of the parameter that would be lost without the window.";

export function selectionPanel(view) {
  return plainPanel(view, {
    label: "Selection of windows",
    title: "Windows to estimate from",
    counts: (job, latest) => [["Windows looked at", isFinished(job) ? null : lookedText(job, latest)]],
    report: (selection, job) => report(selection, job, view),
  });
}

function report(selection, job, view) {
  const { chosen, findings, left_out: leftOut } = selection;
  return [
    h("p", { class: "conclusion" }, h("strong", {}, conclusion(selection))),
    findings.length > 0 && warningList(findings),
    actions(job, chosen.length > 0 && isFinished(job)),
    new Ribbon(view, selection).element,
    h(
      "div",
      { class: "analysis" },
      chosen.length > 0 && titled("Chosen windows", chosenTable(selection), h("p", { class: "quiet" }, ADDS)),
      titled("What would be known", expectationTable(selection)),
      leftOut.length > 0 && titled("What was left out", leftOutTable(leftOut)),
    ),
  ];
}

const titled = (title, ...content) => h("div", {}, h("h3", {}, title), content);

// The chosen windows become recordings, and the job that the selection began from is done again on these. A selection
// can be asked for again, with other windows, targets or starts.
function actions(job, hasWindows) {
  const outcome = notice();
  const keyOf = repeatKey();
  const submit = async ({ target }) => {
    target.disabled = true;
    await outcome.attempt(async () => {
      const headers = { "idempotency-key": keyOf(job.id) };
      const { data } = await send("POST", `/v1/jobs/${job.id}/estimation`, undefined, { headers });
      location.hash = `/jobs/${data.id}`;
    });
    target.disabled = false;
  };
  return h(
    "div",
    {},
    h(
      "div",
      { class: "actions" },
      hasWindows &&
        h("button", { type: "button", class: "primary", onclick: submit }, "Estimate from these windows"),
      h("a", { class: "button", href: `#/plant/windows/new?selection=${job.id}` }, "Ask again"),
    ),
    outcome.place,
  );
}

// The wanted parameters stand before the others.
function inOrder({ wanted, chosen }) {
  const names = wanted.map(({ name }) => name);
  return [...new Set([...names, ...chosen.flatMap(({ adds }) => Object.keys(adds))])];
}

function chosenTable(selection) {
  const names = inOrder(selection);
  return table(
    "Chosen windows",
    [...CHOSEN_COLUMNS, ...names.map((name) => ({ title: `Adds to ${words(name)}`, numeric: true }))],
    selection.chosen.map(({ from, to, samples, moved, adds }) => [
      h("a", { href: streamAddress(selection.stream, from, to) }, instant(from, true)),
      instant(to, true),
      count(samples),
      moved.map(words).join(", ") || "–",
      ...names.map((name) => (name in adds ? percent(Number((100 * adds[name]).toPrecision(2))) : "–")),
    ]),
    { stacked: true },
  );
}

// Without a chosen window there is nothing to compare with.
function expectationTable(selection) {
  const { wanted, chosen, with_chosen: parameters } = selection;
  const compared = chosen.length > 0 ? ["chosen", "random"] : [];
  const columns = [
    { title: "Parameter" },
    { title: "Value", numeric: true },
    { title: "Unit" },
    { title: "Asked for", numeric: true },
    ...compared.map((kind) => ({ title: `With ${windowsText(chosen.length, kind)}`, numeric: true })),
    { title: "With all windows", numeric: true },
  ];
  const targets = new Map(wanted.map(({ name, target }) => [name, target]));
  const row = (parameter) => {
    const { name, value, unit } = parameter;
    const errors = expectationOf(selection, name);
    const target = targets.get(name) ?? null;
    return [
      words(name),
      number(value, 5),
      unitText(unit),
      target === null ? "–" : errorText(target, parameter),
      ...[...compared, "all"].map((kind) => errors[kind]),
    ];
  };
  return table("What would be known", columns, parameters.map(row), {
    empty: "Nothing would be known.",
    stacked: true,
  });
}

function leftOutTable(entries) {
  return table(
    "What was left out",
    LEFT_OUT_COLUMNS,
    entries.map(({ reason, windows, hours }) => [reasonText(reason), count(windows), duration(3600 * hours)]),
    { stacked: true },
  );
}
