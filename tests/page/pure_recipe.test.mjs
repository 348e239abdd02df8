// The tests call the parts of the page about recipes that need no page. They run with `node --test
// tests/page/pure_recipe.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const { draftsOf, equationNames, faultsOfDrafts, KINDS, recipeOf, signalsAt, signalToShow, stepOf } =
  await import(new URL("../../src/dashboard/assets/data/recipe.js", import.meta.url));

const RECORDED = ["command", "PT 101.PV", "pi"];
const STEPS = [
  { step: "cut", from_s: 2.5 },
  {
    step: "calculate",
    signal: "head",
    unit: "m",
    equation: "s2/9810 + command",
    names: { s2: "PT 101.PV" },
  },
  { step: "remove", signals: ["PT 101.PV"] },
  { step: "resample", sample_time_s: 0.5, held: ["command"] },
  { step: "detrend", trend: "slope" },
];

test("steps become drafts, and drafts the same steps again", () => {
  const drafts = draftsOf(STEPS, RECORDED);
  const again = drafts.map((draft, k) => stepOf(draft, signalsAt(RECORDED, drafts.slice(0, k))));
  assert.deepEqual(again, STEPS);
});

test("an equation names a signal that the language cannot write, and no signal that it does not use", () => {
  assert.deepEqual(
    [...equationNames(RECORDED)],
    [
      ["command", "command"],
      ["s2", "PT 101.PV"],
      ["s3", "pi"],
    ],
  );
  const draft = (equation) => ({ step: "calculate", texts: { signal: "x", equation }, signals: [] });
  assert.deepEqual(stepOf(draft("s3*command"), RECORDED).names, { s3: "pi" });
  assert.equal(stepOf(draft("command"), RECORDED).names, undefined);
  // The name of the form must not be that of another signal.
  assert.deepEqual([...equationNames(["s2", "a b"]).keys()], ["s2", "s2_"]);
  const foreign = draftsOf([{ ...STEPS[1], equation: "p/9810", names: { p: "PT 101.PV" } }], RECORDED);
  assert.equal(foreign[0].texts.equation, "s2/9810");
});

test("signals that a step makes are there for the steps after it, and signals that it leaves out are not", () => {
  const drafts = draftsOf(STEPS, RECORDED);
  assert.deepEqual(signalsAt(RECORDED, drafts.slice(0, 2)), [...RECORDED, "head"]);
  assert.deepEqual(signalsAt(RECORDED, drafts), ["command", "pi", "head"]);
});

test("numbers are read as people write them, and texts that are none are told at their fields", () => {
  const draft = { step: "low_pass", texts: { cutoff_hz: "0,5" }, signals: [] };
  assert.deepEqual(stepOf(draft, RECORDED), { step: "low_pass", cutoff_hz: 0.5 });
  assert.deepEqual(faultsOfDrafts([draft]), []);
  const wrong = { ...draft, texts: { cutoff_hz: "five" } };
  assert.deepEqual(
    faultsOfDrafts([draft, wrong]).map(({ pointer }) => pointer),
    ["/steps/1/cutoff_hz"],
  );
  // Without signals the server is asked, which says that some are needed.
  assert.deepEqual(stepOf({ step: "remove", texts: {}, signals: [] }, RECORDED).signals, []);
  assert.ok(!("held" in stepOf({ step: "resample", texts: {}, signals: [] }, RECORDED)));
});

test("a preview begins with the last signal that a step makes or is about, where it is left", () => {
  const drafts = draftsOf(STEPS, RECORDED);
  assert.equal(signalToShow(RECORDED, drafts), "command");
  assert.equal(signalToShow(RECORDED, drafts.slice(0, 2)), "head");
  assert.equal(
    signalToShow(RECORDED, draftsOf([{ step: "remove", signals: ["command"] }], RECORDED)),
    "PT 101.PV",
  );
  assert.equal(signalToShow(RECORDED, []), "command");
});

test("a prepared recording says what it was made of", () => {
  const options = { dataset: "ds_1", version: "2", steps: JSON.stringify(STEPS) };
  const recipe = recipeOf({ source: { format: "prepared", options } });
  assert.deepEqual(recipe, { dataset: "ds_1", version: 2, steps: STEPS });
  assert.equal(recipeOf({ source: { format: "wide_csv", options: {} } }), null);
  assert.ok(Object.values(KINDS).every(({ title }) => title.length > 0));
});
