// @ts-check
// The page of a single monitor shows each parameter over the windows, the windows with their jobs, and
// the alarms. The page follows the events of the monitor.

import { get, pause, send } from "../shell/api.js";
import { facts, h, notice, table } from "../shell/dom.js";
import { duration, instant, number, timeSpan, withInstants, words } from "../shell/format.js";
import { nameHeading, plantHead, stateBadge } from "./head.js";
import { fieldSeconds, isoBefore, secondsOf } from "./instants.js";
import { planText } from "./monitors.js";
import { pagedList } from "./paged.js";
import { mergedWindows } from "./trend.js";
import { TrendPlots, windowLink, windowTable } from "./windows.js";

// Events that come together make a single request.
const GATHER_MS = 300;
const AGAIN_MS = 3000;
const SHOWN_WINDOWS = 100;

const ALARM_COLUMNS = [
  { title: "Raised" },
  { title: "Alarm" },
  { title: "Window", numeric: true },
  { title: "What it is about" },
];

export function showMonitor(view, id) {
  const page = new MonitorPage(view, id);
  page.heading = plantHead(view, "/plant", id, page.state, page.connection);
  view.root.append(page.outcome.place, page.element);
  page.start();
}

class MonitorPage {
  constructor(view, id) {
    this.view = view;
    this.id = id;
    this.address = `/v1/monitors/${id}`;
    this.outcome = notice();
    this.heading = null;
    this.state = h("span", {});
    this.connection = h("span", { class: "quiet", role: "status" });
    this.about = h("div", {});
    this.waiting = h("p", { class: "panel", "aria-live": "polite", hidden: true });
    this.windows = [];
    this.older = null;
    this.lost = false;
    this.isEnding = false;
    this.events = null;
    this.plots = new TrendPlots(view);
    this.table = h("div", { class: "within" });
    this.more = h(
      "button",
      { type: "button", hidden: true, onclick: () => this.readOlder() },
      "Older windows",
    );
    this.alarms = pagedList({
      view,
      address: `${this.address}/alarms`,
      more: "Older alarms",
      limit: 100,
      failed: (error) => this.outcome.fail(error),
      draw: (rows) => {
        this.drawPlots();
        return table(
          "Alarms",
          ALARM_COLUMNS,
          rows.map((alarm) => alarmRow(alarm, this.windows)),
          {
            empty: "No alarm was raised.",
            stacked: true,
          },
        );
      },
    });
    this.spec = h("pre", { tabindex: "0" });
    this.element = h(
      "div",
      { hidden: true },
      this.actions(),
      this.about,
      this.waiting,
      h("h2", {}, "Alarms"),
      h("div", { class: "within few" }, this.alarms.element),
      h("h2", {}, "Parameters over the windows"),
      this.plots.element,
      h("h2", {}, "Windows"),
      this.table,
      this.more,
      h("details", {}, h("summary", {}, "Complete specification"), this.spec),
    );
  }

  async start() {
    try {
      await this.refresh();
      const { data } = await get(`/v1/monitors/${this.id}/windows?limit=${SHOWN_WINDOWS}`, this.view.signal);
      this.take(data);
      this.follow();
    } catch (error) {
      this.outcome.fail(error);
    }
  }

  async refresh() {
    const { data } = await get(`/v1/monitors/${this.id}`, this.view.signal);
    if (this.lost) {
      this.lost = false;
      this.outcome.clear();
    }
    this.element.hidden = false;
    nameHeading(this.heading, data.name || data.id);
    this.state.replaceChildren(stateBadge(data.status));
    this.about.replaceChildren(aboutMonitor(data));
    this.waiting.hidden = !data.waits_for;
    this.waiting.replaceChildren(...waitingText(data.waits_for, data.stream));
    this.spec.textContent = JSON.stringify(data.spec, null, 2);
    this.windows = mergedWindows(this.windows, data.windows);
    this.drawWindows();
    await this.alarms.refresh();
  }

  take(page) {
    this.windows = mergedWindows(this.windows, page.items);
    this.older = page.next_page_token;
    this.drawWindows();
  }

  async readOlder() {
    try {
      const { data } = await get(
        `/v1/monitors/${this.id}/windows?limit=${SHOWN_WINDOWS}&page_token=${this.older}`,
        this.view.signal,
      );
      this.take(data);
    } catch (error) {
      this.outcome.fail(error);
    }
  }

  drawWindows() {
    this.more.hidden = !this.older;
    this.table.replaceChildren(windowTable(this.windows));
    this.drawPlots();
  }

  drawPlots() {
    this.plots.show(this.windows, this.alarms.rows());
  }

