// Measures how long recordings and streams of many samples take to be seen, and to be zoomed.

import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { performance } from "node:perf_hooks";
import { labelled, open, PATIENCE, press } from "./browser.mjs";
import { ms, say } from "./figures_said.mjs";
import { dragAcross } from "./person.mjs";
import { base, post } from "./server.mjs";

const { YEAR_EVERY_S = "60", YEAR_SIGNALS = "10" } = process.env;
const COUNT = 1_000_000;
const SPIKE = 683_412;

async function millionSamples(folder) {
  const file = path.join(folder, "million.csv");
  const out = fs.createWriteStream(file);
  out.write("time [s],level [m],flow [m^3/s]\n");
  for (let from = 0; from < COUNT; from += 10_000) {
    const rows = Array.from({ length: 10_000 }, (_, k) => from + k).map(
      (k) =>
        `${(k / 1000).toFixed(3)},${k === SPIKE ? 9 : Math.sin(k / 9000).toFixed(5)},${Math.cos(k / 700).toFixed(5)}`,
    );
    out.write(`${rows.join("\n")}\n`) || (await new Promise((resolve) => out.once("drain", resolve)));
  }
  await new Promise((resolve) => out.end(resolve));
  say("recording", `${COUNT} samples of 2 signals, ${(fs.statSync(file).size / 1e6).toFixed(1)} MB of CSV`);
  return file;
}

// Uploads the recording, and answers its page once both plots are drawn.
async function uploaded(file) {
  const page = await open("/#/datasets");
  const input = await page.waitForSelector("input[type=file]", PATIENCE);
  await input.uploadFile(file);
  const sent = performance.now();
  await press(page, "Upload");
  const link = await page.waitForSelector("form a[href^='#/datasets/ds_']", { timeout: 300_000 });
  say("upload, read and stored", ms(performance.now() - sent));
  const id = await link.evaluate(({ hash }) => hash.split("/").at(-1));
  const from = performance.now();
  await link.click();
  await page.waitForFunction(
    () =>
      [...document.querySelectorAll(".surface:not(.empty)")].filter((part) => part.querySelector("canvas"))
        .length === 2,
    { ...PATIENCE, polling: "raf" },
  );
  say("from the click on its link to the plots of both signals", ms(performance.now() - from));
  return { page, id };
}

/**
 * Drags across the first plot, and answers when it was drawn after the mouse was released: the samples that were there,
 * and those that the server gave for the part. `asked` is the part that was read.
 */
async function zoomed(page, from, to) {
  const surface = await page.waitForSelector(".surface:not(.empty)", PATIENCE);
  await surface.evaluate((element) => {
    performance.clearResourceTimings();
    const marks = { released: Infinity, drawn: [] };
    globalThis.marks = marks;
    addEventListener(
      "mouseup",
      () => {
        marks.released = performance.now();
      },
      { capture: true, once: true },
    );
    // A plot is described anew whenever it is drawn; the next frame shows it.
    new MutationObserver(() => requestAnimationFrame(() => marks.drawn.push(performance.now()))).observe(
      element,
      {
        attributeFilter: ["aria-label"],
      },
    );
  });
  await dragAcross(page, await surface.$(".u-over"), from, to);
  const handle = await page.waitForFunction(
    () => {
      const { released, drawn } = globalThis.marks;
      const reads = performance
        .getEntriesByType("resource")
        .filter(({ name }) => name.includes("max_points"));
      const read = reads.filter(({ startTime }) => startTime >= released).at(-1);
      const shown = drawn.find((time) => time > released);
      const whole = read && drawn.find((time) => time > read.responseEnd);
      return (
        whole && {
          shown: shown - released,
          whole: whole - released,
          asked: read.startTime - released,
          read: read.responseEnd - read.startTime,
          address: read.name,
        }
      );
    },
    { timeout: 20_000, polling: "raf" },
  );
  return handle.jsonValue();
}

const middleOf = (values) => [...values].sort((a, b) => a - b)[values.length >> 1];
const spread = (values) => `${ms(middleOf(values))}, ${ms(Math.max(...values))}`;

function sayZooms(what, zooms) {
  const of = (member) => spread(zooms.map((zoom) => zoom[member]));
  say(`${what}: ${zooms.length} zooms, from the release to the first drawing (median, longest)`, of("shown"));
  say("    to the drawing with the samples of the part", of("whole"));
  say("    of this before the page asks, and until the server has answered", `${of("asked")}; ${of("read")}`);
}

