// The tests use the page in a browser, against a running server, as an engineer works with it: all that a
// job can say is said in the form, advice is followed by clicks, every number of a result is that of the
// API, and many jobs are dealt with at once.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import {
  fill,
  labelled,
  launch,
  open,
  PATIENCE,
  picture,
  SIZES,
  says,
  specification,
  text,
  tools,
} from "./browser.mjs";
import { numberIn } from "./numbers.mjs";
import { base, ended, JOB, post, recording } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const shared = { browser: null, csv: "", dataset: null, folder: "" };

before(async () => {
  if (skip) {
    return;
  }
  Object.assign(shared, await launch());
  shared.folder = fs.mkdtempSync(path.join(os.tmpdir(), "page-"));
  shared.csv = await recording();
  shared.dataset = (await post("/v1/datasets?name=workbench", shared.csv, "text/csv")).id;
});

after(async () => {
  await shared.browser?.close();
  shared.folder && fs.rmSync(shared.folder, { recursive: true });
});

const api = async (address) => (await fetch(base + address)).json();

async function finished(job) {
  const { id } = await post("/v1/jobs", job);
  assert.equal((await ended(id)).status, "succeeded");
  return id;
}

const fillLabelled = (page, label, words) => fill(page, `input[aria-label='${label}']`, words);

const said = (page, path, value) =>
  page.waitForFunction(
    (path, value) => {
      const spec = JSON.parse(document.querySelector("#panel-json .editor").getText());
      const member = path.reduce((owner, name) => owner?.[name], spec);
      return JSON.stringify(member) === value;
    },
    PATIENCE,
    path,
    JSON.stringify(value),
  );

