// The numbers of the worked examples are those that the server comes to: each job is taken from the guide as the server
// shows it, and is worked on over the recording that the guide links to.
//
//     GREYBOX_URL=http://127.0.0.1:8080 node --test tests/page/pictures_numbers.test.mjs

import assert from "node:assert/strict";
import test from "node:test";
import { chapters, worked } from "./pictures_examples.mjs";
import { base } from "./server.mjs";

const read = async (address) => {
  const answer = await fetch(base + address);
  assert.ok(answer.ok, `${address}: ${answer.status}`);
  return answer.text();
};

test("every model of the catalogue has a worked example with the numbers that its job comes to", {
  skip: !base && "GREYBOX_URL is not set",
}, async () => {
  const examples = chapters(await read("/docs/examples.md"));
  const { items } = JSON.parse(await read("/v1/models"));
  const catalogue = items.map(({ name }) => name).filter((name) => !name.includes("@"));
  assert.deepEqual(examples.map(({ job }) => job.model).sort(), catalogue.sort());
  for (const { job, estimates } of examples) {
    const csv = await read(`/docs/recordings/${job.model}.csv`);
    const { result } = await worked(job, csv);
    assert.deepEqual(
      estimates.map(({ name }) => name),
      result.parameters.map(({ name }) => name),
      job.model,
    );
    for (const [k, { name, truth, estimate, error }] of estimates.entries()) {
      const where = `${name} of ${job.model}`;
      const found = result.parameters[k];
      assert.ok(Math.abs(found.estimate - estimate) <= error, `${where}: ${found.estimate}, not ${estimate}`);
      assert.ok(Math.abs(estimate - truth) <= 4 * error, `${where}: ${estimate} ± ${error} of ${truth}`);
      const ratio = found.total_standard_error / error;
      assert.ok(ratio > 0.8 && ratio < 1.25, `${where}: the total error is ${found.total_standard_error}`);
    }
  }
});
