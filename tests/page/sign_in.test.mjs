// Signing in, in a browser, to a server that asks who calls.
//
// GREYBOX_URL names the server and GREYBOX_TOKEN the secret of a token `operator` of the project `hall-2`
// with the scope `submit`; PAGE_TOOLS and CHROMIUM are those of browser.test.mjs.

import assert from "node:assert/strict";
import fs from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { after, before, test } from "node:test";

const { GREYBOX_URL: base, GREYBOX_TOKEN: token, PAGE_TOOLS: tools, CHROMIUM = "/usr/bin/chromium" } = process.env;
const skip = base && token && tools ? false : "GREYBOX_URL, GREYBOX_TOKEN and PAGE_TOOLS are not set";
const PATIENCE = { timeout: 60_000 };
const known = { browser: null, axe: null, page: null };

const says = (words) => known.page.waitForFunction((wanted) => document.body.innerText.includes(wanted), PATIENCE, words);
const heading = (words) => known.page.waitForFunction((wanted) => document.querySelector("h1")?.textContent === wanted, PATIENCE, words);

async function sign(text) {
  await known.page.waitForSelector("form.sign-in input", PATIENCE);
  await known.page.$eval("form.sign-in input", (input) => { input.value = ""; });
  await known.page.type("form.sign-in input", text);
  await known.page.keyboard.press("Enter");
}

before(async () => {
  if (!skip) {
    const require = createRequire(path.resolve(tools, "package.json"));
    known.axe = fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8");
    known.browser = await require("puppeteer-core").launch({ executablePath: CHROMIUM, headless: true, args: ["--no-sandbox", "--disable-gpu"] });
    known.page = await known.browser.newPage();
  }
});

after(() => known.browser?.close());

test("a token is taken once, and what changes something works from then on", { skip }, async () => {
  const { page } = known;
  await page.goto(`${base}/#/datasets`, { waitUntil: "domcontentloaded" });
  await heading("Sign in");
  await page.evaluate(known.axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document, { resultTypes: ["violations"] }));
  assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`), []);
  await sign(`gbx_${"0".repeat(64)}`);
  await says("The server does not know this token");
  await sign(token);
  await heading("Datasets");
  await says("token operator · submit in hall-2");

  const seen = await page.evaluate(async (secret) => {
    const { request } = await import("/assets/api.js");
    const body = "time [s],u [V]\n0,1\n1,2\n2,3\n";
    const stored = await request("POST", "/v1/datasets?name=mine", { body, headers: { "content-type": "text/csv" } });
    const bare = await fetch("/v1/datasets?name=theirs", { method: "POST", body, headers: { "content-type": "text/csv" } });
    return { stored: [200, 201].includes(stored.status), bare: bare.status, cookie: document.cookie, kept: JSON.stringify([{ ...localStorage }, { ...sessionStorage }]).includes(secret) };
  }, token);
  assert.deepEqual(seen, { stored: true, bare: 403, cookie: "", kept: false });

  // The session outlives a new page, and streams of events belong to it.
  await page.goto(`${base}/#/jobs`, { waitUntil: "domcontentloaded" });
  await page.reload({ waitUntil: "domcontentloaded" });
  await heading("Jobs");
  const streams = await page.evaluate(() => new Promise((resolve) => {
    const stream = new EventSource("/v1/events");
    stream.onopen = () => { stream.close(); resolve("open"); };
    stream.onerror = () => { stream.close(); resolve("refused"); };
  }));
  assert.equal(streams, "open");
});

test("signing out ends the session, also in another tab", { skip }, async () => {
  const other = await known.browser.newPage();
  await other.goto(`${base}/#/models`, { waitUntil: "domcontentloaded" });
  await other.waitForFunction(() => document.querySelector("h1")?.textContent === "Models", PATIENCE);
  // What a tab shows is waited for only while it is in front.
  await known.page.bringToFront();
  await known.page.evaluate(() => document.querySelector("#who button").click());
  await heading("Sign in");
  await other.bringToFront();
  await other.evaluate(() => { location.hash = "/datasets"; });
  await other.waitForFunction(() => document.querySelector("h1")?.textContent === "Sign in", PATIENCE);
  assert.equal(await other.evaluate(async () => (await fetch("/v1/jobs")).status), 401);
});
