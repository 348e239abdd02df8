// This module draws nothing: it computes from the API's answers the axes that the charts of a report must have, and
// tells whether a tick stands where its number lies on the axis.

// Places of a drawing have one decimal.
const ROUNDING = 0.0501;
// A chart leaves this share of the height free above and below.
const MARGIN = 0.04;
// Half the width of a band of 95 %, in standard deviations.
const NORMAL_95 = 1.959964;
// A panel of draws shows this share of them.
const SHOWN = [0.002, 0.998];

const finite = (values) => values.filter((value) => Number.isFinite(value));
export const bracketed = (name, unit) => (unit ? `${name} [${unit}]` : name);
export const inExperiment = ({ experiment = null }) => (experiment === null ? [] : [experiment + 1]);

/**
 * The estimates of a result, each with the key that the API has for it, and with its name in the report.
 *
 * @returns {any[]}
 */
export function unknownsOf({ parameters, initial_states: states }) {
  const place = (word, entry) =>
    inExperiment(entry)
      .map((number) => ` ${word} ${number}`)
      .join("");
  return [
    ...parameters.map((entry) => ({
      ...entry,
      key: `${entry.name}${(entry.experiment ?? null) === null ? "" : `[${entry.experiment}]`}`,
      name: `${entry.name}${place("in experiment", entry)}`,
      label: `${entry.name} (${entry.symbol})${place("in experiment", entry)}`,
    })),
    ...states.map((entry) => {
      const name = `${entry.state}${place("at the start of experiment", entry)}`;
      const number = entry.experiment > 0 ? `_${entry.experiment}` : "";
      return { ...entry, key: `initial_${entry.state}${number}`, name, label: name };
    }),
  ];
}

/** The estimates of a result by their labels in the report. */
export const estimatesOf = (result) =>
  Object.fromEntries(unknownsOf(result).map((entry) => [entry.label, entry]));

// A longer line has the extremes of so many stretches that no more points are drawn.
const MOST_POINTS = 1500;

// The samples of the least and of the largest value of a line between two samples.
function extremesOf(line, from, to) {
  const part = line.slice(from, to);
  const there = finite(part);
  return [Math.min(...there), Math.max(...there)].map((value) => from + part.indexOf(value));
}

// The first and the last sample of long lines that are drawn: those of the extremes of their ends.
function drawnEnds(lines) {
  const [{ length }] = lines;
  const stretches = Math.floor(MOST_POINTS / (2 * lines.length));
  const first = Math.floor(length / stretches);
  const last = Math.floor((length * (stretches - 1)) / stretches);
  return [
    Math.min(...lines.flatMap((line) => extremesOf(line, 0, first))),
    Math.max(...lines.flatMap((line) => extremesOf(line, last, length))),
  ];
}

// The points of lines over the same numbers along the bottom; a point that has no height is not drawn.
function over(along, ...lines) {
  const [first, last] = along.length > MOST_POINTS ? drawnEnds(lines) : [0, along.length - 1];
  const drawn = lines.flatMap((line) => line.map((up, k) => [along[k], up]).slice(first, last + 1));
  return drawn.filter((point) => finite(point).length === 2);
}

function outputOf({ section, title }, { trajectory }) {
  const experiment = trajectory.experiments[Number(section.slice("Experiment ".length)) - 1];
  return { times: experiment.time_s, number: experiment.experiment, output: experiment.outputs[title] };
}

const diagnosticsOf = (place, api) => {
  const { number } = outputOf(place, api);
  return api.residuals.find(({ experiment, output }) => experiment === number && output === place.title);
};

function followed(place, api) {
  const { times, output } = outputOf(place, api);
  return {
    points: over(times, output.measured, output.simulated),
    words: [bracketed(place.title, output.unit), "time [s]"],
  };
}

// The stretch whose ends a caption names: its samples, and the ends and the share that the caption must have. Of all
// stretches of so many samples the simulated output moves most in it.
function stretchOf(place, api) {
  const { times, output } = outputOf(place, api);
  const named = place.caption.match(/[\d.]+/g).map(Number);
  const [first, last] = named.map((time) =>
    times.reduce((best, next, k) => (Math.abs(next - time) < Math.abs(times[best] - time) ? k : best), 0),
  );
  const { measured, simulated } = output;
  const wayTo = [0];
  for (let k = 1; k < simulated.length; k += 1) {
    const isMeasured = measured[k] !== null && measured[k - 1] !== null;
    wayTo.push(wayTo[k - 1] + (isMeasured ? Math.abs(simulated[k] - simulated[k - 1]) : 0));
  }
  const length = last - first + 1;
  const ways = wayTo.slice(length - 1).map((way, start) => way - wayTo[start]);
  const start = ways.indexOf(Math.max(...ways));
  return { start, length, times };
}

/** The ends of the stretch that is drawn beside, and its share of the recording in percent. */
export function busiest(place, api) {
  const { start, length, times } = stretchOf(place, api);
  return [times[start], times[start + length - 1], Number(((100 * length) / times.length).toPrecision(2))];
}

function moving(place, api) {
  const { times, output } = outputOf(place, api);
  const [from, to] = busiest(place, api).map((end) => times.indexOf(end));
  const part = (line) => line.slice(from, to + 1);
  return {
    points: over(part(times), part(output.measured), part(output.simulated)),
    words: [bracketed(place.title, output.unit), "time [s]"],
  };
}

function leftOver(place, api) {
  const { times, output } = outputOf(place, api);
  const { noise_std: noise } = api.result.residuals[place.title];
  return {
    points: over(times, output.residual),
    levels: [-2 * noise, 2 * noise],
    words: [bracketed("measured − simulated", output.unit), "time [s]"],
  };
}

