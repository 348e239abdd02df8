// The tests read every number off the pages of jobs of every kind, and find the field of the API that the number
// comes from.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { launch, open, PATIENCE, tools } from "./browser.mjs";
import { api, jobsOfAllKinds } from "./kinds.mjs";
import { digitsOf, Explained, judge, neighbourOf, writtenIn } from "./numbers.mjs";
import { base } from "./server.mjs";

const { duration } = await import(new URL("../../src/dashboard/assets/shell/format.js", import.meta.url));
const { query } = await import(new URL("../../src/dashboard/assets/shell/api.js", import.meta.url));

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const shared = { browser: null, checker: "", jobs: {} };

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    shared.jobs = await jobsOfAllKinds();
  }
});

after(() => shared.browser?.close());

// Words of the page that have numbers of their own: levels of intervals, what a sum is, the legend of shades, and days.
const FIXED = [
  /95 % (?:interval|band)/g,
  /fit of 100 %/g,
  /sum to 100 %/g,
  /50 to 75 %|from 75 %/g,
  /seconds since 1904/g,
  /[A-Z][a-z]{2} \d+, \d{4}/g,
];
// Parts that are no words of the page: instants of the clock, texts as the server has them, the identity of a job, and
// lines that have a test of their own.
const LEFT_OUT = [
  "time",
  "pre",
  "code",
  ".tour",
  "[data-part='What each unknown moves']",
  ".scatter .tick",
  "input[type='range']",
];

// Reads the texts of the page one by one: text, labels, tips and fields.
const textsOf = (page) =>
  page.evaluate((leftOut) => {
    const main = document.querySelector("#main");
    const texts = [];
    const walker = document.createTreeWalker(main, NodeFilter.SHOW_TEXT | NodeFilter.SHOW_ELEMENT);
    for (let node = walker.currentNode; node; node = walker.nextNode()) {
      const element = node instanceof Element ? node : node.parentElement;
      if (element.closest(leftOut)) {
        continue;
      }
      const part = element.closest("[data-part], section, fieldset");
      const place = part?.getAttribute("data-part") ?? part?.getAttribute("aria-label") ?? element.tagName;
      if (!(node instanceof Element)) {
        texts.push({ text: node.textContent, place });
        continue;
      }
      for (const text of [
        node.getAttribute("aria-label"),
        node.getAttribute("title"),
        /** @type {any} */ (node).value,
      ]) {
        typeof text === "string" && texts.push({ text, place });
      }
    }
    return texts.filter(({ text }) => /\d/.test(text));
  }, LEFT_OUT.join(","));

async function settled(page) {
  await page.evaluate(() => {
    for (const details of document.querySelectorAll("details:not(.save, .dropdown)")) {
      details.open = true;
    }
  });
  await page.waitForNetworkIdle({ idleTime: 400, ...PATIENCE });
}

// The answers of the API about a job explain its numbers: the job, its result, its search and what its plots are of.
async function explainedBy(id) {
  const job = await api(`/v1/jobs/${id}`);
  const [result, report, trajectory, disturbance, ...others] = await Promise.all(
    [
      "result",
      "report?format=json",
      "trajectory",
      "disturbance",
      "generations?limit=500",
      "candidates?limit=200",
    ].map((part) => api(`/v1/jobs/${id}/${part}`)),
  );
  const ids = [...new Set((job.spec.experiments ?? []).map(({ dataset }) => dataset))];
  const datasets = await Promise.all(ids.map((dataset) => api(`/v1/datasets/${dataset}`)));
  const windows = (job.spec.experiments ?? []).map(({ dataset, window }) => [
    dataset,
    window?.from_s,
    window?.to_s,
  ]);
  const samples = await Promise.all(
    windows.map(([dataset, from, to]) => api(`/v1/datasets/${dataset}/samples${query({ from, to })}`)),
  );
  const more = [await api(`/v1/models/${job.model}`), await api("/v1/verdict-rules")];
  const explained = new Explained()
    .add(job, result, trajectory, disturbance, ...others, ...datasets, ...samples, ...more)
    .add(report.residuals)
    .add(derivedFrom({ result, report, trajectory, disturbance }));
  for (const { conversion } of datasets.flatMap(({ signals }) => signals)) {
    conversion && (conversion.factor !== 1 || conversion.offset !== 0) && explained.convert(conversion);
  }
  return explained;
}

