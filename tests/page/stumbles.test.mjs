// The tests go where people who played their roles at the page have stumbled (roles.mjs), in a browser, against a running
// server.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { launch, open, PATIENCE, press, says, text, tools } from "./browser.mjs";
import { csv, feed, WINDOW_S, windowOf } from "./feeding.mjs";
import { base, ended, JOB, post } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const STREAM = `stumbles-${Date.now()}`;
const shared = { browser: null, dataset: "", job: "" };

before(async () => {
  if (skip) {
    return;
  }
  Object.assign(shared, await launch());
  const recorded = csv("time [s]", await windowOf(95, Date.now() % 1009));
  shared.dataset = (await post(`/v1/datasets?name=${STREAM}`, recorded, "text/csv")).id;
  shared.job = (await post("/v1/jobs", JOB(shared.dataset, "cma_es"))).id;
  assert.equal((await ended(shared.job)).status, "succeeded");
});

after(() => shared.browser?.close());

test("an alarm leads to the job of its window", { skip }, async () => {
  await feed(STREAM, { first: 0, count: 4, mass: 95 });
  await feed(STREAM, { first: 4, count: 2, mass: 120 });
  const { spec } = await (await fetch(`${base}/v1/jobs/${shared.job}`)).json();
  const { model, outputs, method, parameters } = spec;
  const estimate = { lower: -0.1, upper: 0.1 };
  const experiment = {
    signals: { force: "drive_force", position: "position" },
    initial_state: { position: { estimate }, velocity: { estimate } },
  };
  const { id } = await post("/v1/monitors", {
    stream: STREAM,
    window: { length_s: WINDOW_S },
    job: { model, outputs, method, parameters, experiments: [experiment] },
  });
  const page = await open(`/#/plant/monitors/${id}`);
  const link = await page.waitForSelector("[aria-label='Alarms'] a[href^='#/jobs/']", { timeout: 300_000 });
  const row = await link.evaluate((element) => element.closest("tr").innerText);
  assert.match(row, /mass has changed since/);
  assert.doesNotMatch(row, /T\d\d:\d\d:/, "the instant is written by the clock of the reader");
  // The stream ends a sample before the end of its last window.
  await says(page, "the newest is 0.01 s before");
  const number = /\d+/.exec(await link.evaluate(({ innerText }) => innerText))[0];
  assert.ok(Number(number) >= 4, number);
  await link.click();
  await page.waitForFunction(() => location.hash.startsWith("#/jobs/job_"), PATIENCE);
  await says(page, `window ${number}`);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("the keyboard comes from the heading of a new job to its start, past the fields", { skip }, async () => {
  const page = await open(`/#/new?from=${shared.job}`);
  await says(page, "The job can start.");
  await page.focus("h1");
  await page.keyboard.press("Tab");
  assert.match(await page.evaluate(() => document.activeElement.innerText), /Go to the start of the job/);
  await page.keyboard.press("Enter");
  assert.equal(await page.evaluate(() => document.activeElement.innerText), "Start the job");
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("the first page asks for no description and no styles of other pages", { skip }, async () => {
  const page = await open("/#/");
  await says(page, "Try it with the demonstration rig");
  const asked = () =>
    page.evaluate(() => performance.getEntriesByType("resource").map(({ name }) => new URL(name).pathname));
  const later = ["/openapi.json", "/assets/job/job.css", "/assets/plant/plant.css", "/assets/data/marks.css"];
  await page.waitForNetworkIdle({ idleTime: 300 });
  const first = await asked();
  assert.ok(first.includes("/assets/list/start.js"));
  assert.deepEqual(
    later.filter((address) => first.includes(address)),
    [],
  );
  await press(page, "Plant");
  await page.waitForSelector(".places", PATIENCE);
  const place = await page.$eval(".places", (places) => getComputedStyle(places).display);
  assert.equal(place, "flex", "the styles are there before the page is shown");
  const order = await page.$$eval("link[rel=stylesheet]", (links) =>
    links.map(({ href }) => new URL(href).pathname.replace("/assets/", "")),
  );
  assert.deepEqual(order, [
    "vendor/uplot-1.6.32.min.css",
    "shell/style.css",
    "plot/plot.css",
    "data/marks.css",
    "list/jobs.css",
    "job/job.css",
    "new/job.css",
    "plant/plant.css",
  ]);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("many changes of the part that is shown make one reading, of the last of them", { skip }, async () => {
  const page = await open(`/#/datasets/${shared.dataset}`);
  const surface = await page.waitForSelector(".surface:not(.empty)", PATIENCE);
  await page.waitForNetworkIdle({ idleTime: 300 });
  const asked = [];
  page.on("request", (request) => request.url().includes("/samples") && asked.push(request.url()));
  const last = page.waitForRequest((request) => request.url().includes("/samples"), PATIENCE);
  await surface.evaluate((element) => {
    for (let turn = 0; turn < 5; turn += 1) {
      element.dispatchEvent(new KeyboardEvent("keydown", { key: "+" }));
    }
  });
  await last;
  await page.waitForNetworkIdle({ idleTime: 300 });
  const parts = asked.map((address) => new URL(address).searchParams);
  assert.equal(parts.length, 1);
  const length = Number(parts[0].get("to")) - Number(parts[0].get("from"));
  assert.ok(Math.abs(length / (WINDOW_S / 32) - 1) < 0.1, `${length}`);
  assert.match(await text(page, "h1"), /stumbles/);
  await page.close();
});
