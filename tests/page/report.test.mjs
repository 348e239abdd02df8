// The tests read every number off the reports of jobs of every kind, and find the field of the API that stands at the
// place of the number: each cell, sentence and tick has its own.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { launch, open, PATIENCE, tools } from "./browser.mjs";
import { api, jobsOfAllKinds, jobWithSamplesLeftOut } from "./kinds.mjs";
import { digitsOf, isRounded, judge, neighbourOf, signedIn } from "./numbers.mjs";
import { isOnAxis, unknownsOf } from "./report_charts.mjs";
import { sourceOf } from "./report_places.mjs";
import { base, ended } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const shared = { browser: null, checker: "", jobs: {} };

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    const leftOut = await jobWithSamplesLeftOut();
    assert.equal((await ended(leftOut)).status, "succeeded");
    shared.jobs = { ...(await jobsOfAllKinds()), "samples left out": leftOut };
  }
});

after(() => shared.browser?.close());

// Teaches the page to tell the place of an element: its section, and its cell or its chart.
function definePlaces() {
  const textOf = (element) => element?.textContent.trim() ?? "";
  // The lines of a cell are texts of their own.
  const firstOf = (cell) => (cell?.firstChild?.textContent ?? "").trim();
  const rowsOf = (table) => [...table.rows].filter((row) => !row.closest("thead"));
  function chartPlace(element, section) {
    const chart = element.closest("svg");
    const words = [...chart.querySelectorAll("text")];
    const isCorner = !chart.querySelector(".series");
    const alike = [...section.querySelectorAll("svg")];
    const isTick = /^(1\.2em|\.35em)$/.test(element.getAttribute("dy") ?? "") && !isCorner;
    const anchor = element.getAttribute("text-anchor");
    return {
      chart: true,
      caption: textOf(chart.parentElement.querySelector("figcaption")),
      ordinal: isCorner ? words.indexOf(element) : alike.indexOf(chart),
      frame: chart
        .querySelector("path.axis")
        .getAttribute("d")
        .match(/[\d.]+/g)
        .map(Number),
      isTick,
      anchor,
      at: Number(element.getAttribute(anchor === "middle" ? "x" : "y")),
    };
  }
  function cellPlace(element, section) {
    const cell = element.closest("td, th");
    const table = cell.closest("table");
    const row = cell.closest("tr");
    return {
      isTitle: row.closest("thead") !== null,
      table: [...section.querySelectorAll("table")].indexOf(table),
      row: rowsOf(table).indexOf(row),
      column: [...row.cells].indexOf(cell),
      first: firstOf(row.cells[0]),
      cells: [...row.cells].map(firstOf),
    };
  }
  globalThis.placeOf = (element) => {
    const section = element.closest("section");
    const before = (part) => part.compareDocumentPosition(element) & Node.DOCUMENT_POSITION_FOLLOWING;
    const tables = [...(section?.querySelectorAll("table") ?? [])];
    const part = element.closest("td, th, p, li, h1, h2, h3, figcaption, pre, svg, mn");
    return {
      section: textOf(section?.querySelector("h2")),
      title: textOf([...(section?.querySelectorAll("h3") ?? [])].filter(before).at(-1)),
      tag: element.closest("svg") ? element.tagName : (part?.tagName ?? element.tagName),
      caption: textOf(element.closest("figure")?.querySelector("figcaption")),
      table: tables.filter(before).length - 1,
      sentence: [...(section?.querySelectorAll("p") ?? [])].indexOf(part),
      equation: element.closest(".equation")?.querySelector("[aria-label], code")?.getAttribute("aria-label"),
      ...(element.closest("svg") && chartPlace(element, section)),
      ...(element.closest("td, th") && cellPlace(element, section)),
    };
  };
}

// Reads the texts of a report one by one, each with its place.
function readTexts() {
  const texts = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT | NodeFilter.SHOW_ELEMENT);
  for (let node = walker.currentNode; node; node = walker.nextNode()) {
    const element = node instanceof Element ? node : node.parentElement;
    const written =
      node instanceof Element
        ? ["aria-label", "title", "alt"].map((name) => node.getAttribute(name))
        : [node.textContent];
    for (const text of written) {
      text && /\d/.test(text) && texts.push({ text: text.trim(), place: globalThis.placeOf(element) });
    }
  }
  return {
    texts,
    title: document.title,
    regions: [...document.querySelectorAll("[role=region]")].map((region) => region.ariaLabel),
  };
}

