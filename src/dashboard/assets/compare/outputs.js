// @ts-check
// The simulated outputs of the compared jobs are drawn over each other, for each recording by itself. The plots of a
// recording show the same part of it.

import uPlot from "/assets/vendor/uplot-1.6.32.min.js";
import { PlotGroup } from "../plot/group.js";
import { plot } from "../plot/plot.js";
import { get } from "../shell/api.js";
import { h } from "../shell/dom.js";
import { words } from "../shell/format.js";

const POINTS = 3000;

/**
 * Fills a place with the plots of the jobs that have simulated outputs. A job whose outputs cannot be simulated, such
 * as one whose recording has been deleted, is named with the reason.
 *
 * @param {{ signal: AbortSignal }} view
 * @param {{ job: any, result: any, k: number }[]} runs
 * @param {HTMLElement} place
 */
export async function drawOutputs(view, runs, place) {
  const able = runs.filter(({ job, result }) => job.kind === "identification" && result);
  if (able.length === 0) {
    return;
  }
  const state = h("p", { class: "quiet", role: "status" }, "The outputs are being simulated …");
  place.append(h("h2", {}, "Outputs, over each other"), state);
  const answers = await Promise.allSettled(able.map(({ job, k }) => linesOf(job.id, k, view.signal)));
  view.signal.throwIfAborted();
  const recordings = new Map();
  const faults = [];
  answers.forEach((answer, n) => {
    if (answer.status === "rejected") {
      faults.push(h("p", {}, `Job ${able[n].k + 1} is left out: ${answer.reason.message}`));
      return;
    }
    for (const line of answer.value) {
      const { dataset } = line.experiment;
      recordings.set(dataset, [...(recordings.get(dataset) ?? []), line]);
    }
  });
  state.replaceWith(...faults);
  for (const lines of recordings.values()) {
    drawRecording(view, lines, place);
  }
}

async function linesOf(id, k, signal) {
  const { data } = await get(`/v1/jobs/${id}/trajectory?experiment=0&max_points=${POINTS}`, signal);
  const experiment = /** @type {any} */ (data.experiments[0]);
  return Object.entries(experiment?.outputs ?? {}).map(([name, output]) => ({ experiment, name, output, k }));
}

function drawRecording({ signal }, lines, place) {
  const times = lines.map(({ experiment }) => experiment.time_s);
  const full = [Math.min(...times.map((time) => time[0])), Math.max(...times.map((time) => time.at(-1)))];
  const group = new PlotGroup({ full, signal });
  place.append(group.toolbar);
  for (const name of new Set(lines.map((line) => line.name))) {
    const together = lines.filter((line) => line.name === name);
    const [first] = together;
    const drawn = plot({
      title: `${words(name)}, measured and simulated`,
      height: 340,
      signal,
      group,
      x: { label: "time", unit: "s" },
      y: { label: words(name), unit: first.output.unit },
      series: [
        { name: "measured", look: "measured" },
        ...together.map(({ k }) => ({ name: `job ${k + 1}`, look: `row-${k}` })),
      ],
    });
    place.append(drawn.element);
    const [xs, ...columns] = uPlot.join([
      [first.experiment.time_s, first.output.measured],
      ...together.map(({ experiment, output }) => [experiment.time_s, output.simulated]),
    ]);
    drawn.set(xs, columns);
  }
}
