// This program measures the page and prints the figures; it asserts nothing, since machines differ.
//
//   GREYBOX_URL=… PAGE_TOOLS=… node tests/page/figures.mjs [samples] [jobs] [memory] [paths]
//
// GREYBOX_URL names a server of a release build that has nothing else to do, PAGE_TOOLS a folder with
// puppeteer-core in its node_modules, CHROMIUM the browser. JOBS is the length of the list of jobs
// (10000), MINUTES the time for which live jobs are watched (4). SERVO and LAB name recordings on the
// disk for the paths of a new user; a path without its recording is left out.

import fs from "node:fs";
import { createRequire } from "node:module";
import os from "node:os";
import path from "node:path";
import { performance } from "node:perf_hooks";

const {
  GREYBOX_URL: base,
  PAGE_TOOLS: tools,
  CHROMIUM = "/usr/bin/chromium",
  JOBS = "10000",
  MINUTES = "4",
  SERVO,
  LAB,
  PDF,
} = process.env;
const require = createRequire(path.resolve(tools, "package.json"));
const browser = await require("puppeteer-core").launch({
  executablePath: CHROMIUM,
  headless: true,
  args: ["--no-sandbox", "--disable-gpu"],
  protocolTimeout: 600_000,
});
const folder = fs.mkdtempSync(path.join(os.tmpdir(), "figures-"));
const PATIENCE = { timeout: 300_000 };
const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
const say = (name, value) => console.log(`${name.padEnd(72)} ${value}`);
const ms = (value) => `${Math.round(value)} ms`;

async function post(address, body, type = "application/json") {
  const answer = await fetch(base + address, {
    method: "POST",
    headers: { "content-type": type },
    body: typeof body === "string" ? body : JSON.stringify(body),
  });
  if (!answer.ok) {
    throw new Error(`${address}: ${answer.status} ${(await answer.text()).slice(0, 300)}`);
  }
  return answer.json();
}

async function open(address) {
  const page = await browser.newPage();
  await page.setViewport({ width: 1400, height: 900 });
  await page.goto(base + address, { waitUntil: "domcontentloaded" });
  return page;
}

const says = (page, words) =>
  page.waitForFunction((text) => document.body.innerText.includes(text), PATIENCE, words);

