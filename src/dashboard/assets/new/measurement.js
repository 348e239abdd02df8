// @ts-check
// This part of the form says how well things were measured: the noise and the sensor of each output, the
// clock, what the model document takes as exact, and what may have moved the plant beside its inputs.

import { toleranceOf } from "../model/parameters.js";
import { h, table } from "../shell/dom.js";
import { assumptionWords, number, quantity, unitText, words } from "../shell/format.js";
import { choice, field, membersOf, shown, titledField } from "./fields.js";

const COLUMNS = [
  { title: "Output" },
  { title: "Noise" },
  { title: "Noise, share" },
  { title: "Gain" },
  { title: "Offset" },
  { title: "Lag, s" },
];

export function measurementPart(job) {
  const place = h("div", {});
  const element = h(
    "section",
    { "aria-label": "Measurement" },
    h("h2", {}, "4. How well it was measured"),
    h(
      "p",
      { class: "quiet" },
      "All are one standard deviation. A noise that is left empty is estimated; a gain, an offset or a lag that is left empty is taken as exact, or as the table below says.",
    ),
    place,
  );
  return {
    element,
    draw() {
      place.replaceChildren(
        ...(job.model
          ? [outputTable(job), disturbances(job), assumedTable(job)].filter(Boolean)
          : [h("p", { class: "quiet" }, "Choose a model first.")]),
      );
    },
  };
}

function outputTable(job) {
  const { at, put } = membersOf(job);
  const measured = job.model.outputs.filter(({ name }) =>
    (job.spec.experiments ?? []).some(({ signals }) => signals?.[name]),
  );
  const rows = measured.map(({ name, unit }) => {
    const entry = (title, member, options = {}) => {
      const path = ["outputs", name, member];
      const read = options.text ? toleranceOf : (value) => value ?? undefined;
      const label = `${words(name)}, ${title}`;
      return field(label, at(path), (value) => put(path)(read(value)), { size: "8", ...options });
    };
    return [
      [words(name), h("span", { class: "quiet" }, ` [${unitText(unit)}]`)],
      entry("noise", "noise_std", { hint: "estimated" }),
      shareField(`${words(name)}, noise as a share in per cent`, at, put, ["outputs", name, "noise_share"]),
      entry("gain of the sensor", "gain_tolerance", { text: true, hint: "0.5 %" }),
      entry("offset of the sensor", "offset_tolerance"),
      entry("lag of the sensor", "lag_tolerance_s"),
    ];
  });
  return table("Noise and sensors", COLUMNS, rows, {
    empty: "No output of the model is measured yet.",
    stacked: true,
  });
}

function shareField(label, at, put, path) {
  const share = at(path);
  const input = field(
    label,
    share === undefined ? "" : Number((100 * share).toPrecision(6)),
    (percent) => put(path)(percent === null ? undefined : percent / 100),
    { size: "6" },
  );
  return h("span", { class: "together" }, input, "%");
}

function disturbances(job) {
  const { number: numeric, usual } = membersOf(job);
  const { process_noise: noise, clock_tolerance: clock } = job.spec;
  const listed = Array.isArray(noise);
  /** @type {[string, string][]} */
  const options = [
    ["", "as the data say"],
    ["none", "nothing beside its inputs"],
  ];
  if (listed) {
    options.push(["listed", `${noise.length} as written in JSON`]);
  }
  const value = listed ? "listed" : noise === "none" ? "none" : "";
  const choose = (name) => name !== "listed" && job.at(["process_noise"], name || undefined);
  return h(
    "div",
    { class: "fields" },
    choice("What moved the plant", options, value, choose),
    titledField("Clock", clock, (text) => job.at(["clock_tolerance"], toleranceOf(text)), {
      text: true,
      hint: "exact",
      size: "8",
      help: "How well the rate of the clock is known that the samples were taken by, such as 0.01 %.",
    }),
    numeric("Outliers count linearly from, σ", ["method", "huber_threshold"], {
      hint: shown(usual(["method", "huber_threshold"])) || "none do",
      help: "Huber's loss: a residual beyond so many times the declared noise counts linearly. The noise of each output must be given.",
    }),
  );
}

// The lines are those of the check before the start that nobody declared, and those that the job
// declares by their names.
function assumedTable(job) {
  const declared = job.spec.tolerances ?? {};
  const lines = (job.budget ?? []).filter(
    ({ assumption, by_default: usual }) => usual || assumption in declared,
  );
  const missing = Object.keys(declared).filter(
    (name) => !lines.some(({ assumption }) => assumption === name),
  );
  if (lines.length + missing.length === 0) {
    return null;
  }
  const row = (name, line) => [
    assumptionWords(name),
    line ? quantity(number(line.value, 4), line.unit) : "",
    h(
      "span",
      { class: "together" },
      "±",
      field(
        `${assumptionWords(name)}, how well known`,
        declared[name],
        (text) => job.at(["tolerances", name], toleranceOf(text)),
        { text: true, size: "9", hint: line?.by_default ? number(line.tolerance, 3) : "" },
      ),
    ),
  ];
  const rows = [
    ...lines.map((line) => row(line.assumption, line)),
    ...missing.map((name) => row(name, null)),
  ];
  return h(
    "details",
    { open: missing.length > 0 || Object.keys(declared).length > 0 },
    h("summary", {}, `Taken as exact by the model: ${rows.length} numbers, and how well they are known`),
    h("p", { class: "quiet" }, "A tolerance in grey is a default. 0 says that the number is exact."),
    table(
      "Numbers that the model takes as exact",
      [{ title: "Number" }, { title: "Value" }, { title: "Known within" }],
      rows,
    ),
  );
}
