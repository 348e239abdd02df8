// The tests sign in, in a browser, to a server that asks who calls.
//
// GREYBOX_TOKEN is the secret of a token `operator` of the project `hall-2` with the scope `submit`,
// GREYBOX_READER_TOKEN that of a token `reader` of this project with the scope `read`; the variables that name the
// server and the browser are described in server.mjs and browser.mjs.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";
import { launch, PATIENCE, tools } from "./browser.mjs";
import { base } from "./server.mjs";

const token = process.env.GREYBOX_TOKEN;
const readerToken = process.env.GREYBOX_READER_TOKEN;
const skip =
  base && token && readerToken && tools
    ? false
    : "GREYBOX_URL, GREYBOX_TOKEN, GREYBOX_READER_TOKEN and PAGE_TOOLS are not set";
const shared = { browser: null, checker: null, page: null };

const says = (words) =>
  shared.page.waitForFunction((text) => document.body.innerText.includes(text), PATIENCE, words);
const heading = (words) =>
  shared.page.waitForFunction((text) => document.querySelector("h1")?.textContent === text, PATIENCE, words);

async function sign(text) {
  await shared.page.waitForSelector("form.sign-in input", PATIENCE);
  await shared.page.$eval("form.sign-in input", (input) => {
    input.value = "";
  });
  await shared.page.type("form.sign-in input", text);
  await shared.page.keyboard.press("Enter");
}

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    shared.page = await shared.browser.newPage();
  }
});

after(() => shared.browser?.close());

test("a token is taken once, and what changes something works from then on", { skip }, async () => {
  const { page } = shared;
  await page.goto(`${base}/#/datasets`, { waitUntil: "domcontentloaded" });
  await heading("Sign in");
  await page.evaluate(shared.checker);
  const { violations } = await page.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ["violations"] }),
  );
  assert.deepEqual(
    violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`),
    [],
  );
  await sign(`gbx_${"0".repeat(64)}`);
  await says("The server does not know this token");
  await sign(token);
  await heading("Datasets");
  await says("token operator · submit in hall-2");

  const seen = await page.evaluate(async (secret) => {
    const { request } = await import("/assets/shell/api.js");
    const body = "time [s],u [V]\n0,1\n1,2\n2,3\n";
    const stored = await request("POST", "/v1/datasets?name=mine", {
      body,
      headers: { "content-type": "text/csv" },
    });
    const bare = await fetch("/v1/datasets?name=theirs", {
      method: "POST",
      body,
      headers: { "content-type": "text/csv" },
    });
    return {
      stored: [200, 201].includes(stored.status),
      bare: bare.status,
      cookie: document.cookie,
      kept: JSON.stringify([{ ...localStorage }, { ...sessionStorage }]).includes(secret),
    };
  }, token);
  assert.deepEqual(seen, { stored: true, bare: 403, cookie: "", kept: false });

  // The session outlives a new page, and streams of events belong to it.
  await page.goto(`${base}/#/jobs`, { waitUntil: "domcontentloaded" });
  await page.reload({ waitUntil: "domcontentloaded" });
  await heading("Jobs");
  const streams = await page.evaluate(
    () =>
      new Promise((resolve) => {
        const stream = new EventSource("/v1/events");
        stream.onopen = () => {
          stream.close();
          resolve("open");
        };
        stream.onerror = () => {
          stream.close();
          resolve("refused");
        };
      }),
  );
  assert.equal(streams, "open");
});

test("signing out ends the session, also in another tab", { skip }, async () => {
  const tab = await shared.browser.newPage();
  await tab.goto(`${base}/#/models`, { waitUntil: "domcontentloaded" });
  await tab.waitForFunction(() => document.querySelector("h1")?.textContent === "Models", PATIENCE);
  // A tab draws only while it is in front.
  await shared.page.bringToFront();
  await shared.page.evaluate(() => document.querySelector("#who button").click());
  await heading("Sign in");
  await tab.bringToFront();
  await tab.evaluate(() => {
    location.hash = "/datasets";
  });
  await tab.waitForFunction(() => document.querySelector("h1")?.textContent === "Sign in", PATIENCE);
  // The tab had a session until now, and says whose it was.
  assert.match(await tab.evaluate(() => document.body.innerText), /The session of token operator is over/);
  assert.equal(await tab.$eval("#who", (who) => who.innerText), "");
  assert.equal(await tab.evaluate(async () => (await fetch("/v1/jobs")).status), 401);
});

test("the list asks for jobs while it asks for the session, and again once a person has signed in", {
  skip,
}, async () => {
  const { page } = shared;
  await page.bringToFront();
  await page.goto(`${base}/#/jobs`, { waitUntil: "domcontentloaded" });
  const refused = (path) =>
    page.waitForResponse(
      (answer) => new URL(answer.url()).pathname === path && answer.status() === 401,
      PATIENCE,
    );
  const both = Promise.all([refused("/v1/session"), refused("/v1/jobs")]);
  await page.reload({ waitUntil: "domcontentloaded" });
  await heading("Sign in");
  await both;
  assert.equal((await page.$$("form.sign-in")).length, 1);
  await sign(token);
  await heading("Jobs");
  await says("Try it with the demonstration rig");
});

test("who may only read is offered nothing that changes something", { skip }, async () => {
  const page = await shared.browser.newPage();
  await page.goto(`${base}/#/jobs`, { waitUntil: "domcontentloaded" });
  // The lists are drawn for whoever signed in before, and then for the reader.
  const offered = async (path, title) => {
    await page.evaluate((path) => {
      location.hash = path;
    }, path);
    // The parts are in the page, shown or not.
    await page.waitForFunction(
      (text) =>
        document.querySelector("h1")?.textContent === text &&
        document.querySelectorAll("main .for-writers").length > 0,
      PATIENCE,
      title,
    );
    return page.$$eval(
      ".for-writers, .danger",
      (parts) => parts.map((part) => part.checkVisibility()).filter(Boolean).length,
    );
  };
  await page.waitForFunction(() => document.body.dataset.scope === "submit", PATIENCE);
  assert.ok((await offered("/datasets", "Datasets")) > 1);
  assert.ok((await offered("/jobs", "Jobs")) > 1);
  await page.evaluate(() => document.querySelector("#who button").click());
  await page.waitForSelector("form.sign-in input", PATIENCE);
  await page.type("form.sign-in input", readerToken);
  await page.keyboard.press("Enter");
  await page.waitForFunction(() => document.body.dataset.scope === "read", PATIENCE);
  assert.equal(await offered("/datasets", "Datasets"), 0);
  assert.equal(await offered("/jobs", "Jobs"), 0);

  // Dragging across a plot can mark a stretch as bad, which is no choice of a reader.
  const { items } = await page.evaluate(async () => (await fetch("/v1/datasets")).json());
  await page.evaluate((id) => {
    location.hash = `/datasets/${id}`;
  }, items[0].id);
  const dragging = await page.waitForSelector(
    "::-p-xpath(//label[contains(., 'Dragging across')]/select)",
    PATIENCE,
  );
  const shown = await dragging.evaluate(({ options }) =>
    [...options].filter((option) => getComputedStyle(option).display !== "none").map(({ value }) => value),
  );
  assert.deepEqual(shown, ["look", "estimation", "validation"]);
  await dragging.focus();
  await page.keyboard.press("End");
  assert.equal(await dragging.evaluate(({ value }) => value), "validation");
  await page.close();
});
