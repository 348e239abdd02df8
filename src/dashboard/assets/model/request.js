// @ts-check
// This module writes requests of simulations. Its function is pure.

// Writes the request that simulates an experiment with the given values of its unknowns, and of the initial states
// among them.
export function simulationOf(spec, k, values, states = {}) {
  const { dataset, signals, window, initial_state: starts = {} } = spec.experiments[k];
  const initialState = Object.fromEntries(
    Object.entries(starts).filter(([, start]) => !(typeof start === "object" && "estimate" in start)),
  );
  const fixedOf = (entries = {}) =>
    Object.entries(entries)
      .filter(([, entry]) => "value" in entry)
      .map(([name, { value }]) => [name, { value }]);
  const free = Object.entries(values).map(([name, value]) => [name, { value }]);
  return {
    model: spec.model,
    dataset,
    signals,
    ...(window ? { window } : {}),
    // A value that is the experiment's own holds against the estimate that the other experiments share.
    parameters: Object.fromEntries([
      ...fixedOf(spec.parameters),
      ...free,
      ...fixedOf(spec.experiments[k].parameters),
    ]),
    initial_state: { ...initialState, ...states },
  };
}
