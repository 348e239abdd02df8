// This module makes a job for each rule of the verdict that a small simulated recording can raise. Each is a plant
// whose truth is stated, measured with noise that repeats, and a job that looks at it in a way that the rule speaks of.

import { levels, normals, PLANTS, plot, recorded, table } from "./pictures_recordings.mjs";
import { post } from "./server.mjs";

const SAMPLES = 400;
const SAMPLE_TIME = 0.1;
const NOISE = 0.05;

const unknown = (unit, lower, upper, scale = "linear") => ({
  unit,
  default: Math.min(Math.max(1, lower), upper),
  lower,
  upper,
  scale,
  unknown: true,
});

// A lag: the output follows the input times the gain.
const LAG = {
  name: "lag",
  inputs: { u: { unit: "1" } },
  parameters: { gain: unknown("1", 0.1, 3), lag: { symbol: "T", ...unknown("s", 0.05, 5, "log") } },
  states: { x: { unit: "1", derivative: "(gain*u - x)/T", initial: 0 } },
  outputs: { y: { unit: "1", expression: "x" } },
};

// The plant has effects that the lag leaves out: a second lag, an input that is not recorded, and a gain that changes.
const PLANT = {
  name: "plant",
  inputs: { u: { unit: "1" }, load: { unit: "1" }, change: { unit: "1" } },
  parameters: {
    gain: { unit: "1", default: 0.8 },
    lag: { symbol: "T", unit: "s", default: 0.5 },
    second: { symbol: "T2", unit: "s", default: 0.001 },
  },
  states: {
    x: { unit: "1", derivative: "(gain*(1 + change)*u + load - x)/T", initial: 0 },
    z: { unit: "1", derivative: "(x - z)/T2", initial: 0 },
  },
  outputs: { y: { unit: "1", expression: "z" } },
};

const INPUT = levels(2, SAMPLES, { among: [-1, 1], clock: 3 });
// A mass on a spring that rings.
const RING = {
  name: "ring",
  inputs: { u: { unit: "1" } },
  parameters: {
    gain: unknown("1", 0.1, 3),
    damping: { symbol: "d", ...unknown("1/s", 0.05, 5, "log") },
    omega: { symbol: "w", ...unknown("rad/s", 0.5, 30) },
  },
  states: {
    x: { unit: "1", derivative: "v", initial: 0 },
    v: { unit: "1/s", derivative: "w^2*(gain*u - x) - d*v", initial: 0 },
  },
  outputs: { y: { unit: "1", expression: "x" } },
};

async function ringing() {
  const { outputs } = await post("/v1/simulations", {
    model: RING,
    parameters: { gain: 0.8, damping: 0.4, omega: 9 },
    inputs: { sample_time_s: SAMPLE_TIME, signals: { u: { unit: "1", values: INPUT } } },
  });
  const normal = normals(1);
  const y = outputs.y.values.map((value) => value + NOISE * normal());
  return table(SAMPLE_TIME, [
    { name: "u", unit: "1", values: INPUT },
    { name: "y", unit: "1", values: y },
  ]);
}

const constant = (value) => Array.from({ length: SAMPLES }, () => value);

// Simulates the plant, and gives the recording of input and output as CSV.
async function recording({
  u = INPUT,
  load,
  change,
  noise = NOISE,
  memory = 0,
  seed = 1,
  sign = 1,
  ...parameters
}) {
  const signals = { u, load: load ?? constant(0), change: change ?? constant(0) };
  const { outputs } = await post("/v1/simulations", {
    model: PLANT,
    parameters,
    inputs: {
      sample_time_s: SAMPLE_TIME,
      signals: Object.fromEntries(
        Object.entries(signals).map(([name, values]) => [name, { unit: "1", values }]),
      ),
    },
  });
  const normal = normals(seed);
  let error = 0;
  const y = outputs.y.values.map((value) => {
    error = memory * error + Math.sqrt(1 - memory ** 2) * normal();
    return sign * (value + noise * error);
  });
  return table(SAMPLE_TIME, [
    { name: "u", unit: "1", values: u },
    { name: "y", unit: "1", values: y },
  ]);
}

