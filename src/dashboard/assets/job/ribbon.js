// @ts-check
// The ribbon shows the windows of a selection over time: a lane for each wanted parameter, in which the shade of a
// window tells how much the window says by itself. Windows that were left out are hatched, and chosen windows
// are framed. The pointer and the arrow keys read the windows, and a window opens in the page of its stream.

import { READER } from "../plot/clock.js";
import { PlotGroup } from "../plot/group.js";
import { colour, onTheme } from "../plot/theme.js";
import { h } from "../shell/dom.js";
import { number } from "../shell/format.js";
import {
  addressOfWindow,
  LEFT_OUT,
  laneTitle,
  SHADE_ENDS,
  sharesOf,
  spanOf,
  stretchesOf,
  windowAfter,
  windowText,
  windowUnder,
} from "./windows.js";

const MARK = 12;
const NAME = 22;
const LANE = 30;
const GAP = 8;
const AXIS = 56;
const TICK_PIXELS = 100;
// A frame is drawn at least so wide, so that a chosen window of a long time is seen.
const FRAME = 5;
const HATCH = 7;
const TICK_FONT = "12px system-ui, sans-serif";
const TO_THE_SECOND = { text: (seconds) => READER.text(seconds, 0) };

export class Ribbon {
  /** @param {{ signal: AbortSignal }} view @param {any} selection */
  constructor(view, selection) {
    this.selection = selection;
    this.lanes = selection.wanted.map(({ name }, k) => ({
      title: laneTitle(selection, name),
      shares: sharesOf(selection.windows.alone[name] ?? []),
      top: MARK + k * (NAME + LANE + GAP) + NAME,
    }));
    // Over a pixel, the windows of all lanes are judged by the lane in which they say most.
    this.shares = Array.from({ length: selection.windows.count }, (_, window) =>
      Math.max(0, ...this.lanes.map(({ shares }) => shares[window] ?? 0)),
    );
    this.cursor = selection.chosen[0]?.window ?? 0;
    this.canvas = h("canvas", { "aria-hidden": "true" });
    this.mark = h("div", { class: "ribbon-cursor", hidden: true });
    this.readout = h("output", { class: "readout" });
    this.link = h("a", {}, "Open this window in the stream");
    this.surface = h(
      "div",
      {
        class: "ribbon",
        tabindex: "0",
        role: "application",
        "aria-label": `The windows of ${selection.stream}, ${this.lanes.map(({ title }) => title).join("; ")}. Arrow keys go from window to window, Page Up and Page Down to chosen windows, Enter opens a window in the stream, + and − change the part that is shown, Escape shows all.`,
        onkeydown: (event) => this.key(event),
        onpointermove: (event) => this.point(event),
        onclick: (event) => this.click(event),
        onfocus: () => this.go(this.cursor),
      },
      this.canvas,
      this.mark,
      this.lanes.map(nameOf),
    );
    const whole = [spanOf(selection, 0)[0], spanOf(selection, selection.windows.count - 1)[1]];
    const centre = () => spanOf(selection, this.cursor).reduce((begin, end) => (begin + end) / 2);
    this.group = new PlotGroup({ full: whole, signal: view.signal, centre });
    this.group.add(this);
    this.element = h(
      "figure",
      { class: "chart" },
      legend(),
      this.group.toolbar,
      this.surface,
      this.readout,
      h("p", {}, this.link),
    );
    this.tell();
    onTheme(() => this.draw(), view.signal);
    const sizes = new ResizeObserver(() => this.draw());
    sizes.observe(this.surface);
    view.signal.addEventListener("abort", () => sizes.disconnect(), { once: true });
  }

  get range() {
    return this.group.part ?? this.group.full;
  }

  // The group calls this when another part is to be shown.
  show() {
    this.draw();
  }

  key(event) {
    const acts = {
      Enter: () => this.open(),
      "+": () => this.group.zoom(0.5),
      "=": () => this.group.zoom(0.5),
      "-": () => this.group.zoom(2),
      Escape: () => this.group.show(null),
    };
    const window = windowAfter(this.selection, this.cursor, event.key);
    if (window !== null || acts[event.key]) {
      event.preventDefault();
      window === null ? acts[event.key]() : this.go(window);
    }
  }

  // Puts the cursor on a window, and moves the part that is shown to the window.
  go(window) {
    this.cursor = window;
    const [from, to] = this.range;
    const [begin, end] = spanOf(this.selection, window);
    if (begin < from || end > to) {
      this.group.move(begin < from ? (begin - from) / (to - from) - 0.1 : (end - to) / (to - from) + 0.1);
    }
    this.tell();
    this.place();
  }

  // The window under the pointer.
  under({ clientX }) {
    const box = this.surface.getBoundingClientRect();
    const [from, to] = this.range;
    const at = (pixel) => from + (Math.max(0, Math.min(box.width, pixel)) / box.width) * (to - from);
    const pixel = Math.floor(clientX - box.left);
    return windowUnder(this.selection, this.shares, [at(pixel), at(pixel + 1)]);
  }

  point(event) {
    this.cursor = this.under(event);
    this.tell();
    this.place();
  }

  // A finger has no place to read before it touches: a touch reads the window, and the link opens the window.
  click(event) {
    this.point(event);
    if (event.pointerType !== "touch") {
      this.open();
    }
  }

  open() {
    location.hash = addressOfWindow(this.selection, this.cursor);
  }

  tell() {
    this.readout.textContent = windowText(this.selection, this.cursor, TO_THE_SECOND);
    this.link.href = addressOfWindow(this.selection, this.cursor);
  }

