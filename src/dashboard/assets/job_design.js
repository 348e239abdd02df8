// @ts-check
// A job that designs an experiment: how far it is, the best so far, and in the end what to play or
// when to measure, with what that is expected to bring.

import { get } from "./api.js";
import { facts, h, notice, table, warningList } from "./dom.js";
import { count, duration, number, unitText, words } from "./format.js";
import { isFinished } from "./job_feed.js";
import { plot } from "./plot.js";

const KNOWN_COLUMNS = [
  { title: "Unknown" }, { title: "Value", numeric: true }, { title: "± now", numeric: true },
  { title: "± after", numeric: true }, { title: "of which noise", numeric: true }, { title: "Unit" },
];

const RANKED_COLUMNS = [
  { title: "Experiment" }, { title: "What is played" }, { title: "Error against the best", numeric: true },
];

const SENSOR_COLUMNS = [{ title: "One sensor more" }, { title: "Error against without", numeric: true }];

const UNIT_OF = { s: "s", hz: "Hz" };

export function designPanel(view) {
  const bar = h("progress", { max: "1", value: "0", "aria-label": "Progress of the design" });
  const numbers = h("div", {});
  const outcome = notice();
  const content = h("div", {});
  const element = h("section", { "aria-label": "Design of an experiment" },
    h("h2", {}, "The next experiment"), bar, numbers, outcome.place, content);
  let shown = null;
  return {
    element,
    async job(job) {
      const progress = job.progress ?? {};
      bar.value = progress.fraction ?? 0;
      bar.hidden = isFinished(job);
      numbers.replaceChildren(facts([
        ["Experiments looked at", count(progress.evaluations)],
        ["Time left", job.status === "running" && Number.isFinite(progress.eta_s) ? `at most ${duration(progress.eta_s)}` : null],
      ]));
      if ((isFinished(job) || job.status === "paused") && shown !== job.status) {
        shown = job.status;
        await get(`/v1/jobs/${job.id}/result`, view.signal).then(
          ({ data }) => content.replaceChildren(...report(data, view)),
          (error) => error.status === 409 || outcome.fail(error));
      }
    },
    history(best) {
      if (best && shown === null) {
        content.replaceChildren(
          h("p", {}, `Best of ${count(best.assessed)}: ${words(best.best.name)}, ${played(best.best.excitation)}.`),
          knownTable([], best.best.after));
      }
    },
  };
}

function report(design, view) {
  const [best] = design.proposals;
  return [
    h("p", {}, h("strong", {}, words(best.name)), `, ${played(best.excitation)}, shrinks what is not known of ${design.wanted.map(words).join(", ")} most`,
      design.finished ? "." : ", as far as was looked."),
    design.findings.length > 0 && warningList(design.findings),
    h("h3", {}, "What it would bring"), knownTable(design.before, best.after),
    ...playedPlots(design, view),
    h("h3", {}, "Compared"),
    table("Experiments compared", RANKED_COLUMNS, design.proposals.map((own) =>
      [words(own.name), played(own.excitation), `× ${number(own.relative_error, 3)}`])),
    design.sensors.length > 0 && table("Sensors compared", SENSOR_COLUMNS, design.sensors.map((sensor) =>
      [words(sensor.output), `× ${number(sensor.relative_error, 3)}`])),
  ].filter(Boolean);
}

// Standard deviations with all that is taken as known within its tolerance; a dash where the unknown
// is not fixed.
function knownTable(before, after) {
  return table("What would be known", KNOWN_COLUMNS, after.map((own, k) => [
    words(own.name), number(own.value, 5), number(before[k]?.total_standard_error, 3),
    number(own.total_standard_error, 3), number(own.standard_error, 3), unitText(own.unit),
  ]), { empty: "It cannot be simulated at the present values." });
}

function playedPlots({ inputs, proposals }, view) {
  if (!inputs) {
    const instants = proposals[0].excitation.instants_s;
    return instants ? [h("p", {}, `Measure at ${instants.map((instant) => number(instant, 5)).join(", ")} s.`)] : [];
  }
  return Object.entries(inputs.signals).map(([name, { unit, values }]) => {
    const chart = plot({
      title: `Play ${words(name)}`, signal: view.signal,
      x: { label: "time", unit: "s" }, y: { label: words(name), unit }, series: [{ name: words(name), look: "first", step: true }],
    });
    chart.set(values.map((_, k) => k * inputs.sample_time_s), [values]);
    return chart.element;
  });
}

// The numbers of an excitation: `clock_s: 0.2` as "clock 0.2 s".
function played({ kind, ...numbers }) {
  const told = Object.entries(numbers).map(([name, value]) => {
    const [, stem, suffix] = /^(.*?)(?:_(s|hz))?$/.exec(name);
    const text = Array.isArray(value) ? value.map((one) => number(one, 3)).join(", ") : number(value, 4);
    return [words(stem), text, UNIT_OF[suffix]].filter(Boolean).join(" ");
  });
  return [words(kind), ...told].join(", ");
}
