// @ts-check
// What makes each model of the program show what it does: a step of its inputs from one level to
// another. Models that are not listed here get a step from 0 to 1 of ten seconds.

export const STEP_SAMPLES = 400;
const QUIET_SHARE = 0.1;

/** @type {Record<string, { seconds: number, before: Record<string, number>, after: Record<string, number>, state?: Record<string, number> }>} */
const KNOWN = {
  single_rod_servo: { seconds: 1, before: { reference: 0.07 }, after: { reference: 0.09 }, state: { position: 0.07 } },
  positioning_drive: { seconds: 4, before: { force: 0 }, after: { force: 100 }, state: { position: 0, velocity: 0 } },
  dc_motor: { seconds: 0.5, before: { voltage: 0 }, after: { voltage: 12 } },
  cascaded_tanks: { seconds: 200, before: { pump: 0 }, after: { pump: 4 } },
  mass_spring_damper: { seconds: 4, before: { force: 0 }, after: { force: 20 } },
  first_order_dead_time: { seconds: 30, before: { u: 0 }, after: { u: 1 } },
  double_rod_cylinder: { seconds: 1, before: { valve_command: 0 }, after: { valve_command: 0.2 } },
  heat_exchanger: { seconds: 600, before: { flow: 0.2, inlet_temperature: 290, heating_temperature: 290 },
    after: { flow: 0.2, inlet_temperature: 290, heating_temperature: 350 }, state: { temperature: 290 } },
  bouc_wen: { seconds: 1, before: { force: 0 }, after: { force: 100 } },
};

// How a model is made to move: its inputs, from where to where, for how long.
export function excitationOf(about) {
  const known = KNOWN[about.name];
  const names = about.input_sets?.[0] ?? about.inputs.map(({ name }) => name);
  const inputs = about.inputs.filter(({ name }) => names.includes(name));
  const each = (value) => Object.fromEntries(inputs.map(({ name }) => [name, value]));
  return known ? { inputs, state: {}, ...known } : { inputs, seconds: 10, before: each(0), after: each(1), state: {} };
}

// The inputs of such a step as a recording.
export function stepOf({ inputs, before, after, seconds }) {
  const from = Math.round(QUIET_SHARE * STEP_SAMPLES);
  const signals = inputs.map(({ name, unit }) => [name, { unit, values: Array.from({ length: STEP_SAMPLES }, (_, k) => (k < from ? before[name] ?? 0 : after[name] ?? 1)) }]);
  return { sample_time_s: seconds / STEP_SAMPLES, signals: Object.fromEntries(signals) };
}
