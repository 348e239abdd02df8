// This program measures the page and prints the figures; it asserts nothing, since machines differ.
//
//   GREYBOX_URL=… PAGE_TOOLS=… node tests/page/figures.mjs [samples] [year] [jobs] [memory] [first]
//
// GREYBOX_URL names a server of a release build that has nothing else to do, PAGE_TOOLS a folder with
// puppeteer-core and axe-core in its node_modules, CHROMIUM the browser. JOBS is the length of the list of jobs
// (10000), MINUTES the time for which live jobs are watched (4). GREYBOX_PROGRAM names the program that serves an
// empty database; without it the first page is left out. What people do on the page roles.mjs measures.

import os from "node:os";
import { performance } from "node:perf_hooks";
import { launch, open, PATIENCE } from "./browser.mjs";
import { ms, pause, say } from "./figures_said.mjs";
import { samples, year } from "./figures_zoom.mjs";
import { base, ownServer, post } from "./server.mjs";

const { JOBS = "10000", MINUTES = "4", GREYBOX_PROGRAM: program } = process.env;
const { browser } = await launch();

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

// Measures the first page of a server that has nothing yet: what comes over the wire, and when something is painted.
async function first() {
  if (!program) {
    say("the first page left out", "GREYBOX_PROGRAM names no program");
    return;
  }
  const server = await ownServer(program);
  for (const round of [1, 2, 3]) {
    const context = await browser.createBrowserContext();
    const page = await context.newPage();
    const client = await page.createCDPSession();
    const came = { bytes: 0, requests: 0 };
    client.on("Network.loadingFinished", ({ encodedDataLength }) => {
      came.bytes += encodedDataLength;
      came.requests += 1;
    });
    await client.send("Network.enable");
    await page.goto(`${server.address}/`, { waitUntil: "domcontentloaded" });
    await page.waitForFunction(
      () => document.body.innerText.includes("Try it with the demonstration"),
      PATIENCE,
    );
    await page.waitForNetworkIdle({ idleTime: 500, concurrency: 1 });
    const painted = await page.evaluate(
      () => performance.getEntriesByName("first-contentful-paint")[0].startTime,
    );
    const used = await page.evaluate(
      () => performance.getEntriesByType("navigation")[0].domContentLoadedEventEnd,
    );
    say(
      `round ${round}: the first page of an empty database`,
      `${(came.bytes / 1000).toFixed(1)} kB in ${came.requests} answers, painted after ${ms(painted)}, its modules run after ${ms(used)}`,
    );
    await context.close();
  }
  await server.stop();
}

const all = { samples, year, jobs, memory, first };
const names = process.argv.slice(2);
say(
  "load of the machine",
  os
    .loadavg()
    .map((load) => load.toFixed(1))
    .join(", "),
);
for (const [name, measure] of Object.entries(all)) {
  if (names.length === 0 || names.includes(name)) {
    await measure();
  }
}
await browser.close();
