// @ts-check
// The page compares two to ten jobs side by side: their trust and fit, their estimates with intervals,
// their simulated outputs over each other, and the differences of their specifications.

import uPlot from "/assets/vendor/uplot-1.6.32.min.js";
import { seconds } from "../list/filter.js";
import { badge, trustBadge } from "../list/rows.js";
import { plot } from "../plot/plot.js";
import { get } from "../shell/api.js";
import { h, notice, svg, table } from "../shell/dom.js";
import { duration, number, percent, unitText, withError, words } from "../shell/format.js";
import { commonRange, differences, intervalOf, place, sideBySide } from "./differences.js";

const MOST = 10;
const POINTS = 3000;

export function showCompare(view) {
  const ids = [...new Set((view.query.get("jobs") ?? "").split(",").filter(Boolean))].slice(0, MOST);
  const outcome = notice();
  const content = h("div", {}, h("p", { class: "quiet" }, "Loading …"));
  view.root.append(h("h1", { tabindex: "-1" }, `${ids.length} jobs compared`), outcome.place, content);
  if (ids.length < 2) {
    content.replaceChildren(
      h("p", {}, "Select two to ten jobs in the ", h("a", { href: "#/jobs" }, "list of jobs"), "."),
    );
    return;
  }
  Promise.all(ids.map((id) => read(id, view.signal)))
    .then((runs) => {
      content.replaceChildren(...parts(runs));
      overlay(view, runs, content, outcome);
    })
    .catch((error) => outcome.fail(error));
}

async function read(id, signal) {
  const { data: job } = await get(`/v1/jobs/${id}`, signal);
  const result = await get(`/v1/jobs/${id}/result`, signal).then(
    ({ data }) => data,
    (error) => {
      if (error.status === 409 || error.status === 404) {
        return null;
      }
      throw error;
    },
  );
  return { job, result, title: job.name || job.id };
}

function tag(k) {
  return svg(
    "svg",
    { width: 14, height: 14, class: "tag", "aria-hidden": "true" },
    svg("rect", { width: 14, height: 14, rx: 3, class: `fill row-${k}` }),
  );
}

function parts(runs) {
  const head = runs.map(({ title, job }, k) => [
    tag(k),
    " ",
    String(k + 1),
    ": ",
    h("a", { href: `#/jobs/${job.id}` }, title),
  ]);
  const about = runs.map(({ job, result }, k) => [
    head[k],
    badge(job.status),
    result?.verdict ? trustBadge(result.verdict.trust) : "–",
    job.model,
    words(job.spec.method?.name ?? ""),
    fits(result, "estimation"),
    fits(result, "validation"),
    seconds(job, Date.now()) === null ? "–" : duration(seconds(job, Date.now())),
  ]);
  const columns = [
    "Job",
    "Status",
    "Trust",
    "Model",
    "Method",
    "Fit, estimated from",
    "Fit, held back",
    "Duration",
  ].map((title) => ({ title }));
  const rows = sideBySide(runs.map(({ result }) => result));
  const changed = differences(runs.map(({ job }) => job.spec));
  return [
    table("Jobs", columns, about, { stacked: true }),
    h("h2", {}, "Estimates"),
    rows.length
      ? h(
          "div",
          { class: "compared-estimates" },
          rows.map((row) => estimates(row, runs)),
        )
      : h("p", { class: "quiet" }, "None of them has an estimate."),
    h("h2", {}, "What was asked differently"),
    table(
      "Differences of the specifications",
      [{ title: "Where" }, ...runs.map((_, k) => ({ title: `Job ${k + 1}` }))],
      changed.map(([pointer, values]) => [h("code", {}, pointer), ...values.map(shown)]),
      { empty: "Nothing: the specifications are the same.", stacked: true },
    ),
  ];
}

function fits(result, part) {
  const fitsOfOutputs = Object.entries(result?.fit?.[part] ?? {});
  return fitsOfOutputs.length
    ? fitsOfOutputs.map(([output, { fit_percent: fit }]) => `${words(output)} ${percent(fit)}`).join(", ")
    : "–";
}

function shown(value) {
  if (value === undefined) {
    return h("span", { class: "quiet" }, "not said");
  }
  return typeof value === "number" && !Number.isInteger(value) ? number(value, 8) : String(value);
}

