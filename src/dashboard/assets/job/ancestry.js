// @ts-check
// This module says what a job changed against the job that it was prepared from. A prepared job has the
// label `follows`, which names the job before it.

import { differences, sideBySide } from "../compare/differences.js";
import { trustBadge } from "../list/rows.js";
import { placeOf } from "../new/preflight.js";
import { get } from "../shell/api.js";
import { h, table } from "../shell/dom.js";
import { number, quantity, unitText, withError } from "../shell/format.js";
import { FOLLOWS } from "../shell/prepared.js";
import { unknownWords } from "./unknowns.js";

/** @typedef {import("page/api").Schemas["Outcome"]} Outcome */

// A line shows this many jobs; further ones are reached from the first that is shown.
const MOST_ANCESTORS = 6;
const MOST_CHANGES = 8;
// A criterion that changes by less does not tell two models apart.
const TELLING = 2;
// Members that differ between jobs with otherwise the same specification.
const BESIDES = /^\/(seed|name|labels|note)(\/|$)/;
const COLUMNS = [
  { title: "Parameter" },
  { title: "Before", numeric: true },
  { title: "Now", numeric: true },
  { title: "Unit" },
  { title: "Moved by, ±", numeric: true },
  { title: "Trust" },
];

// The job to run next names the job that it follows, and has no seed, so that the server draws a new one.
export function followed({ seed, ...spec }, label, id) {
  const name = (spec.name ?? "").replace(/ · .*$/, "");
  return {
    ...spec,
    name: `${name ? `${name} · ` : ""}${label.toLowerCase()}`.slice(0, 200),
    labels: { ...spec.labels, [FOLLOWS]: id },
  };
}

// By how much the criterion fell or rose, where both results come from the same samples and are judged
// alike, and null where they are not.
/** @param {Outcome} before @param {Outcome} now */
export function criterionChange(before, now) {
  const samples = ({ fit }) =>
    JSON.stringify(Object.entries(fit.estimation).map(([output, { samples }]) => [output, samples]));
  const alike =
    samples(before) === samples(now) &&
    Boolean(before.process_noise) === Boolean(now.process_noise) &&
    String(before.engine.dataset_digests) === String(now.engine.dataset_digests);
  const change = (now.criteria.bic ?? NaN) - (before.criteria.bic ?? NaN);
  return alike && Number.isFinite(change) ? change : null;
}

// The parameters of both results, with how far each has moved in standard errors of the result before.
/** @param {Outcome} before @param {Outcome} now */
export function moves(before, now) {
  const error = (estimate) => estimate?.total_standard_error ?? estimate?.standard_error ?? NaN;
  return sideBySide([before, now]).map(({ key, unit, parameters: [old, recent] }) => ({
    key,
    unit,
    old,
    recent,
    moved: old && recent ? (recent.estimate - old.estimate) / error(old) : NaN,
  }));
}

// The unit of a number at a pointer: that of the parameter or the signal of the model which the pointer names.
function unitAt(pointer, model) {
  const [, list, name] = /^\/(parameters|outputs|inputs)\/([^/]+)\//.exec(pointer) ?? [];
  return model?.[list]?.find((entry) => entry.name === name)?.unit;
}

const EMPTY = ["{}", "[]", null, undefined];

function valueText(value, unit) {
  return EMPTY.includes(value)
    ? "–"
    : typeof value === "number"
      ? quantity(number(value, 6), unit)
      : String(value);
}

// The differences of a job's specification from that of the job before, in words.
/** @param {any} before @param {any} now @param {any} [model] */
export const changesOf = (before, now, model = null) =>
  differences([before, now])
    .filter(([pointer, values]) => !BESIDES.test(pointer) && !values.every((value) => EMPTY.includes(value)))
    .map(([pointer, values]) => {
      const unit = unitAt(pointer, model);
      return `${placeOf(pointer)}: ${values.map((value) => valueText(value, unit)).join(" → ")}`;
    });

/**
 * The part is empty until the job before it has been read, and stays so where there is none.
 *
 * @param {any} view
 * @param {any} job
 * @param {Outcome} result
 * @param {any} model
 */
export function ancestryPart(view, job, result, model) {
  const place = h("div", { class: "ancestry" });
  line(view, job).then(
    async ([parent, ...older]) => {
      if (!parent) {
        return;
      }
      const before = await get(`/v1/jobs/${parent.id}/result`, view.signal).then(
        ({ data }) => data,
        () => null,
      );
      const ancestors = [...older.reverse(), parent];
      place.replaceChildren(
        h(
          "p",
          { class: "quiet" },
          ancestors.map((ancestor) => [
            h("a", { href: `#/jobs/${ancestor.id}` }, ancestor.name || ancestor.id),
            " → ",
          ]),
          "this job",
        ),
        changesPart(changesOf(parent.spec, job.spec, model)),
        ...(before ? [comparison(before, result)] : []),
      );
    },
    () => {},
  );
  return place;
}

/** @param {string[]} changes */
function changesPart(changes) {
  const rest = changes.length - MOST_CHANGES;
  return h(
    "div",
    {},
    h("p", {}, changes.length ? "What this job was told otherwise:" : "This job was told the same."),
    h(
      "ul",
      {},
      changes.slice(0, MOST_CHANGES).map((text) => h("li", {}, text)),
      rest > 0 && h("li", {}, `and ${rest} more`),
    ),
  );
}

// Reads the jobs that a job follows, the nearest first.
async function line(view, job) {
  const ancestors = [];
  let id = job.labels?.[FOLLOWS];
  while (id && ancestors.length < MOST_ANCESTORS) {
    const answer = await get(`/v1/jobs/${encodeURIComponent(id)}`, view.signal).catch(() => null);
    if (!answer) {
      break;
    }
    ancestors.push(answer.data);
    id = answer.data.labels?.[FOLLOWS];
  }
  return ancestors;
}

/** @param {Outcome} before @param {Outcome} now */
function comparison(before, now) {
  const change = criterionChange(before, now);
  const value = (estimate) =>
    estimate
      ? withError(estimate.estimate, estimate.total_standard_error ?? estimate.standard_error).join(" ± ")
      : "–";
  const rows = moves(before, now).map(({ key, unit, old, recent, moved }) => [
    unknownWords(key),
    value(old),
    value(recent),
    unitText(unit),
    number(moved, 2),
    [old?.trust && trustBadge(old.trust), " → ", recent?.trust && trustBadge(recent.trust)],
  ]);
  return h(
    "details",
    { open: true },
    h("summary", {}, "What changed against the job before"),
    h(
      "p",
      {},
      "Trust ",
      trustBadge(before.verdict.trust),
      " → ",
      trustBadge(now.verdict.trust),
      change === null ? "" : `; Schwarz's criterion ${criterionWords(change)}`,
      ".",
    ),
    table("Estimates before and now", COLUMNS, rows, { stacked: true }),
  );
}

// Below zero the data ask for the change.
/** @param {number} change */
export function criterionWords(change) {
  const moved = `${change < 0 ? "lower" : "higher"} by ${number(Math.abs(change), 3)}`;
  if (Math.abs(change) < TELLING) {
    return `${moved}: too little for the data to tell the two apart`;
  }
  return `${moved}: the data ${change < 0 ? "ask" : "do not ask"} for the change`;
}
