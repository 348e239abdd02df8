// This module feeds a stream with windows of a drive, each simulated with a mass and measured with a noise of its own.

import { post } from "./server.mjs";

export const WINDOW_S = 6;
const SAMPLES = 600;
const BEGIN = Date.now() - 7_200_000;

// The rows of a window: time in seconds, force and position.
export async function windowOf(mass, place) {
  const force = Array.from(
    { length: SAMPLES },
    (_, k) => 60 * Math.sign(Math.sin(k / 23)) + 25 * Math.sin(k / 7),
  );
  const { outputs } = await post("/v1/simulations", {
    model: "positioning_drive",
    parameters: { mass: { value: mass } },
    inputs: { sample_time_s: WINDOW_S / SAMPLES, signals: { force: { unit: "N", values: force } } },
  });
  return force.map((value, k) => {
    const noise = ((((k + 131 * place) * 7919) % 1009) / 504.5 - 1) * 3.5e-5;
    return [k * 0.01, value.toFixed(4), (outputs.position.values[k] + noise).toFixed(8)];
  });
}

export const csv = (title, rows) =>
  `${title},drive_force [N],position [m]\n${rows.map((row) => row.join(",")).join("\n")}\n`;

// Appends windows with a mass to a stream, the first of them at the place `first` of the stream.
export async function feed(stream, { first, count, mass }) {
  for (let place = first; place < first + count; place += 1) {
    const rows = await windowOf(mass, place);
    const stamped = rows.map(([time, ...values]) => [
      new Date(BEGIN + 1000 * (place * WINDOW_S + time)).toISOString(),
      ...values,
    ]);
    await post(`/v1/streams/${stream}`, csv("time", stamped), "text/csv");
  }
}
