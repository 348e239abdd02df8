// A plant engineer brings an export of a historian as such exports are: local times over the night in which an hour comes
// twice, without a zone, with rows that are missing, spikes, a number for missing values, a column of states, °C and bar,
// semicolons and decimal commas. The export comes from a simulation, so that the true parameters are known.

import fs from "node:fs";
import os from "node:os";
import path from "node:path";
import { PATIENCE } from "./browser.mjs";
import { Person } from "./person.mjs";
import { report, started, tell, verdictOn } from "./roles_engineer.mjs";
import { post } from "./server.mjs";

const TRUTH = { mass: 24.5, transfer: 910, loss: 35 };
const STEP_S = 10;
const ROWS = 1800;
const [SPIKES, GAP, BAD] = [
  [310, 905, 1402],
  [640, 676],
  [1000, 1006],
];
// The clock of the plant is put back in this night, at 1:00 of universal time.
const BEGIN = Date.UTC(2026, 9, 24, 22);
const BACK = Date.UTC(2026, 9, 25, 1);

// The rows of the export have the plant's own time: two hours before universal time in summer, one in winter.
function localTime(instant) {
  const local = new Date(instant + (instant < BACK ? 2 : 1) * 3_600_000);
  const two = (value) => String(value).padStart(2, "0");
  const date = `${two(local.getUTCDate())}.${two(local.getUTCMonth() + 1)}.${local.getUTCFullYear()}`;
  return `${date} ${two(local.getUTCHours())}:${two(local.getUTCMinutes())}:${two(local.getUTCSeconds())}`;
}

// Each run has another noise, so that the server does not know the recording from a run before.
const RUN = Date.now() % 1009;
const noise = (k, factor) => ((((k + RUN) * factor) % 1009) / 1009 - 0.5) * Math.sqrt(12);

async function historianExport() {
  const each = (value) => Array.from({ length: ROWS }, (_, k) => value(k));
  const flow = each((k) => Number((0.5 + 0.25 * Math.sign(Math.sin(k / 23))).toFixed(3)));
  const inlet = each((k) => Number((15 + 4 * Math.sin(k / 140)).toFixed(2)));
  const heating = each((k) => Number((70 + 8 * Math.sign(Math.sin(k / 61))).toFixed(2)));
  const kelvin = (values) => values.map((value) => value + 273.15);
  const { outputs } = await post("/v1/simulations", {
    model: "heat_exchanger",
    parameters: Object.fromEntries(Object.entries(TRUTH).map(([name, value]) => [name, { value }])),
    initial_state: { temperature: 303.15 },
    inputs: {
      sample_time_s: STEP_S,
      signals: {
        flow: { unit: "kg/s", values: flow },
        inlet_temperature: { unit: "K", values: kelvin(inlet) },
        heating_temperature: { unit: "K", values: kelvin(heating) },
      },
    },
  });
  const german = (value, digits) => value.toFixed(digits).replace(".", ",");
  const outlet = outputs.outlet_temperature.values.map((value, k) =>
    SPIKES.includes(k) ? 150 : value - 273.15 + 0.05 * noise(k, 7919),
  );
  const rows = each((k) =>
    [
      localTime(BEGIN + 1000 * STEP_S * k),
      german(flow[k], 3),
      german(inlet[k], 2),
      german(heating[k], 2),
      german(outlet[k], 2),
      k % 250 === 17 ? "-9999" : german(2.4 + 0.02 * noise(k, 4733), 3),
      k >= BAD[0] && k < BAD[1] ? "Bad" : "Good",
    ].join(";"),
  ).filter((_, k) => k < GAP[0] || k >= GAP[1]);
  const titles =
    "Zeitstempel;FIC101 Durchfluss [kg/s];TI101 Zulauf [°C];TI102 Heizung [°C];TI103 Ablauf [°C];PI101 Vordruck [bar];Status";
  const file = path.join(fs.mkdtempSync(path.join(os.tmpdir(), "historian-")), "WT1 Nacht.csv");
  fs.writeFileSync(file, `${titles}\n${rows.join("\n")}\n`);
  return file;
}

const SIGNALS = [
  ["flow [kg/s]", "FIC101"],
  ["inlet temperature [K]", "TI101"],
  ["heating temperature [K]", "TI102"],
  ["outlet temperature [K]", "TI103"],
];

const textOf = (page, part) => page.$eval(part, (element) => element.innerText.replace(/\s+/g, " "));

export async function plant(hands) {
  const file = await historianExport();
  const person = await Person.at("/#/", hands);
  const { page } = person;
  await person.step("where recordings are", () => person.press("Datasets", "Pages"));
  await person.step("the file chosen, its first rows read", async () => {
    await person.give("Recording: choose a file", file);
    await person.sees("Each row holds");
  });
  await person.step("the zone that the server asks for", async () => {
    await person.type("Time zone of its clock", "Europe/Berlin");
    await page.waitForFunction(() => !document.body.innerText.includes("would be refused"), PATIENCE);
  });
  console.log(`    told before the upload: ${await textOf(page, ".first-rows > div:last-child")}`);
  await person.step("uploaded, and the recording opened", async () => {
    await person.press("Upload");
    await person.sees("Stored:");
    await person.press("WT1 Nacht", "Stored:");
    await person.sees("Samples");
  });
  await person.step("the gap looked at", () => person.press("Show: gap", "Quality"));
  await person.step("the spikes marked as bad", async () => {
    await person.press("Mark", "spikes in TI103");
    await person.press("Save", "Mark as bad");
    await person.sees("Version 1");
  });
  await person.step("a window behind the gap", async () => {
    await person.press("All", "Part that is shown");
    await person.choose("Dragging across a plot", "to estimate from");
    await person.drag("TI103 Ablauf", 0.4, 0.95);
    await person.sees("New job with this window");
  });
  await person.step("a new job with this window, the model chosen", async () => {
    await person.press("New job with this window");
    await person.press("Heat exchanger", "Model");
    await person.sees("What the model sees");
  });
  await person.step("the signals put right", async () => {
    for (const [signal, tag] of SIGNALS) {
      const field = await person.control(signal, "select", "");
      const isRight = await field.evaluate((list, tag) => list.selectedOptions[0].text.startsWith(tag), tag);
      isRight || (await person.choose(signal, tag));
    }
    await person.sees("The job can start.");
  });
  await person.step("the job started, until its verdict", async () => {
    await started(person);
    tell(await verdictOn(page));
  });
  const words = await person.step("the report, printed", () => report(person, "heat exchanger"));
  console.log(
    `    true values: ${JSON.stringify(TRUTH)}; the report names the marks: ${words.includes("spikes")}`,
  );
  return person;
}
