// The guides are accessible and fit their width in both schemes, every picture of them is shown, and the search finds
// what stands in them and in the reference.
//
// GREYBOX_URL names the server; PAGE_TOOLS and CHROMIUM are as for the other tests in a browser.

import assert from "node:assert/strict";
import test, { after, before } from "node:test";
import { faultsOf, launch, open, PATIENCE, SIZES, tools } from "./browser.mjs";
import { base } from "./server.mjs";

const skip = !(base && tools) && "GREYBOX_URL and PAGE_TOOLS are not set";
const WIDE = { width: 1280, height: 900, scheme: "light" };
const NARROW = { width: 390, height: 844, scheme: "light" };
const DARK = { scheme: "dark" };
const shared = {};

before(async () => {
  if (!skip) {
    Object.assign(shared, await launch());
    const page = await open("/docs/");
    shared.guides = await page.$$eval("nav[aria-label='Guides'] a", (links) =>
      links.map((link) => link.getAttribute("href")).filter((address) => address.startsWith("/docs/")),
    );
    await page.close();
  }
});
after(() => shared.browser?.close());

test("every guide is accessible and fits its width, in both schemes", { skip }, async () => {
  assert.ok(shared.guides.length >= 14, `${shared.guides}`);
  const faults = [];
  for (const address of ["/docs/", ...shared.guides]) {
    for (const size of [WIDE, NARROW, { ...WIDE, ...DARK }, { ...NARROW, ...DARK }]) {
      const name = address.slice("/docs/".length) || "index";
      faults.push(...(await faultsOf(`guide_${name}`, address, { size, checker: shared.checker })));
    }
  }
  assert.deepEqual(faults, []);
});

test("every picture is shown at the size that was kept for it", { skip }, async () => {
  const counted = {};
  for (const size of [WIDE, NARROW]) {
    for (const address of shared.guides) {
      const page = await open(address, size);
      const pictures = await page.$$eval("main img", (images) =>
        Promise.all(
          images.map(async (image) => {
            const kept = image.getBoundingClientRect();
            image.loading = "eager";
            await image.decode().catch(() => {});
            const { width, height } = image.getBoundingClientRect();
            const { naturalWidth, naturalHeight, src, alt } = image;
            const inside = width <= document.documentElement.clientWidth;
            const moved = Math.abs(kept.height - height) + Math.abs(kept.width - width);
            const squeezed = Math.abs((height / width) * (naturalWidth / naturalHeight) - 1);
            return { src, alt, naturalWidth, inside, moved, squeezed };
          }),
        ),
      );
      counted[address] = pictures.length;
      for (const { src, alt, naturalWidth, inside, moved, squeezed } of pictures) {
        assert.ok(naturalWidth > 0, `${src} is not shown`);
        assert.ok(inside && moved < 1 && squeezed < 0.01, `${src} ${size.width}: ${moved} ${squeezed}`);
        assert.ok(alt.length > 40, `${src}: ${alt}`);
      }
      assert.deepEqual(page.faults, []);
      await page.close();
    }
  }
  assert.ok(counted["/docs/examples"] >= 9 && counted["/docs/verdicts"] >= 20, JSON.stringify(counted));
});

// Types words into the search by keyboard, and lists the hits.
async function found(page, words) {
  await page.keyboard.press("/");
  await page.keyboard.press("Escape");
  await page.keyboard.type(words);
  await page.waitForFunction(
    (words) => {
      const marks = [...document.querySelectorAll("search li")].map((item) => item.innerText.toLowerCase());
      return marks.length > 0 && marks.every((text) => text.includes(words));
    },
    PATIENCE,
    words,
  );
  return page.$$eval("search li", (items) =>
    items.map((item) => ({ to: item.querySelector("a").getAttribute("href"), text: item.innerText })),
  );
}

test("the search finds guides and operations by keyboard, and leads to the heading", { skip }, async () => {
  const page = await open("/docs/", SIZES[0]);
  await page.waitForSelector("search input", PATIENCE);
  const expected = { skip: "/docs/import#", webhook: "/docs#", damping: "/docs/examples#" };
  for (const [words, begin] of Object.entries(expected)) {
    const hits = await found(page, words);
    assert.ok(
      hits.some(({ to }) => to.startsWith(begin)),
      `${words}: ${JSON.stringify(hits)}`,
    );
    await page.evaluate(() => document.activeElement.blur());
  }
  const [first] = await found(page, "at_bound");
  assert.equal(first.to, "/docs/verdicts#at_bound");
  await Promise.all([page.waitForNavigation(PATIENCE), page.keyboard.press("Enter")]);
  assert.equal(await page.evaluate(() => location.pathname + location.hash), "/docs/verdicts#at_bound");
  assert.equal(await page.$eval("h2#at_bound", (heading) => heading.textContent), "at_bound");
  // The way back leads to the list.
  await page.goBack(PATIENCE);
  await page.waitForSelector("search li a[href='/docs/verdicts#at_bound']", PATIENCE);
  assert.deepEqual(page.faults, []);
  await page.close();
});
