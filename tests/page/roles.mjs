// This program plays people who use the page for the first time, from what they bring to what they leave with, and prints
// how many clicks, keys and seconds each step takes. Its figures are read, not asserted, since machines differ.
//
//   GREYBOX_URL=… PAGE_TOOLS=… node tests/page/roles.mjs [engineer] [plant] [operator] [lab]
//
// GREYBOX_URL names a server, PAGE_TOOLS a folder with puppeteer-core and axe-core in its node_modules, CHROMIUM the
// browser. HANDS is "mouse" or "keys": with "keys" the engineer and the plant engineer have a keyboard alone. SERVO names
// the recording of a servo axis with the columns force and position, LAB that of a temperature lab; a role without its
// recording is left out. GREYBOX_PROGRAM names the program that makes tokens. PDF names a folder for the reports.

import { launch } from "./browser.mjs";
import { engineer, lab } from "./roles_engineer.mjs";
import { operator } from "./roles_operator.mjs";
import { plant } from "./roles_plant.mjs";

const ROLES = { engineer, lab, plant, operator };
const chosen = process.argv.slice(2);
const { browser } = await launch();
for (const [name, play] of Object.entries(ROLES)) {
  if (chosen.length === 0 || chosen.includes(name)) {
    console.log(`\n${name}${" ".repeat(Math.max(1, 62 - name.length))} clicks  keys  seconds`);
    const person = await play(process.env.HANDS === "keys" ? "keys" : "mouse");
    if (person) {
      // A server that asks for a token refuses what was asked without one.
      for (const fault of person.page.faults.filter((text) => !/^asked|401/.test(text))) {
        person.stumble(`an error of the page: ${fault}`);
      }
      console.log(`  ${name}, in all: ${person.sum()}; ${person.stumbles.length} stumbles`);
      await person.close();
    }
  }
}
await browser.close();
