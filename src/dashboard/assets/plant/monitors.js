// @ts-check
// The page lists the monitors with what each waits for, the last window and the alarms.

import { get, pause } from "../shell/api.js";
import { h, notice, table } from "../shell/dom.js";
import { count, duration, instant, words } from "../shell/format.js";
import { plantHead, stateBadge } from "./head.js";
import { pagedList } from "./paged.js";

const POLL_MS = 10_000;

const COLUMNS = [
  { title: "Monitor" },
  { title: "State" },
  { title: "Alarms" },
  { title: "Last window" },
  { title: "Next window" },
  { title: "Windows" },
  { title: "Stream" },
];

export function showMonitors(view) {
  const outcome = notice();
  // The last window and the alarms of each monitor are asked for by themselves.
  const details = new Map();
  const list = pagedList({
    view,
    address: "/v1/monitors",
    more: "Older monitors",
    failed: (error) => outcome.fail(error),
    recovered: () => outcome.clear(),
    draw: (rows) =>
      table(
        "Monitors",
        COLUMNS,
        rows.map((row) => monitorRow(row, details.get(row.id))),
        { empty: "No monitors yet.", stacked: true },
      ),
  });
  plantHead(
    view,
    "/plant",
    "Monitors",
    h("a", { class: "button primary", href: "#/plant/monitors/new" }, "New monitor"),
  );
  view.root.append(
    h(
      "p",
      { class: "quiet" },
      "A monitor does a job again and again, on one window of a stream after the other, and raises an alarm when a parameter changes. ",
      h("a", { href: "/docs/monitors" }, "How it does that"),
    ),
    outcome.place,
    list.element,
  );
  keepUp(view, list, details).catch(() => {});
}

async function keepUp(view, list, details) {
  for (;;) {
    await list.refresh();
    for (const { id } of list.rows()) {
      // A monitor may have ended since the list was read.
      details.set(id, await detailsOf(id, view.signal).catch(() => undefined));
    }
    list.show();
    await pause(POLL_MS, view.signal);
  }
}

async function detailsOf(id, signal) {
  const [windows, alarms] = await Promise.all([
    get(`/v1/monitors/${id}/windows?limit=1`, signal),
    get(`/v1/monitors/${id}/alarms?limit=1`, signal),
  ]);
  return { window: windows.data.items[0], alarm: alarms.data.items[0] };
}

function monitorRow(monitor, detail) {
  const { id, name, stream, status, spec, next_window: next, due } = monitor;
  return [
    h("a", { href: `#/plant/monitors/${id}` }, name || id),
    stateBadge(status),
    detail?.alarm ? alarmText(detail.alarm) : "none",
    detail?.window ? [`${detail.window.number}: `, stateBadge(detail.window.status)] : "–",
    [`${next}, ${status === "working" ? "at work" : "due when samples reach"} `, instant(due, true)],
    planText(spec.window),
    h("a", { href: `#/plant/streams/${stream}` }, stream),
  ];
}

// Alarms are numbered from one on, so the number of the last alarm counts them.
function alarmText({ id, kind, raised_at: raised }) {
  return h("span", { class: "bad" }, `${count(id)}, the last: ${words(kind)}, `, instant(raised));
}

export function planText({ length_s: length, every_s: every, delay_s: delay }) {
  const pitch = every === length ? "one after the other" : `every ${duration(every)}`;
  return `${duration(length)}, ${pitch}${delay ? `, worked ${duration(delay)} later` : ""}`;
}