// Measures a recording of a million samples: the time from the end of the upload to the first plot, the
// server's time for zooms, and whether a single sample stays in sight.
async function samples() {
  const count = 1_000_000;
  const spike = 683_412;
  const file = path.join(folder, "million.csv");
  const out = fs.createWriteStream(file);
  out.write("time [s],level [m],flow [m^3/s]\n");
  for (let from = 0; from < count; from += 10_000) {
    const rows = Array.from({ length: 10_000 }, (_, k) => from + k).map(
      (k) =>
        `${(k / 1000).toFixed(3)},${k === spike ? 9 : Math.sin(k / 9000).toFixed(5)},${Math.cos(k / 700).toFixed(5)}`,
    );
    out.write(`${rows.join("\n")}\n`) || (await new Promise((resolve) => out.once("drain", resolve)));
  }
  await new Promise((resolve) => out.end(resolve));
  say("recording", `${count} samples of 2 signals, ${(fs.statSync(file).size / 1e6).toFixed(1)} MB of CSV`);

  const page = await open("/#/datasets");
  await page.evaluate(() => {
    globalThis.marks = {};
    const drawn = () => {
      const chart = [...document.querySelectorAll(".surface")].find(
        (surface) => !surface.classList.contains("empty") && surface.querySelector("canvas"),
      );
      globalThis.marks.plot ??=
        chart && location.hash.startsWith("#/datasets/ds_") ? performance.now() : undefined;
      globalThis.marks.plot || requestAnimationFrame(drawn);
    };
    const fetched = globalThis.fetch;
    globalThis.fetch = async (address, options) => {
      const upload = options?.method === "POST" && String(address).startsWith("/v1/datasets");
      if (upload) {
        globalThis.marks.sent = performance.now();
      }
      const answer = await fetched(address, options);
      if (upload) {
        globalThis.marks.stored = performance.now();
      }
      return answer;
    };
    drawn();
  });
  const input = await page.waitForSelector("input[type=file]", PATIENCE);
  await input.uploadFile(file);
  await (await page.waitForSelector(".drop button[type=submit]:not([disabled])", PATIENCE)).click();
  // The page of the recording opens by itself or by its link.
  await page.waitForFunction(() => globalThis.marks.stored, PATIENCE);
  await page.evaluate(() =>
    setTimeout(() => {
      if (!location.hash.startsWith("#/datasets/ds_")) {
        document.querySelector("a[href^='#/datasets/ds_']")?.click();
      }
    }, 50),
  );
  await page.waitForFunction(() => globalThis.marks.plot, PATIENCE);
  const marks = await page.evaluate(() => globalThis.marks);
  say("upload, read and stored", ms(marks.stored - marks.sent));
  say("from there to the first plot of both signals", ms(marks.plot - marks.stored));

  const id = await page.evaluate(() => location.hash.split("/").at(-1));
  const times = [];
  for (let width = 1000; width > 0.05; width /= 2) {
    for (const at of [0, 0.37, 0.683412]) {
      const from = Math.max(0, Math.min(1000 - width, at * 1000 - width / 2));
      const before = performance.now();
      const answer = await fetch(
        `${base}/v1/datasets/${id}/samples?signals=level,flow&from=${from}&to=${from + width}&max_points=5200`,
      );
      await answer.arrayBuffer();
      times.push(performance.now() - before);
    }
  }
  times.sort((a, b) => a - b);
  say(
    `reading a part, ${times.length} zooms (median, longest)`,
    `${ms(times[times.length >> 1])}, ${ms(times.at(-1))}`,
  );

  const highest = () =>
    page.$eval(".surface", (surface) =>
      Number(/level .* to ([\d.]+)/.exec(surface.getAttribute("aria-label"))[1]),
    );
  let seen = (await highest()) === 9 ? 1 : 0;
  let zooms = 1;
  let shown = [0, (count - 1) / 1000];
  for (let width = 500; width > 0.02; width /= 2) {
    const over = await (await page.$(".u-over")).boundingBox();
    const at = (time) => over.x + ((time - shown[0]) / (shown[1] - shown[0])) * over.width;
    const middle = spike / 1000;
    const [left, right] = [
      Math.max(shown[0], middle - width * 0.4),
      Math.min(shown[1], middle + width * 0.6),
    ];
    const read = page.waitForResponse((response) => response.url().includes("/samples"), PATIENCE);
    await page.mouse.move(Math.max(over.x + 1, at(left)), over.y + 20);
    await page.mouse.down();
    await page.mouse.move(Math.min(over.x + over.width - 1, at(right)), over.y + 20, { steps: 3 });
    await page.mouse.up();
    const { searchParams: part } = new URL((await read).url());
    shown = [Number(part.get("from")), Number(part.get("to"))];
    await pause(250);
    zooms += 1;
    seen += (await highest()) === 9 ? 1 : 0;
  }
  say("one sample in a million stays in sight", `at ${seen} of ${zooms} zooms, down to 40 ms`);
  await page.close();
}

const CHEAP = (dataset, k) => ({
  name: `figure ${k}`,
  labels: { line: `l${k % 20}` },
  model: "positioning_drive",
  experiments: [{ dataset, signals: { force: "force", position: "position" } }],
  method: { name: "cma_es", population: 4, generations: 1 },
  parameters: { mass: { estimate: { lower: 20, upper: 300 } } },
  seed: k,
});

