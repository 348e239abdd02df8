// The figures are printed in two columns: what was measured, and how much it was.

export const pause = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));
export const say = (name, value) => console.log(`${name.padEnd(72)} ${value}`);
export const ms = (value) => `${Math.round(value)} ms`;
