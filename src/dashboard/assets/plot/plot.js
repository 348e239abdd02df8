// @ts-check
// A plot shows columns over a common x as lines, steps or bars, with shaded spans and bands, in the
// units of the reader.
//
//     const chart = plot({ title, x: { label, unit }, y: { label, unit, log }, series: [{ name, look, step }] });
//     chart.set(xs, [ys, …]);
//
// set() takes a common x column and a column for each series, in SI; null is a gap. The pointer and the arrow
// keys read the values. Dragging across, or + at the cursor, shows a part; a double click or Escape shows all.
// Plots of the same `group` (see group.js) share cursor and part. An x with `clock` is an instant in seconds
// since 1970; an x that is `whole` has ticks at whole numbers alone. `whiskers` name the columns of the ends of
// intervals; a series with `bare` is read and not drawn; the `legend` of a series stands for its name in the
// legend, where null leaves it out.

import uPlot from "/assets/vendor/uplot-1.6.32.min.js";
import { h } from "../shell/dom.js";
import { number, quantity, unitSigns, unitText } from "../shell/format.js";
import {
  logarithmicRange,
  logarithmicSplits,
  paddedRange,
  rangeFromZero,
  rangeOf,
  stepsOf,
  tickText,
} from "./axes.js";
import { READER } from "./clock.js";
import { legendOf } from "./legend.js";
import { nearest, sampleAt } from "./math.js";
import { saveMenu } from "./save.js";
import { colour, onTheme, spanColour, width } from "./theme.js";
import { choices, onUnits, prefer, shownUnit, showsClock, toShown } from "./units.js";
import { drawWhiskers } from "./whiskers.js";

const CHARACTER = 7.2;
// Spans that are left out have a cap on top, so that a single sample is seen too.
const CAPPED = ["excluded", "marked"];
const CAP = { width: 8, height: 5 };
export function plot(options) {
  return new Plot(options);
}

class Plot {
  constructor({
    title,
    x,
    y,
    series,
    height = 220,
    spans = [],
    bands = [],
    whiskers = [],
    group = null,
    onBrush = null,
    signal = null,
  }) {
    this.title = title;
    this.x = x;
    this.y = y;
    this.series = series;
    this.height = height;
    this.spans = spans;
    this.bands = bands;
    this.whiskers = whiskers;
    this.group = group;
    this.onBrush = onBrush;
    this.xs = [];
    this.columns = [];
    this.part = null;
    this.cursor = null;
    this.chart = null;
    this.caption = h("figcaption", {});
    this.surface = h("div", {
      class: "surface",
      role: "application",
      tabindex: "0",
      "aria-roledescription": "plot",
      "aria-label": title,
      onkeydown: (event) => this.key(event),
      onblur: () => this.point(null),
    });
    this.readout = h("output", { class: "readout" });
    this.element = h("figure", { class: "chart" }, this.caption, this.surface, this.readout);
    this.unit = shownUnit(y.unit, y);
    this.head();
    group?.add(this);
    this.resized = new ResizeObserver(() => this.fit());
    this.resized.observe(this.element);
    const redraw = () => this.chart?.redraw(false);
    onTheme(redraw, signal);
    onUnits(() => this.changeUnit(), signal);
    signal?.addEventListener("abort", () => this.destroy(), { once: true });
  }

  destroy() {
    this.resized.disconnect();
    this.chart?.destroy();
    this.chart = null;
  }

  // The head has the title, the choice of the unit, the legend of lines and spans, and the menu to
  // save.
  head() {
    const possible = choices(this.y.unit, this.y);
    const fixedUnit = this.unit.name && this.unit.name !== "1" ? `[${unitSigns(this.unit.name)}]` : "";
    const unit =
      possible.length > 1
        ? h(
            "select",
            {
              class: "unit",
              "aria-label": `Unit of ${this.y.label}`,
              onchange: (event) => prefer(this.y.unit, event.target.value),
            },
            possible.map(({ name }) =>
              h("option", { value: name, selected: name === this.unit.name }, unitText(name)),
            ),
          )
        : fixedUnit && h("span", { class: "quiet" }, fixedUnit);
    this.caption.replaceChildren(
      h("span", { class: "plot-title" }, this.title),
      unit || "",
      legendOf(this.series, this.spans) ?? "",
      saveMenu(this),
    );
  }