async function drive(count = 40) {
  const force = Array.from({ length: count }, (_, k) => 60 * Math.sign(Math.sin(k / 6)));
  const { outputs } = await post("/v1/simulations", {
    model: "positioning_drive",
    inputs: { sample_time_s: 0.01, signals: { force: { unit: "N", values: force } } },
  });
  const rows = force.map(
    (value, k) => `${(k * 0.01).toFixed(2)},${value},${outputs.position.values[k].toFixed(9)}`,
  );
  return (
    await post("/v1/datasets?name=drive", `time [s],force [N],position [m]\n${rows.join("\n")}\n`, "text/csv")
  ).id;
}

async function waiting() {
  const { items } = await (await fetch(`${base}/v1/jobs?view=summary&status=queued&limit=500`)).json();
  return items.map(({ id }) => id);
}

// Handles eight elements of the list at a time.
async function each(list, act) {
  const rest = [...list];
  await Promise.all(
    Array.from({ length: 8 }, async () => {
      while (rest.length) {
        await act(rest.pop());
      }
    }),
  );
}

// Counts the jobs that the server has.
async function stored() {
  let [count, token] = [0, ""];
  while (token !== null) {
    const from = token && `&page_token=${token}`;
    const answer = await fetch(`${base}/v1/jobs?view=summary&limit=500${from}`);
    const { items, next_page_token: next } = await answer.json();
    count += items.length;
    token = next;
  }
  return count;
}

// Measures when a list of many jobs is usable and whole, and how fast it is filtered. Jobs are submitted where the
// server has fewer. Jobs that still wait after half a minute are cancelled, so that the figures are about the list and
// not about the search.
async function jobs() {
  const dataset = await drive();
  const number = Number(JOBS);
  const before = performance.now();
  const missing = Math.max(0, number - (await stored()));
  await each(
    Array.from({ length: missing }, (_, k) => k + 1),
    async (k) => {
      for (;;) {
        const answer = await fetch(`${base}/v1/jobs`, {
          method: "POST",
          headers: { "content-type": "application/json" },
          body: JSON.stringify(CHEAP(dataset, k)),
        });
        await answer.arrayBuffer();
        if (answer.ok) {
          break;
        }
        await pause(500);
      }
    },
  );
  if (missing > 0) {
    say(`${missing} jobs submitted`, `${((performance.now() - before) / 1000).toFixed(0)} s`);
    await pause(30_000);
  }
  for (let ids = await waiting(); ids.length; ids = await waiting()) {
    await each(ids, async (id) =>
      (await fetch(`${base}/v1/jobs/${id}/cancel`, { method: "POST" })).arrayBuffer(),
    );
  }
  for (const round of [1, 2, 3]) {
    const page = await browser.newPage();
    await page.setViewport({ width: 1400, height: 900 });
    await page.evaluateOnNewDocument(() => {
      globalThis.marks = {};
      const look = () => {
        const rows = document.querySelectorAll("tbody tr a[href^='#/jobs/job_']").length;
        globalThis.marks.rows ??= rows > 10 ? performance.now() : undefined;
        globalThis.marks.most = Math.max(
          globalThis.marks.most ?? 0,
          Number(
            /([\d\u202f]+) jobs/
              .exec(document.querySelector("main > p[role=status]")?.textContent ?? "")?.[1]
              .replaceAll("\u202f", "") ?? 0,
          ),
        );
        if (globalThis.marks.most >= globalThis.wanted) {
          globalThis.marks.all = performance.now();
          return;
        }
        requestAnimationFrame(look);
      };
      requestAnimationFrame(look);
    });
    await page.evaluateOnNewDocument((least) => {
      globalThis.wanted = least;
    }, number);
    await page.goto(`${base}/#/jobs`);
    await page.waitForFunction(() => globalThis.marks.all, PATIENCE);
    const marks = await page.evaluate(() => globalThis.marks);
    const filtered = await page.evaluate(async () => {
      const input = /** @type {HTMLInputElement} */ (document.querySelector("input[type=search]"));
      const times = [];
      for (const text of ["f", "figure 77", "figure 7", "line:l3", "drive 12", ""]) {
        const from = performance.now();
        input.value = text;
        input.dispatchEvent(new Event("input", { bubbles: true }));
        await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve, 0)));
        times.push(performance.now() - from);
      }
      return times;
    });
    say(`round ${round}: rows of the list to be seen and used`, ms(marks.rows));
    say(`round ${round}: all ${marks.most} jobs in the list`, ms(marks.all));
    say(
      `round ${round}: filter as one types, until drawn (longest of ${filtered.length})`,
      ms(Math.max(...filtered)),
    );
    await page.close();
  }
}