test("what is known of a measurement is said in the form, and the job is what the form says", {
  skip,
}, async () => {
  const page = await open(`/#/new?dataset=${shared.dataset}&model=positioning_drive`);
  await says(page, "The job can start.");
  // What is held back is what the server holds back, and is shaded.
  assert.equal(
    await page.$eval("::-p-xpath(//label[contains(., 'Held back')]/input)", (input) => input.value),
    "25",
  );
  await page.waitForSelector(".experiment .legend .swatch.held", PATIENCE);
  await fillLabelled(page, "position, noise", "0,00002");
  await said(page, ["outputs", "position", "noise_std"], 2e-5);
  await fillLabelled(page, "position, gain of the sensor", "0.1 %");
  await said(page, ["outputs", "position", "gain_tolerance"], "0.1 %");
  await fillLabelled(page, "position, lag of the sensor", "1e-5");
  await said(page, ["outputs", "position", "lag_tolerance_s"], 1e-5);
  await page.select("::-p-xpath(//label[contains(., 'What moved the plant')]/select)", "none");
  await said(page, ["process_noise"], "none");
  await page.$eval("::-p-xpath(//label[contains(., 'Outliers count')]/input)", (input) => {
    input.value = "3";
    input.dispatchEvent(new Event("change", { bubbles: true }));
  });
  await said(page, ["method", "huber_threshold"], 3);
  await page.locator("::-p-text(spikes)").click();
  await said(page, ["experiments", 0, "exclude", "classes"], ["spike"]);
  await says(page, "The job can start.");
  await picture(page, "new-job-measurement");
  await page.locator("aside .primary").click();
  await page.waitForFunction(() => location.hash.startsWith("#/jobs/job_"), PATIENCE);
  const id = (await page.evaluate(() => location.hash)).split("/").at(-1);
  const { spec } = await ended(id);
  assert.equal(spec.outputs.position.noise_std, 2e-5);
  assert.equal(spec.outputs.position.gain_tolerance, "0.1 %");
  assert.equal(spec.process_noise, "none");
  assert.equal(spec.validation.fraction, 0.25);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("a stretch is left out by dragging, and used again by a click", { skip }, async () => {
  const page = await open(`/#/new?dataset=${shared.dataset}&model=positioning_drive`);
  await page.waitForSelector(".surface:not(.empty) .u-over", PATIENCE);
  await page.select("::-p-xpath(//label[contains(., 'Dragging across')]/select)", "leave_out");
  const over = await page.$(".experiment .u-over");
  await over.scrollIntoView();
  const box = await over.boundingBox();
  await page.mouse.move(box.x + 0.5 * box.width, box.y + 20);
  await page.mouse.down();
  await page.mouse.move(box.x + 0.6 * box.width, box.y + 20, { steps: 5 });
  await page.mouse.up();
  const { from_s: from, to_s: to } = (await specification(page)).experiments[0].exclude.spans[0];
  assert.ok(Math.abs(from - 3) < 0.1 && Math.abs(to - 3.6) < 0.1, `${from} to ${to}`);
  await page.locator("button[aria-label^='use '][aria-label$=' again']").click();
  await said(page, ["experiments", 0, "exclude"], undefined);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("a prepared job tells what changed against the job that it follows", { skip }, async () => {
  const job = { ...JOB(shared.dataset, "icra_genetic"), process_noise: "none" };
  job.parameters = { mass: { estimate: { lower: 10, upper: 60 } } };
  const parent = await finished(job);
  const page = await open(`/#/jobs/${parent}`);
  await (
    await page.waitForSelector("::-p-xpath(//button[contains(., 'Widen the range of mass')])", PATIENCE)
  ).click();
  await says(page, "The job can start.");
  await page.click("aside .primary");
  await page.waitForFunction(
    (parent) => location.hash.startsWith("#/jobs/job_") && !location.hash.endsWith(parent),
    PATIENCE,
    parent,
  );
  const id = (await page.evaluate(() => location.hash)).split("/").at(-1);
  await page.waitForSelector(".ancestry table", PATIENCE);
  assert.ok(await page.$(`.ancestry a[href='#/jobs/${parent}']`));
  const [before, now] = await Promise.all([parent, id].map((id) => api(`/v1/jobs/${id}/result`)));
  const cells = await page.$$eval(".ancestry tbody tr", (rows) =>
    rows.map((row) => [...row.cells].map((cell) => cell.innerText)),
  );
  const mass = cells.find(([name]) => name === "mass");
  const near = (text, value) =>
    assert.ok(Math.abs(numberIn(text) - value) <= 1e-2 * Math.abs(value), `${text}: ${value}`);
  near(mass[1], before.parameters[0].estimate);
  near(mass[2], now.parameters[0].estimate);
  assert.equal(mass[5].replace(/\s+/g, " "), `${before.parameters[0].trust} → ${now.parameters[0].trust}`);
  await picture(page, "job-ancestry");
  assert.deepEqual(page.faults, []);
  await page.close();
});

// Jobs of different kinds: of low trust, at a bound, bound by a constraint, of two outputs, with a model search.
const KINDS = {
  "of low trust": { outputs: { position: { noise_std: 2e-7 } } },
  "at a bound": { parameters: { mass: { estimate: { lower: 10, upper: 60 } } } },
  "bound by a constraint": { constraints: ["mass <= 90"] },
  "with a model search": { model_search: { effects: ["coulomb_friction", "input_delay"] } },
  "with a selection": { experiments: "window" },
};

test("every number of a result is that of the API, for jobs of different kinds", { skip }, async () => {
  for (const [kind, change] of Object.entries(KINDS)) {
    const job = { ...JOB(shared.dataset, "icra_genetic"), process_noise: "none", ...change, name: kind };
    if (change.experiments) {
      const [experiment] = JOB(shared.dataset, "icra_genetic").experiments;
      job.experiments = [{ ...experiment, window: { from_s: 1, to_s: 5 } }];
    }
    const id = await finished(job);
    const result = await api(`/v1/jobs/${id}/result`);
    const page = await open(`/#/jobs/${id}`);
    await page.waitForSelector(".verdict .grade", PATIENCE);
    assert.match(await text(page, ".title"), new RegExp(`trust ${result.verdict.trust}`), kind);
    const table = (name) =>
      page.$$eval(`[aria-label='${name}'] tbody tr`, (rows) =>
        rows.map((row) => [...row.cells].map((cell) => cell.innerText)),
      );
    const close = (text, value, share, place) => {
      const shown = numberIn(text);
      const isSame =
        value === null || value === undefined
          ? Number.isNaN(shown) || text === "open"
          : Math.abs(shown - value) <= share * Math.abs(value) + 1e-300;
      assert.ok(isSame, `${kind}, ${place}: the page says ${text}, the API ${value}`);
    };
    const rows = await table("Estimated parameters");
    assert.equal(rows.length, result.parameters.length, kind);
    for (const [k, parameter] of result.parameters.entries()) {
      const [, estimate, error, unit, interval, , trust] = rows[k];
      close(estimate, parameter.estimate, 0.02, "estimate");
      close(error, parameter.total_standard_error ?? parameter.standard_error, 0.06, "total standard error");
      assert.equal(unit, parameter.unit === "1" ? "–" : parameter.unit.replaceAll("*", "·"));
      const total = parameter.total_interval ?? parameter.confidence_interval;
      if (total) {
        close(interval.split("…")[0], total.lower, 0.02, "lower end");
        close(interval.split("…")[1], total.upper, 0.02, "upper end");
      }
      assert.ok(trust.includes(parameter.trust ?? ""), `${kind}: ${trust}`);
    }
    const fits = await table("Fit of the outputs");
    for (const [data, output, fit, rmse, largest, samples] of fits) {
      const values = result.fit[data][output];
      close(fit, values.fit_percent, 0.001, "fit");
      close(rmse, values.rmse, 0.001, "RMSE");
      close(largest, values.max_abs_error, 0.001, "largest error");
      assert.equal(Number(samples.replaceAll("\u202f", "")), values.samples);
    }
    await budgetAddsUp(page, kind);
    await barsAreTrue(page, result, kind);
    if (result.model_search) {
      await says(page, "Effects that the data decided about");
      for (const effect of ["coulomb friction", "input delay"]) {
        const isSupported = result.model_search.supported.includes(effect.replace(" ", "_"));
        await says(page, `${effect}: ${isSupported ? "supported" : "not supported"}`);
      }
    }
    assert.deepEqual(page.faults, [], kind);
    await page.close();
  }
});

// Each parameter's column of the budget sums to a hundred per cent, in the table and in the picture.
async function budgetAddsUp(page, kind) {
  const summary = await page.$("::-p-xpath(//summary[contains(., 'Budget as a table')])");
  if (!summary) {
    return;
  }
  await summary.click();
  await page.waitForSelector("[aria-label='Uncertainty budget'] tbody tr", PATIENCE);
  const sums = await page.evaluate(() => {
    const caption = [...document.querySelectorAll("caption")].find(
      (caption) => caption.textContent === "Uncertainty budget",
    );
    const rows = [...caption.closest("table").tBodies[0].rows].map((row) =>
      [...row.cells].slice(4).map((cell) => cell.textContent),
    );
    return rows[0].map((_, k) =>
      rows.reduce((sum, row) => sum + (Number(row[k].replace("−", "-").replace(" %", "")) || 0), 0),
    );
  });
  for (const sum of sums.filter((sum) => sum !== 0)) {
    // Shares below half a per cent are not written.
    assert.ok(Math.abs(sum - 100) < 4, `${kind}: the budget sums to ${sums} %`);
  }
}

// The bars of the budget have the shares that the API gives, and each bar sums to a hundred per cent.
async function barsAreTrue(page, result, kind) {
  const bars = await page.$$eval(".stack-row", (rows) =>
    rows.map((row) => ({
      label: row.querySelector(".stack-name").textContent,
      texts: [...row.querySelectorAll(".share")].map((part) => part.getAttribute("aria-label")),
    })),
  );
  for (const { label, texts } of bars) {
    const shares = texts.map((text) => {
      const [, source, share] = /^[^:]*: (.*?) ([−\d.·⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+) %/.exec(text);
      return [source, numberIn(share) / 100];
    });
    const sum = shares.reduce((total, [, share]) => total + share, 0);
    assert.ok(Math.abs(sum - 1) < 0.03, `${kind}: the bar of ${label} sums to ${sum}`);
    for (const [source, share] of shares) {
      const line = result.budget.find(({ assumption }) => assumption.replaceAll("_", " ") === source);
      const given = line?.contributions[label.replaceAll(" ", "_")]?.share ?? share;
      assert.ok(Math.abs(share - given) <= 0.06 * Math.abs(given) + 1e-6, `${kind}: ${source} of ${label}`);
    }
  }
  return bars.length;
}

// Each disc says the correlation that the API gives.
async function discsAreTrue(page, { names, matrix }, kind) {
  const texts = await page.$$eval(".discs .cell", (cells) =>
    cells.map((cell) => cell.getAttribute("aria-label")),
  );
  assert.equal(texts.length, names.length ** 2, kind);
  for (const [k, text] of texts.entries()) {
    const given = matrix[Math.floor(k / names.length)][k % names.length];
    const shown = numberIn(text.split(": ").at(-1));
    assert.ok(given === null || Math.abs(shown - given) <= 0.05 * Math.abs(given) + 1e-9, `${kind}: ${text}`);
  }
}

test("a result is a workbench: pictures are read by keyboard, and its parts are reached beside it", {
  skip,
}, async () => {
  const id = await finished({ ...JOB(shared.dataset, "icra_genetic"), process_noise: "none" });
  const result = await api(`/v1/jobs/${id}/result`);
  for (const scheme of ["light", "dark"]) {
    const page = await open(`/#/jobs/${id}`, { width: 1920, height: 1000, scheme });
    await page.waitForSelector(".discs .cell", PATIENCE);
    assert.equal(await barsAreTrue(page, result, scheme), result.parameters.length);
    await discsAreTrue(page, result.correlation, scheme);
    await page.$eval(".discs .cell[tabindex='0']", (cell) => cell.focus());
    await page.keyboard.press("ArrowRight");
    const words = result.correlation.names.slice(0, 2).map((name) => name.replaceAll("_", " "));
    await says(page, `${words[0]} and ${words[1]}: `);
    await page.focus(".share[tabindex='0']");
    await page.keyboard.press("End");
    assert.ok((await text(page, ".stacks + .readout")).startsWith(`${words[0]}: `));
    // All plots of an experiment begin at the same place.
    await page.waitForFunction(
      () => !document.querySelector("[aria-label='Outputs'] .surface.empty"),
      PATIENCE,
    );
    await page.waitForFunction(() => {
      const lefts = [...document.querySelectorAll("[aria-label='Outputs'] .u-over")].map(
        (plot) => plot.getBoundingClientRect().left,
      );
      return lefts.length > 2 && new Set(lefts).size === 1;
    }, PATIENCE);
    const heights = await page.$$eval(".u-over", (plots) => plots.map(({ clientHeight }) => clientHeight));
    assert.ok(Math.min(...heights) >= 120, `plots are ${heights} px high`);
    await page.click(
      "::-p-xpath(//nav[@aria-label='Parts of this job']//button[. = 'The search in numbers'])",
    );
    await page.waitForFunction(
      () => document.activeElement.textContent === "The search in numbers",
      PATIENCE,
    );
    await says(page, "Best found in generation");
    await picture(page, `job-workbench-${scheme}`);
    await page.evaluate(shared.checker);
    const { violations } = await page.evaluate(() => globalThis.axe.run());
    assert.deepEqual(
      violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`),
      [],
    );
    assert.deepEqual(page.faults, []);
    await page.close();
  }
});

test("columns, grouping and views of the list are the person's, and no cell is cut on a wide screen", {
  skip,
}, async () => {
  const job = {
    ...JOB(shared.dataset, "icra_genetic"),
    name: "drive of the second hall, measured after the overhaul",
  };
  // The jobs are those of this run alone, whatever the server had before.
  const visit = `v${Date.now()}`;
  for (const line of ["l1", "l2", "l2"]) {
    await finished({ ...job, labels: { line, visit } });
  }
  const page = await open(`/#/jobs?label=visit%3A${visit}`, { width: 2560, height: 1200, scheme: "light" });
  await says(page, "3 of ");
  const headings = () => page.$$eval(".jobs thead th", (cells) => cells.map((cell) => cell.innerText.trim()));
  await page.click("::-p-xpath(//summary[. = 'Columns'])");
  await page.click("::-p-xpath(//label[. = 'line']/input)");
  await page.click("::-p-xpath(//label[. = 'Evaluations']/input)");
  await page.click("::-p-xpath(//label[. = 'Model']/input)");
  await page.evaluate(shared.checker);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  assert.deepEqual(
    violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`),
    [],
  );
  await page.keyboard.press("Escape");
  const chosen = await headings();
  assert.ok(
    chosen.includes("line") && chosen.includes("Evaluations") && !chosen.includes("Model"),
    `${chosen}`,
  );
  const { items } = await api(`/v1/jobs?view=summary&label=visit%3A${visit}`);
  const evaluations = chosen.indexOf("Evaluations");
  const shown = await page.$$eval(
    ".jobs tbody tr:not([aria-hidden])",
    (rows, k) => rows.map((row) => row.cells[k].innerText),
    evaluations,
  );
  assert.deepEqual(
    shown.map((text) => Number(text.replaceAll("\u202f", ""))),
    items.map(({ progress }) => progress.evaluations),
  );
  const cut = await page.$$eval(".jobs td, .jobs .lines", (cells) =>
    cells
      .filter((cell) => cell.scrollWidth > cell.clientWidth + 1 || cell.scrollHeight > cell.clientHeight + 1)
      .map((cell) => cell.textContent),
  );
  assert.deepEqual(cut, []);
  await page.select("::-p-xpath(//label[contains(., 'Group by')]/select)", "label:line");
  await says(page, "l2 · 2 jobs");
  await page.click("::-p-xpath(//button[contains(., 'l2 · 2 jobs')])");
  await page.waitForFunction(
    () => document.querySelectorAll(".jobs tbody tr td input").length === 1,
    PATIENCE,
  );
  await picture(page, "jobs-grouped");
  await page.click("::-p-xpath(//summary[. = 'Views'])");
  await (await labelled(page, "Name of the present view")).type("lines");
  await page.keyboard.press("Enter");
  await page.waitForSelector("::-p-xpath(//li/button[. = 'lines'])", PATIENCE);
  // Another visit has the columns and the grouping of the last, and the view has its filter too.
  const again = await open("/#/jobs", { width: 2560, height: 1200, scheme: "dark" });
  await says(again, "l1 · ");
  await again.select("::-p-xpath(//label[contains(., 'Group by')]/select)", "");
  await again.click("::-p-xpath(//summary[. = 'Views'])");
  await again.click("::-p-xpath(//li/button[. = 'lines'])");
  await says(again, "3 of ");
  await says(again, "l2 · 2 jobs");
  await again.click("::-p-xpath(//summary[. = 'Views'])");
  await again.click("button[aria-label='Remove the view lines']");
  await says(again, "No view is saved in this browser.");
  await again.evaluate(() => localStorage.clear());
  assert.deepEqual([...page.faults, ...again.faults], []);
  await page.close();
  await again.close();
});

test("the numbers beside the plots of a running job are of the generations that the plots show", {
  skip,
}, async () => {
  const job = JOB(shared.dataset, "icra_genetic");
  job.method = {
    name: "icra_genetic",
    population: 40,
    generations: 100_000,
    stagnation_generations: 0,
    noise_floor: false,
  };
  const { id } = await post("/v1/jobs", job);
  const page = await open(`/#/jobs/${id}`);
  for (let look = 0; look < 5; look += 1) {
    await page.waitForFunction(
      (before) => {
        const plot = document.querySelector("[aria-label^='Cost in the search']")?.getAttribute("aria-label");
        const last = Number(/generation .*? to ([\d.]+)/.exec(plot ?? "")?.[1]);
        globalThis.looked = [last, document.querySelector("[aria-label='Progress'] .facts")?.innerText];
        return last > before;
      },
      PATIENCE,
      look,
    );
    const [last, facts] = await page.evaluate(() => globalThis.looked);
    assert.equal(Number(/Generation\s+([\d\u202f]+)/.exec(facts)[1].replaceAll("\u202f", "")), last);
  }
  await fetch(`${base}/v1/jobs/${id}/cancel`, { method: "POST" });
  await ended(id);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("a newcomer sees what this is, and tries it with one click", { skip }, async () => {
  const page = await open("/#/");
  await says(page, "finds the physical parameters");
  await picture(page, "start");
  await page.click("::-p-text(Try it with the demonstration rig)");
  await page.waitForFunction(() => location.hash.startsWith("#/jobs/job_"), PATIENCE);
  const id = (await page.evaluate(() => location.hash)).split("/").at(-1);
  await ended(id);
  await page.waitForSelector(".verdict .grade", PATIENCE);
  await says(page, "True value");
  const { true_parameters: truths } = await api("/v1/demonstration");
  const rows = await page.$$eval("[aria-label='Estimated parameters'] tbody tr", (rows) =>
    rows.map((row) => [...row.cells].map((cell) => cell.innerText)),
  );
  const { parameters } = await api(`/v1/jobs/${id}/result`);
  for (const [k, { name }] of parameters.entries()) {
    assert.ok(Math.abs(numberIn(rows[k][2]) / truths[name] - 1) < 1e-3, `${name}: ${rows[k][2]}`);
  }
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("forty jobs are found by their label and cancelled at once", { skip }, async () => {
  const job = { ...JOB(shared.dataset, "icra_genetic"), labels: { batch: "forty" } };
  // Long jobs, so that none has ended before it is cancelled.
  job.method = {
    name: "icra_genetic",
    population: 400,
    generations: 100_000,
    stagnation_generations: 0,
    noise_floor: false,
  };
  const ids = [];
  for (let k = 0; k < 40; k += 1) {
    ids.push((await post("/v1/jobs", { ...job, seed: k })).id);
  }
  const page = await open("/#/jobs?label=batch%3Aforty");
  await says(page, "40 of ");
  await page.click("input[aria-label='Select all jobs that the list shows']");
  await page.click("::-p-text(Cancel 40)");
  for (const id of ids) {
    assert.equal((await ended(id)).status, "cancelled");
  }
  page.on("dialog", (dialog) => dialog.accept());
  await (await page.waitForSelector("::-p-text(Delete 40)", PATIENCE)).click();
  await says(page, "No job is like this.");
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("a recording shows its time of day, its units and its gaps", { skip }, async () => {
  const rows = Array.from({ length: 200 }, (_, k) => {
    const instant = new Date(Date.UTC(2026, 2, 29, 0, 30) + 60_000 * k).toISOString().slice(0, 19);
    return `${instant}Z,${20 + (k % 7)},${k % 50}`;
  });
  const csv = `time,oven [degC],valve [%]\n${rows.join("\n")}\n`;
  const { id } = await post("/v1/datasets?name=oven&tz=Europe%2FBerlin", csv, "text/csv");
  const page = await open(`/#/datasets/${id}`);
  await page.waitForSelector(".surface:not(.empty) .u-over", PATIENCE);
  await says(page, "2026-03-29 ");
  const cells = await page.$$eval("[aria-label='Signals'] tbody tr", (rows) =>
    rows.map((row) => [...row.cells].map((cell) => cell.innerText)),
  );
  assert.equal(numberIn(cells[0][3]), 20);
  assert.equal(numberIn(cells[0][5]), 26);
  assert.equal(numberIn(cells[1][5]), 49);
  await page.focus(".surface");
  await page.keyboard.press("Home");
  assert.match(await text(page, ".readout"), /2026-03-29 \d\d:30:00\.000 · oven 20/);
  await picture(page, "dataset-clock");
  assert.deepEqual(page.faults, []);
  await page.close();
});

// Chooses a text as a file, as a person does.
async function chooseText(page, name, content) {
  const file = path.join(shared.folder, name);
  fs.writeFileSync(file, content);
  await (await page.waitForSelector("input[type=file]", PATIENCE)).uploadFile(file);
}

// Waits until a table shows what each row and each column is.
const reads = (page, rows, roles) =>
  page.waitForFunction(
    (rows, roles) => {
      const chosen = (cell) => cell.querySelector("select")?.selectedOptions[0].text;
      const shown = (cells) => JSON.stringify([...document.querySelectorAll(cells)].map(chosen));
      return (
        shown(".first-rows tbody th:has(select)") === rows && shown(".first-rows thead th + th") === roles
      );
    },
    PATIENCE,
    JSON.stringify(rows),
    JSON.stringify(roles),
  );

const fieldOf = (page, title) =>
  page.$eval(`::-p-xpath(//label[contains(., '${title}')]/input)`, (input) => input.value);

test("the first rows of a file show how the server reads them, and are read as is chosen", {
  skip,
}, async () => {
  const page = await open("/#/datasets");
  // A file that no run of the tests has sent before is stored anew.
  const comments = `# exported by the rig\n# run ${Date.now()}\n`;
  await chooseText(page, "rig.csv", `${comments}t,PT,TT\ns,bar,degC\n0,1.2,20\n1,1.3,21\n2,1.4,22\n`);
  const kinds = ["left out", "left out", "titles", "units", "data"];
  await reads(page, kinds, ["Time", "Signal", "Signal"]);
  // Nothing is said of a file that nobody changed.
  for (const title of ["Line of the titles", "Line of the units", "Column of the time", "Signals to leave"]) {
    assert.equal(await fieldOf(page, title), "", title);
  }
  await picture(page, "upload-rows");
  await page.select("select[aria-label^='Role of column 3']", "left_out");
  await reads(page, kinds, ["Time", "Signal", "Left out"]);
  assert.equal(await fieldOf(page, "Signals to leave"), "TT");
  await page.click(".drop button[type=submit]");
  await says(page, "Stored: ");
  const [dataset] = (await api("/v1/datasets?limit=1")).items;
  assert.deepEqual(
    dataset.signals.map(({ name, min }) => [name, min]),
    [["PT", 1.2e5]],
  );
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("a file without titles is read once the page says that its first line has none", {
  skip,
}, async () => {
  const page = await open("/#/datasets");
  // The last column makes the recording a new one.
  await chooseText(page, "bare.csv", `0,1.2,${Date.now()}\n1,1.3,0\n2,1.4,0\n`);
  await says(page, "As it stands, the file would be refused");
  await page.select("select[aria-label='What line 1 is']", "neither");
  await reads(page, ["data", "data", "data"], ["Time", "Signal", "Signal"]);
  assert.equal(await fieldOf(page, "Line of the titles"), "none");
  // Nothing tells the unit of a time without a title.
  await page.select("::-p-xpath(//label[contains(., 'What its times are')]/select)", "s");
  await picture(page, "upload-untitled");
  await page.click(".drop button[type=submit]");
  await says(page, "Stored: ");
  const [dataset] = (await api("/v1/datasets?limit=1")).items;
  assert.deepEqual(
    dataset.signals.map(({ name }) => name),
    ["column_2", "column_3"],
  );
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("rows of several machines become signals once the page says which column names them", {
  skip,
}, async () => {
  const page = await open("/#/datasets");
  const times = [0, 1, 2, 3];
  const rows = times.flatMap((time) => [`${time},north,${5 + time},20`, `${time},south,${7 + time},21`]);
  await chooseText(page, "machines.csv", `time,machine,p,T\n${rows.join("\n")}\n`);
  await page.waitForSelector("::-p-xpath(//*[@class='first-rows']//li[contains(., 'machine')])", PATIENCE);
  await page.select("::-p-xpath(//label[contains(., 'Each row holds')]/select)", "long");
  await reads(
    page,
    ["titles", "data", "data", "data", "data"],
    ["Time", "Tag (name of the signal)", "Value", "Value"],
  );
  assert.equal(await fieldOf(page, "Column that names the signal"), "machine");
  assert.equal(await page.$(".first-rows li"), null);
  await page.evaluate(shared.checker);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  assert.deepEqual(
    violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`),
    [],
  );
  await page.click("::-p-text(Back to what the file tells)");
  await page.waitForSelector(".first-rows li", PATIENCE);
  assert.equal(await fieldOf(page, "Column that names the signal"), "");
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("the new parts are accessible and fit a phone, in both schemes", { skip }, async () => {
  for (const size of SIZES) {
    for (const address of ["/#/", `/#/new?dataset=${shared.dataset}&model=positioning_drive`, "/docs/"]) {
      const page = await open(address, size);
      await page.waitForSelector("h1", PATIENCE);
      if (address.includes("new?")) {
        await says(page, "The job can start.");
      }
      await page.evaluate(shared.checker);
      const { violations } = await page.evaluate(() => globalThis.axe.run());
      assert.deepEqual(
        violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`),
        [],
        `${address} ${size.width} ${size.scheme}`,
      );
      const wide = await page.evaluate(() => document.documentElement.scrollWidth);
      assert.ok(wide <= size.width, `${address} is ${wide} px wide at ${size.width}`);
      await page.close();
    }
  }
});
