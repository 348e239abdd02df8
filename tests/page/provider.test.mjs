// A person signs in at a real identity provider, in a browser.
//
// GREYBOX_PROGRAM names the program; the test starts a server of its own, and a provider beside it: oidc-provider, which
// PAGE_TOOLS has beside the tools of the browser.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import fs from "node:fs";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import os from "node:os";
import path from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import { launch, PATIENCE, picture, tools } from "./browser.mjs";

const program = process.env.GREYBOX_PROGRAM;
const skip = program && tools ? false : "GREYBOX_PROGRAM and PAGE_TOOLS are not set";
const shared = { folder: "", browser: null, checker: "", provider: null, server: null, base: "" };
const SECRET = "the/secret of+greybox";
const GROUPS = { ada: ["fitters", "operators"], eve: ["guests"] };

function listen(server) {
  return new Promise((resolve) => {
    server.listen(0, "127.0.0.1", () => resolve(server.address().port));
  });
}

async function freePort() {
  const server = createServer();
  const port = await listen(server);
  await new Promise((resolve) => server.close(resolve));
  return port;
}

// Starts a provider whose people sign in by their name, whatever the password.
async function startProvider(callback) {
  const require = createRequire(path.resolve(tools, "package.json"));
  const { Provider } = await import(pathToFileURL(require.resolve("oidc-provider")).href);
  const server = createServer((request, response) => shared.provider.callback()(request, response));
  const issuer = `http://127.0.0.1:${await listen(server)}`;
  shared.provider = new Provider(issuer, {
    clients: [{ client_id: "greybox", client_secret: SECRET, redirect_uris: [callback] }],
    claims: { openid: ["sub"], profile: ["preferred_username"], groups: ["groups"] },
    cookies: { keys: ["of this test"] },
    findAccount: (_context, id) => ({
      accountId: id,
      claims: () => ({ sub: id, preferred_username: id, groups: GROUPS[id] ?? [] }),
    }),
  });
  return { issuer, server };
}

// Starts a server that knows the provider, and waits until it listens.
function startServer(port, issuer) {
  const secret = path.join(shared.folder, "secret");
  fs.writeFileSync(secret, `${SECRET}\n`);
  const server = spawn(
    program,
    [
      "serve",
      `--listen=127.0.0.1:${port}`,
      `--database=sqlite://${path.join(shared.folder, "greybox.db")}`,
      `--public-url=http://127.0.0.1:${port}`,
      `--oidc-issuer=${issuer}`,
      "--oidc-client-id=greybox",
      `--oidc-client-secret-file=${secret}`,
      "--oidc-scope=profile,groups",
      "--role=operators=submit:hall-2",
      "--log=warn",
    ],
    { stdio: ["ignore", "pipe", "inherit"] },
  );
  return new Promise((resolve, reject) => {
    server.stdout.on("data", (text) => String(text).includes("listening on") && resolve(server));
    server.on("exit", (code) => reject(new Error(`the server ended with ${code}`)));
  });
}

before(async () => {
  if (skip) {
    return;
  }
  shared.folder = fs.mkdtempSync(path.join(os.tmpdir(), "greybox-provider-"));
  const port = await freePort();
  shared.base = `http://127.0.0.1:${port}`;
  const { issuer, server } = await startProvider(`${shared.base}/v1/session/callback`);
  shared.http = server;
  shared.server = await startServer(port, issuer);
  Object.assign(shared, await launch());
});

after(async () => {
  await shared.browser?.close();
  shared.server?.removeAllListeners("exit");
  shared.server?.kill();
  shared.http?.closeAllConnections();
  shared.http?.close();
  if (shared.folder) {
    fs.rmSync(shared.folder, { recursive: true, force: true });
  }
});

const heading = (page, words) =>
  page.waitForFunction((text) => document.querySelector("h1")?.textContent === text, PATIENCE, words);
const says = (page, words) =>
  page.waitForFunction((text) => document.body.innerText.includes(text), PATIENCE, words);

// Signs in at the provider: the pages for name and consent are those of oidc-provider.
async function signInAtProvider(page, name) {
  await page.waitForSelector("#way-in", PATIENCE);
  await page.click("#way-in");
  await page.waitForSelector("input[name=login]", PATIENCE);
  await page.type("input[name=login]", name);
  await page.type("input[name=password]", "any");
  await Promise.all([page.waitForNavigation(PATIENCE), page.keyboard.press("Enter")]);
  await page.waitForSelector("button[type=submit]", PATIENCE);
  await Promise.all([page.waitForNavigation(PATIENCE), page.click("button[type=submit]")]);
}

test("a person of the plant signs in, comes back to the same view, and signs out", { skip }, async () => {
  const context = await shared.browser.createBrowserContext();
  const page = await context.newPage();
  await page.goto(`${shared.base}/#/datasets`, { waitUntil: "domcontentloaded" });
  await heading(page, "Sign in");
  await page.waitForSelector("#way-in", PATIENCE);
  await page.evaluate(shared.checker);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document));
  assert.deepEqual(
    violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`),
    [],
  );
  await picture(page, "sign-in-with-provider");
  await signInAtProvider(page, "ada");
  await heading(page, "Datasets");
  await says(page, "person ada · submit in hall-2");
  assert.equal(new URL(page.url()).hash, "#/datasets");
  const stored = await page.evaluate(async () => {
    const { request } = await import("/assets/shell/api.js");
    const body = "time [s],u [V]\n0,1\n1,2\n2,3\n";
    const headers = { "content-type": "text/csv" };
    return (await request("POST", "/v1/datasets?name=mine", { body, headers })).status;
  });
  assert.ok([200, 201].includes(stored));
  assert.equal(await page.evaluate(() => document.cookie), "");
  await page.evaluate(() => document.querySelector("#who button").click());
  await heading(page, "Sign in");
  await context.close();
});

test("a person without a role reads why, on a page", { skip }, async () => {
  const context = await shared.browser.createBrowserContext();
  const page = await context.newPage();
  await page.goto(`${shared.base}/#/jobs`, { waitUntil: "domcontentloaded" });
  await signInAtProvider(page, "eve");
  await says(page, "No group of this person has a role here");
  await page.evaluate(shared.checker);
  const { violations } = await page.evaluate(() => globalThis.axe.run(document));
  assert.deepEqual(violations, []);
  await picture(page, "sign-in-refused");
  await page.click("a");
  await heading(page, "Sign in");
  await context.close();
});
