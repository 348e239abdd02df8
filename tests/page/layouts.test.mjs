// The tests save on the page how a file is read, as a person does who gets the same export every month, and read
// the next file by it.
//
// The variables that name the server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { labelled, launch, open, PATIENCE, picture, press, SIZES, says, text, tools } from "./browser.mjs";
import { base } from "./server.mjs";

const skip = base && tools ? false : "GREYBOX_URL and PAGE_TOOLS are not set";
const shared = { browser: null, checker: "", folder: "" };
const LONG = ["Time", "Tag (name of the signal)", "Value"];
const SAID = { tag: "Messstelle", tz: "Europe/Berlin" };
// The machines of a hall have several values in each row.
const SEVERAL = [...LONG, "Value"];
const OF_MACHINES = { tag: "Anlage", value: "p, T", tz: "Europe/Berlin" };

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    shared.folder = fs.mkdtempSync(path.join(os.tmpdir(), "layouts-"));
  }
});

after(async () => {
  await shared.browser?.close();
  shared.folder && fs.rmSync(shared.folder, { recursive: true });
});

const api = async (address, options) => {
  const answer = await fetch(base + address, options);
  return { status: answer.status, data: answer.status === 204 ? null : await answer.json() };
};
const addressOf = (name) => `/v1/layouts/${encodeURIComponent(name)}`;
const keep = (name, options) =>
  api(addressOf(name), {
    method: "PUT",
    headers: { "content-type": "application/json" },
    body: JSON.stringify({ options }),
  });
const forget = (name) => api(addressOf(name), { method: "DELETE" });

const SECONDS = [0, 1, 2, 3];

// The export has a row for each sample, and the server asks which column names the signals, because a word stands
// among the values. The last value makes each recording a new one.
function exported(day) {
  const rows = SECONDS.flatMap((second) => [
    `2026-03-${day} 08:00:0${second};Druck;${second},5`,
    `2026-03-${day} 08:00:0${second};Temperatur;2${second},25`,
  ]);
  const last = `2026-03-${day} 08:00:04`;
  return ["Zeit;Messstelle;Wert", ...rows, `${last};Temperatur;NA`, `${last};Druck;${Date.now()},5`, ""].join(
    "\r\n",
  );
}

function ofMachines() {
  const rows = SECONDS.flatMap((second) => [
    `2026-03-15 08:00:0${second};Nord;${second},5;20,25`,
    `2026-03-15 08:00:0${second};Sued;${second},75;21,5`,
  ]);
  return ["Zeit;Anlage;p;T", ...rows, ""].join("\r\n");
}

async function chooseText(page, name, content) {
  const file = path.join(shared.folder, name);
  fs.writeFileSync(file, content);
  await (await page.waitForSelector("input[type=file]", PATIENCE)).uploadFile(file);
}

// Waits until the columns of the first rows have the roles.
const reads = (page, roles) =>
  page.waitForFunction(
    (roles) => {
      const selects = [...document.querySelectorAll(".first-rows thead select")];
      return JSON.stringify(selects.map(({ selectedOptions: [role] }) => role.text)) === roles;
    },
    PATIENCE,
    JSON.stringify(roles),
  );

// Answers a question of the page, and gives the words of the question.
function answer(page, isYes) {
  return new Promise((resolve) => {
    page.once("dialog", async (dialog) => {
      await (isYes ? dialog.accept() : dialog.dismiss());
      resolve(dialog.message());
    });
  });
}

// Sends the file, and gives the names, units and least values of the signals that the server kept.
async function uploaded(page) {
  await page.click(".drop button[type=submit]");
  await says(page, "Stored: ");
  const { data } = await api("/v1/datasets?limit=1");
  return data.items[0].signals.map(({ name, unit, min }) => [name, unit, min]);
}

const chosenLayout = async (page) => (await labelled(page, "Layout")).evaluate((select) => select.value);

