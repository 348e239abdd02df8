// These steps choose windows of a recording by mouse and by keyboard, on the form of a job and on the page of
// the recording.

import assert from "node:assert/strict";
import { open, PATIENCE, picture, specification } from "./browser.mjs";

const DRAGGING = "::-p-xpath(//label[contains(., 'Dragging across')]/select)";

// Drags across the first plot between two shares of its width.
async function drag(page, from, to) {
  const over = await page.$(".u-over");
  await over.scrollIntoView();
  const box = await over.boundingBox();
  await page.mouse.move(box.x + from * box.width, box.y + 20);
  await page.mouse.down();
  await page.mouse.move(box.x + to * box.width, box.y + 20, { steps: 5 });
  await page.mouse.up();
}

const blocks = (page, count) =>
  page.waitForFunction(
    (count) => document.querySelectorAll(".window-block").length === count,
    PATIENCE,
    count,
  );

// The recording is six seconds long. The form gets three windows, which are moved, given another role, and removed.
export async function windowsOfAForm(dataset) {
  const page = await open(`/#/new?dataset=${dataset}&model=positioning_drive`);
  await page.waitForSelector(".surface:not(.empty) .u-over", PATIENCE);
  await drag(page, 0.1, 0.3);
  await page.waitForSelector("input[aria-label='Experiment 1, to, in seconds'][value^='1.']", PATIENCE);
  await drag(page, 0.4, 0.6);
  await blocks(page, 2);
  await page.select(DRAGGING, "validation");
  await drag(page, 0.7, 0.9);
  await blocks(page, 3);
  const chosen = (await specification(page)).experiments;
  assert.deepEqual(
    chosen.map(({ dataset: id, role, signals }) => [id, role, Object.keys(signals).sort()]),
    [undefined, undefined, "validation"].map((role) => [dataset, role, ["force", "position"]]),
  );
  const ends = chosen.flatMap(({ window }) => [window.from_s, window.to_s]);
  const wanted = [0.6, 1.8, 2.4, 3.6, 4.2, 5.4];
  assert.ok(
    ends.every((end, k) => Math.abs(end - wanted[k]) < 0.1),
    `${ends}`,
  );

  const second = (await page.$$(".window-block"))[1];
  const box = await second.boundingBox();
  await page.mouse.move(box.x + box.width / 2, box.y + 8);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width / 2 - 30, box.y + 8, { steps: 4 });
  await page.mouse.up();
  const { window: moved } = (await specification(page)).experiments[1];
  assert.ok(moved.from_s < ends[2] - 0.02);
  assert.ok(
    Math.abs(moved.to_s - moved.from_s - (ends[3] - ends[2])) < 1e-4,
    "a moved window keeps its length",
  );

  await second.focus();
  await page.keyboard.press("End");
  assert.equal((await specification(page)).experiments[1].window.to_s, undefined);
  await page.select("select[aria-label='What Experiment 3 is for']", "estimation");
  assert.equal((await specification(page)).experiments[2].role, undefined);
  await picture(page, "new-job-windows");
  await second.focus();
  await page.keyboard.press("Delete");
  await blocks(page, 2);
  assert.ok(await page.evaluate(() => document.activeElement.matches(".window-block")), "the focus is kept");
  assert.equal((await specification(page)).experiments.length, 2);
  await page.click("::-p-text(Add a window)");
  await blocks(page, 3);
  const { window: added } = (await specification(page)).experiments[2];
  assert.ok(Math.abs(added.from_s - 1.8) < 0.1 && Math.abs(added.to_s - 4.2) < 0.1, JSON.stringify(added));
  assert.deepEqual(page.faults, []);
  await page.close();
}

// Windows that are chosen on the page of a recording become the experiments of a new job.
export async function windowsOfARecording(dataset) {
  const page = await open(`/#/datasets/${dataset}`);
  await page.waitForSelector(".surface:not(.empty) .u-over", PATIENCE);
  await page.select(DRAGGING, "estimation");
  await drag(page, 0.1, 0.4);
  await blocks(page, 1);
  await drag(page, 0.6, 0.9);
  await blocks(page, 2);
  await page.click("::-p-text(New job with these 2 windows)");
  await page.waitForSelector("input[aria-label='Experiment 2, from, in seconds']", PATIENCE);
  const { experiments } = await specification(page);
  assert.ok(Math.abs(experiments[1].window.from_s - 3.6) < 0.1, JSON.stringify(experiments));
  assert.deepEqual(page.faults, []);
  await page.close();
}
