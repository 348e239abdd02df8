// @ts-check
// The panel shows a search while it runs: its candidates over two unknowns, and the outputs of the best
// candidate so far over the measured outputs.

import { ComparedPlots, comparedWith } from "../model/simulation.js";
import { axis, axisTitle } from "../plot/axes.js";
import { get, query } from "../shell/api.js";
import { h, notice, svg } from "../shell/dom.js";
import { number, words } from "../shell/format.js";
import { isFinished } from "./feed.js";
import { valuesOfCandidate } from "./moves.js";

const EVERY_MS = 4000;
const CANDIDATES_SHOWN = 600;
const SIZE = { width: 520, height: 300, left: 64, bottom: 40, top: 12, right: 12 };

export function livePanel(view, id) {
  const outcome = notice();
  const compared = new ComparedPlots(view.signal);
  const across = h("select", { "aria-label": "Unknown along the bottom", onchange: () => draw() });
  const up = h("select", { "aria-label": "Unknown up the side", onchange: () => draw() });
  const picture = svg("svg", { viewBox: `0 0 ${SIZE.width} ${SIZE.height}`, class: "scatter", role: "img" });
  const state = { job: null, best: null, after: 0, candidates: [], last: 0, busy: false };
  const scatter = h(
    "figure",
    { class: "chart", hidden: true },
    h(
      "figcaption",
      {},
      h("span", { class: "plot-title" }, "Candidates"),
      h("label", { class: "inline" }, "across", across),
      h("label", { class: "inline" }, "up", up),
      h(
        "span",
        { class: "legend" },
        h("span", {}, h("i", { class: "swatch good" }), "low cost"),
        h("span", {}, h("i", { class: "swatch poor" }), "high cost"),
      ),
    ),
    picture,
  );
  const element = h(
    "details",
    { class: "analysed", "data-part": "Candidates" },
    h("summary", {}, h("h3", {}, "Candidates, and the best against what was measured")),
    outcome.place,
    h("div", { class: "pair" }, scatter, compared.element),
  );
  element.addEventListener("toggle", () => element.open && refresh());

  const names = () => Object.keys(state.candidates.at(-1)?.values ?? {});
  const draw = () => {
    scatter.hidden = names().length < 2;
    if (scatter.hidden) {
      return;
    }
    for (const [select, preferred] of [
      [across, 0],
      [up, 1],
    ]) {
      if (select.options.length !== names().length) {
        select.replaceChildren(
          ...names().map((name, k) => h("option", { value: name, selected: k === preferred }, words(name))),
        );
      }
    }
    const unit = (name) => state.columns?.find((column) => column.name === name)?.unit ?? "";
    drawScatter(
      picture,
      state.candidates.slice(-CANDIDATES_SHOWN),
      [across.value, up.value],
      [unit(across.value), unit(up.value)],
    );
  };

  const refresh = async () => {
    const due = Date.now() - state.last > EVERY_MS;
    if (!element.open || state.busy || !due || !state.job || view.signal.aborted) {
      return;
    }
    state.busy = true;
    state.last = Date.now();
    try {
      const { data } = await get(
        `/v1/jobs/${id}/candidates${query({ after: state.after || null, limit: 200 })}`,
        view.signal,
      );
      state.columns = data.columns;
      state.candidates = [...state.candidates, ...data.items.filter(({ cost }) => cost !== null)].slice(
        -4 * CANDIDATES_SHOWN,
      );
      state.after = data.next_after ?? data.items.at(-1)?.generation ?? state.after;
      draw();
      if (state.best && state.columns.length > 0 && state.best !== state.simulated) {
        state.simulated = state.best;
        const { values, states } = valuesOfCandidate(state.columns, state.best, 0);
        compared.show(await comparedWith(state.job.spec, 0, values, view.signal, states));
      }
      outcome.clear();
    } catch (error) {
      outcome.fail(error);
    }
    state.busy = false;
  };
  return {
    element,
    job(job) {
      state.job = job;
      element.open ||= job.status === "running";
      refresh();
    },
    history(rows) {
      state.best = rows.at(-1)?.best ?? null;
      if (state.job && !isFinished(state.job)) {
        refresh();
      }
    },
  };
}

function drawScatter(picture, candidates, [across, up], units) {
  const { width, height, left, bottom, top, right } = SIZE;
  const column = (name) => candidates.map(({ values }) => values[name]);
  const [xs, ys] = [column(across), column(up)];
  const range = (values) => [Math.min(...values), Math.max(...values)];
  const spread = (/** @type {number[]} */ [low, high]) => low > 0 && high / low > 20;
  const [rangeX, rangeY] = [range(xs), range(ys)];
  const horizontal = axis(rangeX, { log: spread(rangeX), steps: 5 });
  const vertical = axis(rangeY, { log: spread(rangeY), steps: 5 });
  const atX = (value) => left + horizontal.position(value) * (width - left - right);
  const atY = (value) => top + (1 - vertical.position(value)) * (height - top - bottom);
  const ranked = candidates.map((candidate, k) => [candidate.cost, k]).sort((a, b) => b[0] - a[0]);
  picture.replaceChildren(
    ...vertical.ticks.flatMap(([value, text]) => [
      svg("line", { x1: left, x2: width - right, y1: atY(value), y2: atY(value), class: "grid" }),
      svg("text", { x: left - 6, y: atY(value) + 4, class: "tick end" }, text),
    ]),
    ...horizontal.ticks.map(([value, text]) =>
      svg("text", { x: atX(value), y: height - bottom + 16, class: "tick middle" }, text),
    ),
    svg(
      "text",
      { x: width - right, y: height - 6, class: "tick end" },
      axisTitle(words(across), units[0], horizontal.exponent),
    ),
    svg("text", { x: 4, y: 10, class: "tick" }, axisTitle(words(up), units[1], vertical.exponent)),
    ...ranked.map(([, k], rank) =>
      svg("circle", {
        cx: atX(xs[k]),
        cy: atY(ys[k]),
        r: 3,
        class: `rank-${Math.min(4, Math.floor((5 * rank) / ranked.length))}`,
      }),
    ),
  );
  const best = ranked.at(-1)?.[1];
  const [spanX, spanY] = [rangeX, rangeY].map(([low, high]) => `${number(low)} to ${number(high)}`);
  picture.setAttribute(
    "aria-label",
    `${candidates.length} candidates: ${words(across)} ${spanX}, ${words(up)} ${spanY}; ` +
      `the best at ${number(xs[best])} and ${number(ys[best])}`,
  );
}
