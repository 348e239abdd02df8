// @ts-check
// The plots show measured over simulated outputs, their residuals and the inputs that drove them, an
// experiment after the other. The plots of an experiment share cursor and part; each part is read from
// the server by itself.

import { clockOf } from "../plot/clock.js";
import { PlotGroup } from "../plot/group.js";
import { isAbout, shadedSpans } from "../plot/math.js";
import { plot } from "../plot/plot.js";
import { recordedUnit } from "../plot/units.js";
import { get, query } from "../shell/api.js";
import { h, notice } from "../shell/dom.js";
import { words } from "../shell/format.js";

// The half width of a 95 % interval is so many standard deviations.
const NORMAL_95 = 1.96;

export function trajectoryPanel(view, id) {
  const outcome = notice();
  const charts = h("div", { class: "experiments" });
  const element = h(
    "section",
    { "aria-label": "Outputs", "data-part": "Measured and simulated", hidden: true },
    h("h2", { id: "outputs" }, "Measured and simulated"),
    outcome.place,
    charts,
  );
  let leave = null;
  return {
    element,
    async load(job) {
      element.hidden = false;
      leave?.abort();
      leave = new AbortController();
      const signal = leave.signal;
      view.signal.addEventListener("abort", () => leave.abort(), { once: true });
      try {
        const { data } = await get(`/v1/jobs/${id}/trajectory?max_points=2`, signal);
        charts.replaceChildren();
        const recordings = await Promise.all(
          data.experiments.map(({ dataset }) => recordingOf(dataset, signal)),
        );
        for (const [k, experiment] of data.experiments.entries()) {
          const { length: number } = data.experiments;
          const place = h("div", {});
          charts.append(place);
          draw({ place, id, job, experiment, k, number, recording: recordings[k], signal, outcome });
        }
      } catch (error) {
        outcome.fail(error);
      }
    },
  };
}

// The recording is null where it is deleted; the plots then do without its clock and its units.
function recordingOf(dataset, signal) {
  return get(`/v1/datasets/${dataset}`, signal).then(
    ({ data }) => data,
    () => null,
  );
}

function draw({ place, id, job, experiment, k, number, recording, signal, outcome }) {
  const specification = job?.spec?.experiments?.[k] ?? {};
  if (number > 1) {
    const role = specification.role === "validation" ? ", which only checks" : "";
    place.append(h("h3", {}, `Experiment ${k + 1}${role}`));
  }
  const outputs = Object.keys(experiment.outputs);
  const inputs = Object.entries(specification.signals ?? {}).filter(([name]) => !outputs.includes(name));
  const full = experiment.span_s ?? [0, 1];
  const group = new PlotGroup({
    full,
    signal,
    clock: clockOf(recording),
    failed: (error) => outcome.fail(error),
    load: (from, to, pixels, abort) =>
      read({ id, k, experiment, inputs, full, from, to, pixels, abort, outputs: outputs.length }),
  });
  place.append(group.toolbar);
  const spans = shaded(experiment, specification, full);
  const x = { label: "time", unit: "s" };
  const signalNamed = (name) => recording?.signals.find((entry) => entry.name === name);
  for (const name of outputs) {
    const column = specification.signals?.[name] ?? name;
    const recorded = recordedUnit(signalNamed(column));
    const spansOfOutput = spans.filter(isAbout(column));
    const { unit, deviation } = experiment.outputs[name];
    // The band is where the simulated output lies with 95 % under the errors of the estimates.
    const band = deviation
      ? [
          { name: "95 % band from", legend: "95 % band", look: "faint" },
          { name: "to", legend: null, look: "faint" },
        ]
      : [];
    const compared = plot({
      title: `${words(name)}, measured and simulated`,
      x,
      y: { label: words(name), unit, recorded },
      height: 340,
      group,
      spans: spansOfOutput,
      signal,
      series: [{ name: "measured", look: "measured" }, { name: "simulated", look: "simulated" }, ...band],
      bands: deviation ? [{ upper: 3, lower: 2, look: "simulated" }] : [],
    });
    const residual = plot({
      title: `${words(name)}, residual (measured − simulated)`,
      x,
      y: { label: "residual", unit, difference: true, recorded },
      height: 230,
      group,
      spans: spansOfOutput,
      signal,
      series: [{ name: "residual", look: "second" }],
    });
    group.feed(compared, ({ shown }) => {
      const { measured, simulated, deviation: spread } = shown.outputs[name];
      const ends = spread
        ? [-NORMAL_95, NORMAL_95].map((by) =>
            simulated.map((value, k) => (value === null ? null : value + by * spread[k])),
          )
        : [];
      return [shown.time_s, [measured, simulated, ...ends]];
    });
    group.feed(residual, ({ shown }) => [shown.time_s, [shown.outputs[name].residual]]);
    place.append(compared.element, residual.element);
  }
  for (const name of new Set(inputs.map(([, signal]) => signal))) {
    const input = inputs.find(([, signal]) => signal === name)[0];
    const driven = plot({
      title: `${words(input)}, input`,
      x,
      y: { label: words(input), unit: "", recorded: recordedUnit(signalNamed(name)) },
      height: 210,
      group,
      spans: spans.filter(isAbout(name)),
      signal,
      series: [{ name: words(input), look: "first", step: true }],
    });
    group.feed(driven, ({ driving }) => {
      const column = driving?.signals?.[name];
      if (column && driven.y.unit !== column.unit) {
        driven.y.unit = column.unit;
        driven.changeUnit();
      }
      return column ? [driving.time_s, [column.values]] : [[], [[]]];
    });
    place.append(driven.element);
  }
  group.start();
}

async function read({ id, k, experiment, inputs, full, from, to, pixels, abort, outputs }) {
  const part = { from, to, max_points: Math.min(100_000, 3 * outputs * pixels) };
  const shown = get(`/v1/jobs/${id}/trajectory${query({ experiment: k, ...part })}`, abort);
  const names = [...new Set(inputs.map(([, signal]) => signal))].filter((name) => !name.includes(","));
  const driving =
    names.length === 0
      ? null
      : get(
          `/v1/datasets/${experiment.dataset}/samples${query({
            signals: names.join(","),
            from: from ?? full[0],
            to: to ?? full[1],
            max_points: Math.min(100_000, 2 * names.length * pixels),
          })}`,
          abort,
        ).then(
          ({ data }) => data,
          (error) => {
            // The inputs are a help; where their recording is deleted, the outputs are plotted without
            // them.
            if (error.name === "AbortError") {
              throw error;
            }
            return null;
          },
        );
  // Both requests end with the same signal, so both are waited for together.
  const [{ data }, recorded] = await Promise.all([shown, driving]);
  return { shown: data.experiments[0], driving: recorded };
}

// The shaded spans are the parts of an experiment that are held back or left out: by the job itself, or by the version
// of the recording's marks that the job was worked on.
function shaded(experiment, { exclude, version, role }, full) {
  const spans = shadedSpans([...(exclude?.spans ?? []), ...(version?.marks ?? [])]);
  const until = experiment.estimation_until_s;
  const all = role === "validation";
  if (all || (until !== null && until < full[1])) {
    spans.push({ from: all ? full[0] : until, to: full[1], kind: "held", signals: null });
  }
  return spans;
}
