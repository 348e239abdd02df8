// The test calls what writes the request of a simulation. It runs with `node --test
// tests/page/pure_simulation.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const { simulationOf } = await import(
  new URL("../../src/dashboard/assets/model/request.js", import.meta.url)
);

test("an experiment is simulated with its own numbers and starts, and with the estimates that it shares", () => {
  const spec = {
    model: "positioning_drive",
    parameters: { mass: { estimate: { lower: 1, upper: 9 } }, offset: { value: 2 } },
    experiments: [
      {
        dataset: "ds_1",
        signals: { force: "F" },
        initial_state: { velocity: 0, position: { estimate: {} } },
      },
      { dataset: "ds_2", parameters: { mass: { value: 7 }, offset: { value: 3 } }, window: { from_s: 1 } },
    ],
  };
  const [shared, separate] = [0, 1].map((k) => simulationOf(spec, k, { mass: 5 }, { position: 0.5 }));
  assert.deepEqual(shared.parameters, { offset: { value: 2 }, mass: { value: 5 } });
  assert.deepEqual(shared.initial_state, { velocity: 0, position: 0.5 });
  assert.deepEqual(separate.parameters, { offset: { value: 3 }, mass: { value: 7 } });
  assert.deepEqual(separate.window, { from_s: 1 });
});