  changeUnit() {
    this.unit = shownUnit(this.y.unit, this.y);
    this.head();
    this.rebuild();
  }

  setSpans(spans) {
    this.spans = spans;
    this.head();
    this.chart?.redraw(false);
  }

  // Sets the common x column and a column for each series, in SI.
  set(xs, columns) {
    const before = this.cursor === null ? null : this.xs[this.cursor];
    this.xs = xs;
    this.columns = columns;
    this.shown = columns.map((column) => column.map((value) => this.drawable(toShown(value, this.unit))));
    this.cursor = null;
    this.surface.classList.toggle("empty", this.isEmpty());
    if (!this.chart) {
      this.rebuild();
    } else {
      this.chart.setData([this.xs, ...this.shown], false);
      this.scale();
    }
    if (before !== null) {
      this.point(before);
    }
    this.surface.setAttribute("aria-label", this.summary());
  }

  isEmpty() {
    return (
      this.xs.length === 0 || !this.shown.some((column) => column.some((value) => Number.isFinite(value)))
    );
  }

  drawable(value) {
    return value === undefined
      ? undefined
      : value === null || !Number.isFinite(value) || (this.y.log && value <= 0)
        ? null
        : value;
  }

  // Shows the part between two values of x, or all where the part is null.
  show(part) {
    this.part = part;
    this.scale();
    this.surface.setAttribute("aria-label", this.summary());
  }

  extent() {
    return this.part ?? this.group?.full ?? rangeOf([this.xs], false) ?? [0, 1];
  }

  // The range has room for the first and the last bar or dot.
  extentShown() {
    const [min, max] = this.extent();
    const wide = !this.part && this.series.some(({ bars, dots }) => bars || dots);
    const room = wide ? 0.5 * Math.max((max - min) / Math.max(this.xs.length - 1, 1), 1e-300) : 0;
    return [min - room, max + room];
  }

  scale() {
    if (!this.chart) {
      return;
    }
    const [min, max] = this.extentShown();
    this.chart.batch(() => {
      this.chart.setScale("x", { min, max: max > min ? max : min + 1 });
    });
  }

  fit() {
    const wide = this.element.clientWidth;
    if (wide === 0) {
      return;
    }
    if (!this.chart) {
      this.rebuild();
    } else if (wide !== this.chart.width) {
      this.chart.setSize({ width: wide, height: this.height });
    }
  }

  rebuild() {
    const wide = this.element.clientWidth;
    if (wide === 0) {
      return;
    }
    this.chart?.destroy();
    this.shown = this.columns.map((column) =>
      column.map((value) => this.drawable(toShown(value, this.unit))),
    );
    this.surface.classList.toggle("empty", this.isEmpty());
    const data = [this.xs, ...(this.shown.length ? this.shown : this.series.map(() => []))];
    this.chart = new uPlot(this.options(wide), data, this.surface);
    const { over } = this.chart;
    over.addEventListener("dblclick", () => this.zoomTo(null));
    over.addEventListener("pointerdown", () => {
      this.isDragged = false;
    });
    over.addEventListener("click", () => this.clicked());
    this.scale();
  }

