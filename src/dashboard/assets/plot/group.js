// @ts-check
// The plots of a group share a time axis: they have the same cursor and show the same part. The samples
// of the part are read from the server whenever the part changes, so that every zoom shows all samples.

import { h } from "../shell/dom.js";
import { AxisWidths } from "./axes.js";
import { onUnits, preferClock, showsClock } from "./units.js";

const WAIT_MS = 90;

export class PlotGroup {
  /**
   * `full` is the whole range. `load(from, to, pixels, signal)` reads a part; both ends are null for the
   * whole range. `failed` is called with an error, `moved` with the part that is shown from now on. `clock`
   * is that of the recording, or null.
   *
   * @param {{
   *   full: any,
   *   signal?: AbortSignal,
   *   failed?: (error: any) => void,
   *   clock?: ReturnType<typeof import("./clock.js").clockOf>,
   *   moved?: (part: any) => void,
   *   load?: (from: number, to: number, pixels: number, abort: AbortSignal) => Promise<any>,
   * }} options
   */
  constructor({
    full = null,
    load = null,
    signal = null,
    failed = () => {},
    moved = () => {},
    clock = null,
  }) {
    this.clock = clock;
    this.full = full;
    this.load = load;
    this.signal = signal;
    this.failed = failed;
    this.moved = moved;
    this.plots = new Set();
    this.takers = new Map();
    this.axes = new AxisWidths(() => requestAnimationFrame(() => this.align()));
    this.part = null;
    this.elapsed = null;
    const button = (text, label, act) =>
      h("button", { type: "button", class: "small", "aria-label": label, title: label, onclick: act }, text);
    this.place = h("span", { class: "quiet", role: "status" });
    this.toolbar = h(
      "div",
      { class: "zoom", role: "group", "aria-label": "Part that is shown" },
      button("+", "Show half as much", () => this.zoom(0.5)),
      button("−", "Show twice as much", () => this.zoom(2)),
      button("◀", "Earlier", () => this.move(-0.5)),
      button("▶", "Later", () => this.move(0.5)),
      button("All", "Show all", () => this.show(null)),
      this.clockChoice() ?? "",
      this.place,
    );
  }

  // Time axes show the clock of the recording, or the seconds since its first sample.
  clockChoice() {
    if (!this.clock) {
      return null;
    }
    const box = h("input", {
      type: "checkbox",
      checked: showsClock(),
      onchange: () => preferClock(box.checked),
    });
    onUnits(() => {
      box.checked = showsClock();
    }, this.signal);
    return h("label", { class: "inline" }, box, "time of day");
  }

  // Draws the plots with axes of the same width.
  align() {
    for (const { chart } of this.plots) {
      chart?.redraw(false, true);
    }
  }

  add(plot) {
    this.plots.add(plot);
  }

  // `take(data)` gives the x column and the columns of a plot from the loaded data.
  feed(plot, take) {
    this.takers.set(plot, take);
  }

  // Reads the samples for the first time.
  start() {
    return this.fetch();
  }

  show(part) {
    this.part = part && this.full ? clamp(part, this.full) : part;
    for (const plot of this.plots) {
      plot.show(this.part);
    }
    this.moved(this.part);
    if (this.load) {
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.fetch(), WAIT_MS);
    }
  }

  zoom(factor) {
    const [from, to] = this.part ?? this.full ?? [0, 1];
    const [middle, reach] = [(from + to) / 2, ((to - from) * factor) / 2];
    const part = [middle - reach, middle + reach];
    this.show(this.full && part[0] <= this.full[0] && part[1] >= this.full[1] ? null : part);
  }

  move(share) {
    if (!this.part || !this.full) {
      return;
    }
    const length = this.part[1] - this.part[0];
    const from = Math.min(Math.max(this.part[0] + share * length, this.full[0]), this.full[1] - length);
    this.show([from, from + length]);
  }

  async fetch() {
    if (!this.load) {
      return;
    }
    this.reading?.abort();
    const reading = new AbortController();
    this.reading = reading;
    const leave = () => reading.abort();
    this.signal?.addEventListener("abort", leave, { once: true });
    const [from, to] = this.part ? widened(this.part) : [null, null];
    const pixels = Math.max(300, ...[...this.plots].map((plot) => plot.element.clientWidth));
    try {
      const data = await this.load(from, to, pixels, reading.signal);
      for (const [plot, take] of this.takers) {
        plot.set(...take(data));
      }
      this.place.textContent = "";
    } catch (error) {
      if (error.name !== "AbortError") {
        this.failed(error);
      }
    }
    this.signal?.removeEventListener("abort", leave);
  }

  // All plots of the group put their cursor where the cursor of the first plot is.
  point(from, x) {
    this.plots.forEach((plot) => {
      if (plot !== from) {
        plot.point(x);
      }
    });
  }
}

// The part that is read is a little wider than the part that is seen, so that lines reach the edges.
function widened([from, to]) {
  const room = 0.02 * (to - from);
  return [from - room, to + room];
}

function clamp([from, to], [first, last]) {
  const part = [Math.max(Math.min(from, to), first), Math.min(Math.max(from, to), last)];
  return part[1] > part[0] ? part : null;
}
