// @ts-check
// The part shows how an output moves over time as each unknown moves up by a step, and ranks the unknowns by it.
// The experiment is simulated once with the estimates, and once more for each unknown.

import { simulationOf } from "../model/request.js";
import { clockOf } from "../plot/clock.js";
import { PlotGroup } from "../plot/group.js";
import { plot } from "../plot/plot.js";
import { onUnits, recordedUnit, shownUnit, toShown } from "../plot/units.js";
import { get, query, send } from "../shell/api.js";
import { h, notice, svg, table } from "../shell/dom.js";
import { count, number, percent, quantity, words } from "../shell/format.js";
import { alikePairs, fittedStarts, movement, ranked, stepOf, unknownsOf, valuesOf } from "./moves.js";
import { listed } from "./verdict.js";

const AT_ONCE = 3;
const MOST_POINTS = 100_000;
// The lines have so many colours.
const MOST_LINES = 10;
const LEAST_SHARE = 1e-5;

const MEANING =
  "An unknown whose line stays at zero has no effect on the output, which then says nothing of its value; two unknowns whose lines have the same shape can stand in for each other, so that the data fix a combination of them and neither by itself.";
const METHOD =
  "Each line is a one-sided difference of two simulations: with that unknown at its estimate plus the step, and with all unknowns at their estimates.";
const FREE_RUN =
  "The simulations run free: the disturbances that the job estimated do not act in them, and no sample corrects them.";

/** @typedef {import("./moves.js").Simulated} Simulated */
/** @typedef {import("./moves.js").Unknown} Unknown */
/** @typedef {{ unknown: Unknown, size: number | null, reason?: string, simulated?: Simulated }} Moved */
/** @typedef {{ base: Simulated & { samples: number, decimated: boolean }, moved: Moved[] }} Simulations */

export function influencePart(view, job, result) {
  const { spec } = job;
  const hasErrors = unknownsOf(result).some(({ error }) => error !== null && error > 0);
  const outcome = notice();
  const progress = h("p", { class: "quiet", role: "status" });
  const place = h("div", {});
  const experiment = choice("Experiment", spec.experiments.map(experimentOption), () => ask());
  const output = choice("Output", [], () => draw());
  const step = choice(
    "Each unknown moves up by",
    [...(hasErrors ? [["error", "its total standard error"]] : []), ["percent", "1 % of its value"]],
    () => ask(),
  );
  const state = { asking: new AbortController(), drawing: new AbortController(), answer: null };

  const draw = () => {
    state.drawing.abort();
    state.drawing = new AbortController();
    const signal = AbortSignal.any([state.drawing.signal, view.signal]);
    const { simulations, recording, k } = state.answer;
    output.offer(Object.keys(simulations.base.outputs).map((name) => [name, words(name)]));
    const name = output.select.value;
    const column = spec.experiments[k].signals?.[name] ?? name;
    const recorded = recordedUnit(recording?.signals.find((entry) => entry.name === column));
    const noise = result.residuals?.[name]?.noise_std ?? null;
    place.replaceChildren(...pictures({ simulations, recording, output: name, recorded, noise, signal }));
  };
  const ask = async () => {
    state.asking.abort();
    state.asking = new AbortController();
    const signal = AbortSignal.any([state.asking.signal, view.signal]);
    const k = Number(experiment.select.value);
    outcome.clear();
    const tell = (done, all) => {
      progress.textContent = done < all ? `Simulated ${done} of ${all} …` : "";
    };
    try {
      const unknowns = unknownsOf(result, k, spec.experiments[k].parameters);
      const starts = fittedStarts(result, k);
      const asked = { spec, k, unknowns, starts, step: step.select.value };
      const [simulations, recording] = await Promise.all([
        simulateAll(asked, signal, tell),
        get(`/v1/datasets/${spec.experiments[k].dataset}`, signal).then(
          ({ data }) => data,
          () => null,
        ),
      ]);
      signal.throwIfAborted();
      state.answer = { simulations, recording, k };
      draw();
    } catch (error) {
      if (error.name !== "AbortError") {
        place.replaceChildren();
        progress.textContent = "";
        outcome.fail(error);
      }
    }
  };
  ask();
  return h(
    "div",
    {},
    h("div", { class: "fields" }, experiment.element, output.element, step.element),
    progress,
    outcome.place,
    place,
    h("p", { class: "quiet" }, MEANING),
    h("p", { class: "quiet" }, METHOD, result.process_noise ? ` ${FREE_RUN}` : ""),
  );
}

// A choice of a single option is not offered.
function choice(label, options, act) {
  const select = h("select", { onchange: act });
  const element = h("label", {}, label, select);
  const offer = (entries) => {
    const { value } = select;
    select.replaceChildren(...entries.map(([name, text]) => h("option", { value: name }, text)));
    select.value = entries.some(([name]) => name === value) ? value : entries[0]?.[0];
    element.hidden = entries.length < 2;
  };
  offer(options);
  return { element, select, offer };
}

function experimentOption({ role }, k) {
  return [String(k), `${k + 1}${role === "validation" ? ", which only checks" : ""}`];
}

// Simulates an experiment with the estimates and with each unknown moved. An unknown that cannot be moved says why.
/**
 * @param {{ spec: any, k: number, unknowns: Unknown[], starts: Record<string, number>, step: import("./moves.js").StepKind }} asked
 * @param {AbortSignal} signal
 * @param {(done: number, all: number) => void} tell
 * @returns {Promise<Simulations>}
 */