// Measures the heap of the page while jobs come, run, end and go, on the list and on the page of a long
// job.
async function memory() {
  const dataset = await drive();
  const long = await post("/v1/jobs", {
    ...CHEAP(dataset, 1),
    name: "long",
    method: { name: "icra_genetic", population: 64, generations: 1_000_000, stagnation_generations: 0 },
    limits: { max_duration_s: 60 * Number(MINUTES) + 600 },
  }).catch((error) => {
    say("long job refused", error.message);
    return null;
  });
  const list = await open("/#/jobs");
  const detail = long && (await open(`/#/jobs/${long.id}`));
  const heap = async (page) => {
    const client = await page.createCDPSession();
    await client.send("HeapProfiler.collectGarbage");
    const { usedSize } = await client.send("Runtime.getHeapUsage");
    await client.detach();
    return usedSize / 1e6;
  };
  const nodes = (page) => page.metrics().then(({ Nodes }) => Nodes);
  const until = Date.now() + Number(MINUTES) * 60_000;
  let made = 0;
  let look = 0;
  while (Date.now() < until) {
    const ids = [];
    for (let k = 0; k < 10; k += 1) {
      made += 1;
      ids.push((await post("/v1/jobs", CHEAP(dataset, made))).id);
    }
    for (const id of ids) {
      await (await fetch(`${base}/v1/jobs/${id}?wait=20`)).arrayBuffer();
      await fetch(`${base}/v1/jobs/${id}`, { method: "DELETE" });
    }
    if (Date.now() >= look) {
      look = Date.now() + 15_000;
      const generation = long
        ? (await (await fetch(`${base}/v1/jobs/${long.id}`)).json()).progress?.generation
        : null;
      say(
        `heap after ${made} jobs that came, ran and went`,
        `list ${(await heap(list)).toFixed(2)} MB, ${await nodes(list)} nodes` +
          (detail
            ? `; long job, generation ${generation}: ${(await heap(detail)).toFixed(2)} MB, ${await nodes(detail)} nodes`
            : ""),
      );
    }
  }
  long && (await fetch(`${base}/v1/jobs/${long.id}/cancel`, { method: "POST" }));
  await list.close();
  await detail?.close();
}

const LAB_MODEL = `name: temperature_lab
inputs:
  heater_1: {symbol: Q1, unit: "1"}
  heater_2: {symbol: Q2, unit: "1"}
parameters:
  transfer: {symbol: U, unit: W/(m^2*K), default: 10, lower: 1, upper: 50, scale: log, unknown: true}
  exchange: {symbol: Us, unit: W/(m^2*K), default: 20, lower: 1, upper: 100, scale: log, unknown: true}
  gain_1: {symbol: a1, unit: W, default: 1, lower: 0.1, upper: 5, scale: log, unknown: true}
  gain_2: {symbol: a2, unit: W, default: 0.75, lower: 0.1, upper: 5, scale: log, unknown: true}
  sensor_lag: {symbol: tau, unit: s, default: 20, lower: 1, upper: 60, scale: log, unknown: true}
  ambient: {symbol: Ta, unit: K, default: 296, lower: 288, upper: 304, unknown: true}
constants:
  mc: {value: 2, unit: J/K}
  A: {value: 0.001, unit: m^2}
  As: {value: 0.0002, unit: m^2}
quantities:
  between: {unit: W, expression: Us*As*(T2 - T1)}
states:
  heat_1: {symbol: T1, unit: K, derivative: (U*A*(Ta - T1) + between + a1*Q1)/mc, initial: first sample of output temperature_1}
  heat_2: {symbol: T2, unit: K, derivative: (U*A*(Ta - T2) - between + a2*Q2)/mc, initial: first sample of output temperature_2}
  sensor_1: {symbol: Tc1, unit: K, derivative: (T1 - Tc1)/tau, initial: first sample of output temperature_1}
  sensor_2: {symbol: Tc2, unit: K, derivative: (T2 - Tc2)/tau, initial: first sample of output temperature_2}
outputs:
  temperature_1: {unit: K, expression: Tc1}
  temperature_2: {unit: K, expression: Tc2}
`;

