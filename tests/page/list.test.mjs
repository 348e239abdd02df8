// The tests use the list of jobs and the comparison of jobs in a browser, against a running server: estimates as
// columns, jobs of different kinds beside each other, and seeds that no number of JavaScript holds.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { faultsOf, fill, launch, open, PATIENCE, press, SIZES, says, tools } from "./browser.mjs";
import { base, designJob, ended, JOB, post, recording } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const LARGEST = "18446744073709551615";
const ODD = "9007199254740993";
// The jobs are those of this run alone, whatever the server had before.
const visit = `v${Date.now()}`;
const labels = { visit };
// The tests share the browser, the recording, two jobs of it and a design.
const shared = { browser: null, checker: null, dataset: null, jobs: [], design: null };

before(async () => {
  if (skip) {
    return;
  }
  Object.assign(shared, await launch());
  shared.dataset = (await post("/v1/datasets?name=drive", await recording(), "text/csv")).id;
  for (const method of ["icra_genetic", "cma_es"]) {
    shared.jobs.push((await post("/v1/jobs", { ...JOB(shared.dataset, method), labels })).id);
  }
  shared.design = (await designJob({ families: ["sine"], points: 1, duration_s: 1 })).id;
  for (const id of [...shared.jobs, shared.design]) {
    assert.equal((await ended(id)).status, "succeeded");
  }
});

after(() => shared.browser?.close());

const row = (id) => `tr:has(a[href='#/jobs/${id}'])`;
const cells = (page, selector) => page.$eval(selector, (line) => line.innerText.replaceAll(/\s+/g, " "));
const choice = (page, name) =>
  page.waitForSelector(
    `::-p-xpath(//div[@class='columns']//label[normalize-space() = '${name}']/input)`,
    PATIENCE,
  );
const hasEstimate = (page, id) =>
  page.waitForFunction(
    (selector) => / ± [\d.]+\skg/.test(document.querySelector(selector)?.innerText),
    PATIENCE,
    row(id),
  );

