// The tests call the parts of the page about what each unknown moves, and about the names of unknowns, without a page.
// They run with `node --test tests/page/pure_influence.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/${name}`, import.meta.url));
const {
  alikePairs,
  fittedStarts,
  likeness,
  movement,
  ranked,
  rms,
  stepOf,
  unknownsOf,
  valuesOf,
  valuesOfCandidate,
} = await part("job/moves.js");
const { labelOf, statesOf, unknownWords } = await part("job/unknowns.js");
const { remainderOf } = await part("job/budget.js");

const RESULT = {
  parameters: [
    { name: "mass", unit: "kg", estimate: 95, standard_error: 1, total_standard_error: 2 },
    { name: "friction", unit: "N", estimate: 0, standard_error: 0.5, total_standard_error: null },
    { name: "friction", experiment: 1, unit: "N", estimate: 4, standard_error: null },
  ],
  initial_states: [{ state: "speed", experiment: 1, unit: "m/s", estimate: 0.1, standard_error: 0.01 }],
};

test("an experiment is moved by shared parameters, by its own and by its states", () => {
  const names = (...args) => unknownsOf(RESULT, ...args).map(({ label }) => label);
  assert.deepEqual(names(0), ["mass", "friction"]);
  assert.deepEqual(names(1, { friction: { estimate: {} } }), [
    "mass",
    "friction in experiment 2",
    "speed at the start of experiment 2",
  ]);
  assert.equal(unknownsOf(RESULT).length, 4);
  assert.deepEqual(unknownsOf({}), []);
  const starts = { validation_starts: [{ experiment: 2, state: "speed", value: 0.3 }] };
  assert.deepEqual(fittedStarts(starts, 2), { speed: 0.3 });
  assert.deepEqual(fittedStarts(starts, 1), {});
});

test("a step is the total standard error or a hundredth of the value, and where there is none it says why", () => {
  const [mass, friction, later] = unknownsOf(RESULT);
  assert.equal(stepOf(mass, "error").size, 2);
  assert.equal(stepOf(friction, "error").size, 0.5);
  assert.match(stepOf(later, "error").reason, /no standard error/);
  assert.ok(Math.abs(stepOf(mass, "percent").size - 0.95) < 1e-12);
  assert.match(stepOf(friction, "percent").reason, /0, and so is 1 % of it/);
  const moved = valuesOf([mass, friction], mass, 2);
  assert.deepEqual(moved, { values: { mass: 97, friction: 0 }, states: {} });
});

test("lines are compared at the instants that both simulations have", () => {
  const simulated = (time_s, values) => ({ time_s, outputs: { x: { unit: "m", values } } });
  const line = movement(simulated([0, 1, 2, 3], [1, 2, null, 4]), simulated([0, 2, 3], [1.5, 3, 4]), "x");
  assert.deepEqual(line, [0.5, undefined, null, 0]);
  assert.equal(rms(line), Math.sqrt(0.125));
  assert.equal(rms([]), 0);
});

test("unknowns are ranked by their lines, shares sum to one, and rounding moves nothing", () => {
  const base = [300, 300];
  const lines = { small: [1, -1], large: [3, 3], none: [1e-10, 0] };
  const rows = ranked(
    Object.entries(lines).map(([label, line]) => ({ label, line })),
    base,
  );
  assert.deepEqual(
    rows.map(({ label, rms, share }) => [label, rms, share]),
    [
      ["large", 3, 0.9],
      ["small", 1, 0.1],
      ["none", 0, 0],
    ],
  );
  assert.equal(ranked([{ line: [0] }], [1])[0].share, 0);
});

test("lines of the same shape are told, also where either is turned over", () => {
  assert.ok(Math.abs(likeness([1, 2, null], [2, 4, 0]) - 1) < 1e-12);
  assert.equal(likeness([1, 0], [0, 0]), 0);
  const rows = ranked(
    [
      { label: "gain", line: [1, 2, 3] },
      { label: "area", line: [2, 4, 6.01] },
      { label: "loss", line: [-3, -6, -9] },
      { label: "lag", line: [3, -2, 1] },
      { label: "glow", line: [0, 0, 0] },
    ],
    [100],
  );
  const pairs = alikePairs(rows);
  assert.equal(pairs.length, 3);
  assert.deepEqual(pairs.map(({ labels, cosine }) => [...labels].sort().concat(Math.sign(cosine))).sort(), [
    ["area", "gain", 1],
    ["area", "loss", -1],
    ["gain", "loss", -1],
  ]);
});

test("a candidate of the search has its values and starts by the columns", () => {
  const columns = [
    { name: "mass", unit: "kg", experiment: null, state: null },
    { name: "friction", unit: "N", experiment: null, state: null },
    { name: "friction[0]", unit: "N", experiment: 0, state: null },
    { name: "initial_speed", unit: "m/s", experiment: 0, state: "speed" },
    { name: "initial_speed_1", unit: "m/s", experiment: 1, state: "speed" },
  ];
  const candidate = { mass: 90, friction: 1, "friction[0]": 2, initial_speed: 0.1, initial_speed_1: 0.2 };
  assert.deepEqual(valuesOfCandidate(columns, candidate, 0), {
    values: { mass: 90, friction: 2 },
    states: { speed: 0.1 },
  });
  assert.deepEqual(valuesOfCandidate(columns, candidate, 1), {
    values: { mass: 90, friction: 1 },
    states: { speed: 0.2 },
  });
});

test("keys of unknowns are written in words, and experiments are counted from one", () => {
  assert.equal(unknownWords("coulomb_friction[1]"), "coulomb friction in experiment 2");
  assert.equal(unknownWords("initial_speed", ["speed"]), "speed at the start");
  assert.equal(unknownWords("initial_speed_1", ["speed"]), "speed at the start of experiment 2");
  assert.equal(unknownWords("initial_speed_1", ["speed_1", "speed"]), "speed 1 at the start");
  assert.equal(unknownWords("initial_load"), "initial load");
  assert.equal(labelOf({ name: "mass" }), "mass");
  assert.equal(labelOf({ state: "speed", experiment: 0 }), "speed at the start");
  assert.deepEqual(statesOf({ initial_states: [{ state: "x" }, { state: "x" }] }), ["x"]);
});

test("what rounding leaves of a sum is no share of the budget", () => {
  const budget = [{ contributions: { mass: { share: 0.36 - 4e-16 } } }];
  const { noise, beside } = remainderOf(
    { name: "mass", standard_error: 0.8, total_standard_error: 1 },
    budget,
  );
  assert.ok(Math.abs(noise - 0.64) < 1e-12);
  assert.equal(beside, 0);
});