  // Events say that there is something new, which is then read. The tab keeps the number of the last
  // event, so that the next visit hears only what came since.
  follow() {
    const key = `monitor-event ${this.id}`;
    const last = sessionStorage.getItem(key);
    const stream = new EventSource(`${this.address}/events${last ? `?last_event_id=${last}` : ""}`);
    this.events = stream;
    this.view.signal.addEventListener("abort", () => stream.close(), { once: true });
    stream.onopen = () => {
      this.connection.textContent = "live";
      this.refreshSoon();
    };
    stream.onerror = () => {
      this.connection.textContent = "connection lost, trying again";
      if (stream.readyState === EventSource.CLOSED && !this.view.signal.aborted) {
        this.followAgain();
      }
    };
    for (const name of ["window", "alarm"]) {
      stream.addEventListener(name, ({ lastEventId }) => {
        sessionStorage.setItem(key, lastEventId);
        this.refreshSoon();
      });
    }
  }

  // A browser does not reconnect by itself after an answer that was no stream.
  async followAgain() {
    try {
      await pause(AGAIN_MS, this.view.signal);
      await this.refresh();
      this.follow();
    } catch (error) {
      this.fail(error);
      if (error.status !== 404 && error.name !== "AbortError") {
        this.followAgain();
      }
    }
  }

  refreshSoon() {
    this.refreshing ??= pause(GATHER_MS, this.view.signal)
      .then(() => {
        this.refreshing = null;
        return this.isEnding ? null : this.refresh();
      })
      .catch((error) => this.fail(error));
  }

  // A failure to read is shown until the monitor can be read again.
  fail(error) {
    this.lost = true;
    this.outcome.fail(error);
  }

  actions() {
    const from = h("input", { type: "datetime-local", step: "0.001", required: true });
    const move = async (event) => {
      event.preventDefault();
      await this.outcome.attempt(async () => {
        await send("POST", `${this.address}/move`, { from: isoBefore(fieldSeconds(from.value)) });
        await this.refresh();
        this.outcome.show(h("p", { role: "status" }, "The monitor goes on with another window."));
      });
    };
    return h(
      "div",
      { class: "actions" },
      h(
        "a",
        { class: "button for-writers", href: `#/plant/monitors/new?monitor=${this.id}` },
        "Use as template",
      ),
      h("button", { type: "button", class: "danger", onclick: () => this.end() }, "End this monitor"),
      h(
        "details",
        { class: "move for-writers" },
        h("summary", {}, "Go on with another window"),
        h(
          "form",
          { class: "fields", onsubmit: move },
          h("label", {}, "The next window is the first from", from),
          h("button", { type: "submit" }, "Move"),
          h(
            "p",
            { class: "quiet" },
            "Windows between are left out. A window that was worked is not worked again.",
          ),
        ),
      ),
    );
  }

  async end() {
    if (!confirm("End this monitor? Its windows and alarms go; jobs and recordings of the windows stay.")) {
      return;
    }
    // Nothing is read of a monitor that is about to go.
    this.isEnding = true;
    this.events?.close();
    try {
      await send("DELETE", this.address);
      location.hash = "/plant";
    } catch (error) {
      this.isEnding = false;
      this.outcome.fail(error);
      this.follow();
    }
  }
}

function aboutMonitor({ stream, spec, created_at: created }) {
  const { window, only_when: only, drift = {}, alarms, keep_jobs: kept, job } = spec;
  const drifts = Object.entries(drift).map(
    ([name, { std, per_s: per }]) => `${words(name)} by ${number(std)} in ${duration(per)}`,
  );
  const stopped = alarms?.data_stopped_after_s;
  return facts([
    ["Stream", h("a", { href: `#/plant/streams/${stream}` }, stream)],
    ["Windows", planText(window)],
    ["First window", window.from && instant(window.from, true)],
    [
      "Worked when",
      only
        ? `${words(only.signal)} moves by more than ${number(100 * only.moves_more_than)} %`
        : "it says something of a parameter",
    ],
    ["Model", h("a", { href: `#/models/${encodeURIComponent(job.model)}` }, job.model)],
    ["Drift", drifts.join(", ")],
    ["False alarms", `${number(100 * alarms.false_alarm_rate)} % of windows at the most`],
    ["Data have stopped after", stopped ? duration(stopped) : null],
    ["Jobs kept", `of ${kept} windows`],
    ["Created", instant(created)],
  ]);
}

// A newest sample that lies within a minute before is told by how far it lies before.
function waitingText(waits, stream) {
  if (!waits) {
    return [];
  }
  const { window, from, to, due, reached } = waits;
  const lack = reached ? secondsOf(due) - secondsOf(reached) : Infinity;
  const isNear = lack > 0 && lack < 60;
  return [
    `Waits for window ${window}, `,
    timeSpan(from, to),
    `: it is worked when ${stream} has a sample at or after `,
    instant(due, true),
    isNear
      ? `; the newest is ${duration(lack)} before.`
      : reached
        ? ["; the newest is at ", instant(reached, true), "."]
        : "; it has none.",
  ].flat();
}

// An alarm leads to the job of its window.
function alarmRow({ kind, raised_at: raised, window: place, detail }, windows) {
  const window = windows.find(({ number }) => number === place);
  return [
    instant(raised),
    h("span", { class: "badge failed" }, words(kind)),
    place === undefined ? "–" : window ? windowLink(window) : String(place),
    h("span", { class: "sentence" }, withInstants(detail)),
  ];
}
