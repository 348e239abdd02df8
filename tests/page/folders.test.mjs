// The test holds the folders of the page to imports in a single direction. The router in shell/main.js
// fetches the views of all folders by itself, with import(), and is left out.

import assert from "node:assert/strict";
import fs from "node:fs";
import path from "node:path";
import test from "node:test";
import { fileURLToPath } from "node:url";

const ASSETS = fileURLToPath(new URL("../../src/dashboard/assets/", import.meta.url));

// Each folder may import the folders behind it.
const FOLDERS = ["plant", "job", "new", "data", "compare", "list", "model", "plot", "text", "shell"];
// The guides and the reference are pages by themselves, and the libraries are not ours.
const APART = ["docs", "vendor"];

test("every folder of the page imports only folders behind it", () => {
  const folders = fs.readdirSync(ASSETS);
  assert.deepEqual([...folders].sort(), [...FOLDERS, ...APART].sort());
  const faults = [];
  for (const [rank, folder] of FOLDERS.entries()) {
    for (const file of fs.readdirSync(path.join(ASSETS, folder)).filter((name) => name.endsWith(".js"))) {
      const text = fs.readFileSync(path.join(ASSETS, folder, file), "utf8");
      for (const [, name] of text.matchAll(/ from "\.\.\/([a-z]+)\//g)) {
        if (FOLDERS.indexOf(name) <= rank) {
          faults.push(`${folder}/${file} imports ${name}`);
        }
      }
    }
  }
  assert.deepEqual(faults, []);
});
