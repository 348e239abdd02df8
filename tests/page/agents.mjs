// The steps of an agent that writes to a mapping, and of a person who gives the series places.

import assert from "node:assert/strict";
import { labelled, open, PATIENCE, press, says, text } from "./browser.mjs";
import { base } from "./server.mjs";

const LINES = (value, stamp) =>
  [
    `press,hall=2,line=a\\ b position=${value},valve=0.3,state="on" ${stamp}`,
    `oil,hall=2 pressure=${value},grade="Good" ${stamp}`,
  ].join("\n");

// Types a text in the place of the text of a field in a table.
async function retype(page, label, text) {
  const input = await page.waitForSelector(`input[aria-label='${label}']`, PATIENCE);
  await input.evaluate((element) => {
    element.value = "";
  });
  await input.type(text);
}

// Gives the label of the field that is marked as wrong, and the fault beside the field.
async function faultBeside(page) {
  const wrong = await page.waitForSelector(".rule [aria-invalid]", PATIENCE);
  return wrong.evaluate((field) => [
    field.getAttribute("aria-label"),
    document.getElementById(field.getAttribute("aria-describedby")).textContent,
  ]);
}

// Makes a mapping, gives places to the series that come, and looks for the samples in the streams.
export async function placesOfSeries() {
  const mapping = `hall 2 ${Date.now()}`;
  const encoded = encodeURIComponent(mapping);
  const write = async (value, stamp, status = 204) => {
    const target = `${base}/write?precision=s&db=${encoded}`;
    assert.equal((await fetch(target, { method: "POST", body: LINES(value, stamp) })).status, status);
  };
  const page = await open("/#/plant/agents");
  page.on("dialog", (dialog) => dialog.accept());
  await (await labelled(page, "Name, which agents give")).type(mapping);
  await press(page, "Make the mapping");
  await page.waitForFunction((name) => location.hash.endsWith(name), PATIENCE, encoded);
  await says(page, "No such series came");
  const addresses = await text(page, ".facts");
  for (const path of ["/write?db=", "/api/v2/write?bucket=", "/omf/"]) {
    assert.ok(addresses.includes(`${base}${path}${encoded}`), addresses);
  }
  await write(101.2, 1_700_000_000);
  await says(page, "none: a stream has numbers");
  await page.click("[aria-label='Give it a place: press hall=2, line=a b position']");
  await says(page, "1. press, hall=2, line=a b → press-2-a_b: position");
  await press(page, "Give all of them a place");
  await says(page, "1. press, hall=2, line=a b → press-2-a_b: position, valve");
  await says(page, "2. oil, hall=2 → oil-2: pressure");
  await page.click("[aria-label='Earlier: rule 2']");
  await says(page, "1. oil, hall=2 → oil-2: pressure");

  // A fault stands at the field that the server names.
  await retype(page, "Unit of field 1 of rule 2", "furlongs");
  await press(page, "Save the rules");
  const [unit, unitFault] = await faultBeside(page);
  assert.equal(unit, "Unit of field 1 of rule 2");
  assert.match(unitFault, /furlongs/);
  await retype(page, "Unit of field 1 of rule 2", "mm");

  // A field says how good the others are.
  await page.click("[aria-label='Add a field of quality to rule 1']");
  await page.select("[aria-label='Codes of quality of rule 1']", "opc_ua");
  await press(page, "Save the rules");
  const name = "Name of field of quality 1 of rule 1";
  assert.equal((await faultBeside(page))[0], name);
  page.faults.splice(0);
  await retype(page, name, "grade");
  const streams = ["oil", "press"].map((name) => `${name}-${Date.now()}`);
  for (const [k, stream] of streams.entries()) {
    const input = await page.$(`[data-pointer='/rules/${k}/stream'] input`);
    await input.click({ count: 3 });
    await input.type(stream);
  }
  await page.select("[aria-label='Between samples of field 2 of rule 2']", "hold");
  await press(page, "Save the rules");
  await says(page, "The rules are saved");
  const { rules } = await (await fetch(`${base}/v1/mappings/${encoded}`)).json();
  const position = { signal: "position", unit: "mm" };
  assert.deepEqual(rules[1].signals, {
    position,
    valve: { signal: "valve", unit: "", interpolation: "hold" },
  });
  assert.deepEqual(rules[1].tags, { hall: "2", line: "a b" });
  assert.deepEqual(rules[0].quality, { fields: ["grade"], codes: "opc_ua" });
  assert.equal(rules[1].quality, undefined);
  // The quality stays with its rule when the rules are saved for something else.
  await retype(page, "Unit of field 1 of rule 1", "bar");
  await press(page, "Save the rules");
  await page.waitForFunction(
    (address) =>
      fetch(address)
        .then((answer) => answer.json())
        .then((mapping) => mapping.rules[0].signals.pressure.unit === "bar"),
    PATIENCE,
    `/v1/mappings/${encoded}`,
  );
  const kept = await (await fetch(`${base}/v1/mappings/${encoded}`)).json();
  assert.deepEqual(kept.rules[0].quality, { fields: ["grade"], codes: "opc_ua" });

  await write(101.3, 1_700_000_001);
  for (const stream of streams) {
    const address = `${base}/v1/streams/${stream}`;
    const { samples } = await (await fetch(address)).json();
    assert.equal(samples, 1, stream);
    await fetch(address, { method: "DELETE" });
  }
  await press(page, "Remove the mapping");
  await page.waitForFunction(() => location.hash === "#/plant/agents", PATIENCE);
  await write(101.4, 1_700_000_002, 404);
  assert.deepEqual(page.faults, []);
  await page.close();
}

// Makes a mapping with a rule, to which series came that the rule does not name, and gives its name.
export async function mappingWithSeries() {
  const mapping = `accessible-${Date.now()}`;
  const signals = { speed: { signal: "speed", unit: "mm/s" } };
  const quality = { fields: ["grade"], codes: "ignition" };
  const rules = [{ measurement: "press", tags: { hall: "2" }, stream: "press-1", signals, quality }];
  await fetch(`${base}/v1/mappings/${mapping}`, {
    method: "PUT",
    headers: { "content-type": "application/json" },
    body: JSON.stringify({ rules }),
  });
  await fetch(`${base}/write?precision=s&db=${mapping}`, { method: "POST", body: LINES(1, 1_700_000_000) });
  return mapping;
}