// The answers of the API about a job that its report is made of.
async function answersOf(id) {
  const job = await api(`/v1/jobs/${id}`);
  const parts = [
    "result",
    "trajectory?max_points=100000",
    "disturbance?max_points=100000",
    "generations?limit=500",
    "report?format=json",
    "posterior",
  ];
  const [result, trajectory, disturbance, generations, report, draws] = await Promise.all(
    parts.map((part) => api(`/v1/jobs/${id}/${part}`)),
  );
  const ids = [...new Set(job.spec.experiments.map(({ dataset }) => dataset))];
  const datasets = await Promise.all(
    ids.map(async (dataset) => [dataset, await api(`/v1/datasets/${dataset}`)]),
  );
  return {
    job,
    result,
    trajectory,
    disturbance,
    draws,
    generations: generations.items,
    residuals: report.residuals,
    model: await api(`/v1/models/${job.model}`),
    datasets: Object.fromEntries(datasets),
  };
}

// Whether what stands at the place of an entry is the API's, with the entry written in another way.
function isExplained({ text, place, entries }, k, answers, written = entries[k].written) {
  if (place.isTick) {
    return isOnAxis(place, answers, { written });
  }
  const source = sourceOf({ ...place, text }, answers);
  if (typeof source[0] === "number") {
    return source.length === entries.length && isRounded(written, source[k]);
  }
  const { index, written: before } = entries[k];
  return source.includes(`${text.slice(0, index)}${written}${text.slice(index + before.length)}`);
}

function count(value) {
  return typeof value === "number"
    ? 1
    : Object.values(value ?? {}).reduce(
        (sum, entry) => sum + (typeof entry === "string" ? 0 : count(entry)),
        0,
      );
}

// Opens the report of a job and lists its numbers that are not what the API has for their places.
async function unexplainedIn(name, id) {
  const answers = await answersOf(id);
  const page = await open(`/v1/jobs/${id}/report`);
  await page.waitForSelector("pre.spec", PATIENCE);
  // A name that may be broken is one text.
  await page.$$eval("wbr", (places) => {
    for (const place of places) {
      const { parentNode } = place;
      place.remove();
      parentNode.normalize();
    }
  });
  await page.evaluate(definePlaces);
  const { texts, title, regions } = await page.evaluate(readTexts);
  const specification = await page.$eval("pre.spec", (spec) => JSON.parse(spec.textContent));
  assert.deepEqual(page.faults, [], name);
  await page.close();
  assert.equal(title, `${answers.job.spec.name} – identification report`);
  assert.deepEqual(
    regions,
    regions.map((_, k) => `table ${k + 1}`),
  );
  assert.deepEqual(specification, answers.job.spec, name);
  const read = texts
    .filter(({ place: { tag, section } }) => tag !== "DIV" && !(tag === "PRE" && section === "What made it"))
    .map((entry) => ({ ...entry, entries: signedIn(entry.text) }));
  const numbers = read.flatMap((entry) => entry.entries.map((number, k) => ({ ...entry, number, k })));
  const long = numbers.filter(({ number }) => digitsOf(number) > 2);
  const other = ({ number }) => neighbourOf(number).written;
  return {
    count: numbers.length + count(specification),
    long: long.length,
    neighbours: long.filter((entry) => isExplained(entry, entry.k, answers, other(entry))).length,
    unexplained: numbers
      .filter((entry) => !isExplained(entry, entry.k, answers))
      .map(({ number, text, place: { section, first = "", caption } }) => {
        const part = [section, first, caption].filter(Boolean).join(", ");
        return `${name}: ${number.written} in “${text.slice(0, 160)}” of ${part}`;
      }),
  };
}

// Hardly a number that is looked for by its place stands there with another last digit.
const MOST_NEIGHBOURS = 0.01;

test("every number of a job's report is what the API has for its place", { skip }, async (t) => {
  const reports = [];
  for (const [name, id] of Object.entries(shared.jobs)) {
    const { kind } = await api(`/v1/jobs/${id}`);
    if (kind === "identification") {
      const report = await unexplainedIn(name, id);
      t.diagnostic(`${name}: ${report.count} numbers`);
      reports.push(report);
    }
  }
  assert.equal(reports.length, 10);
  t.diagnostic(judge(reports, MOST_NEIGHBOURS));
});

test("the verdict says of noise what the table of the estimates says", { skip }, async () => {
  let checked = 0;
  for (const id of Object.values(shared.jobs)) {
    const result = await api(`/v1/jobs/${id}/result`);
    const reasons = (result.verdict?.reasons ?? []).filter(({ code }) => code === "wide_interval");
    for (const { detail } of reasons) {
      const [, name, written] = /^noise leaves `(.+?)` a standard error of ([\d.e-]+)/.exec(detail);
      const { standard_error: error } = unknownsOf(result).find(({ key }) => key === name);
      assert.ok(isRounded(written, error), `${detail}; the table has ${error}`);
      checked += 1;
    }
  }
  assert.ok(checked > 0, "no interval is wide");
});
