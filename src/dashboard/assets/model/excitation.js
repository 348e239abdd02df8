// @ts-check
// The excitation of a model is a step of its inputs from a level to another. Each model of the program
// has its own; any other model gets a step from 0 to 1 of ten seconds.

export const STEP_SAMPLES = 400;
const QUIET_SHARE = 0.1;

/**
 * @typedef {Record<string, number>} Levels
 * @type {Record<string, { seconds: number, before: Levels, after: Levels, state?: Levels }>}
 */
const EXCITATIONS = {
  single_rod_servo: {
    seconds: 1,
    before: { reference: 0.07 },
    after: { reference: 0.09 },
    state: { position: 0.07 },
  },
  positioning_drive: {
    seconds: 4,
    before: { force: 0 },
    after: { force: 100 },
    state: { position: 0, velocity: 0 },
  },
  dc_motor: { seconds: 0.5, before: { voltage: 0 }, after: { voltage: 12 } },
  cascaded_tanks: { seconds: 200, before: { pump: 0 }, after: { pump: 4 } },
  mass_spring_damper: { seconds: 4, before: { force: 0 }, after: { force: 20 } },
  first_order_dead_time: { seconds: 30, before: { u: 0 }, after: { u: 1 } },
  double_rod_cylinder: { seconds: 1, before: { valve_command: 0 }, after: { valve_command: 0.2 } },
  heat_exchanger: {
    seconds: 600,
    before: { flow: 0.2, inlet_temperature: 290, heating_temperature: 290 },
    after: { flow: 0.2, inlet_temperature: 290, heating_temperature: 350 },
    state: { temperature: 290 },
  },
  bouc_wen: { seconds: 1, before: { force: 0 }, after: { force: 100 } },
};

// The excitation of a model has its inputs, their levels before and after the step, the duration and
// the initial state.
export function excitationOf(about) {
  const excitation = EXCITATIONS[about.name];
  const names = about.input_sets?.[0] ?? about.inputs.map(({ name }) => name);
  const inputs = about.inputs.filter(({ name }) => names.includes(name));
  const each = (value) => Object.fromEntries(inputs.map(({ name }) => [name, value]));
  return excitation
    ? { inputs, state: {}, ...excitation }
    : { inputs, seconds: 10, before: each(0), after: each(1), state: {} };
}

// Writes the step of an excitation as the samples of a recording.
export function stepOf({ inputs, before, after, seconds }) {
  const from = Math.round(QUIET_SHARE * STEP_SAMPLES);
  const signals = inputs.map(({ name, unit }) => [
    name,
    {
      unit,
      values: Array.from({ length: STEP_SAMPLES }, (_, k) =>
        k < from ? (before[name] ?? 0) : (after[name] ?? 1),
      ),
    },
  ]);
  return { sample_time_s: seconds / STEP_SAMPLES, signals: Object.fromEntries(signals) };
}
