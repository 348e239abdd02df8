// @ts-check
// Whiskers draw the interval of each value of a plot as an upright line between two columns.

import { colour } from "./theme.js";

const CAP = 3;

// The numbers of the lower and the upper column count from the first series of the plot.
export function drawWhiskers(chart, { lower, upper, look }) {
  const [xs, lows, highs] = [chart.data[0], chart.data[lower + 1], chart.data[upper + 1]];
  const { ctx, bbox } = chart;
  const ratio = bbox.width / Math.max(1, chart.over.clientWidth);
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.beginPath();
  xs.forEach((x, k) => {
    if (Number.isFinite(lows[k]) && Number.isFinite(highs[k])) {
      drawWhisker(chart, x, [lows[k], highs[k]], CAP * ratio);
    }
  });
  ctx.strokeStyle = colour(look);
  ctx.lineWidth = 1.4 * ratio;
  ctx.stroke();
  ctx.restore();
}

function drawWhisker({ ctx, valToPos }, x, ends, cap) {
  const across = valToPos(x, "x", true);
  const [low, high] = ends.map((value) => valToPos(value, "y", true));
  ctx.moveTo(across, low);
  ctx.lineTo(across, high);
  for (const end of [low, high]) {
    ctx.moveTo(across - cap, end);
    ctx.lineTo(across + cap, end);
  }
}
