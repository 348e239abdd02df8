// @ts-check
// This part of the form has a row for each parameter of a new job: a value with its tolerance or a
// range of the search, and beside it the standard error that the check before the start expects.

import { entryOf, middleOf, parameterRows } from "../model/parameters.js";
import { namesIn } from "../shell/description.js";
import { h } from "../shell/dom.js";
import { number, quantity, unitText, words } from "../shell/format.js";
import { changed } from "./draft.js";
import { field } from "./fields.js";

// Above this share of the range a standard error says little more than the range.
const WEAK = 0.25;

export function parametersPart(job) {
  const place = h("div", {});
  const only = h("input", { type: "checkbox", onchange: () => draw() });
  const element = h(
    "section",
    { "aria-label": "Parameters" },
    h("h2", {}, "3. Parameters"),
    h(
      "p",
      { class: "quiet" },
      "An unknown parameter is looked for in its range. A known one has a tolerance: one standard deviation of how well it is known, in its unit or in per cent.",
    ),
    h("label", { class: "inline" }, only, "all parameters, also those that the model takes as known"),
    place,
  );

  const draw = () => {
    const { model } = job;
    only.parentElement.hidden = !model;
    if (!model) {
      place.replaceChildren(h("p", { class: "quiet" }, "Choose a model first."));
      return;
    }
    const rows = parameterRows(model, job.spec.parameters).filter(
      (row) =>
        only.checked ||
        row.free ||
        row.isSpecified ||
        row.about.unknown_by_default ||
        owners(job.spec, row.about.name).length,
    );
    const several = (job.spec.experiments ?? []).length > 1;
    const head = [
      "Parameter",
      "Is",
      "Value, or range to look in",
      ...(several ? ["Experiments"] : []),
      "Expected standard error",
    ];
    place.replaceChildren(
      h(
        "div",
        { class: "scroll", tabindex: "0", role: "region", "aria-label": "Table of the parameters" },
        h(
          "table",
          { class: "parameters" },
          h("caption", { class: "unseen" }, "Parameters"),
          h(
            "thead",
            {},
            h(
              "tr",
              {},
              head.map((title) => h("th", { scope: "col" }, title)),
            ),
          ),
          h(
            "tbody",
            {},
            rows.map((row) => parameterRow(job, row, several)),
          ),
        ),
      ),
    );
  };
  return { element, draw };
}

function owners(spec, name) {
  return (spec.experiments ?? [])
    .map((experiment, k) => [k, experiment.parameters?.[name]])
    .filter(([, entry]) => entry);
}

function parameterRow(job, row, several) {
  const { about } = row;
  const put = (change) => job.at(["parameters", about.name], entryOf({ ...row, ...change }));
  const entries = owners(job.spec, about.name);
  const kind = h(
    "select",
    {
      "aria-label": `${words(about.name)} is`,
      onchange: (event) => put({ free: event.target.value === "unknown" }),
    },
    ["known", "unknown"].map((word) =>
      h("option", { value: word, selected: (word === "unknown") === row.free }, word),
    ),
  );
  return h(
    "tr",
    { class: row.free ? "free" : null },
    h(
      "th",
      { scope: "row", title: about.meaning },
      words(about.name),
      " ",
      h("span", { class: "symbol" }, about.symbol),
      h("span", { class: "quiet" }, ` [${unitText(about.unit)}]`),
    ),
    h("td", {}, kind),
    h(
      "td",
      {},
      entries.length < (job.spec.experiments ?? []).length && fields(job, row, put),
      ownText(job.spec, entries),
    ),
    several && h("td", {}, ownFields(job, row, entries)),
    h("td", { class: "expected" }, expected(job, row)),
  );
}

// Says which experiments have a value or a range of their own, beside what the others share.
function ownText({ experiments = [] }, entries) {
  const numbers = entries.map(([k]) => k + 1).join(", ");
  const text =
    entries.length === experiments.length
      ? "each experiment has its own"
      : `its own in experiment${entries.length > 1 ? "s" : ""} ${numbers}`;
  return entries.length > 0 && h("div", { class: "quiet" }, text);
}

