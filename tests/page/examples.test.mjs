// The clicks of the worked examples are done in a browser as the guide has them: each lists the steps from the recording
// to the start of the job, and the job comes to the estimates that the guide has.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { fill, launch, open, PATIENCE, picture, press, says, tools } from "./browser.mjs";
import { chapters } from "./pictures_examples.mjs";
import { base, ended, post } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
/** @type {{ browser: any, chapters: any[], folder: string, jobs: Record<string, string> }} */
const shared = { browser: null, chapters: [], folder: "", jobs: {} };

const read = async (address) => (await fetch(base + address)).text();
const api = async (address) => (await fetch(base + address)).json();

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    shared.chapters = chapters(await read("/docs/examples.md"));
    shared.folder = fs.mkdtempSync(path.join(os.tmpdir(), "examples-"));
  }
});

after(async () => {
  await shared.browser?.close();
  shared.folder && fs.rmSync(shared.folder, { recursive: true });
});

const NUMBERS = { four: 4, five: 5 };
const IN_SI = { kg: 1, cm: 0.01 };
const emphasised = (text) => [...text.matchAll(/(?<![*\w])\*([^*]+)\*/g)].map(([, words]) => words);

// The steps of a chapter in the order of its list.
const stepsOf = ({ text }) => [...text.matchAll(/^\d\. (.*)$/gm)].map(([, step]) => step);

// Uploads the file that the first step names.
async function upload(page, step) {
  const [, name] = /`(.*\.csv)`/.exec(step);
  const file = path.join(shared.folder, name);
  fs.writeFileSync(file, await read(`/docs/recordings/${name}`));
  await (await page.waitForSelector("input[type=file]", PATIENCE)).uploadFile(file);
  await (await page.waitForSelector(".drop button[type=submit]", { ...PATIENCE, visible: true })).click();
  await says(page, "Experiment 1");
}

// The units of the recording become those that the first step has.
async function lookAtUnits(step, dataset) {
  const [, recorded, unit] = /(\w+) becomes? (\w+)/.exec(step) ?? [];
  const { signals } = await api(`/v1/datasets/${dataset}`);
  const converted = signals.map((signal) => `${signal.recorded_unit} becomes ${signal.unit}`);
  assert.ok(!unit || converted.includes(`${recorded} becomes ${unit}`), `${step}: ${converted}`);
}

// Chooses the model by its title.
async function choose(page, step) {
  const [title] = emphasised(step);
  const card = `::-p-xpath(//button[@role='radio'][strong[. = '${title}']])`;
  await (await page.waitForSelector(card, PATIENCE)).click();
  await says(page, "The job can start.");
}

// Lists the parameters of the form by what they are: unknown or known.
const kindsOf = (page) =>
  page.$$eval("table.parameters tbody select[aria-label$=' is']", (kinds) =>
    kinds.map((kind) => [kind.getAttribute("aria-label").slice(0, -" is".length), kind.value]),
  );

// The parameters that stand at unknown are those whose estimates the chapter has; the step counts them or names them.
async function lookAtParameters(page, step, { estimates }) {
  const kinds = await kindsOf(page);
  const unknown = kinds.filter(([, kind]) => kind === "unknown").map(([name]) => name);
  assert.deepEqual(
    unknown,
    estimates.map(({ name }) => name.replaceAll("_", " ")),
  );
  const [, listed] = /^Parameters: (.*?) stands? at \*unknown\*/.exec(step);
  const count = NUMBERS[listed.split(" ").at(-1)];
  const names = listed
    .replace("both frictions", "viscous friction, coulomb friction")
    .split(/, | and (?:the )?/);
  assert.ok(count ? count === unknown.length : names.length === unknown.length, `${listed}: ${unknown}`);
  assert.ok(count || names.every((name) => unknown.includes(name)), `${listed}: ${unknown}`);
}

// Types the noise of each output that the step names, in the unit that the step has.
async function typeNoise(page, step) {
  const [, entries] = /^How well it was measured: (.*)\.$/.exec(step);
  for (const entry of entries.split("; ")) {
    const [, outputs, noise, unit = "–"] = /^(.*), noise `(.*)`(?: \((.*)\))?$/.exec(entry);
    for (const output of outputs.split(" and ")) {
      const field = `input[aria-label='${output}, noise']`;
      await page.waitForSelector(field, PATIENCE);
      const row = await page.$eval(field, (input) => input.closest("tr").cells[0].textContent);
      assert.equal(row.trim(), `${output} [${unit}]`);
      await fill(page, field, noise);
    }
  }
  await says(page, "The job can start.");
}

async function start(page, step) {
  assert.match(step, /^\*Start the job\*/);
  await press(page, "Start the job");
  await page.waitForFunction(() => location.hash.startsWith("#/jobs/job_"), PATIENCE);
  return page.url().split("/").at(-1);
}

// The words on a page that a reader is sent to, such as titles of parts.
const textOf = (page) => page.$eval("main", (main) => main.textContent);

