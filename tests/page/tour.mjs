// These steps go through the tour of the first result by keyboard and leave it.

import assert from "node:assert/strict";
import { open, PATIENCE } from "./browser.mjs";

const CARD = "section[aria-label='Tour of the result']";

export async function tourOfAResult(job, checker) {
  const page = await open(`/#/jobs/${job}`);
  await page.evaluate(() => localStorage.removeItem("greybox.tour"));
  await page.reload({ waitUntil: "domcontentloaded" });
  await page.waitForSelector(CARD, PATIENCE);
  assert.ok(await page.evaluate(() => !document.activeElement.closest(".tour")), "the focus is not taken");
  await page.evaluate(checker);
  const { violations } = await page.evaluate(() =>
    globalThis.axe.run(document, { resultTypes: ["violations"] }),
  );
  assert.deepEqual(
    violations.map(({ id, nodes }) => `${id}: ${nodes[0].html}`),
    [],
  );
  const step = () => page.$eval(`${CARD} .grade`, (title) => title.innerText);
  const explained = () => page.$eval(CARD, (card) => card.nextElementSibling.className);
  const steps = Number(/1 of (\d)/.exec(await step())[1]);
  assert.equal(steps, 6);
  assert.match(await explained(), /verdict/);
  await page.focus(`${CARD} .primary`);
  for (let place = 2; place <= steps; place += 1) {
    await page.keyboard.press("Enter");
    assert.match(await step(), new RegExp(`${place} of ${steps}`));
    const top = await page.$eval(CARD, (card) => card.getBoundingClientRect().top);
    const height = await page.evaluate(() => innerHeight);
    assert.ok(top >= 0 && top < height, `the card is at ${top} in a window of ${height}`);
  }
  await page.keyboard.press("Escape");
  assert.equal(await page.$(CARD), null);
  assert.equal(await page.evaluate(() => document.activeElement.textContent), "Report for the file");

  // A tour that was left is not shown again.
  await page.reload({ waitUntil: "domcontentloaded" });
  await page.waitForSelector(".verdict", PATIENCE);
  await page.waitForSelector("[data-part='Uncertainty budget']", PATIENCE);
  assert.equal(await page.$(CARD), null);
  assert.deepEqual(page.faults, []);
  await page.close();
}
