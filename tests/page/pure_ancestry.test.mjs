// The tests call what a job says of the job that it follows, without a page. They run with
// `node --test tests/page/pure_ancestry.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/${name}`, import.meta.url));
const { changesOf, criterionChange, criterionWords, followed, moves } = await part("job/ancestry.js");

const RESULT = {
  engine: { dataset_digests: ["sha256:1"] },
  fit: { estimation: { position: { samples: 900 } }, validation: {} },
  criteria: { bic: 100 },
  parameters: [
    { name: "mass", unit: "kg", estimate: 95, standard_error: 0.1, total_standard_error: 0.5, trust: "low" },
  ],
};

test("a prepared job names the job that it follows and draws a new seed", () => {
  const spec = { name: "rig 4 · free friction", seed: 7, labels: { site: "hall 2" }, model: "servo" };
  assert.deepEqual(followed(spec, "Widen the range", "job_1"), {
    name: "rig 4 · widen the range",
    labels: { site: "hall 2", follows: "job_1" },
    model: "servo",
  });
});

test("moves are counted in total errors of the result before", () => {
  const now = {
    ...RESULT,
    criteria: { bic: 88 },
    parameters: [
      { name: "mass", unit: "kg", estimate: 96, standard_error: 0.1 },
      { name: "friction", unit: "N", estimate: 20, standard_error: 1 },
    ],
  };
  const rows = moves(RESULT, now);
  assert.deepEqual(
    rows.map(({ key }) => key),
    ["mass", "friction"],
  );
  assert.equal(rows[0].moved, 2);
  assert.ok(Number.isNaN(rows[1].moved));
  assert.equal(criterionChange(RESULT, now), -12);
});

test("a criterion that hardly changes asks for nothing", () => {
  assert.equal(criterionWords(-23.5), "lower by 23.5: the data ask for the change");
  assert.equal(criterionWords(4.61), "higher by 4.61: the data do not ask for the change");
  assert.match(criterionWords(-4e-7), /^lower by 4·10⁻⁷: too little for the data/);
  assert.match(criterionWords(0), /too little/);
});

test("a job says what it was told otherwise than the job before, and not its seed and its name", () => {
  const before = { name: "a", seed: 1, labels: {}, outputs: { position: { noise_std: null } } };
  const now = {
    name: "b",
    seed: 2,
    labels: { follows: "job_1" },
    outputs: { position: { noise_std: 0.0023951237 } },
  };
  const model = { outputs: [{ name: "position", unit: "m" }] };
  assert.deepEqual(changesOf(before, now, model), ["outputs, position, noise std: – → 0.00239512\u00a0m"]);
  assert.deepEqual(changesOf({ ...before, outputs: {} }, before), []);
  assert.deepEqual(changesOf(before, { ...before, seed: 3, note: "x" }), []);
  assert.deepEqual(changesOf({ model: "servo" }, { model: "servo", validation: { fraction: 0.25 } }), [
    "validation, fraction: – → 0.25",
  ]);
});

test("criteria of other samples, other recordings or a noise model are not compared", () => {
  const change = (part) => criterionChange(RESULT, { ...RESULT, ...part });
  assert.equal(change({}), 0);
  assert.equal(change({ fit: { estimation: { position: { samples: 600 } } } }), null);
  assert.equal(change({ engine: { dataset_digests: ["sha256:2"] } }), null);
  assert.equal(change({ process_noise: { chosen: "white" } }), null);
  assert.equal(change({ criteria: { bic: null } }), null);
});
