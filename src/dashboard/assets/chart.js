// A line chart in SVG, drawn at the width that it has, so that its text is always readable.
//
// const chart = lineChart({ title, x: { label, unit }, y: { label, unit, log }, series: [{ name, look }] });
// chart.set(xs, [ys, …]) takes a common x column and a column for each series; null is a gap.
// The pointer or the arrow keys read the values. Dragging across, or + at the cursor, shows a part;
// a double click or Escape shows all.

import { axis, axisTitle, rangeOf } from "./axes.js";
import { h, svg } from "./dom.js";
import { number, quantity } from "./format.js";

const RIGHT = 14;
const TOP = 24;
const BOTTOM = 40;
const CHARACTER = 7;

export function lineChart(options) {
  const chart = new LineChart(options);
  return { element: chart.element, set: (xs, columns) => chart.set(xs, columns) };
}

class LineChart {
  constructor({ title, x, y, series, height = 220 }) {
    Object.assign(this, { title, x, y, series, height, xs: [], columns: [], cursor: null });
    Object.assign(this, { all: { xs: [], columns: [] }, part: null, pressed: null });
    this.surface = svg("svg", {
      role: "img", tabindex: "0", height, "aria-label": title,
      onpointermove: (event) => this.moveTo(this.indexAt(event)),
      onpointerleave: () => this.moveTo(null),
      onpointerdown: (event) => this.press(event),
      onpointerup: (event) => this.release(event),
      ondblclick: () => this.show(null),
      onkeydown: (event) => this.key(event),
      onblur: () => this.moveTo(null),
    });
    this.readout = h("output", { class: "readout" });
    this.element = h("figure", { class: "chart" },
      h("figcaption", {}, title, this.legend()), this.surface, this.readout);
    new ResizeObserver(() => this.draw()).observe(this.element);
  }

  legend() {
    if (this.series.length < 2) {
      return null;
    }
    return h("span", { class: "legend" }, this.series.map(({ name, look }) => h("span", {},
      svg("svg", { width: 22, height: 10, "aria-hidden": "true" },
        svg("line", { x1: 0, x2: 22, y1: 5, y2: 5, class: `line ${look}` })), name)));
  }

  set(xs, columns) {
    this.all = { xs, columns };
    this.show(this.part);
  }

  // Shows the samples from the first to the second index, or all of them.
  show(part) {
    const kept = this.cursor === null ? null : this.xs[this.cursor];
    this.part = part && part[1] - part[0] >= 2 ? part : null;
    const cut = (column) => (this.part ? column.slice(this.part[0], this.part[1] + 1) : column);
    this.xs = cut(this.all.xs);
    this.columns = this.all.columns.map(cut);
    const again = kept === null ? -1 : this.xs.indexOf(kept);
    this.cursor = again < 0 ? null : again;
    this.draw();
    this.moveTo(this.cursor);
  }

  draw() {
    const width = this.element.clientWidth;
    if (width === 0) {
      return;
    }
    this.surface.setAttribute("width", width);
    this.surface.setAttribute("viewBox", `0 0 ${width} ${this.height}`);
    const rangeY = rangeOf(this.columns, this.y.log);
    const rangeX = rangeOf([this.xs], false);
    if (!rangeX || !rangeY) {
      this.layout = null;
      const empty = svg("text", { x: width / 2, y: this.height / 2, class: "none" }, "no data yet");
      this.surface.replaceChildren(empty);
      this.surface.setAttribute("aria-label", `${this.title}: no data yet`);
      return;
    }
    this.layout = this.place(width, rangeX, rangeY);
    this.mark = svg("g", {});
    this.surface.replaceChildren(...this.grid(), ...this.lines(), this.mark);
    this.surface.setAttribute("aria-label", this.summary(rangeX, rangeY));
  }

  place(width, rangeX, rangeY) {
    const vertical = axis(rangeY, { log: this.y.log, wanted: Math.max(3, Math.round(this.height / 42)) });
    const widest = Math.max(...vertical.ticks.map(([, text]) => text.length), 1);
    const left = 12 + CHARACTER * widest;
    const inner = { width: width - left - RIGHT, height: this.height - TOP - BOTTOM };
    const horizontal = axis(rangeX, { wanted: Math.max(2, Math.round(inner.width / 90)), tight: true });
    return {
      left, inner, width, horizontal, vertical,
      atX: (value) => left + horizontal.position(value) * inner.width,
      atY: (value) => TOP + (1 - vertical.position(value)) * inner.height,
    };
  }