test("estimates are columns: offered, typed, kept, sorted by, and up to date", { skip }, async () => {
  const page = await open(`/#/jobs?label=visit:${visit}`);
  const asked = [];
  page.on("request", (request) => {
    const { pathname, searchParams } = new URL(request.url());
    pathname === "/v1/jobs" && asked.push(searchParams.get("estimates"));
  });
  await page.waitForSelector(row(shared.jobs[1]), PATIENCE);
  await says(page, "live");
  await press(page, "Columns");
  await (await choice(page, "mass")).click();
  await hasEstimate(page, shared.jobs[0]);
  assert.match(await cells(page, row(shared.jobs[0])), / 95\.\d+ ± 0\.\d+ kg (high|moderate|low)\s*$/);
  assert.equal(asked.at(-1), "mass");

  // A name that the list does not offer is typed.
  await fill(page, ".columns form input", "nothing_like_it");
  await page.focus(".columns form button");
  await page.keyboard.press("Enter");
  await choice(page, "nothing like it");
  assert.match(await page.evaluate(() => location.hash), /estimate%3Amass%2Cestimate%3Anothing_like_it/);
  await page.keyboard.press("Escape");

  // A job that ends while the list is open gets its estimate.
  const job = { ...JOB(shared.dataset, "cma_es"), name: "later", labels };
  const { id } = await post("/v1/jobs", job);
  await page.waitForSelector(row(id), PATIENCE);
  await hasEstimate(page, id);

  // The heading sorts by the value, and a second time the other way round.
  const order = () =>
    page.$$eval(".jobs tbody a", (links) => links.map((link) => link.hash.split("/").at(-1)));
  await (await page.waitForSelector("::-p-xpath(//th/button[. = 'mass'])", PATIENCE)).click();
  await page.waitForSelector("th[aria-sort='ascending']", PATIENCE);
  const values = new Map();
  for (const one of [...shared.jobs, id]) {
    const { parameters } = await (await fetch(`${base}/v1/jobs/${one}/result`)).json();
    values.set(one, parameters.find(({ name }) => name === "mass").estimate);
  }
  const ordered = (await order()).map((one) => values.get(one));
  assert.deepEqual(
    ordered,
    [...ordered].sort((a, b) => a - b),
  );

  // The columns are there again on the next visit, whose first request asks for their estimates.
  await page.goto("about:blank");
  asked.splice(0);
  await page.goto(`${base}/#/jobs`, { waitUntil: "domcontentloaded" });
  await hasEstimate(page, id);
  assert.equal(asked[0], "mass,nothing_like_it");
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("an estimation is compared with a design from the list", { skip }, async () => {
  const page = await open("/#/jobs");
  for (const id of [shared.jobs[0], shared.design]) {
    await (await page.waitForSelector(`${row(id)} input`, PATIENCE)).click();
  }
  await press(page, "Compare 2");
  await says(page, "is the design of an experiment, which estimates nothing");
  await says(page, "foretold");
  await says(page, "no other job here is of this kind");
  await page.waitForSelector(".comparison .surface canvas", PATIENCE);
  assert.deepEqual(page.faults, []);

  // A job that is gone is named, and the rest is compared.
  const ids = [...shared.jobs, shared.design, "job_00000000000000000000000000000000"].join(",");
  await page.evaluate((jobs) => {
    location.hash = `/compare?jobs=${jobs}`;
  }, ids);
  await says(page, "There is no job job_0000");
  await says(page, "Estimation: jobs 1 and 2");
  await says(page, "method › name");
  await page.close();
  const compared = `/#/compare?jobs=${[...shared.jobs, shared.design].join(",")}`;
  const listed = `/#/jobs?columns=status,name,estimate:mass,estimate:offset&label=visit:${visit}`;
  const faults = [];
  for (const size of [...SIZES, { width: 2560, height: 1440, scheme: "light" }]) {
    const { checker } = shared;
    faults.push(
      ...(await faultsOf("comparison_of_kinds", compared, { size, checker, ready: ".comparison canvas" })),
      ...(await faultsOf("list_of_estimates", listed, { size, checker, ready: ".jobs tbody a" })),
    );
  }
  assert.deepEqual(faults, []);
});

// The server gives a job with another seed than it has.
async function withSeed(page, id, seed) {
  const text = await (await fetch(`${base}/v1/jobs/${id}`)).text();
  const told = text.replace(/"seed":\d+/, `"seed":${seed}`);
  assert.notEqual(told, text);
  await page.setRequestInterception(true);
  page.on("request", (request) =>
    new URL(request.url()).pathname === `/v1/jobs/${id}`
      ? request.respond({ contentType: "application/json", body: told })
      : request.continue(),
  );
}

test("a seed of 64 bits is shown with all its digits", { skip }, async () => {
  const page = await open("/#/models");
  await withSeed(page, shared.jobs[0], LARGEST);
  await page.evaluate((jobs) => {
    location.hash = `/compare?jobs=${jobs}`;
  }, shared.jobs.join(","));
  const seeds = await page.waitForSelector("::-p-xpath(//tr[.//span[@title = '/seed']])", PATIENCE);
  assert.match(await seeds.evaluate((line) => line.innerText), new RegExp(`^seed\\s+${LARGEST}\\s+1$`));
  await page.evaluate((id) => {
    location.hash = `/jobs/${id}`;
  }, shared.jobs[0]);
  await page.waitForFunction(
    (digits) => document.querySelector("main").textContent.includes(`"seed": ${digits}`),
    PATIENCE,
    LARGEST,
  );
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("a seed of 64 bits is kept and sent with all its digits", { skip }, async () => {
  const page = await open(`/#/new?dataset=${shared.dataset}&model=positioning_drive`);
  const bodies = [];
  await page.setRequestInterception(true);
  page.on("request", (request) => {
    const { pathname, searchParams } = new URL(request.url());
    if (request.method() === "POST" && pathname === "/v1/jobs" && !searchParams.has("validate_only")) {
      bodies.push(request.postData());
      request.respond({
        status: 202,
        contentType: "application/json",
        body: JSON.stringify({ id: shared.jobs[0] }),
      });
    } else {
      request.continue();
    }
  });
  const text = () => page.$eval("#panel-json .editor", (editor) => editor.getText());
  await press(page, "Settings of the search");
  await fill(page, "::-p-xpath(//label[contains(., 'Seed')]//input)", LARGEST);
  await page.waitForFunction(
    (digits) => document.querySelector("#panel-json .editor").getText().includes(`"seed": ${digits}`),
    PATIENCE,
    LARGEST,
  );
  // The text is read as exactly as the field, and the field follows it.
  const changed = (await text()).replace(LARGEST, ODD);
  await press(page, "JSON");
  await (await page.waitForSelector("#panel-json .editor >>> .cm-content", PATIENCE)).focus();
  await page.keyboard.down("Control");
  await page.keyboard.press("a");
  await page.keyboard.up("Control");
  await page.keyboard.sendCharacter(changed);
  await page.waitForFunction(
    (digits) =>
      [...document.querySelectorAll("#panel-guided label input")].some((input) => input.value === digits),
    PATIENCE,
    ODD,
  );
  await press(page, "Start the job");
  await page.waitForFunction((id) => location.hash === `#/jobs/${id}`, PATIENCE, shared.jobs[0]);
  assert.match(bodies[0], new RegExp(`"seed":${ODD}[,}]`));
  await page.close();
});
