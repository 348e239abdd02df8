// @ts-check
// This module names the unknowns of a job in words. Its functions are pure.

import { keyOf } from "../compare/differences.js";
import { words } from "../shell/format.js";

/**
 * Writes the key of an unknown in words. `load[1]` is the load of the second experiment, and `initial_speed_1` is the
 * state `speed` at the start of the second experiment, where `states` has it.
 *
 * @param {string} key
 * @param {string[]} [states]
 */
export function unknownWords(key, states = []) {
  for (const state of states) {
    if (key === `initial_${state}`) {
      return `${words(state)} at the start`;
    }
    const experiment = key.startsWith(`initial_${state}_`)
      ? Number(key.slice(`initial_${state}_`.length))
      : NaN;
    if (experiment > 0) {
      return `${words(state)} at the start of experiment ${experiment + 1}`;
    }
  }
  return words(key.replace(/\[(\d+)\]$/, (_, k) => ` in experiment ${Number(k) + 1}`));
}

/** The states whose starts a result has estimates of. @param {any} result @returns {string[]} */
export const statesOf = ({ initial_states: states = [] }) => [...new Set(states.map(({ state }) => state))];

/** Names an estimate of a result in words: a parameter, or a state at the start. @param {any} estimate */
export function labelOf({ name, state, experiment }) {
  return state
    ? unknownWords(experiment ? `initial_${state}_${experiment}` : `initial_${state}`, [state])
    : unknownWords(keyOf({ name, experiment }));
}
