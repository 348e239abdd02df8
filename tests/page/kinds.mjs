// This module makes jobs of every kind that a result has a form of, each worked off within seconds.

import assert from "node:assert/strict";
import { base, designJob, disturbedJob, ended, JOB, post, recording } from "./server.mjs";

// The oven is linear. Efficiency and coupling stand in a product alone, so that their data fix the product and neither
// by itself; the glow acts on nothing.
const OVEN = {
  name: "oven",
  title: "Oven with a sensor on its wall",
  inputs: { power: { unit: "W" } },
  parameters: {
    efficiency: { unit: "1", default: 0.8, lower: 0.2, upper: 1, unknown: true },
    coupling: { unit: "1", default: 1, lower: 0.5, upper: 2 },
    glow: { unit: "W", default: 2, lower: 1, upper: 3 },
    conductance: { unit: "W/K", default: 5, lower: 1, upper: 20 },
    capacity: { unit: "J/K", default: 500, lower: 100, upper: 2000, unknown: true },
    lag: { unit: "s", default: 20, lower: 1, upper: 100, unknown: true },
  },
  states: {
    wall: {
      unit: "K",
      derivative: "(efficiency*coupling*power + 0*glow - conductance*(wall - 293.15))/capacity",
      initial: 293.15,
    },
    sensor: { unit: "K", derivative: "(wall - sensor)/lag", initial: 293.15 },
  },
  outputs: {
    wall_temperature: { unit: "K", expression: "wall" },
    sensor_temperature: { unit: "K", expression: "sensor" },
  },
};
const OVEN_SAMPLES = 300;
const OVEN_POWER = Array.from({ length: OVEN_SAMPLES }, (_, k) => (k >= 20 && k < 160 ? 400 : 0));
const START = "2026-03-02T08:00:00Z";

// The recording of the oven is in degrees Celsius, has a time of day, and begins 4 K above the air around the oven.
async function ovenRecording() {
  const { outputs } = await post("/v1/simulations", {
    model: OVEN,
    inputs: { sample_time_s: 2, signals: { power: { unit: "W", values: OVEN_POWER } } },
    parameters: { efficiency: { value: 0.8 }, capacity: { value: 500 }, lag: { value: 20 } },
    initial_state: { wall: { value: 297.15 }, sensor: { value: 297.15 } },
  });
  const read = (name, k) =>
    (outputs[name].values[k] - 273.15 + 0.02 * (((k * 7919) % 101) / 50 - 1)).toFixed(4);
  const rows = OVEN_POWER.map((power, k) => {
    const instant = new Date(Date.parse(START) + 2000 * k).toISOString();
    return `${instant},${power},${read("wall_temperature", k)},${read("sensor_temperature", k)}`;
  });
  const titles = "time,power [W],wall_temperature [degC],sensor_temperature [degC]";
  return (await post("/v1/datasets?name=oven", `${titles}\n${rows.join("\n")}\n`, "text/csv")).id;
}

const METHOD = { name: "cma_es", population: 10, generations: 10 };

// The temperatures of the oven at its start are unknown.
function ovenJob(dataset, change) {
  const start = { estimate: { lower: 280, upper: 320 } };
  return {
    model: OVEN,
    experiments: [{ dataset, initial_state: { wall: start, sensor: start } }],
    outputs: { wall_temperature: { noise_std: 0.012 }, sensor_temperature: { noise_std: 0.012 } },
    process_noise: "none",
    method: METHOD,
    seed: 1,
    ...change,
  };
}

/** The job whose line of each unknown is known in closed form. */
export async function productJob() {
  const id = await ovenRecording();
  return submitted(
    ovenJob(id, {
      name: "product",
      parameters: {
        efficiency: { estimate: {}, prior: { mean: 0.8, std: 0.05 } },
        coupling: { estimate: {}, prior: { mean: 1, std: 0.1 } },
        glow: { estimate: {}, prior: { mean: 2, std: 0.2 } },
      },
    }),
  );
}

async function submitted(job) {
  const { id } = await post("/v1/jobs", job);
  return id;
}

// A line of a lag whose input moves in every third window, and the selection of the windows that say most.
async function selectionJob() {
  const stream = `line-${Date.now()}`;
  const window = 60;
  let level = 2;
  const rows = Array.from({ length: 9 * window }, (_, k) => {
    const part = Math.floor(k / window);
    const u = part % 3 === 1 && Math.floor((k % window) / 15) % 2 === 1 ? 1.5 + 0.1 * part : 1;
    const read = (level + 0.01 * Math.sin(7.3 * k)).toFixed(3);
    level = 2 * u + Math.exp(-0.2) * (level - 2 * u);
    return `${new Date(Date.parse(START) + 1000 * k).toISOString()},${u},${read}`;
  });
  await post(`/v1/streams/${stream}`, `time,u [-],y [-]\n${rows.join("\n")}\n`, "text/csv");
  const part = { from: START, to: new Date(Date.parse(START) + 3000 * window).toISOString() };
  const { id: dataset } = await post(`/v1/streams/${stream}/recordings`, part);
  const job = await submitted({
    name: "lag",
    model: "first_order_dead_time",
    experiments: [{ dataset, initial_state: { lagged: { value: 2 } } }],
    parameters: {
      gain: { estimate: { lower: 1, upper: 4 } },
      time_constant: { estimate: {} },
      dead_time: { value: 0 },
      offset: { value: 0 },
    },
    method: { name: "multistart_lm", population: 8, generations: 2, further_searches: 0 },
    process_noise: "none",
    validation: { fraction: 0 },
    seed: 1,
  });
  assert.equal((await ended(job)).status, "succeeded");
  const { id } = await post("/v1/selections", {
    job,
    stream,
    window_s: window,
    wanted: ["time_constant"],
    budget_samples: 2 * window,
    initial_state: { lagged: { estimate: { lower: 0, upper: 6 } } },
  });
  return id;
}