// A job for the lag, with what is asked differently.
const lagJob = (more = {}) => ({
  model: LAG,
  outputs: { y: { noise_std: NOISE } },
  process_noise: "none",
  validation: { fraction: 0 },
  seed: 1,
  ...more,
});

const catalogueJob = (model, more = {}) => ({
  model,
  outputs: Object.fromEntries(
    Object.entries(PLANTS[model].noise).map(([output, noise_std]) => [output, { noise_std }]),
  ),
  seed: 1,
  ...more,
});

const PARAMETERS = ["[data-part='Parameters'] + *"];
const OUTPUT = [plot("y, measured and simulated")];
const RESIDUAL = [plot("y, residual (measured − simulated)")];
const SPREAD = [plot("y: spread of the residuals")];
const MEMORY = [plot("y: autocorrelation")];
const inside = (title, part) => [`[data-part='${title}'] ${part}`];
const BUDGET = inside("Uncertainty budget", ".picture");
const ACTED = ["section[aria-label='What acted on the plant'] figure.chart"];
const COMPARED = ["::-p-xpath(//*[@role='region'][contains(@aria-label, 'Noise models')])"];

// The rules, each with its recording, its job, and the part of the result's page that shows it.
export const RULES = {
  at_bound: {
    part: PARAMETERS,
    width: 1000,
    csv: () => recorded("positioning_drive"),
    job: catalogueJob("positioning_drive", { parameters: { mass: { estimate: { lower: 10, upper: 60 } } } }),
  },
  not_identifiable: {
    part: PARAMETERS,
    width: 1000,
    csv: () => recording({}),
    job: lagJob({
      model: {
        ...LAG,
        parameters: { ...LAG.parameters, lever: unknown("1", 0.1, 3) },
        states: { x: { ...LAG.states.x, derivative: "(lever*gain*u - x)/T" } },
      },
      uncertainty: { flat_directions: "report" },
    }),
  },
  correlated: {
    part: inside("Correlation of the errors", ".picture"),
    csv: () => recorded("heat_exchanger"),
    job: catalogueJob("heat_exchanger"),
  },
  wide_interval: {
    part: PARAMETERS,
    width: 1000,
    csv: () => recording({ noise: 1.5 }),
    job: lagJob({ outputs: { y: { noise_std: 1.5 } } }),
  },
  misfit: { part: OUTPUT, csv: () => recording({ second: 0.4 }), job: lagJob() },
  slight_misfit: {
    part: SPREAD,
    csv: () => recording({}),
    job: lagJob({ outputs: { y: { noise_std: NOISE / 1.14 } } }),
  },
  noise_contradicted: {
    part: SPREAD,
    csv: () => recording({}),
    job: lagJob({ outputs: { y: { noise_std: 5 * NOISE } } }),
  },
  noise_unknown: { part: OUTPUT, csv: () => recording({ noise: 0.3 }), job: lagJob({ outputs: {} }) },
  residuals_not_white: { part: MEMORY, csv: () => recording({ memory: 0.5 }), job: lagJob() },
  residuals_follow_input: {
    part: [...RESIDUAL, plot("u, input")],
    csv: () => recording({ second: 0.05 }),
    job: lagJob(),
  },
  opposite_sign: { part: OUTPUT, csv: () => recording({ sign: -1 }), job: lagJob() },
  worse_on_validation: {
    part: OUTPUT,
    csv: () => recording({ change: INPUT.map((_, k) => (k >= 300 ? 0.3 : 0)) }),
    job: lagJob({ validation: { fraction: 0.25 } }),
  },
  starts_disagree: {
    part: inside("Starts of the refinement", "figure.chart"),
    csv: () => ringing(),
    job: lagJob({
      model: RING,
      method: {
        population: 4,
        generations: 2,
        refine_candidates: 4,
        further_searches: 0,
        noise_floor: false,
      },
    }),
  },
  plateau: {
    part: OUTPUT,
    csv: () => recording({ gain: 0, noise: 0.3 }),
    job: lagJob({ outputs: { y: { noise_std: 0.3 } } }),
  },
  twin_minima: {
    part: inside("Starts of the refinement", ".scroll"),
    csv: () => recording({}),
    job: lagJob({
      model: {
        ...LAG,
        parameters: { ...LAG.parameters, gain: { symbol: "g", ...unknown("1", -2, 2) } },
        states: { x: { ...LAG.states.x, derivative: "(g^2*u - x)/T" } },
      },
      method: { population: 12, generations: 1, refine_candidates: 8 },
      uncertainty: { intervals: "profile" },
    }),
  },
  assumption_contradicted: {
    part: BUDGET,
    csv: () => recorded("positioning_drive"),
    job: catalogueJob("positioning_drive", {
      parameters: { coulomb_friction: { value: 15, tolerance: "2 %" } },
      process_noise: "none",
    }),
  },
  drift: {
    part: RESIDUAL,
    csv: () => recording({ change: INPUT.map((_, k) => (k >= SAMPLES / 2 ? 0.4 : 0)) }),
    job: lagJob(),
  },
  assumptions_dominate: {
    part: BUDGET,
    csv: () => recorded("single_rod_servo"),
    job: catalogueJob("single_rod_servo"),
  },
  disturbance: {
    part: ACTED,
    csv: () => recording({ load: INPUT.map((_, k) => (k >= 150 && k < 270 ? 0.4 : 0)) }),
    job: lagJob({ process_noise: "auto" }),
  },
  disturbance_dominates: {
    part: ACTED,
    csv: () => {
      const normal = normals(5);
      let load = 0;
      return recording({
        load: INPUT.map(() => {
          load = 0.96 * load + 0.35 * normal();
          return load;
        }),
        noise: 0.02,
      });
    },
    job: lagJob({ process_noise: "auto", outputs: { y: { noise_std: 0.02 } } }),
  },
  noise_not_needed: {
    part: COMPARED,
    width: 1000,
    csv: () => recording({}),
    job: lagJob({
      process_noise: [{ acts_on: { state: "x" }, kind: "memory", std: { estimate: {} }, time_constant_s: 1 }],
    }),
  },
  noise_models_disagree: {
    part: COMPARED,
    width: 1000,
    csv: () => recording({ second: 0.05 }),
    job: lagJob({ process_noise: "auto" }),
  },
  windows_disagree: {
    part: ACTED,
    csv: () =>
      recording({
        change: INPUT.map((_, k) => (k % 200 >= 100 ? 0.5 : 0)),
        load: INPUT.map((_, k) => 0.2 * Math.sin(k / 17)),
      }),
    job: lagJob({ process_noise: "auto" }),
  },
  posterior_not_converged: {
    part: inside("Draws from the posterior", ".scroll"),
    width: 1000,
    csv: () => recording({ noise: 1.5 }),
    window: { to_s: 20 },
    job: lagJob({
      uncertainty: { intervals: "posterior", posterior_generations: 500 },
      outputs: { y: { noise_std: 1.5 } },
    }),
  },
  constraint_binds: {
    part: PARAMETERS,
    width: 1000,
    csv: () => recording({}),
    job: lagJob({ constraints: ["gain <= 0.796"] }),
  },
  constraint_contradicted: {
    part: PARAMETERS,
    width: 1000,
    csv: () => recording({}),
    job: lagJob({ constraints: ["gain <= 0.7"] }),
  },
  prior_contradicted: {
    part: PARAMETERS,
    width: 1000,
    csv: () => recording({}),
    job: lagJob({ parameters: { gain: { estimate: {}, prior: { mean: 1, std: 0.02 } } } }),
  },
};
