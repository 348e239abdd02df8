// The tests call the parts of the page about the draft of a job that need no page. They run with `node --test
// tests/page/pure_draft.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const { withSignal } = await import(new URL("../../src/dashboard/assets/new/draft.js", import.meta.url));

const SPEC = {
  model: "dc_motor",
  experiments: [
    { dataset: "a", signals: { voltage: "u", measured_speed: "n", measured_current: "i" } },
    { dataset: "b", signals: { voltage: "u", measured_speed: "n", measured_current: "i" } },
  ],
  outputs: { measured_speed: { noise_std: 0.5 }, measured_current: { noise_std: 0.02 } },
};

test("an output has its noise as long as an experiment measures it", () => {
  const once = withSignal(SPEC, [0], "measured_current", undefined);
  assert.deepEqual(once.experiments[0].signals, { voltage: "u", measured_speed: "n" });
  assert.deepEqual(once.outputs, SPEC.outputs);
  const never = withSignal(once, [1], "measured_current", undefined);
  assert.deepEqual(never.outputs, { measured_speed: { noise_std: 0.5 } });
  const again = withSignal(never, [0, 1], "measured_current", "current");
  assert.deepEqual(
    again.experiments.map(({ signals }) => signals.measured_current),
    ["current", "current"],
  );
  assert.deepEqual(
    withSignal({ ...SPEC, outputs: undefined }, [0, 1], "measured_speed", undefined).outputs,
    undefined,
  );
});