// The ends of a band of 95 %.
const ends = (middle, deviation) =>
  [-1.96, 1.96].map((by) =>
    middle.map((value, k) => (value === null ? null : value + by * (deviation[k] ?? NaN))),
  );

// Shares below zero are summed with the largest above zero, until the sum is no less than zero.
function together(shares) {
  const negative = shares.filter((share) => share < 0).reduce((sum, share) => sum + share, 0);
  const positive = shares.filter((share) => share > 0).sort((a, b) => b - a);
  return positive.reduce((sum, share) => (sum < 0 ? sum + share : sum), negative);
}

// The page computes numbers of the answers: ends of bands and bars, lengths of events, what the budget leaves, differences
// of criteria, and errors as shares of values.
function derivedFrom({ result, report, trajectory, disturbance }) {
  const outputs = (trajectory.experiments ?? []).flatMap((experiment) => Object.values(experiment.outputs));
  const series = (disturbance.experiments ?? []).flatMap((experiment) => experiment.disturbances);
  const budget = (parameter) => {
    const { name, experiment = null, standard_error: error, total_standard_error: total } = parameter;
    const key = experiment === null ? name : `${name}[${experiment}]`;
    const assumed = (result.budget ?? []).map(({ contributions }) => contributions[key]?.share ?? 0);
    const noise = (error / total) ** 2;
    return [noise, 1 - noise - assumed.reduce((sum, share) => sum + share, 0), together(assumed)];
  };
  const tried = result.model_search?.tried ?? [];
  const { sample_time_s: step, signals } = result.inputs ?? {};
  const { with_chosen: chosen = [], with_random: random = [], with_all: all = [] } = result;
  return {
    bands: [
      ...outputs
        .filter(({ deviation }) => deviation)
        .map((output) => ends(output.simulated, output.deviation)),
      ...series.map(({ value, deviation }) => ends(value, deviation)),
    ],
    events: series.flatMap(({ events }) => events.map((event) => event.end_s - event.start_s)),
    bars: (report.residuals ?? []).map(({ histogram: { from, width, counts } }) =>
      counts.map((_, k) => from + (k + 0.5) * width),
    ),
    budgets: (result.parameters ?? []).map(budget),
    criteria: tried.map(({ bic }) => bic - tried[0].bic),
    lengths: signals ? Object.values(signals).map(({ values }) => (values.length - 1) * step) : [],
    alone: Object.entries(result.windows?.alone ?? {}).map(([name, errors]) =>
      errors.map((error) => error / all.find((entry) => entry.name === name).value),
    ),
    errors: [...chosen, ...random, ...all].map((entry) => [
      entry.total_standard_error / entry.value,
      entry.standard_error / entry.value,
    ]),
  };
}

// Answers to requests that the page makes of its own: simulations of candidates and the check of a specification.
const ASKED = /\/v1\/(?:simulations|jobs)\?/;

// Opens a page and lists the numbers on it that no answer explains. An answer to a request that the page has given up
// explains none. Of the numbers of three digits and more it counts
// also how many would be explained with another last digit.
async function unexplainedOn({ address, ready, name }, explained) {
  const page = await open(address);
  const answers = [];
  page.on("response", (response) => {
    if (response.request().method() === "POST" && ASKED.test(response.url())) {
      answers.push(response.json().catch(() => null));
    }
  });
  await page.waitForSelector(ready, PATIENCE);
  await settled(page);
  explained.add(...(await Promise.all(answers)));
  const texts = await textsOf(page);
  assert.deepEqual(page.faults, [], name);
  await page.close();
  const numbers = texts.flatMap(({ text, place }) => {
    const words = FIXED.reduce((rest, fixed) => rest.replace(fixed, ""), text);
    return writtenIn(words).map((entry) => ({ ...entry, text, place }));
  });
  const long = numbers.filter((entry) => digitsOf(entry) > 2);
  return {
    count: numbers.length,
    long: long.length,
    neighbours: long.filter((entry) => explained.has(neighbourOf(entry))).length,
    unexplained: numbers
      .filter((entry) => !explained.has(entry))
      .map(({ written, text, place }) => `${name}: ${written} in “${text.slice(0, 160)}” of ${place}`),
  };
}

