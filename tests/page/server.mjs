// This module sends the requests of the tests to the server, and makes the drive that the tests are
// about.
//
// GREYBOX_URL names the server.

import assert from "node:assert/strict";

export const base = process.env.GREYBOX_URL;

export async function post(address, body, type = "application/json", headers = {}) {
  const answer = await fetch(base + address, {
    method: "POST",
    headers: { "content-type": type, ...headers },
    body: typeof body === "string" ? body : JSON.stringify(body),
  });
  assert.ok(answer.ok, `${address}: ${answer.status} ${await answer.clone().text()}`);
  return answer.json();
}

// The recording is of a drive that is pushed to and fro, with fixed parameters and a little noise of a
// fixed pattern.
export async function recording() {
  const samples = 600;
  const force = Array.from(
    { length: samples },
    (_, k) => 60 * Math.sign(Math.sin(k / 23)) + 25 * Math.sin(k / 7),
  );
  const { outputs } = await post("/v1/simulations", {
    model: "positioning_drive",
    parameters: { mass: { value: 95 } },
    inputs: { sample_time_s: 0.01, signals: { force: { unit: "N", values: force } } },
  });
  const rows = force.map(
    (value, k) =>
      `${(k * 0.01).toFixed(2)},${value.toFixed(4)},${(outputs.position.values[k] + 2e-5 * (((k * 7919) % 101) / 50 - 1)).toFixed(8)}`,
  );
  return `time [s],drive_force [N],position [m]\n${rows.join("\n")}\n`;
}

export const JOB = (dataset, method) => ({
  name: `drive ${method}`,
  labels: { site: "hall 2" },
  model: "positioning_drive",
  experiments: [{ dataset, signals: { force: "drive_force", position: "position" } }],
  outputs: { position: { noise_std: 2e-5 } },
  method: { name: method, population: 12, generations: 10 },
  validation: { fraction: 0.25 },
  seed: 1,
});

// The design is an experiment for the drive.
const DESIGN = {
  model: "positioning_drive",
  parameters: {
    mass: { estimate: {}, prior: { mean: 95, std: 10 } },
    viscous_friction: { estimate: {}, prior: { mean: 200, std: 50 } },
  },
  initial_state: { position: 0, velocity: 0 },
  outputs: { position: { noise_std: 1e-4 } },
  sensors: { velocity: { noise_std: 1e-3 } },
  inputs: { force: { lower: -100, upper: 100, rate_per_s: 2000 } },
  families: ["steps", "sine"],
  sample_time_s: 0.02,
  duration_s: 2,
  points: 2,
};
export const designJob = () => post("/v1/designs", DESIGN, "application/json", { prefer: "respond-async" });

export async function ended(id) {
  for (;;) {
    const job = await (await fetch(`${base}/v1/jobs/${id}?wait=30`)).json();
    if (["succeeded", "failed", "cancelled"].includes(job.status)) {
      return job;
    }
  }
}