async function readingParts(id) {
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
  say(`reading a part, ${times.length} zooms (median, longest)`, spread(times));
}

// Measures a recording of a million samples: the time from the upload to the first plots, that of zooms, and whether a
// single sample stays in sight.
export async function samples() {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), "figures-"));
  const { page, id } = await uploaded(await millionSamples(folder));
  await readingParts(id);
  const highest = () =>
    page.$eval(".surface", (surface) =>
      Number(/level .* to ([\d.]+)/.exec(surface.getAttribute("aria-label"))[1]),
    );
  let seen = (await highest()) === 9 ? 1 : 0;
  let shown = [0, (COUNT - 1) / 1000];
  const zooms = [];
  for (let width = 500; width > 0.02; width /= 2) {
    const share = (time) => Math.min(1, Math.max(0, (time - shown[0]) / (shown[1] - shown[0])));
    const middle = SPIKE / 1000;
    const zoom = await zoomed(page, share(middle - width * 0.4), share(middle + width * 0.6));
    const { searchParams: part } = new URL(zoom.address);
    // The part that is read has room beside the part that is shown.
    const [from, to] = [Number(part.get("from")), Number(part.get("to"))];
    const room = (0.02 * (to - from)) / 1.04;
    shown = [from + room, to - room];
    zooms.push(zoom);
    seen += (await highest()) === 9 ? 1 : 0;
  }
  sayZooms("a million samples", zooms);
  say("one sample in a million stays in sight", `at ${seen} of ${zooms.length + 1} zooms, down to 40 ms`);
  await page.close();
  fs.rmSync(folder, { recursive: true });
}

const YEAR_S = 365 * 86_400;
const MOST_VALUES_OF_A_BATCH = 1_000_000;

async function yearOfAPlant(name) {
  const [every, signals] = [Number(YEAR_EVERY_S), Number(YEAR_SIGNALS)];
  const rows = Math.floor(YEAR_S / every);
  const batch = Math.floor(MOST_VALUES_OF_A_BATCH / signals);
  const begin = Date.now() - 1000 * YEAR_S;
  const before = performance.now();
  for (let from = 0; from < rows; from += batch) {
    const values = (place) =>
      Array.from({ length: Math.min(batch, rows - from) }, (_, k) => {
        const day = ((from + k) * every) / 86_400;
        return Number(
          (Math.sin(2 * Math.PI * day + place) + 0.1 * Math.sin(37 * day * (place + 1))).toFixed(4),
        );
      });
    const named = Array.from({ length: signals }, (_, place) => [
      `tag_${place + 1}`,
      { unit: "bar", values: values(place) },
    ]);
    await post(`/v1/streams/${name}`, {
      start: new Date(begin + 1000 * every * from).toISOString(),
      sample_time_s: every,
      signals: Object.fromEntries(named),
    });
  }
  const seconds = (performance.now() - before) / 1000;
  const count = rows * signals;
  say(
    `a year of ${signals} signals, a value each ${every} s: ${(count / 1e6).toFixed(1)} M values fed`,
    `${seconds.toFixed(1)} s, ${(count / seconds / 1e6).toFixed(2)} M a second`,
  );
}

// Measures a stream of a year: its first plots, all of the year, and zooms into it.
export async function year() {
  const name = `year-${Date.now().toString(36)}`;
  await yearOfAPlant(name);
  const plotted = (page) =>
    page.waitForFunction(() => document.querySelectorAll(".surface:not(.empty) canvas").length > 0, {
      ...PATIENCE,
      polling: "raf",
    });
  const from = performance.now();
  const page = await open(`/#/plant/streams/${name}`);
  await plotted(page);
  say("from the address to the first plots", ms(performance.now() - from));
  await labelled(page, "From");
  const asked = page.waitForResponse((answer) => answer.url().includes("max_points"), PATIENCE);
  const all = performance.now();
  await press(page, "All of it");
  await (await asked).text();
  say("the whole year read", ms(performance.now() - all));
  const zooms = [];
  for (let depth = 0; depth < 12; depth += 1) {
    zooms.push(await zoomed(page, 0.3, 0.75));
  }
  sayZooms("a year", zooms);
  await page.close();
}