  options(wide) {
    const line = () => colour("rule");
    const axis = {
      stroke: () => colour("quiet"),
      grid: { stroke: line, width: 1 },
      ticks: { stroke: line, width: 1, size: 4 },
      font: "12px system-ui, sans-serif",
    };
    return {
      width: wide,
      height: this.height,
      padding: [10, 20, 0, 0],
      legend: { show: false },
      scales: {
        x: { time: false, auto: false },
        y: {
          distr: this.y.log ? 3 : 1,
          range: this.y.log
            ? logarithmicRange
            : this.series.some(({ bars }) => bars)
              ? rangeFromZero
              : paddedRange,
        },
      },
      axes: [
        {
          ...axis,
          labelSize: 18,
          labelFont: "12px system-ui, sans-serif",
          labelGap: 0,
          ...this.across(),
        },
        {
          ...axis,
          ...(this.y.log ? { splits: logarithmicSplits, filter: (_, splits) => splits } : {}),
          space: Math.max(18, Math.min(34, this.height / 8)),
          size: (_, texts) => this.axisWidth(texts),
          values: (_, splits) =>
            splits.map((value) => (value === null ? "" : this.y.log ? tickText(value) : number(value, 6))),
        },
      ],
      series: [
        {},
        ...this.series.map(({ look, step, dash, bars, dots, bare, thin }) => ({
          stroke: () => colour(look),
          width: dots || bare ? 0 : thin ? 0.6 : width(look),
          dash: dash ?? (look === "faint" ? [6, 4] : undefined),
          spanGaps: false,
          fill: bars ? () => `${colour(look)}66` : undefined,
          paths: step
            ? uPlot.paths.stepped({ align: 1 })
            : bars
              ? uPlot.paths.bars({ size: [0.8, 40] })
              : undefined,
          points: dots
            ? { show: true, size: 7, width: 1, stroke: () => colour(look), fill: () => colour(look) }
            : bars || bare || look === "faint"
              ? { show: false }
              : { show: (chart, _series, first, last) => last - first < chart.width / 12, size: 5 },
        })),
      ],
      bands: this.bands.map(({ upper, lower, look }) => ({
        series: [upper + 1, lower + 1],
        fill: () => `${colour(look)}33`,
      })),
      cursor: {
        y: false,
        points: { size: 8 },
        focus: { prox: -1 },
        drag: { x: true, y: false, setScale: false, dist: 5, click: () => {} },
        bind: { dblclick: () => null },
      },
      hooks: {
        drawClear: [(chart) => this.drawSpans(chart)],
        draw: this.whiskers.map((whisker) => (chart) => drawWhiskers(chart, whisker)),
        setSelect: [(chart) => this.selected(chart)],
        setCursor: [(chart) => this.moved(chart)],
      },
    };
  }

  // The axis up the side has room for its longest text; before the plot has values, it has no texts.
  axisWidth(texts) {
    const need = 14 + CHARACTER * Math.max(2, ...(texts ?? []).map((text) => (text ?? "").length));
    return texts && this.group ? this.group.axes.widthOf(this, need) : need;
  }

  // The axis along the bottom: of the clock of the reader or of the recording, or of the numbers.
  across() {
    const { clock } = this;
    const unit = clock ? ` [${clock.zone}]` : this.x.unit ? ` [${unitSigns(this.x.unit)}]` : "";
    const axis = { size: 30, space: 70, values: (_, splits) => splits.map((value) => number(value, 7)) };
    return { ...(clock?.axis() ?? axis), ...stepsOf(this.x), label: `${this.x.label}${unit}` };
  }

  get clock() {
    return this.x.clock ? READER : showsClock() ? (this.group?.clock ?? null) : null;
  }

  drawSpans(chart) {
    const { left, top, width: wide, height: high } = chart.bbox;
    for (const { from, to, kind } of this.spans) {
      const first = Math.max(chart.valToPos(from, "x", true), left);
      const last = Math.min(chart.valToPos(to, "x", true), left + wide);
      if (last >= left && first <= left + wide) {
        chart.ctx.fillStyle = spanColour(kind);
        chart.ctx.fillRect(first, top, Math.max(last - first, 2), high);
        if (CAPPED.includes(kind)) {
          const reach = Math.max(last - first, CAP.width * devicePixelRatio) / 2;
          chart.ctx.fillStyle = colour("quiet");
          chart.ctx.fillRect((first + last) / 2 - reach, top, 2 * reach, CAP.height * devicePixelRatio);
        }
      }
    }
  }

  selected(chart) {
    const { left, width: wide } = chart.select;
    if (wide < 5) {
      return;
    }
    this.isDragged = true;
    const part = [chart.posToVal(left, "x"), chart.posToVal(left + wide, "x")];
    chart.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    this.onBrush?.active() ? this.onBrush.take(part) : this.zoomTo(part);
  }

  // A click that ends no dragging is about the sample under it.
  clicked() {
    if (this.isDragged || !this.onBrush?.active()) {
      return;
    }
    const { left, top } = this.chart.cursor;
    const at = (x, y) => [this.chart.valToPos(x, "x"), this.chart.valToPos(y, "y")];
    const index = sampleAt(this.xs, this.shown[0] ?? [], [left, top], at);
    index !== null && this.onBrush.sample(this.xs[index]);
  }

  zoomTo(part) {
    this.group ? this.group.show(part) : this.show(part);
  }