  place() {
    const [from, to] = this.range;
    const share = (seconds) => (seconds - from) / (to - from);
    const [begin, end] = spanOf(this.selection, this.cursor).map(share);
    this.mark.hidden = end <= 0 || begin >= 1;
    this.mark.style.left = `${100 * Math.max(0, begin)}%`;
    this.mark.style.width = `${100 * (Math.min(1, end) - Math.max(0, begin))}%`;
    this.mark.style.bottom = `${AXIS}px`;
  }

  draw() {
    const wide = this.surface.clientWidth;
    if (wide === 0) {
      return;
    }
    const high = MARK + this.lanes.length * (NAME + LANE + GAP) + AXIS;
    const ratio = devicePixelRatio || 1;
    this.canvas.width = Math.round(wide * ratio);
    this.canvas.height = Math.round(high * ratio);
    this.canvas.style.height = `${high}px`;
    const ink = this.canvas.getContext("2d");
    ink.scale(ratio, ratio);
    const hatch = hatchOf(ink);
    for (const { shares, top } of this.lanes) {
      for (const { from, to, shade } of stretchesOf(this.selection, shares, this.range, wide)) {
        ink.fillStyle = shade === LEFT_OUT ? hatch : colour(`shade-${shade}`);
        ink.fillRect(from, top, to - from, LANE);
      }
    }
    this.drawChosen(ink, wide);
    drawAxis(ink, { range: this.range, wide, top: high - AXIS });
    this.place();
  }

  // A chosen window has a mark above the lanes and a frame in each lane.
  drawChosen(ink, wide) {
    const [from, to] = this.range;
    ink.strokeStyle = colour("focus");
    ink.fillStyle = colour("focus");
    ink.lineWidth = 2;
    for (const { window } of this.selection.chosen) {
      const [left, right] = spanOf(this.selection, window).map((end) => ((end - from) / (to - from)) * wide);
      if (right < 0 || left > wide) {
        continue;
      }
      const [middle, reach] = [(left + right) / 2, Math.max(FRAME, right - left) / 2];
      ink.beginPath();
      ink.moveTo(middle - 6, 0);
      ink.lineTo(middle + 6, 0);
      ink.lineTo(middle, MARK - 2);
      ink.fill();
      for (const { top } of this.lanes) {
        ink.strokeRect(middle - reach, top - 1, 2 * reach, LANE + 2);
      }
    }
  }
}

// The name of a lane stands above the lane.
function nameOf({ title, top }) {
  const name = h("span", { class: "ribbon-name" }, title);
  name.style.top = `${top - NAME}px`;
  return name;
}

// The hatching of windows that were left out.
function hatchOf(ink) {
  const ratio = devicePixelRatio || 1;
  const tile = h("canvas", { width: String(HATCH * ratio), height: String(HATCH * ratio) });
  const brush = tile.getContext("2d");
  brush.scale(ratio, ratio);
  brush.fillStyle = colour("panel");
  brush.fillRect(0, 0, HATCH, HATCH);
  brush.strokeStyle = colour("rule");
  brush.lineWidth = 1.5;
  for (const shift of [-HATCH, 0, HATCH]) {
    brush.beginPath();
    brush.moveTo(shift - 1, HATCH + 1);
    brush.lineTo(shift + HATCH + 1, -1);
    brush.stroke();
  }
  const hatch = ink.createPattern(tile, "repeat");
  hatch.setTransform(new DOMMatrix([1 / ratio, 0, 0, 1 / ratio, 0, 0]));
  return hatch;
}

// The axis has the clock of the reader, as plots of streams have.
function drawAxis(ink, { range, wide, top }) {
  const [from, to] = range;
  ink.font = TICK_FONT;
  ink.textBaseline = "top";
  ink.fillStyle = colour("quiet");
  ink.strokeStyle = colour("rule");
  ink.lineWidth = 1;
  for (const [seconds, text] of READER.ticks(range, Math.max(2, wide / TICK_PIXELS))) {
    const x = ((seconds - from) / (to - from)) * wide;
    ink.beginPath();
    ink.moveTo(Math.round(x) + 0.5, top - GAP + 2);
    ink.lineTo(Math.round(x) + 0.5, top);
    ink.stroke();
    const lines = text.split("\n");
    const reach = Math.max(...lines.map((line) => ink.measureText(line).width)) / 2;
    // A text at an end of the axis stays within the picture.
    const middle = Math.min(wide - reach, Math.max(reach, x));
    ink.textAlign = "center";
    lines.forEach((line, k) => {
      ink.fillText(line, middle, top + 4 + 15 * k);
    });
  }
  ink.fillText(`time [${READER.zone}]`, wide / 2, top + 38);
  ink.textAlign = "start";
}

function legend() {
  const percent = (share) => number(100 * share, 3);
  const between = SHADE_ENDS.slice(1).map((end, k) => `${percent(SHADE_ENDS[k])} to ${percent(end)} %`);
  const texts = [`below ${percent(SHADE_ENDS[0])} %`, ...between, `from ${percent(SHADE_ENDS.at(-1))} %`];
  return h(
    "figcaption",
    {},
    h("span", { class: "plot-title" }, "What each window says by itself"),
    h(
      "span",
      { class: "legend" },
      "of what the best window says:",
      texts.map((text, shade) => h("span", {}, h("i", { class: `swatch shade-${shade}` }), text)),
      h("span", {}, h("i", { class: "swatch left-out" }), "left out"),
      h("span", {}, h("i", { class: "swatch chosen" }), "chosen"),
    ),
  );
}
