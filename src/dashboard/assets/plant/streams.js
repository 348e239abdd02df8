// @ts-check
// The page lists the streams: recordings that grow.

import { h, notice, quoted, table } from "../shell/dom.js";
import { count, duration, instant, size, timeSpan, words } from "../shell/format.js";
import { plantHead } from "./head.js";
import { secondsOf } from "./instants.js";
import { pagedList } from "./paged.js";

const COLUMNS = [
  { title: "Stream" },
  { title: "Span" },
  { title: "Length", numeric: true },
  { title: "Samples", numeric: true },
  { title: "Size", numeric: true },
  { title: "Signals" },
  { title: "Last batch" },
];
const SIGNALS_NAMED = 4;

export function showStreams(view) {
  const outcome = notice();
  const list = pagedList({
    view,
    address: "/v1/streams",
    more: "More streams",
    failed: (error) => outcome.fail(error),
    draw: (rows) =>
      table("Streams", COLUMNS, rows.map(streamRow), { empty: "No streams yet.", stacked: true }),
  });
  plantHead(view, "/plant/streams", "Streams");
  view.root.append(
    h(
      "p",
      { class: "quiet" },
      quoted(
        "A stream is a recording that grows: the plant appends samples with `POST /v1/streams/{name}`. ",
      ),
      h("a", { href: "/docs/monitors" }, "How that is done"),
    ),
    outcome.place,
    list.element,
  );
  list.read();
}

function streamRow({ name, first, last, samples, bytes, signals, received_at: received }) {
  return [
    h("a", { href: `#/plant/streams/${name}` }, name),
    timeSpan(first, last),
    first ? duration(secondsOf(last) - secondsOf(first)) : "–",
    count(samples),
    size(bytes),
    h("span", { class: "sentence" }, signalNames(signals)),
    instant(received),
  ];
}

function signalNames(signals) {
  const named = signals.slice(0, SIGNALS_NAMED).map(({ name }) => words(name));
  const rest = signals.length - named.length;
  return rest > 0 ? `${named.join(", ")} and ${rest} more` : named.join(", ");
}