async function simulateAll({ spec, k, unknowns, starts, step }, signal, tell) {
  const simulate = async ({ values, states }) => {
    const address = `/v1/simulations${query({ max_points: MOST_POINTS })}`;
    const { data } = await send("POST", address, simulationOf(spec, k, values, { ...starts, ...states }), {
      signal,
    });
    return data;
  };
  let done = 0;
  tell(done, unknowns.length + 1);
  const base = await simulate(valuesOf(unknowns));
  /** @type {Moved[]} */
  const moved = unknowns.map((unknown) => ({ unknown, ...stepOf(unknown, step) }));
  const waiting = [...moved];
  const work = async () => {
    for (let entry = waiting.shift(); entry; entry = waiting.shift()) {
      done += 1;
      tell(done, unknowns.length + 1);
      if (entry.size !== null) {
        try {
          entry.simulated = await simulate(valuesOf(unknowns, entry.unknown, entry.size));
        } catch (error) {
          if (error.name === "AbortError") {
            throw error;
          }
          entry.reason = `not simulated: ${error.errors?.[0]?.detail ?? error.message}`;
        }
      }
    }
  };
  await Promise.all(Array.from({ length: AT_ONCE }, work));
  tell(unknowns.length + 1, unknowns.length + 1);
  return { base, moved };
}

// The lines of an output over time, the ranking of the unknowns, and what lines of the same shape say.
/** @param {{ simulations: Simulations, recording: any, output: string, recorded: any, noise: number | null, signal: AbortSignal }} shown */
function pictures({ simulations, recording, output, recorded, noise, signal }) {
  const { base, moved } = simulations;
  const { unit, values } = base.outputs[output];
  const rows = ranked(
    moved.flatMap(({ unknown, size, simulated }) =>
      simulated ? [{ label: unknown.label, unknown, size, line: movement(base, simulated, output) }] : [],
    ),
    values,
  );
  const drawn = rows.slice(0, MOST_LINES);
  const full = [base.time_s[0] ?? 0, base.time_s.at(-1) ?? 1];
  const group = new PlotGroup({ full, clock: clockOf(recording), signal });
  const chart = plot({
    title: `${words(output)}: how each unknown moves it`,
    x: { label: "time", unit: "s" },
    y: { label: `movement of ${words(output)}`, unit, difference: true, recorded },
    height: 320,
    group,
    signal,
    series: drawn.map(({ label }, k) => ({ name: label, look: `row-${k}`, legend: label })),
  });
  chart.set(
    base.time_s,
    drawn.map(({ line }) => line),
  );
  const ranking = h("div", {});
  const rank = () => {
    const reading = shownUnit(unit, { difference: true, recorded });
    ranking.replaceChildren(rankingTable({ rows, moved, noise, reading }));
  };
  onUnits(rank, signal);
  rank();
  return [
    group.toolbar,
    drawn.length > 0 && chart.element,
    ranking,
    h("p", {}, shapesText(rows), " ", samplesText(base, rows.length)),
  ].filter(Boolean);
}

const COLUMNS = [
  { title: "Unknown" },
  { title: "Step", numeric: true },
  { title: "Moves the output by (rms)", numeric: true },
  { title: "In standard deviations of the noise", numeric: true },
  { title: "Share of the squares", numeric: true },
  { title: "Beside the largest" },
];

function rankingTable({ rows, moved, noise, reading }) {
  const stepText = ({ unknown, size }) =>
    size === null ? "–" : quantity(`+${number(size, 3)}`, unknown.unit);
  const most = rows[0]?.rms || 1;
  const ranks = rows.map((entry, k) => [
    [swatch(k), " ", entry.label],
    stepText(entry),
    quantity(number(toShown(entry.rms, { ...reading, offset: 0 }), 3), reading.name),
    noise > 0 ? number(entry.rms / noise, 3) : "–",
    shareText(entry.share),
    lengthBar(entry.rms / most, k),
  ]);
  const failed = moved
    .filter(({ simulated }) => !simulated)
    .map((entry) => [
      entry.unknown.label,
      stepText(entry),
      "–",
      "–",
      "–",
      h("span", { class: "quiet" }, entry.reason),
    ]);
  return table("What each unknown moves", COLUMNS, [...ranks, ...failed], { stacked: true });
}

// A share is written to three digits, and the smallest not at all.
function shareText(share) {
  return share > 0 && share < LEAST_SHARE
    ? `< ${percent(100 * LEAST_SHARE)}`
    : percent(Number((100 * share).toPrecision(3)));
}

// The bar and the swatch have the colour of the unknown's line; an unknown without a line has none.
const fillOf = (k) => (k < MOST_LINES ? `fill row-${k}` : "fill");

function swatch(k) {
  return svg(
    "svg",
    { width: 12, height: 12, "aria-hidden": "true" },
    svg("rect", { width: 12, height: 12, rx: 2, class: fillOf(k) }),
  );
}

function lengthBar(share, k) {
  return svg(
    "svg",
    { class: "bar-of", viewBox: "0 0 100 20", preserveAspectRatio: "none", "aria-hidden": "true" },
    svg("rect", { width: 100 * share, y: 4, height: 12, class: fillOf(k) }),
  );
}

function shapesText(rows) {
  const pairs = alikePairs(rows);
  if (rows.length < 2) {
    return "";
  }
  return pairs.length === 0
    ? "No two of the lines have the same shape."
    : `Lines of the same shape: ${pairs
        .map(({ labels, cosine }) => `${listed(labels)}${cosine < 0 ? " (turned over)" : ""}`)
        .join("; ")}.`;
}

function samplesText({ samples, decimated, time_s: instants }, lines) {
  const more = lines > MOST_LINES ? ` The plot shows the ${MOST_LINES} largest of ${lines} lines.` : "";
  return decimated
    ? `${count(instants.length)} of ${count(samples)} samples are compared, the extremes of each stretch among them.${more}`
    : more;
}