// The table shows one parameter of all jobs, an interval below the other on a common range.
function estimates({ key, unit, symbol, parameters }, runs) {
  const range = commonRange(parameters);
  const rows = parameters.map((parameter, k) => {
    const [value, error] = parameter
      ? withError(parameter.estimate, parameter.total_standard_error ?? parameter.standard_error)
      : ["–", "–"];
    return h(
      "tr",
      {},
      h("th", { scope: "row" }, tag(k), ` ${k + 1} `, h("span", { class: "unseen" }, runs[k].title)),
      h("td", { class: "number" }, value),
      h("td", { class: "number" }, error === "–" ? "" : `± ${error}`),
      h("td", { class: "interval" }, range && parameter ? intervalBar(parameter, range, k) : ""),
    );
  });
  return h(
    "div",
    { class: "scroll compared", tabindex: "0", role: "region", "aria-label": words(key) },
    h(
      "table",
      {},
      h(
        "caption",
        {},
        words(key),
        " ",
        h("span", { class: "symbol" }, symbol ?? ""),
        ` [${unitText(unit)}]`,
        range &&
          h(
            "span",
            { class: "quiet" },
            ` drawn from ${number(range.low)} to ${number(range.high)}${range.log ? ", logarithmic" : ""}`,
          ),
      ),
      h("tbody", {}, rows),
    ),
  );
}

// The bar leaves this share of its width free at each end, for the marks of the ends.
const MARGIN = 0.03;

// Draws the interval of an estimate on a range, over the whole width that it gets; an open end of the interval
// has an arrow.
export function intervalBar(parameter, range, k = 0) {
  const interval = intervalOf(parameter);
  const percentAt = (share) => `${100 * (MARGIN + (1 - 2 * MARGIN) * share)}%`;
  const at = (value, share) => percentAt(Number.isFinite(value) ? place(value, range) : share);
  const [low, high, middle] = [at(interval?.lower, 0), at(interval?.upper, 1), at(parameter.estimate, 0.5)];
  const words = interval ? `${number(interval.lower)} to ${number(interval.upper)}` : "no interval";
  const cut = (value, side) => !Number.isFinite(value) || (side < 0 ? value < range.low : value > range.high);
  const end = (x, value, side) =>
    cut(value, side)
      ? svg(
          "svg",
          { x: percentAt(side < 0 ? 0 : 1), overflow: "visible" },
          svg("path", { d: `M0 10l${-8 * side} -5v10z`, class: `fill row-${k}` }),
        )
      : svg("line", { x1: x, x2: x, y1: 5, y2: 15, class: `stroke thin row-${k}` });
  return svg(
    "svg",
    {
      class: "bar-of",
      role: "img",
      "aria-label": `Estimate ${number(parameter.estimate)}, interval ${words}`,
    },
    svg("line", { x1: percentAt(0), x2: percentAt(1), y1: 10, y2: 10, class: "range" }),
    interval && [
      svg("line", { x1: low, x2: high, y1: 10, y2: 10, class: `stroke row-${k}` }),
      end(low, interval.lower, -1),
      end(high, interval.upper, 1),
    ],
    svg("circle", { cx: middle, cy: 10, r: 4.5, class: `fill row-${k}` }),
  );
}

// Plots the outputs of all jobs that use the same recording over each other.
async function overlay(view, runs, content, outcome) {
  const able = runs.map((run, k) => ({ ...run, k })).filter(({ result }) => result);
  try {
    const all = await Promise.all(
      able.map(({ job }) =>
        get(`/v1/jobs/${job.id}/trajectory?experiment=0&max_points=${POINTS}`, view.signal).then(
          ({ data }) => data.experiments[0],
        ),
      ),
    );
    const groups = new Map();
    for (const [n, experiment] of all.entries()) {
      for (const [name, output] of Object.entries(experiment?.outputs ?? {})) {
        const key = `${experiment.dataset} ${name}`;
        groups.set(key, [
          ...(groups.get(key) ?? []),
          { experiment, name, output, k: able[n].k, title: able[n].title },
        ]);
      }
    }
    const place = h("div", {});
    content.insertBefore(
      h("div", {}, h("h2", {}, "Outputs, over each other"), place),
      content.querySelectorAll("h2")[1] ?? null,
    );
    for (const lines of groups.values()) {
      const [first] = lines;
      const drawn = plot({
        title: `${words(first.name)}, measured and simulated`,
        height: 340,
        signal: view.signal,
        x: { label: "time", unit: "s" },
        y: { label: words(first.name), unit: first.output.unit },
        series: [
          { name: "measured", look: "measured" },
          ...lines.map(({ k }) => ({ name: `job ${k + 1}`, look: `row-${k}` })),
        ],
      });
      place.append(drawn.element);
      const joined = uPlot.join([
        [first.experiment.time_s, first.output.measured],
        ...lines.map(({ experiment, output }) => [experiment.time_s, output.simulated]),
      ]);
      drawn.set(joined[0], joined.slice(1));
    }
  } catch (error) {
    outcome.fail(error);
  }
}
