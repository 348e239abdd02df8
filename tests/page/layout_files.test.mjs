// The tests take files of kinds that plants have from the choice of the file to the stored recording, by what a
// person does on the page, and compare the samples that the server kept with those that were written.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { launch, open, PATIENCE, picture, press, SIZES, tools } from "./browser.mjs";
import { CASES } from "./layout_cases.mjs";
import { base } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const shared = { browser: null, checker: "", folder: "" };

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    shared.folder = fs.mkdtempSync(path.join(os.tmpdir(), "layout-files-"));
  }
});

after(async () => {
  await shared.browser?.close();
  shared.folder && fs.rmSync(shared.folder, { recursive: true });
});

// Waits until the page shows what the server tells of the options in force.
const settled = (page) =>
  page.waitForSelector(".first-rows:not([hidden]):not([aria-busy])", { ...PATIENCE, visible: true });

async function control(page, words) {
  const isNamed = `starts-with(@aria-label, '${words}') or ancestor::label[contains(., '${words}')]`;
  const selector = `::-p-xpath(//*[self::input or self::select][${isNamed}])`;
  return page.waitForSelector(selector, { ...PATIENCE, visible: true });
}

const ACTS = {
  press,
  async choose(page, words, option) {
    const select = await control(page, words);
    const value = await select.evaluate(
      ({ options }, option) => [...options].find(({ text, disabled }) => text === option && !disabled)?.value,
      option,
    );
    assert.ok(value, `${words} offers no “${option}”`);
    await select.select(value);
  },
  async type(page, words, text) {
    const field = await control(page, words);
    await field.click({ count: 3 });
    await field.type(text);
    await page.keyboard.press("Tab");
  },
};

// Gives what is drawn on the first rows.
const drawn = (page) =>
  page.$eval(".first-rows", (part) => {
    const chosen = (select) => select?.selectedOptions[0].text;
    const lines = [...part.querySelectorAll("tbody th")];
    return {
      sentence: part.querySelector("[role=status]").textContent,
      roles: [...part.querySelectorAll("thead select")].map(chosen),
      heads: [...part.querySelectorAll("thead th")].map((head) => head.textContent),
      struck: part.querySelectorAll("tr.data td.left-out").length,
      lines: lines.map((line) => chosen(line.querySelector("select")) ?? line.lastChild.textContent),
      refusals: [...part.querySelectorAll("li")].map((item) => item.textContent),
      words: part.textContent,
    };
  });

// Lists what makes the form hard to use at the size of the window.
async function faultsOf(page) {
  const wide = await page.evaluate(
    () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
  );
  await page.evaluate(shared.checker);
  const { violations } = await page.evaluate(() =>
    globalThis.axe.run(".drop", { resultTypes: ["violations"] }),
  );
  return [
    ...violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`),
    ...(wide > 0 ? [`${wide} pixels too wide`] : []),
    ...page.faults,
  ];
}

// Sends the file; a server that the tests were run on before has the same recording already.
async function storedBy(page) {
  await page.click(".drop button[type=submit]");
  const answer = await page.waitForSelector(".drop a[href^='#/datasets/']", PATIENCE);
  const link = await answer.evaluate((link) => link.getAttribute("href"));
  const address = `${base}/v1${link.slice(1)}`;
  const dataset = await (await fetch(address)).json();
  const samples = await (await fetch(`${address}/samples?max_points=1000`)).json();
  return { dataset, samples };
}

function assertNear(values, truth, tolerance, what) {
  const isNear = (value, k) =>
    truth[k] === null || value === null
      ? value === truth[k]
      : Math.abs(value - truth[k]) <= tolerance * Math.max(1, Math.abs(truth[k]));
  assert.ok(values.length === truth.length && values.every(isNear), `${what}: ${values}, not ${truth}`);
}

for (const [k, sample] of CASES.entries()) {
  const { name, file, content, asks, notes, steps, truth } = sample;
  const size = SIZES[k % SIZES.length];
  test(`${name}: ${file} at ${size.width} ${size.scheme}`, { skip }, async () => {
    const page = await open("/#/datasets", size);
    const place = path.join(shared.folder, file);
    fs.writeFileSync(place, content);
    await (await page.waitForSelector("input[type=file]", PATIENCE)).uploadFile(place);
    await settled(page);
    const guess = await drawn(page);
    await picture(page, `${file}-guess-${size.width}-${size.scheme}`, ".drop");
    assert.equal(guess.refusals.length > 0, Boolean(asks), guess.refusals.join("\n"));
    for (const words of [asks, notes].filter(Boolean)) {
      assert.ok(guess.words.includes(words), guess.words);
    }
    for (const [act, ...words] of steps) {
      await ACTS[act](page, ...words);
      await settled(page);
    }
    await picture(page, `${file}-read-${size.width}-${size.scheme}`, ".drop");
    const { refusals, sentence, roles, heads, struck, lines } = await drawn(page);
    assert.deepEqual(refusals, []);
    assert.equal(sentence, `${sample.place ?? "Read as"}: ${sample.read}.`);
    assert.deepEqual(roles, sample.roles);
    assert.deepEqual(sample.heads ?? heads, heads);
    assert.equal(struck > 0, sample.roles.includes("Left out"));
    const tops = sample.lines ?? ["titles"];
    assert.deepEqual(lines.slice(0, tops.length + 1), [...tops, "data"]);
    assert.deepEqual(await faultsOf(page), []);

    const { dataset, samples } = await storedBy(page);
    assert.equal(dataset.start, truth.start ?? null);
    assertNear(samples.time_s, truth.time, truth.tolerance ?? 1e-9, "time");
    const { signals } = samples;
    assert.deepEqual(Object.keys(signals).sort(), Object.keys(truth.signals).sort());
    for (const [signal, { unit, values }] of Object.entries(truth.signals)) {
      assert.equal(signals[signal].unit, unit);
      assertNear(signals[signal].values, values, 1e-9, signal);
    }
    await page.close();
  });
}
