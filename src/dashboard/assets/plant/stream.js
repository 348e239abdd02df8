// @ts-check
// The page of a single stream shows what it holds, plots of a chosen part, and what can be done with
// the part: keep it as a recording, or take its samples out.

import { download } from "../plot/save.js";
import { get, pause, query, request, send } from "../shell/api.js";
import { facts, h, notice } from "../shell/dom.js";
import { count, duration, instant, instantText, size } from "../shell/format.js";
import { nameHeading, plantHead } from "./head.js";
import { isoAfter, isoBefore, partNamed, secondsOf } from "./instants.js";
import { PartPlots } from "./part.js";
import { StreamMarks } from "./stream_marks.js";

const POLL_MS = 5000;

export function showStream(view, name) {
  const page = new StreamPage(view, name);
  nameHeading(plantHead(view, "/plant/streams", name), name);
  view.root.append(page.outcome.place, page.element);
  page.start();
}

class StreamPage {
  constructor(view, name) {
    this.view = view;
    this.address = `/v1/streams/${encodeURIComponent(name)}`;
    this.name = name;
    this.outcome = notice();
    this.facts = h("div", {});
    this.element = h("div", { hidden: true });
    this.plots = null;
    this.lost = false;
    this.isEnding = false;
    // The address may name the part that is shown first.
    this.part = partNamed(view.query);
  }

  async start() {
    try {
      const stream = await this.read();
      this.draw(stream);
      await this.follow(stream);
    } catch (error) {
      this.outcome.fail(error);
    }
  }

  async read() {
    /** @type {{ data: any }} */
    const { data } = await get(this.address, this.view.signal);
    this.facts.replaceChildren(factsOf(data));
    return data;
  }

  // A failure is shown until the stream can be read again.
  async readOrSay() {
    try {
      const stream = await this.read();
      if (this.lost) {
        this.lost = false;
        this.outcome.clear();
      }
      return stream;
    } catch (error) {
      this.lost = true;
      this.outcome.fail(error);
      return null;
    }
  }

  // A stream grows while it is looked at.
  async follow(stream) {
    let before = stream;
    for (;;) {
      await pause(POLL_MS, this.view.signal);
      const now = this.isEnding ? before : ((await this.readOrSay()) ?? before);
      if (now.first !== before.first || now.last !== before.last || now.samples !== before.samples) {
        before = now;
        this.plots ? this.plots.grow(now) : this.draw(now);
      }
    }
  }

  draw(stream) {
    this.element.hidden = false;
    this.plots?.leave();
    const { view } = this;
    const plots = stream.first ? new PartPlots({ view, address: this.address, stream }) : null;
    this.plots = plots;
    const ofStream = query({ stream: this.name });
    this.element.replaceChildren(
      h(
        "div",
        { class: "actions" },
        h(
          "a",
          { class: "button for-writers", href: `#/plant/monitors/new${ofStream}` },
          "Watch it with a monitor",
        ),
        h(
          "a",
          { class: "button for-writers", href: `#/plant/windows/new${ofStream}` },
          "Find windows for a job",
        ),
        h(
          "button",
          { type: "button", class: "danger", onclick: () => this.removeStream() },
          "Delete the stream",
        ),
      ),
      this.facts,
      ...(plots ? this.partOf(plots, stream) : [h("p", {}, "It has no samples.")]),
    );
    this.plots?.start(this.part);
    this.part = null;
  }

  partOf(plots, stream) {
    const marks = new StreamMarks({
      view: this.view,
      address: this.address,
      signals: stream.signals,
      chosen: () => plots.chosen(),
      show: (from, to) => plots.group.show([from, to]),
      changed: (spans) => plots.shade(spans),
    });
    const name = h("input", {
      type: "text",
      maxlength: "200",
      size: "28",
      placeholder: `${this.name}, part`,
    });
    const button = (title, act, look) => h("button", { type: "button", class: look, onclick: act }, title);
    return [
      h(
        "div",
        { class: "workbench" },
        h(
          "div",
          {},
          h("h2", {}, "A part of the stream"),
          plots.fields,
          h(
            "div",
            { class: "panel fields" },
            h("label", { class: "for-writers" }, "Name of the recording", name),
            button("Cut a recording from this part", () => this.cut(name.value.trim()), "for-writers"),
            button("Download the part as CSV", () => this.saveCsv()),
            button("Remove these samples", () => this.removePart(), "danger"),
          ),
          marks.element,
        ),
        plots.element,
      ),
    ];
  }

  // Gives the chosen part as the API takes it, which ends before its `to`.
  chosen() {
    const [from, to] = this.plots.chosen();
    return { from: isoBefore(from), to: isoAfter(to) };
  }

  cut(name) {
    return this.outcome.attempt(async () => {
      const { data } = await send("POST", `${this.address}/recordings`, {
        ...(name ? { name } : {}),
        ...this.chosen(),
      });
      location.hash = `/datasets/${data.id}`;
    });
  }

  saveCsv() {
    return this.outcome.attempt(async () => {
      const { data } = await request("GET", `${this.address}${query(this.chosen())}`, {
        headers: { accept: "text/csv" },
        signal: this.view.signal,
      });
      download(new Blob([data], { type: "text/csv" }), `${this.name}.csv`);
    });
  }

  removePart() {
    return this.outcome.attempt(async () => {
      const { from, to } = this.chosen();
      const [first, end] = [from, to].map((text) => instantText(new Date(text), true));
      if (!confirm(`Remove the samples of ${this.name} from ${first} until ${end}? They do not come back.`)) {
        return;
      }
      const { data } = await send("DELETE", `${this.address}/samples${query({ from, to })}`);
      this.draw(await this.read());
      this.outcome.show(h("p", { role: "status" }, `${count(data.removed)} samples were removed.`));
    });
  }

  removeStream() {
    return this.outcome.attempt(async () => {
      if (confirm(`Delete the stream ${this.name} with all its samples?`)) {
        this.isEnding = true;
        await send("DELETE", this.address).catch((error) => {
          this.isEnding = false;
          throw error;
        });
        location.hash = "/plant/streams";
      }
    });
  }
}

function factsOf(stream) {
  const { first, last } = stream;
  const keptFor = stream.keep_s === null ? "" : `${duration(stream.keep_s)}, and `;
  return facts([
    ["From", first && instant(first, true)],
    ["To", last && instant(last, true)],
    ["Span", first && duration(secondsOf(last) - secondsOf(first))],
    ["Samples", count(stream.samples)],
    ["Signals", count(stream.signals.length)],
    ["Size", size(stream.bytes)],
    ["Kept", `${keptFor}at most ${stream.keep_mib} MiB`],
    ["Zone of its source", stream.zone],
    ["First batch", instant(stream.created_at)],
    ["Last batch", instant(stream.received_at)],
  ]);
}
