// An engineer identifies a plant from a file on the disk: from the upload to a verdict, by the steps that each verdict
// offers until none is left, to the report.

import fs from "node:fs";
import path from "node:path";
import { PATIENCE } from "./browser.mjs";
import { Person } from "./person.mjs";

const JOB_PATIENCE = { timeout: 900_000 };
const MOST_ROUNDS = 12;
const { SERVO, LAB, PDF } = process.env;

// Starts the job of the form; with the keyboard the person takes the way past its fields.
export async function started(person) {
  person.isWithoutMouse && (await person.press("Go to the start of the job"));
  await person.press("Start the job");
}

// Waits for the result of the job that the page shows, and reads the verdict as it stands there.
export async function verdictOn(page) {
  await page.waitForFunction(() => location.hash.startsWith("#/jobs/job_"), PATIENCE);
  const address = await page.evaluate(() => location.hash);
  await page.waitForFunction(
    (hash) => location.hash === hash && document.querySelector(".verdict .grade"),
    JOB_PATIENCE,
    address,
  );
  return page.evaluate(() => {
    const box = document.querySelector(".verdict");
    const own = (item) => [...item.childNodes].filter(({ tagName }) => tagName !== "UL");
    const reasons = [...box.querySelectorAll(":scope > ol > li, :scope > details > ol > li")];
    return {
      grade: box.querySelector(".grade").innerText,
      reasons: reasons.map((item) =>
        own(item)
          .map(({ textContent }) => textContent)
          .join(""),
      ),
      steps: [...box.querySelectorAll(".next button")].map(({ innerText }) => innerText),
      close: box.innerText.includes("No change of this job is left"),
      parameters: [...document.querySelectorAll("[aria-label='Estimated parameters'] tbody tr")].map((row) =>
        row.innerText.replace(/\s+/g, " "),
      ),
    };
  });
}

// Reads what the job changed against the job that it follows.
const changesOn = (page) =>
  page
    .waitForFunction(() => {
      const details = [...document.querySelectorAll(".ancestry details")].at(-1);
      return details?.innerText.replace(/\s+/g, " ");
    }, PATIENCE)
    .then((handle) => handle.jsonValue());

export function tell({ grade, reasons, steps, close, parameters }) {
  console.log(`    ${grade}`);
  for (const text of [...reasons, ...parameters]) {
    console.log(`      - ${text}`);
  }
  console.log(`      offered: ${steps.join(" | ") || (close ? "nothing, and the page says so" : "nothing")}`);
}

// Opens the report of the job and prints it, as the person does with the dialog of the browser.
export async function report(person, name) {
  const opened = new Promise((resolve) => person.page.once("popup", resolve));
  await person.press("Report for the file");
  const page = await opened;
  await page.waitForFunction(() => document.readyState === "complete", PATIENCE);
  person.did.keys += 1;
  person.did[person.isWithoutMouse ? "keys" : "clicks"] += 1;
  if (PDF) {
    fs.mkdirSync(PDF, { recursive: true });
    await page.pdf({ path: path.join(PDF, `${name}.pdf`), preferCSSPageSize: true });
  }
  const words = await page.evaluate(() => document.body.innerText);
  await page.close();
  await person.page.bringToFront();
  return words;
}

// Follows the first step of each verdict until a verdict offers none.
async function followed(person) {
  const { page } = person;
  for (let round = 1; round <= MOST_ROUNDS; round += 1) {
    const verdict = await verdictOn(page);
    tell(verdict);
    if (verdict.steps.length === 0) {
      return;
    }
    const before = await page.evaluate(() => location.hash);
    await person.step(`advice ${round}: ${verdict.steps[0]}`, async () => {
      await person.press(verdict.steps[0]);
      await person.sees("The job can start.");
      await started(person);
      await page.waitForFunction(
        (hash) => location.hash.startsWith("#/jobs/job_") && location.hash !== hash,
        PATIENCE,
        before,
      );
      await verdictOn(page);
    });
    console.log(`    changed: ${await changesOn(page)}`);
  }
  person.stumble(`after ${MOST_ROUNDS} rounds the verdict still offers steps`);
}

async function begun(hands, file) {
  const person = await Person.at("/#/", hands);
  await person.step("the first page, and where to begin", () => person.press("Begin with your own file"));
  await person.step("the file chosen and uploaded", async () => {
    await person.give("Recording: choose a file", file);
    await person.press("Upload", "Recordings");
    await person.sees("What the model sees");
  });
  return person;
}

export async function engineer(hands) {
  if (!SERVO) {
    console.log("  left out: SERVO names no recording");
    return null;
  }
  const person = await begun(hands, SERVO);
  await person.step("the model chosen", async () => {
    await person.press("Positioning drive", "Model");
    await person.sees("The job can start.");
  });
  await person.step("the job started, until its verdict", async () => {
    await started(person);
    await verdictOn(person.page);
  });
  await followed(person);
  await person.step("the report, printed", () => report(person, "servo axis"));
  return person;
}

const LAB_MODEL = `name: temperature_lab
inputs:
  heater_1: {symbol: Q1, unit: "1"}
  heater_2: {symbol: Q2, unit: "1"}
parameters:
  transfer: {symbol: U, unit: W/(m^2*K), default: 10, lower: 1, upper: 50, scale: log, unknown: true}
  exchange: {symbol: Us, unit: W/(m^2*K), default: 20, lower: 1, upper: 100, scale: log, unknown: true}
  gain_1: {symbol: a1, unit: W, default: 1, lower: 0.1, upper: 5, scale: log, unknown: true}
  gain_2: {symbol: a2, unit: W, default: 0.75, lower: 0.1, upper: 5, scale: log, unknown: true}
  sensor_lag: {symbol: tau, unit: s, default: 20, lower: 1, upper: 60, scale: log, unknown: true}
  ambient: {symbol: Ta, unit: K, default: 296, lower: 288, upper: 304, unknown: true}
constants:
  mc: {value: 2, unit: J/K}
  A: {value: 0.001, unit: m^2}
  As: {value: 0.0002, unit: m^2}
quantities:
  between: {unit: W, expression: Us*As*(T2 - T1)}
states:
  heat_1: {symbol: T1, unit: K, derivative: (U*A*(Ta - T1) + between + a1*Q1)/mc, initial: first sample of output temperature_1}
  heat_2: {symbol: T2, unit: K, derivative: (U*A*(Ta - T2) - between + a2*Q2)/mc, initial: first sample of output temperature_2}
  sensor_1: {symbol: Tc1, unit: K, derivative: (T1 - Tc1)/tau, initial: first sample of output temperature_1}
  sensor_2: {symbol: Tc2, unit: K, derivative: (T2 - Tc2)/tau, initial: first sample of output temperature_2}
outputs:
  temperature_1: {unit: K, expression: Tc1}
  temperature_2: {unit: K, expression: Tc2}
`;

// The engineer writes the equations of the plant instead of choosing a model.
export async function lab(hands) {
  if (!LAB) {
    console.log("  left out: LAB names no recording");
    return null;
  }
  const person = await begun(hands, LAB);
  await person.step("own equations written and kept", async () => {
    await person.press("Write your own equations");
    await person.writeEquations(LAB_MODEL);
    await person.sees("No fault");
    await person.sees("measured and simulated");
    await person.press("Keep this model");
    await person.sees("The job can start.");
  });
  await person.step("the job started, until its verdict", async () => {
    await started(person);
    tell(await verdictOn(person.page));
  });
  await person.step("the report, printed", () => report(person, "temperature lab"));
  return person;
}
