// @ts-check
// The plots of a group share a time axis: they have the same cursor and show the same part. The samples
// of the part are read from the server whenever the part changes, so that every zoom shows all samples.
// Windows of a recording are chosen on the plots of its signals.

import { h } from "../shell/dom.js";
import { number, numberOf } from "../shell/format.js";
import { AxisWidths } from "./axes.js";
import { isAbout, longestUnused, movedWindow, partWithin } from "./math.js";
import { onUnits, preferClock, showsClock } from "./units.js";

const WAIT_MS = 90;

export class PlotGroup {
  /**
   * `full` is the whole range. `load(from, to, pixels, signal)` reads a part; both ends are null for the
   * whole range. `failed` is called with an error, `moved` with the part that is shown from now on. `clock`
   * is that of the recording, or null. `centre()` gives what a zoom keeps in the middle, which else is the middle of
   * the part.
   *
   * @param {{
   *   full: any,
   *   signal?: AbortSignal,
   *   failed?: (error: any) => void,
   *   clock?: ReturnType<typeof import("./clock.js").clockOf>,
   *   moved?: (part: any) => void,
   *   centre?: () => number | null,
   *   load?: (from: number, to: number, pixels: number, abort: AbortSignal) => Promise<any>,
   * }} options
   */
  constructor({
    full = null,
    load = null,
    signal = null,
    failed = () => {},
    moved = () => {},
    centre = () => null,
    clock = null,
  }) {
    this.clock = clock;
    this.centre = centre;
    this.full = full;
    this.load = load;
    this.signal = signal;
    this.failed = failed;
    this.moved = moved;
    this.plots = new Set();
    this.takers = new Map();
    this.axes = new AxisWidths(() => requestAnimationFrame(() => this.align()));
    this.part = null;
    this.changedAt = -Infinity;
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
    this.fetchSoon();
  }

