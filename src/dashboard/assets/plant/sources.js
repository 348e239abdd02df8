// @ts-check
// The page shows how the sources of collectors are, as each collector says: how far each series has come, and why
// one stands. A collector is set up where it runs, by its sources file, and not here.

import { get, items, pause, send } from "../shell/api.js";
import { h, notice, smallButton, table } from "../shell/dom.js";
import { count, instant, words } from "../shell/format.js";
import { plantHead, stateBadge } from "./head.js";

const POLL_MS = 10_000;

const COLUMNS = [
  { title: "Source" },
  { title: "State" },
  { title: "Samples up to" },
  { title: "Series", numeric: true },
  { title: "Last heard of" },
];
const SERIES_COLUMNS = [
  { title: "Series" },
  { title: "Stream" },
  { title: "Samples up to" },
  { title: "Why it stands" },
];

const HEALTH_WORDS = {
  following: "its samples come",
  refused: "a series is refused",
  away: "not reached",
  silent: "its collector is not heard of",
};

export function showSources(view) {
  const outcome = notice();
  const list = h("div", {});
  plantHead(view, "/plant/sources", "Sources");
  view.root.append(
    h(
      "p",
      { class: "quiet" },
      "A collector (",
      h("code", {}, "greybox collect"),
      ") runs beside a historian, reads its sources and appends their samples to streams. It says here how far it has come. ",
      h("a", { href: "/docs/collect" }, "How a collector is set up"),
    ),
    outcome.place,
    list,
  );
  follow({ view, outcome, list });
}

async function follow({ view, outcome, list }) {
  while (!view.signal.aborted) {
    try {
      const { data } = await get("/v1/sources", view.signal);
      outcome.clear();
      draw({ outcome, list, sources: items(data) });
    } catch (error) {
      outcome.fail(error);
    }
    await pause(POLL_MS, view.signal).catch(() => {});
  }
}

function draw({ outcome, list, sources }) {
  const open = new Set(
    [...list.querySelectorAll("details[open]")].map((part) => part.getAttribute("data-name")),
  );
  const forget = (name) => async () => {
    try {
      await send("DELETE", `/v1/sources/${encodeURIComponent(name)}`);
      draw({ outcome, list, sources: sources.filter((source) => source.name !== name) });
    } catch (error) {
      outcome.fail(error);
    }
  };
  const rows = sources.map((source) => [
    h("span", {}, source.name, h("span", { class: "quiet" }, ` ${words(source.kind)}`)),
    h("span", {}, stateBadge(source.health), ` ${HEALTH_WORDS[source.health]}`),
    reachedOf(source.series),
    count(source.series.length),
    h(
      "span",
      {},
      instant(source.heard_at),
      source.health === "silent" &&
        h(
          "span",
          { class: "for-writers" },
          " ",
          smallButton("Forget", `Forget the source ${source.name}`, forget(source.name)),
        ),
    ),
  ]);
  list.replaceChildren(
    h("h2", {}, "Sources of the project"),
    table("Sources", COLUMNS, rows, {
      empty: "No collector has said anything of a source yet.",
      stacked: true,
    }),
    ...sources.map((source) => seriesOf(source, open.has(source.name))),
  );
}

// A source has come as far as the series that is farthest behind.
function reachedOf(series) {
  const instants = series.map(({ reached }) => reached);
  if (instants.length === 0 || instants.includes(null)) {
    return "–";
  }
  return instant(
    instants.reduce((least, reached) => (Date.parse(reached) < Date.parse(least) ? reached : least)),
  );
}

function seriesOf({ name, away, series }, isOpen) {
  const stands = series.filter(({ fault }) => fault).length;
  const rows = series.map(({ series, stream, reached, fault }) => [
    series,
    h("a", { href: `#/plant/streams/${encodeURIComponent(stream)}` }, stream),
    reached ? instant(reached) : "–",
    fault ?? "–",
  ]);
  const behind = stands > 0 ? `, ${count(stands)} of ${count(series.length)} stand` : "";
  return h(
    "details",
    { open: isOpen || stands > 0, "data-name": name },
    h("summary", {}, `Series of ${name}${behind}`),
    away && h("p", { class: "note" }, away),
    table(`Series of ${name}`, SERIES_COLUMNS, rows, { stacked: true }),
  );
}
