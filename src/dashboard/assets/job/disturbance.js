// @ts-check
// The panel shows what acted on the plant beside its inputs: the disturbances of the result in words, over
// time with their bands and events, the noise models that were compared, and how well the outputs are
// expected from sample to sample. It shows for a result that has process noise alone.

import { PlotGroup } from "../plot/group.js";
import { plot } from "../plot/plot.js";
import { get, query } from "../shell/api.js";
import { h, notice, table } from "../shell/dom.js";
import { count, number, percent, quantity, unitText, words } from "../shell/format.js";
import { actedOn, plainUnit, sentence } from "./disturbance_words.js";

// The half width of a 95 % interval is so many standard deviations.
const NORMAL_95 = 1.96;
// Beyond this, what a disturbance received is an event.
const EVENT = 4;
const EVENTS_SHOWN = 8;

/** @typedef {import("page/api").Schemas["ProcessNoiseReport"]} ProcessNoiseReport */

export function disturbancePanel(view, id) {
  const outcome = notice();
  const content = h("div", {});
  const element = h(
    "section",
    { "aria-label": "What acted on the plant", "data-part": "What acted on the plant", hidden: true },
    h("h2", { id: "disturbance" }, "What acted on the plant"),
    outcome.place,
    content,
  );
  let leave = null;
  return {
    element,
    async load(job, result) {
      leave?.abort();
      const noise = result.process_noise;
      element.hidden = !noise;
      if (!noise) {
        return;
      }
      leave = new AbortController();
      const signal = leave.signal;
      view.signal.addEventListener("abort", () => leave.abort(), { once: true });
      const charts = h("div", {});
      const events = h("div", {});
      content.replaceChildren(
        h(
          "div",
          { class: "workbench" },
          h("div", {}, ...told(noise), charts),
          h("div", {}, ...compared(noise), events),
        ),
      );
      if (noise.disturbances.length === 0) {
        return;
      }
      try {
        const { data } = await get(`/v1/jobs/${id}/disturbance?max_points=2`, signal);
        for (const experiment of data.experiments) {
          const { length: number } = data.experiments;
          draw({ place: charts, events, id, job, experiment, number, signal, outcome });
        }
      } catch (error) {
        outcome.fail(error);
      }
    },
  };
}

/** @param {ProcessNoiseReport} noise */
function told({ disturbances }) {
  if (disturbances.length === 0) {
    return [
      h(
        "p",
        {},
        "Of the noise models that were compared, none with a disturbance explains the data better than the sensors’ noise alone.",
      ),
    ];
  }
  return [
    disturbances.map((disturbance) => h("p", {}, sentence(disturbance))),
    h(
      "p",
      { class: "quiet" },
      "The parameters are the plant’s physical ones if the disturbance follows neither the inputs nor the states. A disturbance that does, such as a friction that the equations lack, is taken for noise in part and moves the parameters: the verdict says what speaks for that.",
    ),
  ].flat();
}

/** @param {ProcessNoiseReport} noise */
function compared({ chosen, compared: models, innovations, held_back: heldBack }) {
  const plainName = (name) => words(name.replaceAll("`", ""));
  const rows = models.map(({ name, log_likelihood: likelihood, bic }) => [
    name === chosen ? h("strong", {}, `${plainName(name)} (chosen)`) : plainName(name),
    number(likelihood, 6),
    number(bic, 6),
  ]);
  const white = { true: "yes", false: "no" };
  const tests = Object.entries(innovations).map(([output, test]) => {
    const band = heldBack?.[output];
    return [
      words(output),
      white[test.white] ?? "–",
      number(test.chi_square_per_sample, 3),
      number(test.lag_1_autocorrelation, 2),
      band ? `${percent(Number((100 * band.inside).toPrecision(3)))} of ${count(band.samples)}` : "–",
    ];
  });
  return [
    h("h3", {}, "Noise models that were compared"),
    table(
      "Noise models that were compared",
      [
        { title: "Noise model" },
        { title: "Log-likelihood", numeric: true },
        { title: "BIC, lowest is best", numeric: true },
      ],
      rows,
      { stacked: true },
    ),
    h("h3", {}, "Errors of prediction from sample to sample"),
    table(
      "Errors of prediction from sample to sample",
      [
        { title: "Output" },
        { title: "White" },
        { title: "χ² per sample, 1 is right", numeric: true },
        { title: "Lag-1 autocorrelation", numeric: true },
        { title: "Held back, in the 95 % band", numeric: true },
      ],
      tests,
      { stacked: true },
    ),
  ];
}

