// This module makes the recordings of the guides: the plants of the catalogue, simulated by the server with parameters
// that are stated, and measured with noise that repeats.

import { post } from "./server.mjs";

// Gives numbers between 0 and 1 that repeat with their seed (Mulberry32).
export function numbers(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let mixed = Math.imul(state ^ (state >>> 15), state | 1);
    mixed ^= mixed + Math.imul(mixed ^ (mixed >>> 7), mixed | 61);
    return ((mixed ^ (mixed >>> 14)) >>> 0) / 2 ** 32;
  };
}

// Gives numbers of the normal distribution (Box and Muller).
export function normals(seed) {
  const next = numbers(seed);
  return () => Math.sqrt(-2 * Math.log(1 - next())) * Math.cos(2 * Math.PI * next());
}

// Gives levels from a list, each of which is held for one to `longest` multiples of `clock` samples.
export function levels(seed, samples, { among, clock, longest = 4 }) {
  const next = numbers(seed);
  const values = [];
  let last = null;
  while (values.length < samples) {
    const choice = among.filter((level) => level !== last);
    last = choice[Math.floor(next() * choice.length)];
    const held = clock * (1 + Math.floor(next() * longest));
    values.push(...Array.from({ length: held }, () => last));
  }
  return values.slice(0, samples);
}

// Selects a plot of the page of a job by its title.
export const plot = (title) =>
  `::-p-xpath(//figure[contains(@class, 'chart')][.//*[@class='plot-title'][.='${title}']])`;

const compared = (output, input) => [plot(`${output}, measured and simulated`), plot(`${input}, input`)];

// A plant with the recording that is made of it. `signals` are what drives the plant; `parameters` are the true values
// that differ from the model's defaults; `noise` has the standard deviation of each recorded output in SI, and `shown`
// the unit, the factor and the offset in which the recording has it; `picture` selects the plots that the guide shows.
export const PLANTS = {
  mass_spring_damper: {
    sample_time_s: 0.01,
    signals: { force: { unit: "N", values: levels(3, 600, { among: [-20, -8, 8, 20], clock: 10 }) } },
    parameters: { mass: 2.6, damping: 4.2, stiffness: 520, coulomb_friction: 2 },
    noise: { displacement: 1e-4 },
    shown: { displacement: { unit: "mm", factor: 1000, digits: 3 } },
    picture: compared("displacement", "force"),
  },
  positioning_drive: {
    sample_time_s: 0.01,
    signals: { force: { unit: "N", values: levels(5, 800, { among: [-90, -40, 40, 90], clock: 15 }) } },
    parameters: { mass: 95, viscous_friction: 180, coulomb_friction: 24, offset: 6 },
    initial_state: { position: 0, velocity: 0 },
    noise: { position: 2e-5 },
    shown: { position: { unit: "mm", factor: 1000, digits: 3 } },
    picture: compared("position", "force"),
  },
  dc_motor: {
    sample_time_s: 0.005,
    signals: { voltage: { unit: "V", values: levels(7, 800, { among: [-12, -5, 5, 12], clock: 20 }) } },
    parameters: {
      resistance: 1.6,
      motor_constant: 0.062,
      inertia: 3.1e-4,
      viscous_friction: 2.4e-4,
      coulomb_friction: 0.027,
    },
    noise: { measured_speed: 0.5, measured_current: 0.02 },
    shown: { measured_speed: { unit: "rad/s", digits: 2 }, measured_current: { unit: "A", digits: 3 } },
    picture: compared("measured speed", "voltage"),
  },
  first_order_dead_time: {
    sample_time_s: 0.25,
    signals: { u: { unit: "1", values: levels(11, 600, { among: [0.2, 0.5, 0.8], clock: 30 }) } },
    parameters: { gain: 3.2, time_constant: 7.5, dead_time: 2.3, offset: 1.1 },
    noise: { y: 0.02 },
    shown: { y: { unit: "1", digits: 3 } },
    picture: compared("y", "u"),
  },
  heat_exchanger: {
    sample_time_s: 5,
    signals: {
      flow: { unit: "kg/s", values: levels(13, 600, { among: [0.12, 0.2, 0.3], clock: 30 }) },
      inlet_temperature: {
        unit: "K",
        shown: { unit: "degC", offset: -273.15, digits: 1 },
        values: levels(17, 600, { among: [288.15, 293.15, 298.15], clock: 50 }),
      },
      heating_temperature: {
        unit: "K",
        shown: { unit: "degC", offset: -273.15, digits: 1 },
        values: levels(19, 600, { among: [333.15, 348.15, 363.15], clock: 25 }),
      },
    },
    parameters: { mass: 26, transfer: 640, loss: 35 },
    initial_state: { temperature: 313.15 },
    noise: { outlet_temperature: 0.1 },
    shown: { outlet_temperature: { unit: "degC", offset: -273.15, digits: 2 } },
    picture: compared("outlet temperature", "heating temperature"),
  },
  cascaded_tanks: {
    sample_time_s: 4,
    signals: { pump: { unit: "V", values: levels(23, 500, { among: [0.8, 1.6, 2.4, 3.4], clock: 15 }) } },
    parameters: {
      upper_outlet: 0.0085,
      lower_outlet: 0.0095,
      pump_gain: 0.0017,
      transfer: 0.0088,
      overflow_share: 0.6,
    },
    noise: { level: 1e-3, first_level: 1e-3 },
    shown: {
      level: { unit: "cm", factor: 100, digits: 2 },
      first_level: { unit: "cm", factor: 100, digits: 2 },
    },
    picture: compared("level", "pump"),
  },
  double_rod_cylinder: {
    sample_time_s: 0.002,
    signals: {
      valve_command: { unit: "1", values: levels(29, 600, { among: [-0.6, -0.2, 0.2, 0.6], clock: 15 }) },
    },
    parameters: { mass: 110, damping: 850, bulk_modulus: 1.05e9, flow_gain: 9.1e-8 },
    noise: { piston_position: 2e-5, measured_load_pressure: 1e4 },
    shown: {
      piston_position: { unit: "mm", factor: 1000, digits: 3 },
      measured_load_pressure: { unit: "bar", factor: 1e-5, digits: 2 },
    },
    picture: compared("piston position", "valve command"),
  },
  bouc_wen: {
    sample_time_s: 0.001,
    signals: {
      force: {
        unit: "N",
        values: Array.from({ length: 600 }, (_, k) =>
          Number(
            ((40 + 80 * (k / 600)) * Math.sin(2 * Math.PI * (4 + 8 * (k / 600)) * k * 0.001)).toFixed(2),
          ),
        ),
      },
    },
    parameters: { damping: 14, stiffness: 42000, alpha: 61000, beta: 1300, gamma: 0.7 },
    noise: { displacement: 5e-6 },
    shown: { displacement: { unit: "mm", factor: 1000, digits: 4 } },
    picture: compared("displacement", "force"),
  },
  single_rod_servo: {
    sample_time_s: 0.01,
    signals: {
      reference: {
        unit: "m",
        shown: { unit: "mm", factor: 1000, digits: 0 },
        values: levels(31, 1500, { among: [0.045, 0.06, 0.08, 0.095], clock: 10 }),
      },
    },
    parameters: { mass: 64, damping: 420, stiffness: 19000, bulk_modulus: 1.45e9 },
    noise: { position: 1e-5 },
    shown: { position: { unit: "mm", factor: 1000, digits: 3 } },
    picture: compared("position", "reference"),
  },
};

