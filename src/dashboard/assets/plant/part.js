// @ts-check
// This module shows a part of a stream: the fields that choose it, plots of its signals over the clock,
// and what each signal comes to in it.

import { isoText } from "../plot/clock.js";
import { PlotGroup } from "../plot/group.js";
import { isAbout } from "../plot/math.js";
import { plot } from "../plot/plot.js";
import { get, query } from "../shell/api.js";
import { h, notice, table } from "../shell/dom.js";
import { number, unitText, words, zoneName } from "../shell/format.js";
import { fieldSeconds, fieldText, wholeOf } from "./instants.js";
import { columnOf, pointsFor, summaryOf } from "./samples.js";

const PLOTS_AT_ONCE = 8;
// The table of more signals than these is closed at first, so that the plots are seen.
const SIGNALS_SHOWN = 12;
// The server reads at most two million instants at once.
const MOST_INSTANTS = 1_500_000;

const SIGNAL_COLUMNS = [
  { title: "Signal" },
  { title: "Unit" },
  { title: "Recorded in" },
  { title: "Least", numeric: true },
  { title: "Mean", numeric: true },
  { title: "Greatest", numeric: true },
];

export class PartPlots {
  constructor({ view, address, stream }) {
    this.stream = stream;
    this.address = address;
    this.leaving = new AbortController();
    view.signal.addEventListener("abort", () => this.leave(), { once: true });
    this.from = instantField();
    this.to = instantField();
    this.filled = "";
    this.keepsFields = false;
    this.fields = this.form();
    this.outcome = notice();
    this.summary = h("div", {});
    this.group = new PlotGroup({
      full: wholeOf(stream),
      signal: this.leaving.signal,
      failed: (error) => this.outcome.fail(error),
      load: (from, to, pixels, abort) => this.load(from, to, pixels, abort),
      moved: () => this.keepsFields || this.fill(),
    });
    this.names = stream.signals.map(({ name }) => name);
    this.place = h("div", {});
    /** @type {{ name: string, chart: any }[]} */
    this.charts = [];
    /** @type {any[]} */
    this.spans = [];
    this.more = h("button", { type: "button", onclick: () => this.plotMore() }, "Plot more signals");
    this.element = h(
      "div",
      {},
      this.outcome.place,
      h(
        "details",
        { open: stream.signals.length <= SIGNALS_SHOWN },
        h("summary", {}, "Signals in this part"),
        this.summary,
      ),
      this.group.toolbar,
      this.place,
      this.more,
    );
  }

  leave() {
    this.leaving.abort();
  }

  form() {
    const show = (event) => {
      event.preventDefault();
      const part = this.chosen();
      this.group.show(part[0] < part[1] ? part : null);
    };
    return h(
      "form",
      { class: "fields", onsubmit: show },
      h("label", {}, `From, ${zoneName()}`, this.from),
      h("label", {}, `To, ${zoneName()}`, this.to),
      h("button", { type: "submit" }, "Show this part"),
      h("button", { type: "button", onclick: () => this.group.show(null) }, "All of it"),
    );
  }

  // Shows a part of the stream, or the whole stream where `part` is null.
  start(part = null) {
    this.addPlots();
    this.fill();
    const { samples } = this.stream;
    const [from, to] = this.group.full;
    if (part) {
      this.group.show(part);
    } else if (samples > MOST_INSTANTS) {
      this.group.show([to - ((to - from) * MOST_INSTANTS) / samples, to]);
    } else {
      this.group.start();
    }
  }

  // Takes a later state of the stream; plots of the whole stream then show what came. Fields in which
  // the reader has typed stay as they are.
  grow(stream) {
    this.stream = stream;
    if (stream.first) {
      this.keepsFields = this.typed() !== this.filled;
      this.group.full = wholeOf(stream);
      this.group.show(this.group.part);
      this.keepsFields = false;
    }
  }

  typed() {
    return `${this.from.value} ${this.to.value}`;
  }

  // Gives the part that the fields say, which the buttons beside them act on.
  chosen() {
    const [first, last] = this.group.full;
    const [from, to] = [fieldSeconds(this.from.value), fieldSeconds(this.to.value)];
    return [Number.isFinite(from) ? from : first, Number.isFinite(to) ? to : last];
  }

  fill() {
    const [from, to] = this.group.part ?? this.group.full;
    this.from.value = fieldText(Math.floor(1000 * from) / 1000);
    this.to.value = fieldText(Math.ceil(1000 * to) / 1000);
    this.filled = this.typed();
  }

  async load(from, to, pixels, abort) {
    const [first, last] = this.group.full;
    const part = { from: isoText(from ?? first), to: isoText(to ?? last) };
    const points = pointsFor(this.stream.signals.length, pixels);
    /** @type {{ data: any }} */
    const { data } = await get(`${this.address}${query({ ...part, max_points: points })}`, abort);
    this.outcome.clear();
    this.summarise(data.window ?? {}, points);
    return data.window ?? {};
  }

  // A stream with fewer samples than were asked for comes whole, and then the means are exact.
  summarise(samples, points) {
    const part = this.group.part ?? this.group.full;
    const about = this.stream.samples <= points ? "" : "≈ ";
    const rows = this.stream.signals.map((signal) => {
      const { least, mean, greatest } = summaryOf(columnOf(samples, signal.name), part);
      return [
        words(signal.name),
        unitText(signal.unit),
        unitText(signal.recorded_unit),
        number(least),
        mean === null ? "–" : about + number(mean),
        number(greatest),
      ];
    });
    this.summary.replaceChildren(table("Signals in this part", SIGNAL_COLUMNS, rows, { stacked: true }));
  }

  addPlots() {
    for (const name of this.names.splice(0, PLOTS_AT_ONCE)) {
      const signal = this.stream.signals.find((entry) => entry.name === name);
      const chart = plot({
        title: words(name),
        height: 220,
        x: { label: "time", clock: true },
        y: { label: words(name), unit: signal.unit },
        group: this.group,
        signal: this.leaving.signal,
        series: [{ name: words(name), look: "first", step: signal.interpolation === "hold" }],
      });
      this.group.feed(chart, (samples) => {
        const [times, values] = columnOf(samples, name);
        return [times, [values]];
      });
      chart.show(this.group.part);
      this.charts.push({ name, chart });
      this.place.append(chart.element);
    }
    this.shade(this.spans);
    this.more.hidden = this.names.length === 0;
  }

  // Shades spans of the signals on their plots.
  shade(spans) {
    this.spans = spans;
    for (const { name, chart } of this.charts) {
      chart.setSpans(spans.filter(isAbout(name)));
    }
  }

  plotMore() {
    this.addPlots();
    this.group.start();
  }
}

function instantField() {
  return h("input", { type: "datetime-local", step: "0.001" });
}
