// @ts-check
// The page compares two to ten jobs side by side: their trust and fit, their estimates with intervals,
// their simulated outputs over each other, and the differences of their specifications.

import { seconds } from "../list/filter.js";
import { badge, trustBadge } from "../list/rows.js";
import { get } from "../shell/api.js";
import { h, notice, svg, table } from "../shell/dom.js";
import {
  duration,
  methodText,
  modelText,
  number,
  percent,
  unitText,
  withError,
  words,
} from "../shell/format.js";
import { commonRange, differences, intervalOf, isOfTheModel, place, sideBySide } from "./differences.js";
import { byKind, KINDS, numbersOf, remark } from "./kinds.js";
import { drawOutputs } from "./outputs.js";

const MOST = 10;

export function showCompare(view) {
  const ids = [...new Set((view.query.get("jobs") ?? "").split(",").filter(Boolean))].slice(0, MOST);
  const outcome = notice();
  const content = h("div", { class: "comparison" }, h("p", { class: "quiet" }, "Loading …"));
  view.root.append(h("h1", { tabindex: "-1" }, `${ids.length} jobs compared`), outcome.place, content);
  if (ids.length < 2) {
    content.replaceChildren(
      h("p", {}, "Select two to ten jobs in the ", h("a", { href: "#/jobs" }, "list of jobs"), "."),
    );
    return;
  }
  Promise.all(ids.map((id) => read(id, view.signal)))
    .then((all) => {
      const runs = all.filter(({ job }) => job).map((run, k) => ({ ...run, k }));
      const outputs = h("div", {});
      content.replaceChildren(
        ...all
          .filter(({ job }) => !job)
          .map(({ id }) => h("p", {}, "There is no job ", h("code", {}, id), ".")),
        ...(runs.length ? parts(runs, outputs) : []),
      );
      return drawOutputs(view, runs, outputs);
    })
    .catch((error) => {
      content.querySelector("p.quiet:only-child")?.remove();
      outcome.fail(error);
    });
}

async function read(id, signal) {
  const unless =
    (...statuses) =>
    (error) => {
      if (statuses.includes(error.status)) {
        return { data: null };
      }
      throw error;
    };
  const { data: job } = await get(`/v1/jobs/${id}`, signal).catch(unless(404));
  const { data: result } = job
    ? await get(`/v1/jobs/${id}/result`, signal).catch(unless(404, 409))
    : { data: null };
  return { id, job, result, title: job?.name || id };
}

function tag(k) {
  return svg(
    "svg",
    { width: 14, height: 14, class: "tag", "aria-hidden": "true" },
    svg("rect", { width: 14, height: 14, rx: 3, class: `fill row-${k}` }),
  );
}

function parts(runs, outputs) {
  const about = runs.map(({ job, result, title, k }) => [
    [tag(k), " ", String(k + 1), ": ", h("a", { href: `#/jobs/${job.id}` }, title)],
    badge(job.status),
    result?.verdict ? trustBadge(result.verdict.trust) : "–",
    modelText(job.model),
    job.spec.method ? methodText(job.spec.method.name) : KINDS[job.kind].name,
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
  ].map((title) => ({ title, numeric: title === "Duration" }));
  const rows = sideBySide(runs.map(({ result }) => result));
  const models = new Set(runs.map(({ job }) => job.model)).size;
  const remarks = [
    ...runs.map(remark),
    models > 1 &&
      `The jobs are about ${models} models: a parameter of one of them need not be that of the same name of another.`,
  ].filter(Boolean);
  return [
    table("Jobs", columns, about, { stacked: true }),
    remarks.map((text) => h("p", {}, text)),
    h("h2", {}, "Estimates"),
    rows.length
      ? h(
          "div",
          { class: "compared-estimates" },
          rows.map((row) => estimates(row, runs)),
        )
      : h("p", { class: "quiet" }, "None of them has an estimate."),
    outputs,
    h("h2", {}, "What was asked differently"),
    ...byKind(runs).flatMap(([kind, members]) => askedDifferently(kind, members)),
  ].flat();
}

// Only jobs of the same kind are asked for the same things.
function askedDifferently(kind, runs) {
  const { name, about } = KINDS[kind];
  if (runs.length < 2) {
    return h("p", {}, `Job ${numbersOf(runs)} is ${about}; no other job here is of this kind.`);
  }
  const lines = differences(runs.map(({ job }) => job.spec));
  const isOneModel = new Set(runs.map(({ job }) => job.model)).size === 1;
  const [apart, alike] = [true, false].map((wanted) =>
    lines.filter(([pointer]) => (!isOneModel && isOfTheModel(pointer)) === wanted),
  );
  const title = `${name}: jobs ${numbersOf(runs)}`;
  const drawn = (caption, shownLines) =>
    table(
      caption,
      [{ title: "Where in the specification" }, ...runs.map(({ k }) => ({ title: `Job ${k + 1}` }))],
      shownLines.map(([pointer, values]) => [
        h("span", { title: pointer }, placeText(pointer)),
        ...values.map(shown),
      ]),
      { empty: "Nothing: the specifications are the same.", stacked: true },
    );
  return [
    h("h3", {}, title[0].toUpperCase() + title.slice(1)),
    drawn(`Differences of the specifications, ${title}`, alike),
    apart.length > 0 &&
      h(
        "details",
        {},
        h("summary", {}, `${apart.length} lines about parts of the different models`),
        drawn(`Parts of the different models, ${title}`, apart),
      ),
  ].filter(Boolean);
}

// Writes a pointer as the way to a member: `/experiments/0/window/to_s` becomes "experiments › 1 › window › to s".
function placeText(pointer) {
  const parts = pointer.split("/").filter(Boolean);
  return parts.map((part) => (/^\d+$/.test(part) ? String(Number(part) + 1) : words(part))).join(" › ");
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
    const isForetold = parameter && parameter.estimate === undefined;
    const error = parameter?.total_standard_error ?? parameter?.standard_error;
    const [value, deviation] = isForetold
      ? ["", number(error, 2, true)]
      : withError(parameter?.estimate, error);
    return h(
      "tr",
      {},
      h("th", { scope: "row" }, tag(k), ` ${k + 1} `, h("span", { class: "unseen" }, runs[k].title)),
      h("td", { class: "number" }, value),
      h("td", { class: "number" }, deviation === "–" ? "" : `± ${deviation}`),
      h(
        "td",
        { class: isForetold ? "quiet" : "interval" },
        isForetold
          ? error === null
            ? "foretold: not fixed"
            : "foretold"
          : range && parameter && intervalBar(parameter, range, k),
      ),
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