async function violations(page) {
  await page.evaluate(shared.checker);
  const { violations } = await page.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ["violations"] }),
  );
  return violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`);
}

test("an answer that was clicked is saved by name, and the next file of the kind is read without a click", {
  skip,
}, async () => {
  const name = `Leitsystem, Halle 2 ${Date.now()}`;
  const page = await open("/#/datasets");
  await chooseText(page, "march-13.csv", exported(13));
  await page.waitForSelector("::-p-xpath(//*[@class='first-rows']//li[contains(., 'Messstelle')])", PATIENCE);
  // Nobody is asked to save what nobody said.
  assert.equal(await page.$eval(".saving-layout .fields", ({ hidden }) => hidden), true);
  await page.select("::-p-xpath(//label[contains(., 'Each row holds')]/select)", "long");
  await reads(page, LONG);
  await (await labelled(page, "Time zone of its clock")).type("Europe/Berlin");
  await page.keyboard.press("Tab");
  await page.waitForFunction(() => !document.querySelector(".first-rows li"), PATIENCE);
  const before = await uploaded(page);
  assert.deepEqual(
    before.map(([signal, , least]) => [signal, least]),
    [
      ["Druck", 0.5],
      ["Temperatur", 20.25],
    ],
  );
  await (await labelled(page, "Save this layout as")).type(name);
  // The key saves the layout and does not send the file again.
  await page.keyboard.press("Enter");
  await says(page, "Saved. The next file of the kind");
  assert.equal(await chosenLayout(page), name);
  const saved = await api(addressOf(name));
  assert.deepEqual([saved.status, saved.data.name, saved.data.options], [200, name, SAID]);
  await picture(page, "layout-saved");
  assert.deepEqual(page.faults, []);
  await page.close();

  const later = await open("/#/datasets");
  const asked = [];
  later.on("request", (request) => request.method() === "POST" && asked.push(new URL(request.url())));
  // The browser keeps nothing of the layout: the file is read as it is until the layout is chosen.
  assert.equal(await chosenLayout(later), "");
  await chooseText(later, "march-14.csv", exported(14));
  await later.waitForSelector(".first-rows li", PATIENCE);
  await later.select("::-p-xpath(//label[contains(., 'Layout')]/select)", name);
  await reads(later, LONG);
  assert.equal(await later.$(".first-rows li"), null);
  assert.deepEqual(
    (await uploaded(later)).map(([signal]) => signal),
    before.map(([signal]) => signal),
  );
  const { pathname, searchParams } = asked.at(-1);
  assert.equal(pathname, "/v1/datasets");
  assert.deepEqual(Object.fromEntries(searchParams), { name: "march-14", layout: name });
  assert.deepEqual(later.faults, []);
  await later.close();
  await forget(name);
});

test("what is chosen beside a layout wins, and an option that is taken out of it is not said", {
  skip,
}, async () => {
  const name = `beside ${Date.now()}`;
  await keep(name, OF_MACHINES);
  const page = await open("/#/datasets");
  const asks = async (parameters) => {
    const wanted = JSON.stringify(parameters);
    const isAsked = (url) => JSON.stringify(Object.fromEntries(url.searchParams)) === wanted;
    await page.waitForResponse((response) => isAsked(new URL(response.url())), PATIENCE);
  };
  await says(page, "Layout");
  await page.select("::-p-xpath(//label[contains(., 'Layout')]/select)", name);
  await Promise.all([asks({ layout: name }), chooseText(page, "march-15.csv", ofMachines())]);
  await reads(page, SEVERAL);
  const leaveOut = () => page.select("select[aria-label^='Role of column 4']", "left_out");
  await Promise.all([asks({ layout: name, value: "p" }), leaveOut()]);
  await reads(page, [...LONG, "Left out"]);
  await Promise.all([asks({ layout: name }), press(page, "Back to what the layout says")]);
  await reads(page, SEVERAL);
  // No option of the layout is left that speaks of the columns.
  const widen = () => page.select("::-p-xpath(//label[contains(., 'Each row holds')]/select)", "wide");
  await Promise.all([asks({ tz: "Europe/Berlin" }), widen()]);
  await page.waitForSelector("::-p-xpath(//*[@class='first-rows']//li[contains(., 'Anlage')])", PATIENCE);
  await page.select("::-p-xpath(//label[contains(., 'Layout')]/select)", "");
  assert.equal(
    await (await page.$("::-p-xpath(//label[contains(., 'Time zone')]/input)")).evaluate(
      (input) => input.value,
    ),
    "",
  );
  assert.deepEqual(page.faults, []);
  await page.close();
  await forget(name);
});

test("a layout is replaced when the person says so, and is removed", { skip }, async () => {
  const name = `monthly export, 100 % ${Date.now()}`;
  await keep(name, SAID);
  const page = await open("/#/datasets");
  await says(page, "Layout");
  await page.select("::-p-xpath(//label[contains(., 'Layout')]/select)", name);
  await press(page, "What the file does not say");
  await (await labelled(page, "What stands for no sample")).type("-9999");
  await page.keyboard.press("Tab");
  let question = answer(page, false);
  await press(page, "Replace");
  assert.ok((await question).includes(name));
  assert.deepEqual((await api(addressOf(name))).data.options, SAID);
  question = answer(page, true);
  await press(page, "Replace");
  await question;
  await says(page, "Replaced. The next file of the kind");
  assert.equal(await chosenLayout(page), name);
  assert.deepEqual((await api(addressOf(name))).data.options, { ...SAID, missing: "-9999" });

  await press(page, "Saved layouts");
  await says(page, "Column that names the signal: Messstelle");
  await picture(page, "layouts-list");
  question = answer(page, true);
  await page.click(`button[aria-label='Remove the layout ${name}']`);
  await question;
  await page.waitForFunction((name) => !document.body.innerText.includes(name), PATIENCE, name);
  assert.match(await page.evaluate(() => document.activeElement.textContent), /^Saved layouts/);
  assert.equal((await api(addressOf(name))).status, 404);
  assert.deepEqual(page.faults, []);
  await page.close();
});

test("what is wrong with a layout is told where it is saved", { skip }, async () => {
  const page = await open("/#/datasets");
  await press(page, "What the file does not say");
  await (await labelled(page, "Time zone of its clock")).type("Nowhere");
  await page.keyboard.press("Tab");
  const name = await labelled(page, "Save this layout as");
  await name.type("a/b");
  await press(page, "Save");
  const wrong = await page.waitForSelector(".saving-layout input[aria-invalid]", PATIENCE);
  assert.match(await wrong.evaluate((input) => input.nextSibling.textContent), /slash/);
  assert.equal(await wrong.evaluate((input) => input === document.activeElement), true);
  await name.click({ count: 3 });
  await name.type(`nowhere ${Date.now()}`);
  await press(page, "Save");
  await page.waitForSelector(".saving-layout .problem", PATIENCE);
  assert.match(await text(page, ".saving-layout .problem"), /Nowhere/);
  assert.equal(await page.$(".saving-layout input[aria-invalid]"), null);
  await picture(page, "layout-refused");
  await page.close();
});

test("saved layouts are accessible and fit a phone and a desk, in both schemes", { skip }, async () => {
  const names = ["Leitsystem", "x".repeat(100)].map((name) => `${name}${Date.now()}`.slice(-100));
  for (const name of names) {
    await keep(name, { ...SAID, decimal: ",", units: "Druck:bar, Temperatur:degC", interpolation: "linear" });
  }
  const faults = [];
  for (const size of SIZES) {
    const page = await open("/#/datasets", size);
    await says(page, "Layout");
    await page.select("::-p-xpath(//label[contains(., 'Layout')]/select)", names[0]);
    await chooseText(page, "sizes.csv", exported(16));
    await reads(page, LONG);
    await press(page, "Saved layouts");
    await page.waitForSelector(`button[aria-label='Remove the layout ${names[1]}']`, PATIENCE);
    await picture(page, `layouts-${size.width}-${size.scheme}`);
    const wide = await page.evaluate(
      () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
    );
    const all = [...(await violations(page)), ...page.faults, ...(wide > 0 ? [`${wide} too wide`] : [])];
    faults.push(...all.map((fault) => `${size.width} ${size.scheme}: ${fault}`));
    await page.close();
  }
  await Promise.all(names.map(forget));
  assert.deepEqual(faults, []);
});