  // Shows a part around the cursor, half or twice as long as the present part.
  zoom(factor) {
    const [from, to] = this.extent();
    const all = this.group?.full ?? rangeOf([this.xs], false) ?? [0, 1];
    const centre = this.cursor === null ? (from + to) / 2 : this.xs[this.cursor];
    const reach = ((to - from) * factor) / 2;
    const part = [Math.max(all[0], centre - reach), Math.min(all[1], centre + reach)];
    this.zoomTo(part[0] <= all[0] && part[1] >= all[1] ? null : part);
  }

  moved(chart) {
    const { idx: index, left } = chart.cursor;
    const inside = left >= 0 && index !== null && index !== undefined;
    this.read(inside ? index : null);
    if (this.moving) {
      return;
    }
    this.group?.point(this, inside ? this.xs[index] : null);
  }

  // Puts the cursor at the sample that is nearest to an x, or takes it away where x is null.
  point(x) {
    if (!this.chart) {
      return;
    }
    this.moving = true;
    if (x === null) {
      this.chart.setCursor({ left: -10, top: -10 });
      this.read(null);
    } else {
      const index = nearest(this.xs, x);
      this.chart.setCursor({ left: this.chart.valToPos(this.xs[index], "x"), top: 5 });
      this.read(index);
    }
    this.moving = false;
  }

  read(index) {
    this.cursor = index;
    if (index === null || index >= this.xs.length) {
      this.readout.textContent = "";
      return;
    }
    const texts = this.shown.map(
      (column, k) => `${this.series[k].name} ${quantity(number(column[index], 5), this.unit.name)}`,
    );
    this.readout.textContent = [
      `${this.x.label} ${this.textOf(this.xs[index], 7)}`,
      this.group?.clock?.text(this.xs[index]),
      ...texts,
    ]
      .filter(Boolean)
      .join(" · ");
  }

  textOf(x, digits) {
    return this.x.clock ? READER.text(x) : quantity(number(x, digits), this.x.unit);
  }

  key(event) {
    if (event.target !== this.surface) {
      return;
    }
    const views = {
      "+": () => this.zoom(0.5),
      "=": () => this.zoom(0.5),
      "-": () => this.zoom(2),
      Escape: () => this.zoomTo(null),
    };
    const brush = this.onBrush && { "[": 0, "]": 1 }[event.key];
    if (brush !== undefined && brush !== null && this.cursor !== null) {
      event.preventDefault();
      this.onBrush.end(brush, this.xs[this.cursor]);
      return;
    }
    if (views[event.key]) {
      event.preventDefault();
      views[event.key]();
      return;
    }
    this.step(event);
  }

  step(event) {
    const [first, last] = this.visible();
    const stride = event.shiftKey ? Math.max(1, Math.round((last - first) / 20)) : 1;
    const from = this.cursor ?? (event.key === "ArrowLeft" ? last + 1 : first - 1);
    const target = { ArrowRight: from + stride, ArrowLeft: from - stride, Home: first, End: last }[event.key];
    if (target === undefined || last < first) {
      return;
    }
    event.preventDefault();
    const x = this.xs[Math.min(last, Math.max(first, target))];
    this.point(x);
    this.group?.point(this, x);
  }

  // Gives the first and the last index of the part that is shown.
  visible() {
    const [from, to] = this.extent();
    let [first, last] = [nearest(this.xs, from), nearest(this.xs, to)];
    first += this.xs[first] < from ? 1 : 0;
    last -= this.xs[last] > to ? 1 : 0;
    return [first, last];
  }

  summary() {
    const rangeY = rangeOf(this.shown ?? [], this.y.log);
    if (!rangeY || this.xs.length === 0) {
      return `${this.title}: no data yet`;
    }
    const [first, last] = this.extent();
    const from = this.x.clock ? READER.text(first) : number(first);
    return (
      `${this.title}. ${this.x.label} ${from} to ${this.textOf(last, 4)}, ${this.y.label} ` +
      `${number(rangeY[0])} to ${quantity(number(rangeY[1]), this.unit.name)}. Arrow keys read the values, + and − change the part that is shown, Escape shows all.` +
      (this.onBrush ? " [ and ] put the ends of the window, or of a mark, at the cursor." : "")
    );
  }
}