  grid() {
    const { left, inner, width, horizontal, vertical, atX, atY } = this.layout;
    const bottom = TOP + inner.height;
    const marks = [
      svg("text", { x: 2, y: 13, class: "axis" }, axisTitle(this.y.label, this.y.unit, vertical.exponent)),
      svg("text", { x: width - RIGHT, y: this.height - 6, class: "axis end" },
        axisTitle(this.x.label, this.x.unit, horizontal.exponent)),
    ];
    for (const [value, text] of vertical.ticks) {
      const y = atY(value);
      marks.push(svg("line", { x1: left, x2: left + inner.width, y1: y, y2: y, class: "grid" }),
        svg("text", { x: left - 6, y: y + 4, class: "tick end" }, text));
    }
    for (const [value, text] of horizontal.ticks) {
      const x = atX(value);
      marks.push(svg("line", { x1: x, x2: x, y1: bottom, y2: bottom + 4, class: "frame" }),
        svg("text", { x, y: bottom + 17, class: "tick middle" }, text));
    }
    marks.push(svg("line", { x1: left, x2: left + inner.width, y1: bottom, y2: bottom, class: "frame" }));
    return marks;
  }

  lines() {
    return this.series.map(({ look }, k) =>
      svg("path", { d: this.path(this.columns[k] ?? []), class: `line ${look}` }));
  }

  path(column) {
    const { atX, atY } = this.layout;
    let text = "";
    let pen = "M";
    column.forEach((value, k) => {
      if (!this.drawable(value)) {
        pen = "M";
        return;
      }
      text += `${pen}${atX(this.xs[k]).toFixed(1)} ${atY(value).toFixed(1)}`;
      pen = "L";
    });
    return text;
  }

  drawable(value) {
    return value !== null && Number.isFinite(value) && (!this.y.log || value > 0);
  }

  summary(rangeX, rangeY) {
    const span = ([low, high], unit) => `${number(low)} to ${quantity(number(high), unit)}`;
    return `${this.title}. ${this.x.label} ${span(rangeX, this.x.unit)}, ${this.y.label} ` +
      `${span(rangeY, this.y.unit)}. Arrow keys read the values, + and − change the part that is shown.`;
  }

  indexAt(event) {
    if (!this.layout) {
      return null;
    }
    const offset = event.clientX - this.surface.getBoundingClientRect().left;
    return nearest(this.xs, (x) => this.layout.atX(x), offset);
  }

  press(event) {
    this.pressed = this.indexAt(event);
  }

  release(event) {
    const ends = [this.pressed, this.indexAt(event)];
    this.pressed = null;
    if (!ends.includes(null) && Math.abs(ends[0] - ends[1]) >= 2) {
      const start = this.part?.[0] ?? 0;
      this.show([start + Math.min(...ends), start + Math.max(...ends)]);
    }
  }

  // A part around the cursor, half or twice as long as what is shown.
  zoom(factor) {
    const reach = Math.round((this.xs.length * factor) / 2);
    const centre = (this.part?.[0] ?? 0) + (this.cursor ?? Math.round(this.xs.length / 2));
    const last = this.all.xs.length - 1;
    const whole = 2 * reach >= last;
    this.show(whole ? null : [Math.max(0, centre - reach), Math.min(last, centre + reach)]);
  }

  key(event) {
    const views = { "+": () => this.zoom(0.5), "-": () => this.zoom(2), Escape: () => this.show(null) };
    if (views[event.key]) {
      event.preventDefault();
      views[event.key]();
      return;
    }
    const last = this.xs.length - 1;
    const stride = event.shiftKey ? Math.max(1, Math.round(last / 20)) : 1;
    const from = this.cursor ?? (event.key === "ArrowLeft" ? last + 1 : -1);
    const target = { ArrowRight: from + stride, ArrowLeft: from - stride, Home: 0, End: last }[event.key];
    if (target !== undefined && last >= 0) {
      event.preventDefault();
      this.moveTo(Math.min(last, Math.max(0, target)));
    }
  }

  moveTo(index) {
    this.cursor = index;
    if (!this.layout) {
      return;
    }
    if (index === null) {
      this.mark.replaceChildren();
      this.readout.textContent = "";
      return;
    }
    const { inner, atX, atY } = this.layout;
    const x = atX(this.xs[index]);
    const values = this.columns.map((column) => column[index]);
    const dots = values.map((value, k) => this.drawable(value) &&
      svg("circle", { cx: x, cy: atY(value), r: 3.5, class: `dot ${this.series[k].look}` }));
    this.mark.replaceChildren(
      svg("line", { x1: x, x2: x, y1: TOP, y2: TOP + inner.height, class: "cursor" }),
      ...dots.filter(Boolean));
    const texts = values.map((value, k) =>
      `${this.series[k].name} ${quantity(number(value, 5), this.y.unit)}`);
    this.readout.textContent =
      [`${this.x.label} ${quantity(number(this.xs[index], 6), this.x.unit)}`, ...texts].join(" · ");
  }
}

// The index of the sorted column whose place is nearest to an offset.
function nearest(xs, place, offset) {
  let low = 0;
  let high = xs.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    place(xs[middle]) < offset ? (low = middle) : (high = middle);
  }
  return Math.abs(place(xs[low]) - offset) <= Math.abs(place(xs[high]) - offset) ? low : high;
}
