// This module sends the requests of the tests to the server, and makes the drive that the tests are
// about.
//
// GREYBOX_URL names the server.

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import fs from "node:fs";
import os from "node:os";
import path from "node:path";

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
export const designJob = (more = {}) =>
  post("/v1/designs", { ...DESIGN, ...more }, "application/json", { prefer: "respond-async" });

// The rig is a mass on a spring, on which a load of 12 N stands from 4 s to 7 s that nobody records.
const RIG = {
  name: "rig",
  title: "Mass on a spring",
  inputs: { force: { unit: "N" } },
  parameters: {
    mass: { unit: "kg", default: 10, lower: 5, upper: 20, unknown: true },
    damping: { unit: "N*s/m", default: 20, lower: 1, upper: 100 },
    stiffness: { unit: "N/m", default: 1000, lower: 500, upper: 2000, unknown: true },
    load: { unit: "N", default: 0, lower: -50, upper: 50, scale: "linear" },
  },
  states: {
    x: { unit: "m", derivative: "v", initial: 0 },
    v: { unit: "m/s", derivative: "(force + load - damping*v - stiffness*x)/mass", initial: 0 },
  },
  outputs: { position: { unit: "m", expression: "x" } },
};

export async function disturbedJob() {
  const [force, position] = [[], []];
  let [x, v] = [0, 0];
  for (let sample = 0; sample < 500; sample += 1) {
    const push = Math.floor(sample / 7) % 3 === 0 ? 10 : -10;
    const load = sample >= 200 && sample < 350 ? 12 : 0;
    force.push(push);
    position.push(x + 1.7e-4 * (((sample * 7919) % 101) / 50 - 1));
    for (let step = 0; step < 100; step += 1) {
      v += 2e-5 * (push + load - 20 * v - 1000 * x);
      x += 2e-4 * v;
    }
  }
  const signals = { force: { unit: "N", values: force }, position: { unit: "m", values: position } };
  const dataset = await post("/v1/datasets?name=rig", { sample_time_s: 0.02, signals });
  const noise = { acts_on: { parameter: "load" }, kind: "memory", std: 3, time_constant_s: 2 };
  return post("/v1/jobs", {
    name: "rig with a load",
    model: RIG,
    experiments: [{ dataset: dataset.id }],
    outputs: { position: { noise_std: 1e-4 } },
    process_noise: [noise],
    method: { population: 12, generations: 10 },
    validation: { fraction: 0.2 },
    seed: 1,
  });
}

export async function ended(id) {
  for (;;) {
    const job = await (await fetch(`${base}/v1/jobs/${id}?wait=30`)).json();
    if (["succeeded", "failed", "cancelled"].includes(job.status)) {
      return job;
    }
  }
}

// Starts a server with a database of its own, and answers once it listens. `database` is for the commands of the
// program.
export async function ownServer(program) {
  const folder = fs.mkdtempSync(path.join(os.tmpdir(), "greybox-"));
  const database = `sqlite://${path.join(folder, "greybox.db")}`;
  const settings = ["serve", "--listen=127.0.0.1:0", `--database=${database}`, "--log=warn"];
  const server = spawn(program, settings, { stdio: ["ignore", "pipe", "inherit"] });
  const ending = new Promise((resolve) => server.once("exit", resolve));
  const stop = async () => {
    server.kill();
    await ending;
    fs.rmSync(folder, { recursive: true });
  };
  const address = await new Promise((resolve, reject) => {
    let text = "";
    server.stdout.on("data", (part) => {
      text += part;
      const [url] = /http:\/\/127\.0\.0\.1:\d+/.exec(text) ?? [];
      url && resolve(url);
    });
    server.once("exit", (code) => reject(new Error(`the server ended with ${code}`)));
  });
  return { address, database, stop };
}