  // A change that comes alone is read at once, and the last of many after a pause.
  fetchSoon() {
    const before = this.changedAt;
    this.changedAt = performance.now();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.fetch(), this.changedAt - before > WAIT_MS ? 0 : WAIT_MS);
  }

  zoom(factor) {
    const [from, to] = this.part ?? this.full ?? [0, 1];
    const [middle, reach] = [this.centre() ?? (from + to) / 2, ((to - from) * factor) / 2];
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
    this.reading = new AbortController();
    const signals = [this.signal, this.reading.signal].filter(Boolean);
    const [from, to] = this.part ? widened(this.part) : [null, null];
    const pixels = Math.max(300, ...[...this.plots].map((plot) => plot.element.clientWidth));
    try {
      const data = await this.load(from, to, pixels, AbortSignal.any(signals));
      for (const [plot, take] of this.takers) {
        plot.set(...take(data));
      }
      this.place.textContent = "";
    } catch (error) {
      if (error.name !== "AbortError") {
        this.failed(error);
      }
    }
  }

  // All plots of the group put their cursor where the cursor of the first plot is.
  point(from, x) {
    for (const plot of this.plots) {
      plot === from || plot.point(x);
    }
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

const ROLES = [
  ["estimation", "to estimate from"],
  ["validation", "only to check the estimate"],
];
// The words say what dragging across a plot does.
const DRAGS = {
  estimation: "chooses a window to estimate from",
  validation: "chooses a window to check with",
  leave_out: "leaves a stretch out",
  mark: "marks a stretch as bad; a click marks a sample",
  look: "only looks closer",
};
// An end of a window is held within so many pixels.
const HOLD = 9;

// The windows of a recording stand on a bar above its plots and in a list. They are chosen by dragging across
// a plot, moved and stretched on the bar, and changed by keyboard. `add`, `change` and `remove` store them;
// `draw()` then shows them, and `shade()` on the plots. `acts` says by the names of drags what further drags do:
// `take(part, name)` with a part of a signal's plot, `sample(x, name)` with a sample that was clicked, and
// `end(side, x, name)` with an end that was put at the cursor.
export class WindowChooser {
  constructor({ dataset, signal, drags, add, change, remove, acts = {} }) {
    this.length = dataset.duration_s;
    this.add = add;
    this.change = change;
    this.remove = remove;
    this.windows = [];
    this.further = [];
    this.current = 0;
    this.blocks = [];
    this.parts = [];
    this.brushing = h(
      "select",
      {},
      drags.map((name) =>
        h("option", { value: name, class: name === "mark" ? "for-writers" : null }, DRAGS[name]),
      ),
    );
    this.onBrush = {
      active: () => this.brushing.value !== "look",
      take: (part, name) => (acts[this.brushing.value]?.take ?? ((part) => this.drag(part)))(part, name),
      sample: (x, name) => acts[this.brushing.value]?.sample?.(x, name),
      end: (...end) => (acts[this.brushing.value]?.end ?? ((side, x) => this.end(side, x)))(...end),
    };
    this.track = h("div", { class: "track" });
    this.list = h("div", {});
    this.more = h("button", { type: "button", onclick: () => this.addUnused() }, "Add a window");
    this.element = h(
      "div",
      { class: "windows", role: "group", "aria-label": `Windows of ${dataset.name || dataset.id}` },
      this.list,
      h(
        "div",
        { class: "actions" },
        this.more,
        h("label", { class: "inline" }, "Dragging across a plot", this.brushing),
      ),
      this.track,
    );
    this.resized = new ResizeObserver(() => this.align());
    this.resized.observe(this.element);
    signal.addEventListener("abort", () => this.resized.disconnect(), { once: true });
  }

  // The bar lies above the plots of `part`, and shows the same time as they do.
  follow(part) {
    this.parts.push(part);
    if (this.parts.length === 1) {
      part.group.moved = () => this.align();
      part.ready.then(() => this.align());
    }
    this.shade();
  }

  isWhole({ from, to }) {
    return from <= 0 && to >= this.length;
  }

  // A window that is dragged takes the place of the whole recording, or is added to other windows.
  drag(part) {
    const [from, to] = partWithin(part, this.length);
    const whole = this.windows.findIndex((window) => this.isWhole(window));
    this.put(whole < 0 ? this.windows.length : whole, { from, to, role: this.brushing.value });
  }

  put(k, window) {
    this.current = k;
    if (k >= this.windows.length) {
      this.add(window);
      return;
    }
    // The form draws itself later; the next key has to meet the window as it is now.
    this.windows = this.windows.with(k, window);
    this.change(k, window);
  }

  // Sets an end of the window that was worked on last.
  end(side, x) {
    const window = this.windows[this.current] ?? { from: 0, to: this.length, role: "estimation" };
    const [from, to] = partWithin(side === 0 ? [x, window.to] : [window.from, x], this.length);
    this.put(Math.min(this.current, this.windows.length), { ...window, from, to });
  }

  // Adds the longest part that is not used yet; where all is used, the present window is cut in two.
  addUnused() {
    const unused = longestUnused(this.windows, this.length);
    const role = "estimation";
    if (unused) {
      this.put(this.windows.length, { from: unused[0], to: unused[1], role });
      return;
    }
    const k = Math.min(this.current, this.windows.length - 1);
    const window = this.windows[k];
    const [, middle] = partWithin([0, (window.from + window.to) / 2], this.length);
    const added = this.windows.length;
    this.change(k, { ...window, to: middle });
    this.current = added;
    this.add({ ...window, from: middle });
  }

  /**
   * Shows the windows; `nameOf` gives the name of each.
   *
   * @param {import("../plot/math.js").RecordingWindow[]} windows
   * @param {(k: number) => string} nameOf
   */
  draw(windows, nameOf) {
    this.windows = windows;
    this.names = windows.map((_, k) => nameOf(k));
    this.current = Math.max(0, Math.min(this.current, windows.length - 1));
    this.list.replaceChildren(...windows.map((window, k) => this.row(window, k)));
    for (const block of this.blocks.splice(windows.length)) {
      const isFocused = block === document.activeElement;
      block.remove();
      isFocused && (this.blocks.at(-1) ?? this.more).focus();
    }
    while (this.blocks.length < windows.length) {
      this.blocks.push(this.block(this.blocks.length));
      this.track.append(this.blocks.at(-1));
    }
    this.align();
  }

  // The list has the ends of each window as fields, and what the window is for.
  row(window, k) {
    const name = this.names[k];
    const end = (member, title, usual) =>
      h(
        "label",
        { class: "inline" },
        title,
        h("input", {
          type: "text",
          size: "8",
          "aria-label": `${name}, ${member}, in seconds`,
          value: window[member] === usual ? "" : String(window[member]),
          placeholder: String(Number(usual.toPrecision(6))),
          onfocus: () => this.mark(k),
          onchange: ({ target }) => {
            const typed = numberOf(target.value);
            const value = target.value.trim() && Number.isFinite(typed) ? typed : usual;
            const ends = { from: window.from, to: window.to, [member]: value };
            const [from, to] = partWithin([ends.from, ends.to], this.length);
            this.put(k, { ...window, from, to });
          },
        }),
      );
    const role = h(
      "select",
      {
        "aria-label": `What ${name} is for`,
        onfocus: () => this.mark(k),
        onchange: ({ target }) => this.put(k, { ...window, role: target.value }),
      },
      ROLES.map(([value, text]) => h("option", { value, selected: value === window.role }, text)),
    );
    const whole = this.isWhole(window);
    const all = { from: 0, to: this.length };
    const button = (title, label, onclick) =>
      h("button", { type: "button", class: "small", "aria-label": label, onclick }, title);
    return h(
      "div",
      { class: "window-row" },
      h("strong", {}, name),
      end("from", "from, s", 0),
      end("to", "to, s", this.length),
      role,
      !whole && button("All of it", `All of it for ${name}`, () => this.put(k, { ...window, ...all })),
      (this.windows.length > 1 || !whole) && button("Remove", `Remove ${name}`, () => this.remove(k)),
    );
  }

  // A block on the bar is moved by its middle, and stretched by its ends.
  block(k) {
    const block = h("div", { class: "window-block", role: "slider", tabindex: "0" });
    let held = null;
    const at = ({ clientX }) => {
      const [from, to] = this.shown();
      const shift = ((clientX - held.x) * (to - from)) / this.track.clientWidth;
      const { window } = held;
      if (held.end === null) {
        return movedWindow(window, shift, this.length);
      }
      const fixed = held.end === "from" ? window.to : window.from;
      const [first, last] = partWithin([window[held.end] + shift, fixed], this.length);
      return { ...window, from: first, to: last };
    };
    const release = (event) => {
      const [window, moved] = held ? [held.window, at(event)] : [];
      held = null;
      if (moved && event.type === "pointerup" && moved.to > moved.from) {
        (moved.from !== window.from || moved.to !== window.to) && this.put(k, moved);
      }
      this.align();
    };
    const grip = ({ clientX }) => {
      const { left, right } = block.getBoundingClientRect();
      return clientX - left < HOLD ? "from" : right - clientX < HOLD ? "to" : null;
    };
    block.addEventListener("pointerdown", (event) => {
      block.setPointerCapture(event.pointerId);
      held = { x: event.clientX, end: grip(event), window: this.windows[k] };
      this.mark(k);
    });
    block.addEventListener("pointermove", (event) => {
      block.classList.toggle("at-end", grip(event) !== null);
      held && this.place(block, at(event));
    });
    block.addEventListener("pointerup", release);
    block.addEventListener("pointercancel", release);
    block.addEventListener("focus", () => this.mark(k));
    block.addEventListener("keydown", (event) => this.key(event, k));
    return block;
  }

  key(event, k) {
    const [from, to] = this.shown();
    const step = (to - from) / (event.shiftKey ? 10 : 100);
    const shifts = { ArrowLeft: -step, ArrowRight: step, Home: -this.length, End: this.length };
    if (event.key in shifts) {
      event.preventDefault();
      this.put(k, movedWindow(this.windows[k], shifts[event.key], this.length));
    } else if (event.key === "Delete" || event.key === "Backspace") {
      event.preventDefault();
      this.remove(k);
    }
  }

  // The window that was worked on last is the window that [ and ] on a plot change.
  mark(k) {
    this.current = k;
    this.blocks.forEach((block, place) => {
      block.classList.toggle("current", place === k && this.blocks.length > 1);
    });
  }

  shown() {
    return this.parts[0]?.group.part ?? [0, this.length];
  }

  place(block, { from, to }) {
    const [first, last] = this.shown();
    const share = (x) => Math.min(1, Math.max(0, (x - first) / (last - first || 1)));
    block.hidden = to < first || from > last;
    block.style.left = `${100 * share(from)}%`;
    block.style.width = `${100 * (share(to) - share(from))}%`;
  }

  // Lays the bar exactly above the plots, and the blocks where the windows are.
  align() {
    const over = this.parts[0]?.drawn[0]?.chart.chart?.over;
    if (over) {
      over === this.over || this.resized.observe(over);
      this.over = over;
      const { left } = this.element.getBoundingClientRect();
      this.track.style.marginLeft = `${over.getBoundingClientRect().left - left}px`;
      this.track.style.width = `${over.clientWidth}px`;
    }
    this.track.hidden = this.windows.length === 0;
    this.blocks.forEach((block, k) => {
      const window = this.windows[k];
      const role = ROLES.find(([name]) => name === window.role)?.[1];
      block.className = `window-block ${window.role}`;
      const [, kind, place] = /^(.*?)(\d*)$/.exec(this.names[k]) ?? [];
      block.replaceChildren(h("span", { class: "kind" }, kind), place);
      block.title = `${this.names[k]}: drag to move it, drag an end to stretch it`;
      const values = {
        "aria-label": `${this.names[k]}. Arrow keys move it, Delete removes it.`,
        "aria-valuemin": 0,
        "aria-valuemax": Math.max(window.from, this.length - (window.to - window.from)),
        "aria-valuenow": window.from,
        "aria-valuetext": `${number(window.from, 6)} to ${number(window.to, 6)} s, ${role}`,
      };
      for (const [name, value] of Object.entries(values)) {
        block.setAttribute(name, String(value));
      }
      this.place(block, window);
    });
    this.mark(this.current);
  }

  // The spans of the windows on a plot; the whole recording alone is not shaded.
  spans() {
    const [window] = this.windows;
    return this.windows.length === 1 && this.isWhole(window) && window.role !== "validation"
      ? []
      : this.windows.map(({ from, to, role }) => ({
          from,
          to,
          kind: role === "validation" ? "check" : "window",
        }));
  }

  // Shades the windows on the plots, beside `further` spans of the signals and what is odd about the samples.
  shade(further = this.further) {
    this.further = further;
    for (const { name, chart } of this.parts.flatMap(({ drawn }) => drawn)) {
      const odd = chart.spans.filter(({ kind }) => kind === "bad" || kind === "missing");
      chart.setSpans([...this.spans(), ...further.filter(isAbout(name)), ...odd]);
    }
  }
}