function draw({ place, events, id, job, experiment, number: experiments, signal, outcome }) {
  const { experiment: k, disturbances, span_s: full = [0, 1] } = experiment;
  const specification = job?.spec?.experiments?.[k] ?? {};
  if (experiments > 1) {
    place.append(h("h3", {}, `Experiment ${k + 1}`));
  }
  const several = experiments > 1 || disturbances.length > 1;
  const titleOf = ({ acts_on: actsOn }) =>
    several ? `Events of the ${actedOn(actsOn)}${experiments > 1 ? `, experiment ${k + 1}` : ""}` : "Events";
  const columns = 2 * disturbances.length + Object.keys(experiment.outputs).length;
  const group = new PlotGroup({
    full,
    signal,
    failed: (error) => outcome.fail(error),
    load: async (from, to, pixels, abort) => {
      const part = { experiment: k, from, to, max_points: Math.min(100_000, columns * pixels) };
      const { data } = await get(`/v1/jobs/${id}/disturbance${query(part)}`, abort);
      return data.experiments[0];
    },
  });
  place.append(group.toolbar);
  const held = heldBack(experiment, specification, full);
  disturbances.forEach((disturbance, index) => {
    place.append(...pictures({ disturbance, index, group, held, signal }));
    events.append(eventList(disturbance, group, titleOf(disturbance)));
  });
  group.start();
}

// The charts of a disturbance show its path with the band, and how unexpected each step of it is.
function pictures({ disturbance, index, group, held, signal }) {
  const { acts_on: actsOn, kind, events } = disturbance;
  const name = actedOn(actsOn);
  const unit = plainUnit(disturbance.unit);
  const spans = [...events.map(({ start_s: from, end_s: to }) => ({ from, to, kind: "event" })), ...held];
  const step = kind === "white";
  const x = { label: "time", unit: "s" };
  const path = plot({
    title: `Disturbance of the ${name}`,
    x,
    y: { label: `disturbance of the ${name}`, unit, difference: true },
    height: 280,
    group,
    spans,
    signal,
    series: [
      { name: step ? "mean from sample to sample" : "disturbance", look: "first", step },
      { name: "95 % band from", legend: "95 % band", look: "measured", thin: true, step },
      { name: "to", legend: null, look: "measured", thin: true, step },
    ],
    bands: [{ upper: 2, lower: 1, look: "first" }],
  });
  const surprise = plot({
    title: "How unexpected each change is (t)",
    x,
    y: { label: "t", unit: "" },
    height: 220,
    group,
    spans,
    signal,
    series: [
      { name: "t", look: "second" },
      { name: "event above", legend: "limits of an event", look: "faint" },
      { name: "and below", legend: null, look: "faint" },
    ],
  });
  group.feed(path, (shown) => {
    const { value, deviation } = shown.disturbances[index];
    const end = (by) =>
      value.map((middle, k) =>
        middle === null || deviation[k] === null ? null : middle + by * deviation[k],
      );
    return [shown.time_s, [value, end(-NORMAL_95), end(NORMAL_95)]];
  });
  group.feed(surprise, (shown) => {
    const { t } = shown.disturbances[index];
    return [shown.time_s, [t, t.map(() => EVENT), t.map(() => -EVENT)]];
  });
  return [path.element, surprise.element];
}

function eventList({ events, event_count: all, kind, unit }, group, name) {
  if (events.length === 0) {
    return h(
      "div",
      {},
      h("h3", {}, name),
      h("p", { class: "quiet" }, `None: no change is beyond t = ±${EVENT}.`),
    );
  }
  const shown = [...events].sort((a, b) => Math.abs(b.t) - Math.abs(a.t)).slice(0, EVENTS_SHOWN);
  const rows = shown.map(({ start_s: from, end_s: to, size, t }) => {
    const room = Math.max(5 * (to - from), 0.02 * (group.full[1] - group.full[0]));
    const show = () => group.show([from - room, to + room]);
    return [
      h("button", { type: "button", class: "small", onclick: show }, `${number(from, 6)} s`),
      quantity(number(to - from, 3), "s"),
      quantity(number(size, 3), plainUnit(unitText(unit))),
      number(t, 3),
    ];
  });
  const title = `${name}, the largest first${all > shown.length ? ` (${shown.length} of ${count(all)})` : ""}`;
  return h(
    "div",
    {},
    h("h3", {}, title),
    table(
      title,
      [
        { title: "Begins" },
        { title: "Lasts", numeric: true },
        { title: kind === "white" ? "Mean" : "Change", numeric: true },
        { title: "t", numeric: true },
      ],
      rows,
    ),
  );
}

// The part of an experiment that is held back is shaded.
function heldBack({ estimation_until_s: until }, { role }, full) {
  const all = role === "validation";
  return all || (until !== null && until < full[1])
    ? [{ from: all ? full[0] : until, to: full[1], kind: "held" }]
    : [];
}