const MOST_NEIGHBOURS = 0.15;

test("every number of a job's page is one of the API's", { skip }, async (t) => {
  const pages = [];
  const ready = ".verdict .grade, [aria-label^='Design'] table, [aria-label^='Selection'] table";
  for (const [name, id] of Object.entries(shared.jobs)) {
    const explained = await explainedBy(id);
    pages.push(await unexplainedOn({ address: `/#/jobs/${id}`, ready, name }, explained));
  }
  t.diagnostic(judge(pages, MOST_NEIGHBOURS));
});

// The form offers all recordings with their lengths, and its sliders begin at defaults or in the middle of ranges.
async function explainForm(explained, id) {
  const { items } = await api("/v1/datasets?limit=200");
  const { spec, model } = await api(`/v1/jobs/${id}`);
  const { parameters } = await api(`/v1/models/${model}`);
  for (const recording of items) {
    explained.add([recording]).addText(duration(recording.duration_s));
  }
  for (const { name, lower, upper } of parameters) {
    const range = { lower, upper, ...spec.parameters[name]?.estimate };
    explained.take(range.lower > 0 ? Math.sqrt(range.lower * range.upper) : (range.lower + range.upper) / 2);
  }
}

test("every number of a job's form is one of the API's", { skip }, async (t) => {
  const pages = [];
  for (const [name, id] of Object.entries(shared.jobs)) {
    const { kind } = await api(`/v1/jobs/${id}`);
    if (kind === "identification") {
      const explained = await explainedBy(id);
      await explainForm(explained, id);
      const ready = "::-p-text(The job can start.)";
      pages.push(await unexplainedOn({ address: `/#/new?from=${id}`, ready, name }, explained));
    }
  }
  t.diagnostic(judge(pages, MOST_NEIGHBOURS));
});

test("a wide page has experiments beside each other, and a phone shows all of a matrix and of a budget", {
  skip,
}, async () => {
  const page = await open(`/#/jobs/${shared.jobs["several experiments"]}`, {
    width: 1920,
    height: 1000,
    scheme: "light",
  });
  await page.waitForSelector(".experiments > div:nth-child(3) .surface", PATIENCE);
  const places = () =>
    page.$$eval(".experiments > div", (parts) => parts.map((part) => part.getBoundingClientRect().toJSON()));
  const [first, second] = await places();
  assert.ok(first.top === second.top && first.right < second.left, JSON.stringify([first, second]));
  await page.setViewport({ width: 390, height: 844 });
  // The parts go back to their places where the page is narrow.
  await page.waitForSelector(".analysis > [data-part='Uncertainty budget'] .stack", PATIENCE);
  const [above, below] = await places();
  assert.ok(above.left === below.left && above.bottom <= below.top, JSON.stringify([above, below]));
  const cut = await page.$$eval(".matrix, .stack-row", (parts) =>
    parts.filter((part) => part.scrollWidth > part.clientWidth + 2).map((part) => part.className),
  );
  assert.deepEqual(cut, []);
  // Shares that make up for each other are a single part, so that no part lies below zero.
  await page.goto(`${base}/#/jobs/${shared.jobs["two outputs and initial states"]}`);
  await page.waitForSelector(".share.summed", PATIENCE);
  assert.equal(await page.$(".first-above"), null);
  assert.match(await page.$eval(".stack-members", ({ textContent }) => textContent), /^Together .* %: .* −/);
  assert.deepEqual(page.faults, []);
  await page.close();
});