const driveJob = (drive, change) =>
  submitted({ ...JOB(drive, "cma_es"), process_noise: "none", method: METHOD, ...change });

const driveRecording = async () => (await post("/v1/datasets?name=drive", await recording(), "text/csv")).id;

/** The job of three experiments: the second has a friction of its own, and the third only checks. */
export async function jobWithOwnParameters() {
  const drive = await driveRecording();
  const part = (from_s, to_s, more = {}) => ({
    dataset: drive,
    signals: { force: "drive_force", position: "position" },
    window: { from_s, to_s },
    ...more,
  });
  return driveJob(drive, {
    name: "three experiments",
    experiments: [
      part(0, 2),
      part(2, 4, { parameters: { coulomb_friction: { estimate: {} } } }),
      part(4, 5.9, { role: "validation" }),
    ],
  });
}

/**
 * The job of a lag of the unit 1 that goes to and fro many times. Its window is given by instants, and it does without
 * samples that a version of the recording marks, and without those that it names itself.
 */
export async function jobWithSamplesLeftOut() {
  let level = 2;
  const rows = Array.from({ length: 2000 }, (_, k) => {
    const u = 1 + 0.5 * Math.sign(Math.sin(0.15 * k + 0.05)) * (1 + 0.2 * Math.sin(k / 900));
    const read = (level + 0.01 * (((k * 7919) % 101) / 50 - 1)).toFixed(4);
    level = 2 * u + Math.exp(-0.1) * (level - 2 * u);
    return `${new Date(Date.parse(START) + 10 * k).toISOString()},${u.toFixed(4)},${read}`;
  });
  const csv = `time,u [-],y [-]\n${rows.join("\n")}\n`;
  const { id: dataset } = await post("/v1/datasets?name=to%20and%20fro", csv, "text/csv");
  await post(`/v1/datasets/${dataset}/versions`, {
    based_on: 0,
    marks: [{ from_s: 7.25, to_s: 7.75, signals: ["y"], reason: "plug 3 was loose" }],
  });
  const instant = (seconds) => new Date(Date.parse(START) + 1000 * seconds).toISOString();
  return submitted({
    name: "to and fro",
    note: "Measured with 2 amplifiers.",
    model: "first_order_dead_time",
    experiments: [
      {
        dataset,
        window: { from: instant(1.5), to: instant(18.5) },
        exclude: { classes: ["spike"], spans: [{ from_s: 10.125, to_s: 10.625 }] },
        initial_state: { lagged: { estimate: { lower: 0, upper: 6 } } },
      },
    ],
    parameters: {
      gain: { estimate: { lower: 1, upper: 4 } },
      time_constant: { estimate: { lower: 0.01, upper: 1 } },
      dead_time: { value: 0 },
      offset: { value: 0, tolerance: 0.01 },
    },
    method: METHOD,
    process_noise: "none",
    seed: 1,
  });
}

/**
 * Submits a job of each kind, and gives their ids by the kind once all have succeeded.
 *
 * @returns {Promise<Record<string, string>>}
 */
export async function jobsOfAllKinds() {
  const drive = await driveRecording();
  const oven = await ovenRecording();
  const jobs = {
    "low trust": driveJob(drive, { outputs: { position: { noise_std: 2e-7 } } }),
    "at a bound": driveJob(drive, { parameters: { mass: { estimate: { lower: 10, upper: 60 } } } }),
    "bound by a constraint": driveJob(drive, { constraints: ["mass <= 90"] }),
    "two outputs and initial states": submitted(ovenJob(oven, { name: "two outputs" })),
    "model search": driveJob(drive, { model_search: { effects: ["coulomb_friction", "input_delay"] } }),
    selection: selectionJob(),
    design: designJob().then(({ id }) => id),
    "several experiments": jobWithOwnParameters(),
    "process noise": disturbedJob().then(({ id }) => id),
    posterior: driveJob(drive, { uncertainty: { intervals: "posterior", posterior_generations: 500 } }),
    "profile and Monte Carlo": driveJob(drive, {
      uncertainty: { intervals: "profile", monte_carlo_samples: 100 },
    }),
  };
  /** @type {Record<string, string>} */
  const ids = {};
  for (const [kind, submission] of Object.entries(jobs)) {
    ids[kind] = await submission;
  }
  for (const [kind, id] of Object.entries(ids)) {
    const { status, error } = await ended(id);
    assert.equal(status, "succeeded", `${kind}: ${JSON.stringify(error)}`);
  }
  return ids;
}

export const api = async (address) => (await fetch(base + address)).json();
