// The tests give jobs other names, labels and notes on the page, as a person does who tidies up after a measurement.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import {
  labelled,
  launch,
  open,
  PATIENCE,
  picture,
  press,
  SIZES,
  says,
  specification,
  text,
  tools,
} from "./browser.mjs";
import { base, ended, JOB, post, recording } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const shared = { browser: null, checker: "", dataset: null };

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    shared.dataset = (await post("/v1/datasets?name=words", await recording(), "text/csv")).id;
  }
});

after(() => shared.browser?.close());

const api = async (address) => (await fetch(base + address)).json();
const textarea = "form.words textarea";

async function finished(labels) {
  const { id } = await post("/v1/jobs", { ...JOB(shared.dataset, "icra_genetic"), labels });
  assert.equal((await ended(id)).status, "succeeded");
  return id;
}

async function retype(page, field, words) {
  await field.click({ count: 3 });
  await page.keyboard.press("Delete");
  await field.type(words);
}

async function violations(page) {
  await page.evaluate(shared.checker);
  const { violations } = await page.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ["violations"] }),
  );
  return violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`);
}

test("a job gets another name, other labels and a note, and jobs that are made from it have them", {
  skip,
}, async () => {
  const id = await finished({ site: "hall 2", rig: "4" });
  const page = await open(`/#/jobs/${id}`);
  await page.waitForSelector(".verdict .grade", PATIENCE);
  await press(page, "Edit");
  await retype(page, await labelled(page, "Name"), "after the overhaul");
  await retype(page, await page.$("[aria-label='Value of label 2']"), "hall 3");
  await page.click("[aria-label='× remove label 1']");
  await press(page, "Add a label");
  await page.keyboard.type("site");
  await page.click(textarea);
  await page.keyboard.type("Valve 7 was replaced.");
  await page.keyboard.press("Enter");
  await page.keyboard.type("<b>Load</b> unknown");
  // A label that stands twice is told beside its field, and nothing is sent.
  await press(page, "Save");
  const twice = await page.waitForSelector("[aria-label='Name of label 2'][aria-invalid]", PATIENCE);
  assert.match(await twice.evaluate((input) => input.nextSibling.textContent), /has this label already/);
  await retype(page, twice, "shift");
  await retype(page, await page.$("[aria-label='Value of label 2']"), "n".repeat(201));
  await press(page, "Save");
  const long = await page.waitForSelector("[aria-label='Value of label 2'][aria-invalid]", PATIENCE);
  assert.match(await long.evaluate((input) => input.nextSibling.textContent), /201/);
  page.faults.splice(0);
  await retype(page, long, "night");
  await picture(page, "job-words-form");
  assert.deepEqual(await violations(page), []);
  await press(page, "Save");
  await page.waitForFunction(
    () => document.querySelector("h1").textContent === "after the overhaul",
    PATIENCE,
  );
  assert.equal(await page.title(), "after the overhaul · greybox");
  assert.equal(
    await page.$eval(".note", (note) => note.innerText),
    "Valve 7 was replaced.\n<b>Load</b> unknown",
  );
  assert.equal(await page.$(textarea), null);
  assert.match(await page.evaluate(() => document.activeElement.textContent), /Edit/);
  const job = await api(`/v1/jobs/${id}`);
  assert.equal(job.name, "after the overhaul");
  assert.deepEqual(job.labels, { site: "hall 3", shift: "night" });
  assert.equal(job.note, "Valve 7 was replaced.\n<b>Load</b> unknown");
  await says(page, "shift: night");

  // A text that was typed and not saved is gone with the form.
  await press(page, "Edit");
  await retype(page, await labelled(page, "Name"), "a slip");
  await press(page, "Cancel");
  assert.equal(await text(page, "h1"), "after the overhaul");

  await press(page, "Use as template");
  await page.waitForSelector("#panel-json .editor", PATIENCE);
  const { name, labels, note } = await specification(page);
  assert.deepEqual(
    [name, labels, note],
    ["after the overhaul", { site: "hall 3", shift: "night" }, undefined],
  );

  // Emptied fields remove what stood in them.
  await page.goto(`${base}/#/jobs/${id}`);
  await press(page, "Edit");
  await page.waitForSelector(textarea, PATIENCE);
  await page.$eval(textarea, (area) => area.select());
  await page.keyboard.press("Delete");
  await retype(page, await labelled(page, "Name"), "");
  await page.click("[aria-label='× remove label 1']");
  await page.click("[aria-label='× remove label 1']");
  await press(page, "Save");
  await page.waitForFunction(() => /^Unnamed job/.test(document.querySelector("h1").textContent), PATIENCE);
  const bare = await api(`/v1/jobs/${id}`);
  assert.deepEqual([bare.name, bare.labels, bare.note], [null, {}, null]);
  assert.ok(await page.$eval(".note", ({ hidden }) => hidden));
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("chosen jobs get a label at once, and it is taken from them", { skip }, async () => {
  const visit = `v${Date.now()}`;
  const ids = [];
  for (const line of ["l1", "l2"]) {
    ids.push(await finished({ line, visit }));
  }
  const crowded = Object.fromEntries(Array.from({ length: 15 }, (_, k) => [`k${k}`, "x"]));
  ids.push(await finished({ ...crowded, visit }));
  const labelsOf = () => Promise.all(ids.map(async (id) => (await api(`/v1/jobs/${id}`)).labels));
  const page = await open(`/#/jobs?label=visit%3A${visit}`);
  await says(page, "3 of ");
  await page.click("input[aria-label='Select all jobs that the list shows']");
  await press(page, "Label… 3");
  await (await labelled(page, "Label")).type("shift");
  await (await labelled(page, "Value")).type("night");
  assert.deepEqual(await violations(page), []);
  await press(page, "Set the label");
  // A job has sixteen labels at the most.
  await says(page, "2 of 3 jobs are labelled.");
  assert.match(await text(page, ".problem"), /drive icra_genetic: .*16 /);
  page.faults.splice(0);
  const [first, second, third] = await labelsOf();
  assert.deepEqual(
    [first, second],
    [
      { line: "l1", visit, shift: "night" },
      { line: "l2", visit, shift: "night" },
    ],
  );
  assert.equal(third.shift, undefined);
  await page.waitForFunction(
    () => document.querySelector(".jobs").innerText.includes("shift: night"),
    PATIENCE,
  );
  await picture(page, "jobs-label-form");

  for (const [label, value] of [
    ["Label", "k0"],
    ["Value", ""],
  ]) {
    await retype(page, await labelled(page, label), value);
  }
  await press(page, "Set the label");
  await says(page, "3 of 3 jobs are without the label.");
  assert.equal((await labelsOf())[2].k0, undefined);
  assert.ok(await page.$eval("form[aria-label='Label jobs']", ({ hidden }) => hidden));
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("the forms of names and labels fit a phone and a desk, in both schemes", { skip }, async () => {
  const visit = `f${Date.now()}`;
  const id = await finished({ visit, site: "hall 2" });
  const note = `${"A long sentence about the rig and the valve. ".repeat(12)}\n\n- ${"x".repeat(120)}`;
  await fetch(`${base}/v1/jobs/${id}`, {
    method: "PATCH",
    headers: { "content-type": "application/json" },
    body: JSON.stringify({ note }),
  });
  const faults = [];
  for (const size of [...SIZES, { width: 1920, height: 1000, scheme: "light" }]) {
    const job = await open(`/#/jobs/${id}`, size);
    await press(job, "Edit");
    await job.waitForSelector(textarea, PATIENCE);
    const list = await open(`/#/jobs?label=visit%3A${visit}`, size);
    await says(list, "1 of ");
    await list.click("input[aria-label='Select all jobs that the list shows']");
    await press(list, "Label… 1");
    for (const [page, name] of [
      [job, "job-words"],
      [list, "jobs-label"],
    ]) {
      await picture(page, `${name}-${size.width}-${size.scheme}`);
      const wide = await page.evaluate(
        () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
      );
      const all = [...(await violations(page)), ...page.faults, ...(wide > 0 ? [`${wide} too wide`] : [])];
      faults.push(...all.map((fault) => `${name} ${size.width} ${size.scheme}: ${fault}`));
      await page.close();
    }
  }
  assert.deepEqual(faults, []);
});
