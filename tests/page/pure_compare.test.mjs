// The tests call the parts of the page that compare jobs of different kinds, without a page. They run with
// `node --test tests/page/pure_compare.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/${name}`, import.meta.url));
const { isOfTheModel, sideBySide } = await part("compare/differences.js");
const { byKind, numbersOf, remark } = await part("compare/kinds.js");

const run = (k, kind, status, result = null, error = null) => ({ k, job: { kind, status, error }, result });

test("a compared job says in words what it is, and why it has no result", () => {
  const said = (...about) => remark(run(0, ...about));
  assert.equal(said("identification", "succeeded", {}), null);
  assert.equal(
    said("identification", "failed", null, { detail: "nothing could be simulated" }),
    "Job 1 failed and has no result: nothing could be simulated.",
  );
  assert.equal(said("identification", "running"), "Job 1 is still at work and has no result.");
  assert.match(
    said("design", "succeeded", {}),
    /^Job 1 is the design of an experiment, which estimates nothing\. .* its best experiment would leave\.$/,
  );
  assert.match(said("selection", "succeeded", {}), /^Job 1 is a selection of windows, .* from its windows/);
  assert.equal(
    said("selection", "queued"),
    "Job 1 is a selection of windows, which estimates nothing; it waits for its turn and has no result.",
  );
});

test("jobs are compared line by line with those of their own kind alone", () => {
  const runs = ["identification", "design", "identification"].map((kind, k) => run(k, kind, "succeeded"));
  assert.deepEqual(
    byKind(runs).map(([kind, members]) => [kind, numbersOf(members)]),
    [
      ["identification", "1 and 3"],
      ["design", "2"],
    ],
  );
});

test("what a design and a selection foretell stands beside the estimates", () => {
  const estimate = { name: "mass", symbol: "M", unit: "kg", estimate: 95, standard_error: 0.1 };
  const error = (unit) => ({ name: "mass", unit, value: 95, total_standard_error: 0.2 });
  const rows = sideBySide([
    { proposals: [{ after: [error("kg")] }, { after: [] }] },
    { parameters: [estimate] },
    { with_chosen: [error("kg")] },
    { parameters: [{ ...estimate, unit: "t" }] },
    null,
  ]);
  assert.deepEqual(
    rows.map(({ key, unit, symbol }) => [key, unit, symbol]),
    [
      ["mass", "kg", "M"],
      ["mass", "t", "M"],
    ],
  );
  assert.deepEqual(rows[0].parameters, [error("kg"), estimate, error("kg"), null, null]);
});

test("lines that name parts of a model are told from others", () => {
  for (const pointer of ["/parameters/mass/value", "/experiments/3/signals/force", "/constraints"]) {
    assert.ok(isOfTheModel(pointer), pointer);
  }
  for (const pointer of ["/model", "/method/name", "/experiments/0/dataset", "/labels/parameters"]) {
    assert.ok(!isOfTheModel(pointer), pointer);
  }
});