async function clicked(chapter) {
  const { job, estimates } = chapter;
  const steps = stepsOf(chapter);
  assert.equal(steps.length, 5, job.model);
  const page = await open("/#/new");
  await upload(page, steps[0]);
  await choose(page, steps[1]);
  await lookAtParameters(page, steps[2], chapter);
  await typeNoise(page, steps[3]);
  await picture(page, `example-${job.model}`);
  const form = await textOf(page);
  const id = await start(page, steps[4]);
  const { status, spec } = await ended(id);
  assert.equal(status, "succeeded", job.model);

  // The clicks make the job that the chapter has as JSON; the page leaves the seed to the server.
  const [{ dataset }] = spec.experiments;
  await lookAtUnits(steps[0], dataset);
  const experiments = job.experiments.map((experiment) => ({ ...experiment, dataset }));
  const asked = await post("/v1/jobs?validate_only=true", { ...job, experiments });
  const { seed, name, ...clicks } = spec;
  const { seed: fixed, name: none, ...json } = asked.spec;
  assert.deepEqual(clicks, json, job.model);
  const [, size, unit] = /known \((\S+) (\w+)\)/.exec(steps[2]) ?? [];
  const known = Object.values(spec.parameters).map(({ value }) => value);
  assert.ok(!unit || known.includes(size * IN_SI[unit]), `${steps[2]}: ${known}`);
  const { parameters } = await api(`/v1/jobs/${id}/result`);
  for (const [k, { estimate, error }] of estimates.entries()) {
    const moved = Math.abs(parameters[k].estimate - estimate);
    assert.ok(
      moved <= error,
      `${parameters[k].name} of ${job.model}: ${parameters[k].estimate}, seed ${seed}`,
    );
  }

  // The form or the page of the job has everything that the text sends a reader to.
  await page.waitForSelector(".verdict .grade", PATIENCE);
  await page.waitForNetworkIdle({ idleTime: 400, ...PATIENCE });
  const shown = `${form} ${await textOf(page)}`.toLowerCase();
  const prose = chapter.text.replaceAll(/^!\[.*$|\*\*/gm, "").replaceAll(/\s+/g, " ");
  for (const words of emphasised(prose)) {
    assert.ok(shown.includes(words.toLowerCase()), `${job.model}: nothing is called ${words}`);
  }
  assert.deepEqual(page.faults, []);
  await page.close();
  return id;
}

// Starts a job like another without one of its outputs, and gives the result.
async function without(output, job) {
  const page = await open(`/#/new?from=${job}`);
  const label = `//label[starts-with(normalize-space(.), '${output} [')]//select`;
  const select = await page.waitForSelector(`::-p-xpath(${label})`, { ...PATIENCE, visible: true });
  await select.select("");
  await page.waitForFunction(
    (name) => !document.querySelector(`input[aria-label='${name}, noise']`),
    PATIENCE,
    output,
  );
  await says(page, "The job can start.");
  const id = await start(page, "*Start the job*");
  assert.deepEqual(page.faults, []);
  await page.close();
  assert.equal((await ended(id)).status, "succeeded");
  return api(`/v1/jobs/${id}/result`);
}

test("the clicks of each worked example make its job, which comes to its estimates", { skip }, async (t) => {
  assert.ok(shared.chapters.length >= 9);
  for (const chapter of shared.chapters) {
    await t.test(chapter.job.model, async () => {
      shared.jobs[chapter.job.model] = await clicked(chapter);
    });
  }
});

test("a motor without its current is not fixed, and tanks without the upper level have larger errors", {
  skip,
}, async () => {
  const guide = await read("/docs/examples.md");
  assert.match(guide, /Leave the current out of the signals, and the trust is low/);
  const { verdict } = await without("measured current", shared.jobs.dc_motor);
  assert.equal(verdict.trust, "low");
  const told = verdict.reasons
    .filter(({ code }) => code === "not_identifiable")
    .flatMap(({ concerns }) => concerns);
  const fixed = ["motor_constant", "inertia", "viscous_friction", "coulomb_friction"];
  assert.deepEqual([...new Set(told)].sort(), fixed.sort());

  assert.match(
    guide,
    /Leave the upper level out of the signals, and everything is still found, with about twice the error/,
  );
  const { parameters } = await without("first level", shared.jobs.cascaded_tanks);
  const { estimates } = shared.chapters.find(({ job }) => job.model === "cascaded_tanks");
  const ratios = estimates.map(({ error }, k) => parameters[k].total_standard_error / error);
  const mean = Math.exp(ratios.reduce((sum, ratio) => sum + Math.log(ratio), 0) / ratios.length);
  assert.ok(mean > 1.5 && mean < 2.5, `${ratios}`);
  for (const [k, { truth }] of estimates.entries()) {
    const { estimate, total_standard_error: error, name } = parameters[k];
    assert.ok(Math.abs(estimate - truth) < 4 * error, `${name}: ${estimate} ± ${error} of ${truth}`);
  }
});
