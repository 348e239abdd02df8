// @ts-check
// The page of a job that designs an experiment shows its progress and the best experiment so far; in
// the end it shows what to play or when to measure, and what the experiment is expected to bring.

import { plot } from "../plot/plot.js";
import { h, table, warningList } from "../shell/dom.js";
import { count, number, unitText, words } from "../shell/format.js";
import { plainPanel } from "./plain.js";
import { listed } from "./verdict.js";

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
  { title: "Error, best = 1", numeric: true },
];

const SENSOR_COLUMNS = [{ title: "One sensor more" }, { title: "Error with it, without = 1", numeric: true }];

const OF_THE_RANGE =
  "Levels and amplitudes are shares of the range of the input: −1 is its lower limit, 1 its upper one.";

const UNIT_OF = { s: "s", hz: "Hz" };

export function designPanel(view) {
  return plainPanel(view, {
    label: "Design of an experiment",
    title: "The next experiment",
    counts: ({ progress }) => [["Experiments looked at", count(progress?.evaluations)]],
    interim: ({ assessed, best }) => [
      h("p", {}, `Best of ${count(assessed)}: ${titled(best)}.`),
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
      h("strong", {}, titled(best)),
      `: of the experiments looked at${design.finished ? "" : " so far"}, this one fixes ${listed(design.wanted)} best.`,
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
    proposals.some(({ excitation }) => "levels" in excitation || "amplitude" in excitation) &&
      h("p", { class: "quiet" }, OF_THE_RANGE),
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

// A proposal that has the name of its kind is named once.
function titled({ name, excitation }) {
  return name === excitation.kind ? played(excitation) : `${words(name)}, ${played(excitation)}`;
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
