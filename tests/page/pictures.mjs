// This program makes the pictures and the recordings of the guides anew, and writes the tables of the worked examples:
//
//     GREYBOX_URL=http://127.0.0.1:8080 PAGE_TOOLS=folder node tests/page/pictures.mjs [NAME …]
//
// NAME is a model of the catalogue or a rule of the verdict; without names everything is made. The server simulates the
// recordings and works on the jobs, and the pictures are parts of its page. The same server gives the same content.

import fs from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { launch, open, PATIENCE } from "./browser.mjs";
import { chapters, madeText, put, worked } from "./pictures_examples.mjs";
import { PLANTS, recorded } from "./pictures_recordings.mjs";
import { RULES } from "./pictures_rules.mjs";
import { base, ended, post } from "./server.mjs";

const DOCS = fileURLToPath(new URL("../../src/dashboard/docs/", import.meta.url));
// The many samples of a plot make a picture of twice the pixels too large, and the many names of a budget one of fewer.
const pixelsOf = (parts) => {
  const [isBudget, isPlot] = [/Uncertainty budget/, /chart/].map((part) =>
    parts.some((text) => part.test(text)),
  );
  return isBudget ? 800 : isPlot ? 1080 : 1440;
};
const MOST_BYTES = 25_000;
const chosen = process.argv.slice(2);
const isChosen = (name) => chosen.length === 0 || chosen.includes(name);

// Opens the page of a job in a window of a width, with every part of it drawn.
async function opened(id, width, parts) {
  const page = await open("/docs/", { width, height: 900, scheme: "light" });
  await page.setViewport({ width, height: 900, deviceScaleFactor: pixelsOf(parts) / width });
  await page.evaluate(() => localStorage.setItem("greybox.tour", "left"));
  await page.goto(`${base}/#/jobs/${id}`, { waitUntil: "domcontentloaded" });
  await page.waitForSelector(".verdict .grade", PATIENCE);
  await page.evaluate(() => {
    for (const part of document.querySelectorAll("details.analysed")) {
      part.open = true;
    }
  });
  await page.waitForNetworkIdle({ idleTime: 500, concurrency: 2, ...PATIENCE });
  await page.waitForFunction(() => !document.querySelector(".surface.empty"), PATIENCE);
  return page;
}

// Takes a picture of the parts of a page, from the top of the highest to the bottom of the lowest. The plots that stand
// between them are left out.
async function shoot(page, parts, file) {
  for (const part of parts) {
    await (await page.waitForSelector(part, PATIENCE)).evaluate((element) => {
      element.dataset.pictured = "";
    });
  }
  const clip = await page.evaluate(() => {
    const shown = [...document.querySelectorAll("[data-pictured]")];
    for (const plot of document.querySelectorAll("figure.chart")) {
      plot.hidden =
        !shown.some((part) => part.contains(plot)) && shown[0].parentElement === plot.parentElement;
    }
    for (const control of document.querySelectorAll("details.save, output.readout")) {
      control.hidden = true;
    }
    const boxes = shown.map((part) => part.getBoundingClientRect());
    const top = Math.min(...boxes.map((box) => box.top)) + scrollY;
    const bottom = Math.max(...boxes.map((box) => box.bottom)) + scrollY;
    const left = Math.min(...boxes.map((box) => box.left));
    const right = Math.max(...boxes.map((box) => box.right));
    return { x: left, y: top - 4, width: right - left, height: bottom - top + 8 };
  });
  for (const quality of [75, 60, 45, 30, 20]) {
    await page.screenshot({ path: file, type: "webp", quality, clip, captureBeyondViewport: true });
    const { size } = fs.statSync(file);
    if (size <= MOST_BYTES) {
      console.log(`${path.basename(file)}: ${size} bytes, quality ${quality}`);
      return;
    }
  }
  throw new Error(`${file} is larger than ${MOST_BYTES} bytes`);
}

const picture = (name) => path.join(DOCS, "pictures", `${name}.webp`);

async function example(chapter) {
  const { model } = chapter.job;
  const csv = await recorded(model);
  fs.writeFileSync(path.join(DOCS, "recordings", `${model}.csv`), csv);
  const { id, result } = await worked(chapter.job, csv);
  const guide = path.join(DOCS, "examples.md");
  fs.writeFileSync(guide, put(fs.readFileSync(guide, "utf8"), model, madeText(model, csv, result)));
  const page = await opened(id, 720, PLANTS[model].picture);
  await shoot(page, PLANTS[model].picture, picture(`example_${model}`));
  await page.close();
}

async function rule(code) {
  const { csv, job, window, part, width = 720 } = RULES[code];
  const { id: dataset } = await post(`/v1/datasets?name=${code}`, await csv(), "text/csv");
  const experiment = window ? { dataset, window } : { dataset };
  const { id } = await post("/v1/jobs", { ...job, name: code, experiments: [experiment] });
  await ended(id);
  const { verdict } = await (await fetch(`${base}/v1/jobs/${id}/result`)).json();
  if (!verdict.reasons.some((reason) => reason.code === code)) {
    throw new Error(`the verdict of ${id} does not say ${code}`);
  }
  const page = await opened(id, width, part);
  await shoot(page, part, picture(`rule_${code}`));
  await page.close();
}

for (const folder of ["pictures", "recordings"]) {
  fs.mkdirSync(path.join(DOCS, folder), { recursive: true });
}
const { browser } = await launch();
try {
  for (const chapter of chapters(fs.readFileSync(path.join(DOCS, "examples.md"), "utf8"))) {
    if (isChosen(chapter.job.model)) {
      await example(chapter);
    }
  }
  for (const code of Object.keys(RULES).filter(isChosen)) {
    await rule(code);
  }
} finally {
  await browser.close();
}
