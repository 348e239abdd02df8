// This module starts the browser of the tests and has the steps that they do on a page.
//
// PAGE_TOOLS names a folder with puppeteer-core and axe-core in its node_modules, CHROMIUM names the
// browser, and SCREENSHOTS names a folder for pictures of every page.

import fs from "node:fs";
import { createRequire } from "node:module";
import path from "node:path";
import { base } from "./server.mjs";

export const tools = process.env.PAGE_TOOLS;
const { CHROMIUM = "/usr/bin/chromium", SCREENSHOTS: pictures } = process.env;
export const PATIENCE = { timeout: 60_000 };
export const SIZES = [
  { width: 1400, height: 900, scheme: "light" },
  { width: 1400, height: 900, scheme: "dark" },
  { width: 390, height: 844, scheme: "light" },
  { width: 390, height: 844, scheme: "dark" },
];

let browser = null;

// Starts the browser, and reads the script of the accessibility checker.
export async function launch() {
  const require = createRequire(path.resolve(tools, "package.json"));
  browser = await require("puppeteer-core").launch({
    executablePath: CHROMIUM,
    headless: true,
    args: ["--no-sandbox", "--disable-gpu"],
    // A machine that builds beside the tests takes minutes for the accessibility check of a long page.
    protocolTimeout: 600_000,
  });
  return { browser, checker: fs.readFileSync(require.resolve("axe-core/axe.min.js"), "utf8") };
}

// Opens a page that records its errors and its requests to other hosts in `faults`.
export async function open(address, { width, height, scheme } = SIZES[0]) {
  const page = await browser.newPage();
  page.setDefaultTimeout(PATIENCE.timeout);
  page.faults = [];
  await page.setViewport({ width, height });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  page.on("console", (message) => message.type() === "error" && page.faults.push(message.text()));
  page.on("pageerror", (error) => page.faults.push(error.message));
  page.on("request", (request) => {
    const url = new URL(request.url());
    if (!["data:", "blob:"].includes(url.protocol) && url.origin !== base) {
      page.faults.push(`asked ${url}`);
    }
  });
  await page.goto(base + address, { waitUntil: "domcontentloaded" });
  return page;
}

export const text = (page, selector) => page.$eval(selector, (element) => element.textContent);
export const says = (page, words) =>
  page.waitForFunction((text) => document.body.innerText.includes(text), PATIENCE, words);

// Presses a button, a link or a summary. A form draws its parts anew where the server has answered, so that a part may
// be gone between the look and the click: then the new one is pressed.
export async function press(page, words) {
  const selector = `::-p-xpath(//*[self::a or self::button or self::summary][contains(., '${words}')])`;
  for (let turn = 0; turn < 20; turn += 1) {
    const part = await page.waitForSelector(selector, { ...PATIENCE, visible: true });
    try {
      await part.click();
      return;
    } catch (error) {
      if (!/detached/.test(error.message)) {
        throw error;
      }
    }
  }
  throw new Error(`${words} is drawn anew again and again`);
}

// Types into a field as a person does, and leaves it.
export async function fill(page, field, words) {
  await page.locator(field).click({ count: 3 });
  await page.keyboard.type(words);
  await page.keyboard.press("Tab");
}

// Waits for the field whose label has the words.
export const labelled = (page, words) =>
  page.waitForSelector(`::-p-xpath(//label[contains(., '${words}')]//*[self::input or self::select])`, {
    ...PATIENCE,
    visible: true,
  });

export const specification = (page) =>
  page.$eval("#panel-json .editor", (editor) => JSON.parse(editor.getText()));

// Replaces the text in an editor by keyboard.
export async function write(page, editor, text) {
  await (await page.waitForSelector(`${editor} >>> .cm-content`, PATIENCE)).focus();
  await page.keyboard.down("Control");
  await page.keyboard.press("a");
  await page.keyboard.up("Control");
  await page.keyboard.press("Delete");
  await page.keyboard.sendCharacter(text);
}

// Takes a picture of the page, or of the part of it that is selected.
export async function picture(page, name, part) {
  if (pictures) {
    fs.mkdirSync(pictures, { recursive: true });
    const file = path.join(pictures, `${name}.png`);
    await (part
      ? (await page.$(part)).screenshot({ path: file })
      : page.screenshot({ path: file, fullPage: true }));
  }
}

// Looks at a page of a size once it has what `ready` selects: lists what the accessibility checker finds, errors, and whether the page is
// wider than the window.
export async function faultsOf(name, address, { size, checker, ready = "h1" }) {
  const page = await open(address, size);
  const where = `${name} ${size.width} ${size.scheme}`;
  await page.waitForSelector(ready, PATIENCE);
  await page.waitForNetworkIdle({ idleTime: 400, timeout: 15_000, concurrency: 2 }).catch(() => {});
  await page.evaluate(() =>
    document.querySelectorAll("details").forEach((details) => {
      details.open = !details.matches(".save, .dropdown");
    }),
  );
  await page.waitForNetworkIdle({ idleTime: 300, timeout: 15_000, concurrency: 2 }).catch(() => {});
  await picture(page, where.replaceAll(" ", "-"));
  const wide = await page.evaluate(
    () => document.documentElement.scrollWidth - document.documentElement.clientWidth,
  );
  const faults = wide > 0 ? [`${where}: ${wide} pixels too wide`] : [];
  // The policy lets in no script but the page's own, so the checker comes in beside it.
  await page.evaluate(checker);
  const { violations } = await page.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ["violations"] }),
  );
  for (const { id, nodes } of violations) {
    const places = nodes.slice(0, 2).map(({ html }) => html.slice(0, 160));
    faults.push(`${where}: ${id}: ${places.join(" | ")}`);
  }
  faults.push(...page.faults.map((fault) => `${where}: ${fault}`));
  await page.close();
  return faults;
}
