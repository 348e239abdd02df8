// @ts-check
// The page of a job that designs an experiment shows its progress and the best experiment so far; in
// the end it shows what to play or when to measure, and what the experiment is expected to bring.

import { plot } from "../plot/plot.js";
import { h, table, warningList } from "../shell/dom.js";
import { count, number, unitText, words } from "../shell/format.js";
import { plainPanel } from "./plain.js";

const KNOWN_COLUMNS = [
  { title: "Unknown" },
  { title: "Value", numeric: true },
  { title: "± now", numeric: true },
  { title: "± after", numeric: true },
  { title: "of which noise", numeric: true },
  { title: "Unit" },
];

const RANKED_COLUMNS = [
  { title: "Experiment" },
  { title: "What is played" },
  { title: "Error against the best", numeric: true },
];

const SENSOR_COLUMNS = [{ title: "One sensor more" }, { title: "Error against without", numeric: true }];

const UNIT_OF = { s: "s", hz: "Hz" };

export function designPanel(view) {
  return plainPanel(view, {
    label: "Design of an experiment",
    title: "The next experiment",
    counts: ({ progress }) => [["Experiments looked at", count(progress?.evaluations)]],
    interim: ({ assessed, best }) => [
      h("p", {}, `Best of ${count(assessed)}: ${words(best.name)}, ${played(best.excitation)}.`),
      knownTable([], best.after),
    ],
    report: (design) => report(design, view),
  });
}

function report(design, view) {
  const [best] = design.proposals;
  return [
    h(
      "p",
      {},
      h("strong", {}, words(best.name)),
      `, ${played(best.excitation)}, shrinks what is not known of ${design.wanted.map(words).join(", ")} most`,
      design.finished ? "." : ", as far as was looked.",
    ),
    design.findings.length > 0 && warningList(design.findings),
    h(
      "div",
      { class: "workbench" },
      h(
        "div",
        {},
        h("h3", {}, "What it would bring"),
        knownTable(design.before, best.after),
        ...comparison(design),
      ),
      h("div", {}, ...playedPlots(design, view)),
    ),
  ];
}

// The proposals, and what a further sensor would bring.
function comparison({ proposals, sensors }) {
  return [
    h("h3", {}, "Compared"),
    table(
      "Experiments compared",
      RANKED_COLUMNS,
      proposals.map((proposal) => [
        words(proposal.name),
        played(proposal.excitation),
        `× ${number(proposal.relative_error, 3)}`,
      ]),
      { stacked: true },
    ),
    sensors.length > 0 &&
      table(
        "Sensors compared",
        SENSOR_COLUMNS,
        sensors.map((sensor) => [words(sensor.output), `× ${number(sensor.relative_error, 3)}`]),
      ),
  ].filter(Boolean);
}

// The table has the standard deviations that count the tolerances of assumed values; an unknown that
// the data do not fix has a dash.
function knownTable(before, after) {
  return table(
    "What would be known",
    KNOWN_COLUMNS,
    after.map((unknown, k) => [
      words(unknown.name),
      number(unknown.value, 5),
      number(before[k]?.total_standard_error, 3),
      number(unknown.total_standard_error, 3),
      number(unknown.standard_error, 3),
      unitText(unknown.unit),
    ]),
    { empty: "It cannot be simulated at the present values.", stacked: true },
  );
}

function playedPlots({ inputs, proposals }, view) {
  if (!inputs) {
    const instants = proposals[0].excitation.instants_s;
    return instants
      ? [h("p", {}, `Measure at ${instants.map((instant) => number(instant, 5)).join(", ")} s.`)]
      : [];
  }
  return Object.entries(inputs.signals).map(([name, { unit, values }]) => {
    const chart = plot({
      title: `Play ${words(name)}`,
      height: 340,
      signal: view.signal,
      x: { label: "time", unit: "s" },
      y: { label: words(name), unit },
      series: [{ name: words(name), look: "first", step: true }],
    });
    chart.set(
      values.map((_, k) => k * inputs.sample_time_s),
      [values],
    );
    return chart.element;
  });
}

// Writes the numbers of an excitation as text: `clock_s: 0.2` becomes "clock 0.2 s".
function played({ kind, ...numbers }) {
  const phrases = Object.entries(numbers).map(([name, value]) => {
    const [, stem, suffix] = /^(.*?)(?:_(s|hz))?$/.exec(name);
    const text = Array.isArray(value)
      ? value.map((element) => number(element, 3)).join(", ")
      : number(value, 4);
    return [words(stem), text, UNIT_OF[suffix]].filter(Boolean).join(" ");
  });
  return [words(kind), ...phrases].join(", ");
}
