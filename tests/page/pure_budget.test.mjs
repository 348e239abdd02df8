// The tests call the parts of the page that sum up what is taken as known, and those that write units, zones and names of
// models, without a page. They run with `node --test tests/page/pure_budget.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/${name}`, import.meta.url));
const { budgetBars, placedParts, shareText, sorted } = await part("job/budget.js");
const { mattering, unknownsText } = await part("new/preflight.js");
const { assumptionWords, instantText, modelText, quantity, timeSpan, unitSigns, unitText, zoneName } =
  await part("shell/format.js");

// The budget of two parameters: eleven assumptions, of which the last makes up for another.
const TOGETHER = "assumption 0 40 %, assumption 10 −5 %";
const BUDGET = {
  parameters: [
    { name: "mass", unit: "kg", standard_error: 3, total_standard_error: 5 },
    { name: "friction", unit: "N", standard_error: 1, total_standard_error: 2 },
    { name: "gain", unit: "1", standard_error: 1, total_standard_error: null },
  ],
  budget: Array.from({ length: 11 }, (_, k) => {
    const share = k === 10 ? -0.05 : k === 0 ? 0.4 : 0.02 + 0.001 * k;
    const contributions = { mass: { share, standard_error: 1, total_if_better: 2 } };
    return { assumption: `assumption_${k}`, value: 1, tolerance: 1, unit: "1", contributions };
  }),
};

test("the parts of each bar of the budget sum to a hundred per cent, and the rest is named", () => {
  const { bars, sources } = budgetBars(BUDGET);
  assert.deepEqual(
    bars.map(({ key }) => key),
    ["mass", "friction"],
  );
  for (const { parts } of bars) {
    assert.ok(Math.abs(parts.reduce((sum, { share }) => sum + share, 0) - 1) < 1e-12);
  }
  const [mass, friction] = bars;
  assert.equal(mass.parts[0].share, 9 / 25);
  // The assumption below zero is summed with the one that it makes up for, so that no part is below zero.
  assert.ok(mass.parts.every(({ share }) => share > 0));
  const [, together] = mass.parts;
  assert.deepEqual([together.look, together.members], ["source-0 summed", TOGETHER]);
  assert.ok(Math.abs(together.share - 0.35) < 1e-12);
  const rest = mass.parts.find(({ look }) => look === "rest");
  assert.equal(rest.detail, "assumption 1 2.1 %");
  assert.deepEqual(
    friction.parts.map(({ look, share }) => [look, share]),
    [
      ["noise", 0.25],
      ["beside", 0.75],
    ],
  );
  assert.equal(sources.length, 12);
});

test("a share below zero that cannot be seen is summed with the remaining assumptions", () => {
  const [first, second, last] = [0.5, 0.004, -0.003].map((share, k) => ({ assumption: `a${k}`, share }));
  const { together, alone, rest } = sorted([first, second, last], [first, second], ({ share }) => share);
  assert.deepEqual([together, alone, rest], [[], [first], [last, second]]);
});

test("an assumption about a part of a model is named in words", () => {
  assert.equal(assumptionWords("wall.quadratic_loss"), "quadratic loss of wall");
  assert.equal(assumptionWords("input_delay"), "input delay");
});

test("a share below zero stands left of zero", () => {
  assert.deepEqual(placedParts([{ share: 0.75 }, { share: -0.25 }, { share: 0.5 }]), [
    { from: 0, to: 0.75 },
    { from: -0.25, to: 0 },
    { from: 0.75, to: 1.25 },
  ]);
  assert.equal(shareText(0.4137), "41.4 %");
  assert.equal(shareText(-0.0012), "−0.12 %");
});

test("initial states are told apart from the parameters among the unknowns", () => {
  const mass = { name: "mass", unit: "kg" };
  const position = { name: "position", unit: "m", experiment: 0 };
  assert.equal(unknownsText(2, [mass, position]), "2, of which 1 is the start of a state");
  assert.equal(unknownsText(1, [{ ...mass, experiment: null }]), "1");
  const second = { name: "mass[1]", unit: "kg", experiment: 1 };
  assert.equal(unknownsText(3, [mass, second, position]), "3, of which 1 is the start of a state");
});

test("what is taken as known matters where a parameter would be known better with it", () => {
  const errors = (mass, friction) => ({
    mass: { share: 40, total_if_better: mass },
    friction: { share: -3, total_if_better: friction },
  });
  const budget = [
    { assumption: "force.input_gain", contributions: errors(0.2, 1) },
    { assumption: "input_delay", contributions: errors(1, 0.97) },
  ];
  const predictions = [
    { name: "mass", unit: "kg" },
    { name: "friction", unit: "N*s/m" },
  ];
  assert.deepEqual(mattering(budget, predictions), [
    "input gain of force: known five times better, mass comes to ± 0.2\u00a0kg in place of ± 1\u00a0kg",
  ]);
  assert.deepEqual(mattering([], predictions), []);
});

test("units are written with dots and raised numbers", () => {
  assert.equal(unitSigns("kg*m^2"), "kg·m²");
  assert.equal(unitSigns("W/(m^2*K)"), "W/(m²·K)");
  assert.equal(quantity("3", "N*s/m"), "3\u00a0N·s/m");
  assert.deepEqual(["1", "-", "", null, "m^-1"].map(unitText), ["–", "–", "–", "–", "m⁻¹"]);
});

test("the name of a model has the begin of the digest of its equations", () => {
  assert.equal(modelText("positioning_drive"), "positioning drive");
  assert.equal(modelText("oven@cfa38899ce62004f"), "oven @cfa3");
});

test("an instant and a span say their zone", () => {
  const date = new Date("2026-03-02T08:00:00Z");
  const zone = zoneName(date);
  assert.match(zone, /^(UTC|GMT|[A-Z]{3,4})/);
  assert.ok(instantText(date).endsWith(` ${zone}`));
  assert.ok(timeSpan("2026-03-02T08:00:00Z", "2026-03-02T09:00:00Z").endsWith(` ${zone}`));
  assert.equal(timeSpan(null, null), "–");
});
