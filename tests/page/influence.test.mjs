// The tests read in a browser how each unknown of a job moves the outputs, and compare the lines with what a linear
// model moves in closed form.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { labelled, launch, open, PATIENCE, picture, press, says, text, tools } from "./browser.mjs";
import { api, jobWithOwnParameters, productJob } from "./kinds.mjs";
import { numberIn } from "./numbers.mjs";
import { base, designJob, ended } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const PART = "[data-part='What each unknown moves']";
const TABLE = `${PART} [aria-label='What each unknown moves'] tbody tr`;
const shared = { browser: null, checker: "", job: "", result: null };

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    shared.job = await productJob();
    assert.equal((await ended(shared.job)).status, "succeeded");
    shared.result = await api(`/v1/jobs/${shared.job}/result`);
  }
});

after(() => shared.browser?.close());

// Opens the part by its entry beside the page, and waits until it has its table.
async function opened(job) {
  const page = await open(`/#/jobs/${job}`);
  const asked = [];
  page.on("request", (request) => request.url().includes("/v1/simulations") && asked.push(request));
  await page.waitForSelector(".verdict .grade", PATIENCE);
  return { page, asked };
}

async function show(page) {
  await press(page, "What each unknown moves");
  await page.waitForSelector(TABLE, PATIENCE);
}

const rowsOf = (page) =>
  page.$$eval(TABLE, (rows) =>
    Object.fromEntries(
      rows.map((row) => {
        const [name, step, rms, noise, share] = [...row.cells].map((cell) =>
          cell.innerText.trim().replaceAll("\u00a0", " "),
        );
        return [name, { step, rms, noise, share }];
      }),
    ),
  );

// The values of all lines at an instant, by the names of the unknowns: the cursor goes to an end by the keyboard.
async function linesAt(page, key) {
  await page.focus(`${PART} .surface`);
  await page.keyboard.press(key);
  const readout = await text(page, `${PART} .readout`);
  return Object.fromEntries(
    readout
      .split(" · ")
      .map((entry) => /^(.*?) ([−\d].*)$/.exec(entry))
      .filter(Boolean)
      .map(([, name, value]) => [name, numberIn(value)]),
  );
}

const near = (shown, value, place) =>
  assert.ok(Math.abs(shown - value) <= 0.006 * Math.abs(value) + 1e-9, `${place}: ${shown} is not ${value}`);

