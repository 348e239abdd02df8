// The test makes a picture of every page as a phone and three screens show it, in both schemes, into the folder that
// SCREENSHOTS names, and sees that no page is wider than the window. People look at the pictures.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { launch, open, PATIENCE, picture, tools } from "./browser.mjs";
import { api, jobsOfAllKinds } from "./kinds.mjs";
import { base, post } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const WIDTHS = [390, 1280, 1920, 2560];
const shared = { browser: null, jobs: {} };

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    shared.jobs = await jobsOfAllKinds();
  }
});

after(() => shared.browser?.close());

const draw = (page) =>
  page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));

// Takes the pictures of a page, and lists the widths at which the page is wider than the window.
async function pictures(name, address) {
  const page = await open("/", { width: WIDTHS[1], height: 1000, scheme: "light" });
  await page.evaluate(() => localStorage.setItem("greybox.tour", "left"));
  await page.goto(base + address, { waitUntil: "domcontentloaded" });
  await page.waitForSelector("h1, rapi-doc", PATIENCE);
  await page.waitForNetworkIdle({ idleTime: 400, timeout: 15_000, concurrency: 2 }).catch(() => {});
  const faults = [];
  for (const width of WIDTHS) {
    await page.setViewport({ width, height: width < 500 ? 844 : 1000 });
    for (const scheme of ["light", "dark"]) {
      await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
      await draw(page);
      await picture(page, `screens-${name}-${width}-${scheme}`);
    }
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    wide > width && faults.push(`${name} is ${wide} px wide at ${width}`);
  }
  faults.push(...page.faults.map((fault) => `${name}: ${fault}`));
  await page.close();
  return faults;
}

test("every page fits a phone and three screens", { skip }, async () => {
  const { jobs } = shared;
  const { spec } = await api(`/v1/jobs/${jobs["low trust"]}`);
  const [{ dataset }] = spec.experiments;
  const { id: comparison } = await post("/v1/comparisons", { job: { ...spec, labels: {} }, seeds: 2 });
  const { selection } = (await api(`/v1/jobs/${jobs.selection}`)).spec;
  const pages = {
    start: "/#/",
    jobs: "/#/jobs",
    ...Object.fromEntries(
      Object.entries(jobs).map(([kind, id]) => [`job-${kind.replaceAll(" ", "-")}`, `/#/jobs/${id}`]),
    ),
    compare: `/#/compare?jobs=${jobs["low trust"]},${jobs["at a bound"]},${jobs["bound by a constraint"]}`,
    comparisons: "/#/comparisons",
    comparison: `/#/comparisons/${comparison}`,
    datasets: "/#/datasets",
    dataset: `/#/datasets/${dataset}`,
    models: "/#/models",
    model: "/#/models/positioning_drive",
    equations: `/#/equations?dataset=${dataset}`,
    new: `/#/new?from=${jobs["several experiments"]}`,
    plant: "/#/plant",
    streams: "/#/plant/streams",
    stream: `/#/plant/streams/${selection.stream}`,
    windows: `/#/plant/windows/new?selection=${jobs.selection}`,
    guide: "/docs/start",
    report: `/v1/jobs/${jobs["low trust"]}/report`,
  };
  const faults = [];
  for (const [name, address] of Object.entries(pages)) {
    faults.push(...(await pictures(name, address)));
  }
  assert.deepEqual(faults, []);
});