// Counts what a new user does from a file on the disk to a report on paper.
async function path_(name, file, choose) {
  const page = await open("/#/jobs");
  const start = performance.now();
  const did = { clicks: 0, keys: 0 };
  const click = async (selector) => {
    did.clicks += 1;
    await (await page.waitForSelector(selector, { ...PATIENCE, visible: true })).click();
  };
  await click("a.button[href='#/new']");
  const input = await page.waitForSelector("input[type=file]", PATIENCE);
  // The user clicks the field, and the file in the dialog of the system.
  did.clicks += 2;
  await input.uploadFile(file);
  await click(".drop button[type=submit]:not([disabled])");
  await says(page, "Experiment 1");
  await choose({ page, click, did });
  await says(page, "The job can start.");
  const ready = performance.now();
  await click("aside .primary:not([disabled])");
  await page.waitForSelector(".verdict .grade", PATIENCE);
  const end = performance.now();
  const address = await page.$eval("a.button[href$='/report']", (link) => link.href);
  did.clicks += 1;
  const report = await browser.newPage();
  await report.goto(address, { waitUntil: "load" });
  const printed = path.join(PDF ?? folder, `${name.replaceAll(" ", "-")}.pdf`);
  // The user presses Ctrl+P and the button of the print dialog.
  did.clicks += 1;
  did.keys += 1;
  await report.pdf({ path: printed, preferCSSPageSize: true });
  const seconds = (from, to) => ((to - from) / 1000).toFixed(1);
  say(
    `${name}: to the printed report`,
    `${did.clicks} clicks, ${did.keys} keys, ${seconds(start, performance.now())} s of which the job ${seconds(ready, end)} s`,
  );
  say(`${name}: verdict`, await page.$eval(".verdict .grade", (grade) => grade.textContent));
  await report.close();
  await page.close();
}

async function paths() {
  if (SERVO) {
    await path_("servo axis", SERVO, async ({ page, did }) => {
      did.clicks += 1;
      await (
        await page.waitForSelector(
          "::-p-xpath(//button[@role='radio'][contains(., 'Positioning drive')])",
          PATIENCE,
        )
      ).click();
    });
  }
  if (LAB) {
    await path_("temperature lab, own equations", LAB, async ({ page, click, did }) => {
      await click("::-p-text(Write your own equations)");
      await (await page.waitForSelector(".editor >>> .cm-content", PATIENCE)).focus();
      did.clicks += 1;
      await page.keyboard.down("Control");
      await page.keyboard.press("a");
      await page.keyboard.up("Control");
      await page.keyboard.press("Delete");
      await page.keyboard.sendCharacter(LAB_MODEL);
      did.keys += LAB_MODEL.length + 2;
      await says(page, "No fault");
      await page.waitForFunction(() => document.body.innerText.includes("measured and simulated"), PATIENCE);
      await click("::-p-text(Keep this model)");
    });
  }
}

const all = { samples, jobs, memory, paths };
const names = process.argv.slice(2);
for (const [name, measure] of Object.entries(all)) {
  if (names.length === 0 || names.includes(name)) {
    await measure();
  }
}
await browser.close();
fs.rmSync(folder, { recursive: true });