test("the lines of a linear model are those in closed form, and the ranking is theirs", {
  skip,
}, async () => {
  const estimates = Object.fromEntries(
    [...shared.result.parameters, ...shared.result.initial_states].map((estimate) => [
      estimate.name ?? estimate.state,
      estimate,
    ]),
  );
  const { page, asked } = await opened(shared.job);
  assert.equal(asked.length, 0, "nothing is simulated before the part is open");
  await show(page);
  assert.equal(asked.length, 1 + Object.keys(estimates).length);
  await (await labelled(page, "Output")).select("wall_temperature");
  const byErrors = await rowsOf(page);
  for (const name of ["efficiency", "coupling", "glow", "capacity", "lag"]) {
    near(numberIn(byErrors[name].step), estimates[name].total_standard_error, `step of ${name}`);
  }
  assert.match(byErrors.capacity.step, /J\/K$/);
  // The line of a state at the start dies out with the time constant of the wall; the conductance is 5 W/K.
  const capacity = estimates.capacity.estimate;
  const start = estimates.wall.total_standard_error;
  const decay = Math.exp((-5 * 598) / capacity);
  near((await linesAt(page, "Home"))["wall at the start"], start, "the wall's line at 0 s");
  near((await linesAt(page, "End"))["wall at the start"], start * decay, "the wall's line at its end");

  // By 1 % of the value, efficiency and coupling move the wall alike: by 1 % of what the power makes of it.
  await (await labelled(page, "Each unknown moves up by")).select("percent");
  await page.waitForFunction(
    (rows) => [...document.querySelectorAll(rows)].some((row) => row.innerText.includes("+0.008")),
    PATIENCE,
    TABLE,
  );
  const rows = await rowsOf(page);
  assert.equal(rows.coupling.rms, rows.efficiency.rms);
  assert.equal(rows.lag.rms, "0 K", "the lag of the sensor does not move the wall");
  const last = await linesAt(page, "End");
  const heated = estimates.efficiency.estimate * estimates.coupling.estimate * (400 / 5);
  const powered = heated * (Math.exp((-5 * 278) / capacity) - Math.exp((-5 * 558) / capacity));
  near(last.efficiency, 0.01 * powered, "the line of efficiency at its end");
  near(last.coupling, last.efficiency, "the line of coupling at its end");
  assert.equal(last.glow, 0);
  assert.equal(rows.glow.rms, "0 K");
  const squares = Object.values(rows).reduce((sum, { rms }) => sum + numberIn(rms) ** 2, 0);
  near(numberIn(rows.efficiency.share), (100 * numberIn(rows.efficiency.rms) ** 2) / squares, "its share");
  const { noise_std: noise } = shared.result.residuals.wall_temperature;
  near(numberIn(rows.efficiency.noise), numberIn(rows.efficiency.rms) / noise, "efficiency by the noise");
  assert.match(await text(page, PART), /Lines of the same shape: \w+ and \w+\./);

  // The recording has a time of day and was in degrees Celsius: a difference stays in kelvin.
  assert.match(await text(page, `${PART} .readout`), /2026-03-02 08:09:58/);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("an unknown whose simulation fails says so, and the others have their lines", { skip }, async () => {
  const { page } = await opened(shared.job);
  const lag = shared.result.parameters.find(({ name }) => name === "lag").estimate;
  await page.setRequestInterception(true);
  page.on("request", (request) => {
    const moved =
      request.url().includes("/v1/simulations") && JSON.parse(request.postData()).parameters.lag.value;
    moved && moved !== lag
      ? request.respond({
          status: 422,
          contentType: "application/problem+json",
          body: JSON.stringify({ title: "The request is wrong", detail: "the lag is too long" }),
        })
      : request.continue();
  });
  await show(page);
  assert.match(await text(page, PART), /lag.*not simulated: the lag is too long/);
  assert.match((await rowsOf(page)).capacity.rms, /K$/);
  assert.deepEqual(
    page.faults.filter((fault) => !fault.includes("422")),
    [],
  );
  await page.close();
});

test("each experiment has its own unknowns, and a design has no such part", { skip }, async () => {
  const job = await jobWithOwnParameters();
  assert.equal((await ended(job)).status, "succeeded");
  const { parameters, initial_states: states } = await api(`/v1/jobs/${job}/result`);
  // The second experiment has a friction of its own, which stands in the place of the friction that the others share.
  const common = parameters.filter(({ experiment = null }) => experiment === null).length;
  const statesOf = (k) => states.filter(({ experiment }) => experiment === k).length;
  assert.equal(parameters.length, common + 1);
  const { page, asked } = await opened(job);
  await show(page);
  assert.equal(Object.keys(await rowsOf(page)).length, common + statesOf(0));
  await (await labelled(page, "Experiment")).select("1");
  await page.waitForFunction(
    (rows) => [...document.querySelectorAll(rows)].some((row) => row.innerText.includes("in experiment 2")),
    PATIENCE,
    TABLE,
  );
  const rows = await rowsOf(page);
  assert.equal(Object.keys(rows).length, common + statesOf(1));
  assert.equal(rows["coulomb friction"], undefined);
  assert.ok(numberIn(rows["coulomb friction in experiment 2"].rms) > 0);
  // The third experiment starts where the result says that its first samples are met.
  await (await labelled(page, "Experiment")).select("2");
  await page.waitForFunction(
    (rows) => ![...document.querySelectorAll(rows)].some((row) => row.innerText.includes("in experiment 2")),
    PATIENCE,
    TABLE,
  );
  const last = JSON.parse(asked.at(-1).postData());
  const { validation_starts: starts } = await api(`/v1/jobs/${job}/result`);
  assert.deepEqual(last.initial_state, Object.fromEntries(starts.map(({ state, value }) => [state, value])));
  assert.deepEqual(page.faults, []);
  await page.close();

  const { id } = await designJob();
  const design = await open(`/#/jobs/${id}`);
  await says(design, "What it would bring");
  assert.equal(await design.$(PART), null);
  await design.close();
});

test("the part is accessible and fits every width, in both schemes", { skip }, async () => {
  for (const width of [390, 1280, 2560]) {
    for (const scheme of ["light", "dark"]) {
      const page = await open(`/#/jobs/${shared.job}`, { width, height: 900, scheme });
      await page.waitForSelector(".verdict .grade", PATIENCE);
      await show(page);
      await picture(page, `influence-${width}-${scheme}`, PART);
      await page.evaluate(shared.checker);
      const { violations } = await page.evaluate((part) => globalThis.axe.run(part), PART);
      assert.deepEqual(
        violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`),
        [],
        `${width} ${scheme}`,
      );
      const wide = await page.evaluate(() => document.documentElement.scrollWidth);
      assert.ok(wide <= width, `the page is ${wide} px wide at ${width}`);
      assert.deepEqual(page.faults, []);
      await page.close();
    }
  }
});