function spread(place, api) {
  const { histogram, unit } = diagnosticsOf(place, api);
  return {
    points: histogram.counts.map((count, k) => [histogram.from + (k + 0.5) * histogram.width, count]),
    levels: [0],
    words: ["number of residuals", bracketed("measured − simulated", unit)],
  };
}

function memory(place, api) {
  const { autocorrelation, white_within: within } = diagnosticsOf(place, api);
  return {
    points: autocorrelation.map((value, k) => [k + 1, value]),
    levels: [0, -within, within],
    words: ["autocorrelation [1]", "lag [samples]"],
  };
}

function frequencies(place, api) {
  const { spectrum, unit } = diagnosticsOf(place, api);
  const squared = unit.includes("/") || unit.includes("*") ? `(${unit})²/Hz` : `${unit}²/Hz`;
  return {
    points: spectrum.filter(([, power]) => power > 0).map(([hz, power]) => [hz, Math.log10(power)]),
    words: [`log10 of the power density [${unit ? squared : "1/Hz"}]`, "frequency [Hz]"],
  };
}

function disturbance({ ordinal }, { disturbance: { experiments } }) {
  const paths = experiments.flatMap(({ time_s: times, disturbances }) =>
    disturbances.map((path) => ({ times, ...path })),
  );
  const { times, value, deviation, unit, acts_on: actsOn } = paths[ordinal];
  const end = (by) => value.map((middle, k) => middle + by * deviation[k]);
  const words = { state: "the rate of ", output: "the sensor of ", sampled: "what computes " };
  const [[kind, name]] = Object.entries(actsOn);
  return {
    points: over(times, value, end(-NORMAL_95), end(NORMAL_95)),
    words: [bracketed(`${words[kind] ?? ""}${name}`, unit), "time [s]", "95 % from"],
  };
}

function search(_, { generations }) {
  const along = generations.map(({ generation }) => generation);
  const heights = (member) =>
    generations.map((row) => (row[member] === null ? NaN : Math.log10(row[member])));
  return {
    points: over(along, heights("mean_cost"), heights("best_cost")),
    words: ["log10 of the cost [1]", "generation"],
  };
}

function profile({ ordinal }, { result }) {
  const profiled = Object.entries(estimatesOf(result)).filter(
    ([, { profile: fits = [] }]) => fits.length > 2,
  );
  const [name, { profile: fits, unit, confidence_interval: interval }] = profiled[ordinal];
  const level = `${100 * (interval?.level ?? 0.95)} %`;
  return {
    points: fits.map(({ value, excess }) => [value, excess]),
    levels: [1],
    words: [`rise [1 = ${level}]`, level, bracketed(name, unit)],
  };
}

const CHARTS = [
  ["Measured and simulated", followed],
  [/ s: of all stretches of /, moving],
  ["What is left over", leftOver],
  ["How the residuals are spread", spread],
  ["The autocorrelation of the residuals", memory],
  ["The spectrum of the residuals", frequencies],
  ["The disturbance as all samples", disturbance],
  ["The lowest cost so far", search],
  ["", profile],
];

function chartOf(place, api) {
  const [, chart] = CHARTS.find(([words]) =>
    words instanceof RegExp ? words.test(place.caption) : place.caption.startsWith(words),
  );
  return chart(place, api);
}

// The least and the largest, never the same.
function extent(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const width = Math.max(high - low, 1e-9 * Math.abs(high), Number.MIN_VALUE);
  return high > low ? [low, high] : [low - width, high + width];
}

// The axes of a chart as the API's answers give them, between the ends that the drawing has.
function axesOf({ points, levels = [] }, { frame }) {
  const [left, top, bottom, right] = frame;
  const [low, high] = extent([...points.map(([, up]) => up), ...levels]);
  const margin = MARGIN * (high - low);
  return {
    middle: { range: extent(points.map(([along]) => along)), place: [left, right] },
    end: { range: [low - margin, high + margin], place: [bottom, top] },
  };
}

/**
 * Whether a tick stands where its number lies on the axis.
 *
 * @param {{written: string}} entry
 */
export function isOnAxis(place, api, { written }) {
  const { range, place: between } = axesOf(chartOf(place, api), place)[place.anchor];
  const share = (Number(written) - range[0]) / (range[1] - range[0]);
  const [from, to] = between;
  return Math.abs(from + share * (to - from) - place.at) <= ROUNDING;
}

function quantile(values, share) {
  const sorted = values.toSorted((a, b) => a - b);
  const position = share * (sorted.length - 1);
  const below = Math.floor(position);
  const above = Math.min(below + 1, sorted.length - 1);
  return sorted[below] + (position - below) * (sorted[above] - sorted[below]);
}

// Each unknown has its range and its name along the bottom, and all but the first their names along the left too.
function cornerSource({ ordinal }, { draws: { names, units, rows } }) {
  const column = ordinal < 3 ? 0 : 1 + Math.floor((ordinal - 3) / 4);
  const part = ordinal < 3 ? ordinal : (ordinal - 3) % 4;
  const values = rows.map((row) => row[column]);
  return part < 2 ? [quantile(values, SHOWN[part])] : [`${names[column]} [${units[column]}]`];
}

/** The source of words in a chart that are no tick. */
export function chartSource(place, api) {
  if (place.caption.startsWith("Draws from the posterior")) {
    return cornerSource(place, api);
  }
  const { words } = chartOf(place, api);
  // A chart is called by what is up its side and along its bottom.
  return place.tag === "svg" ? words.flatMap((up) => words.map((along) => `${up} over ${along}`)) : words;
}