function fields(job, row, put) {
  const { about } = row;
  const name = words(about.name);
  if (!row.free) {
    return h(
      "span",
      { class: "together" },
      field(`${name}, value`, row.value, (value) => put({ value: value ?? about.default })),
      "±",
      field(`${name}, tolerance`, row.tolerance, (tolerance) => put({ tolerance }), {
        text: true,
        size: "7",
        hint: toleranceHint(about),
      }),
    );
  }
  const prior = row.prior?.range_95;
  return h(
    "span",
    { class: "together" },
    field(`${name}, lower bound`, row.lower, (lower) => put({ lower: lower ?? about.lower })),
    "…",
    field(`${name}, upper bound`, row.upper, (upper) => put({ upper: upper ?? about.upper })),
    h(
      "select",
      { "aria-label": `${name}, scale`, onchange: (event) => put({ scale: event.target.value }) },
      namesIn(job.description, "Scale").map((scale) =>
        h("option", { value: scale, selected: scale === row.scale }, scale),
      ),
    ),
    startFields(row, put),
    row.prior
      ? h(
          "span",
          { class: "together prior" },
          "95 % sure between",
          field(`${name}, prior from`, prior?.[0], (low) =>
            put({ prior: { range_95: [low ?? row.lower, prior?.[1] ?? row.upper] } }),
          ),
          "and",
          field(`${name}, prior to`, prior?.[1], (high) =>
            put({ prior: { range_95: [prior?.[0] ?? row.lower, high ?? row.upper] } }),
          ),
          row.prior.range_95 ? "" : h("span", { class: "quiet" }, JSON.stringify(row.prior)),
          h(
            "button",
            {
              type: "button",
              class: "small",
              "aria-label": `× forget the prior of ${name}`,
              onclick: () => put({ prior: null }),
            },
            "×",
          ),
        )
      : h(
          "button",
          {
            type: "button",
            class: "small",
            "aria-label": `+ prior: what was known of ${name} before`,
            onclick: () => put({ prior: { range_95: [row.lower, row.upper] } }),
          },
          "+ prior",
        ),
  );
}

// The value at which a descent begins beside those of the search, where the job says one.
function startFields(row, put) {
  const name = words(row.about.name);
  if (row.start === null) {
    return h(
      "button",
      {
        type: "button",
        class: "small",
        "aria-label": `+ start: a value of ${name} at which a descent begins`,
        onclick: () => put({ start: middleOf(row) }),
      },
      "+ start",
    );
  }
  return h(
    "span",
    { class: "together prior" },
    "a descent begins at",
    field(`${name}, start of a descent`, row.start, (start) => put({ start })),
    h(
      "button",
      {
        type: "button",
        class: "small",
        "aria-label": `× forget the start of ${name}`,
        onclick: () => put({ start: null }),
      },
      "×",
    ),
  );
}

function toleranceHint({ tolerance }) {
  return tolerance === undefined || tolerance === null
    ? "exact"
    : typeof tolerance === "object"
      ? "model's"
      : String(tolerance);
}

// The fields set a parameter in each experiment by itself, to a value or a range.
function ownFields(job, row, entries) {
  const { about } = row;
  const { experiments } = job.spec;
  const toggle = h("input", {
    type: "checkbox",
    checked: entries.length === experiments.length,
    "aria-label": `${words(about.name)}: each experiment has its own`,
    onchange: (event) => {
      const entry = row.free ? { estimate: {} } : { value: row.value };
      let { spec } = job;
      experiments.forEach(({ parameters }, k) => {
        spec = changed(
          spec,
          ["experiments", k, "parameters", about.name],
          event.target.checked ? (parameters?.[about.name] ?? entry) : undefined,
        );
      });
      job.set(event.target.checked ? changed(spec, ["parameters", about.name], undefined) : spec);
    },
  });
  toggle.indeterminate = entries.length > 0 && entries.length < experiments.length;
  const values = entries
    .filter(([, entry]) => "value" in entry)
    .map(([k, entry]) =>
      h(
        "label",
        { class: "inline" },
        `${k + 1}:`,
        field(
          `${words(about.name)}, value in experiment ${k + 1}`,
          entry.value,
          (value) => job.at(["experiments", k, "parameters", about.name, "value"], value ?? about.default),
          { size: "7" },
        ),
      ),
    );
  return h(
    "span",
    { class: "together" },
    h("label", { class: "inline" }, toggle, "one in each", h("span", { class: "on-phones" }, " experiment")),
    values,
  );
}

function expected(job, { about, free }) {
  const predictions = (job.predictions ?? []).filter(
    ({ name }) => name === about.name || name.startsWith(`${about.name}[`),
  );
  if (predictions.length === 0) {
    return free ? h("span", { class: "quiet" }, job.checking ? "…" : "–") : "";
  }
  return predictions.map(({ experiment, standard_error: error, share_of_range: share }) => {
    const place = Number.isFinite(experiment) ? `experiment ${experiment + 1}: ` : "";
    return error === null
      ? h("div", {}, place, h("span", { class: "badge failed" }, "not fixed by the data"))
      : h(
          "div",
          {
            title: share
              ? `${number(100 * share[0], 2)} to ${number(100 * share[1], 2)} % of the range`
              : null,
          },
          `${place}± ${quantity(number(error, 2), about.unit)}`,
          share && share[1] > WEAK
            ? [
                " ",
                h(
                  "span",
                  { class: "badge paused" },
                  share[0] > WEAK ? "weakly fixed" : "weak in parts of the range",
                ),
              ]
            : "",
        );
  });
}
