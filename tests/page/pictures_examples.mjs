// This module reads the chapters of the guide of worked examples, works on their jobs, and writes what came of them.
//
// A chapter has the job as JSON, and between two marks what is made anew: how the recording was made, and the estimates
// beside the truth.

import { PLANTS } from "./pictures_recordings.mjs";
import { base, ended, post } from "./server.mjs";

const begin = (model) => `<!-- made: ${model} -->\n`;
const END = "<!-- end -->\n";

// Lists the chapters with a job, each with its text and with what it says of the estimates.
export function chapters(guide) {
  const parts = guide.split("\n## ").slice(1);
  const jobs = parts.map((text) => ({ text, found: /```json\n(.*?)```/s.exec(text) }));
  return jobs
    .filter(({ found }) => found)
    .map(({ text, found }) => ({ text, job: JSON.parse(found[1]), estimates: estimates(text) }));
}

// Reads the table of a chapter.
function estimates(text) {
  const rows = [...text.matchAll(/^\| `(\w+)` \|(.*)\|$/gm)];
  return rows.map(([, name, cells]) => {
    const [, truth, estimate, error, trust] = cells.split("|").map((cell) => cell.trim());
    return { name, truth: Number(truth), estimate: Number(estimate), error: Number(error), trust };
  });
}

// Puts a text between the marks of a model.
export function put(guide, model, text) {
  const [before, rest] = guide.split(begin(model));
  const after = rest.slice(rest.indexOf(END));
  return `${before}${begin(model)}\n${text}\n${after}`;
}

// Works on a job over a recording, and gives the result.
export async function worked(job, csv) {
  const { id: dataset } = await post(`/v1/datasets?name=${job.model}`, csv, "text/csv");
  const experiments = job.experiments.map((experiment) => ({ ...experiment, dataset }));
  const { id } = await post("/v1/jobs", { ...job, experiments });
  await ended(id);
  return { id, result: await (await fetch(`${base}/v1/jobs/${id}/result`)).json() };
}

// Writes a number with some digits; those that are far from one have a power of ten.
function short(value, digits) {
  const number = Number(value.toPrecision(digits));
  const isFar = Math.abs(number) >= 1e6 || (number !== 0 && Math.abs(number) < 1e-3);
  return (isFar ? number.toExponential() : String(number)).replace("e+", "e");
}

// Writes a value with two digits of its error.
function rounded(value, error) {
  const places = 1 - Math.floor(Math.log10(error));
  const digits = Math.max(2, places + Math.floor(Math.log10(Math.abs(value))) + 1);
  const isFar = Math.abs(value) >= 1e6 || Math.abs(value) < 1e-3;
  const text = isFar ? value.toExponential(digits - 1) : value.toFixed(Math.max(0, places));
  return text.replace("e+", "e");
}

// Writes how the recording was made, and the estimates beside the truth.
export function madeText(model, csv, result) {
  const { sample_time_s, noise, shown } = PLANTS[model];
  const samples = csv.trimEnd().split("\n").length - 1;
  const noises = Object.entries(noise).map(([output, std]) => {
    const { unit, factor = 1 } = shown[output];
    return `${short(std * factor, 3)} ${unit === "1" ? "" : `${unit.replace("deg", "°")} `}on \`${output}\``;
  });
  const rows = result.parameters.map(
    ({ name, unit, estimate, total_standard_error: error, trust }) =>
      `| \`${name}\` | ${unit.replaceAll("*", "·")} | ${short(PLANTS[model].parameters[name], 6)} | ${rounded(estimate, error)} | ${short(error, 2)} | ${trust} |`,
  );
  const fits = Object.entries(result.fit.validation).map(
    ([output, { fit_percent: percent }]) => `${percent.toFixed(1)} % of \`${output}\``,
  );
  const codes = [...new Set(result.verdict.reasons.map(({ code }) => code))];
  const reasons = codes.map((code) => `[${code}](/docs/verdicts#${code})`).join(", ");
  return [
    `[The recording](/docs/recordings/${model}.csv) has ${samples} samples ${sample_time_s} s apart, and noise of ${noises.join(" and ")} (one standard deviation).`,
    "",
    "| parameter | unit | true | estimate | total standard error | trust |",
    "|---|---|---|---|---|---|",
    ...rows,
    "",
    `Trust: **${result.verdict.trust}**${reasons ? ` (${reasons})` : ""}. On the data held back the simulation follows ${fits.join(" and ")}.`,
    "",
  ].join("\n");
}