// Simulates a plant and gives the recording as CSV.
export async function recorded(model, seed = 1, plant = PLANTS[model]) {
  const { sample_time_s, signals, parameters, initial_state } = plant;
  const inputs = Object.fromEntries(
    Object.entries(signals).map(([name, { unit, values }]) => [name, { unit, values }]),
  );
  const { outputs } = await post("/v1/simulations", {
    model,
    parameters,
    ...(initial_state ? { initial_state } : {}),
    inputs: { sample_time_s, signals: inputs },
  });
  const normal = normals(seed);
  const columns = [
    ...Object.entries(signals).map(([name, signal]) => ({
      name,
      unit: signal.unit,
      ...signal.shown,
      values: signal.values,
    })),
    ...Object.entries(plant.noise).map(([name, std]) => ({
      name,
      ...plant.shown[name],
      values: outputs[name].values.map((value) => value + std * normal()),
    })),
  ];
  return table(sample_time_s, columns);
}

// Writes columns with their units as CSV.
export function table(sampleTime, columns) {
  const head = ["time [s]", ...columns.map(({ name, unit }) => `${name} [${unit}]`)];
  const places = Math.max(0, -Math.floor(Math.log10(sampleTime) + 1e-9) + (sampleTime % 0.25 === 0 ? 1 : 0));
  const written = ({ factor = 1, offset = 0, digits, values }, k) => {
    const value = values[k] * factor + offset;
    return String(Number(value.toFixed(digits ?? 6)));
  };
  const rows = columns[0].values.map((_, k) =>
    [(k * sampleTime).toFixed(places), ...columns.map((column) => written(column, k))].join(","),
  );
  return `${[head.join(","), ...rows].join("\n")}\n`;
}
