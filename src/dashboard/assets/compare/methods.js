// @ts-check
// These pages show comparisons of methods: the list of them, and a single comparison with its success
// rates, evaluations and times.

import { badge } from "../list/rows.js";
import { get, items, pause, query } from "../shell/api.js";
import { facts, h, notice, table } from "../shell/dom.js";
import { count, duration, instant, methodText, number, percent } from "../shell/format.js";

const REFRESH_MS = 3000;

export function showComparisons(view) {
  const outcome = notice();
  const list = h("div", {});
  const state = { rows: [], next: null };
  const more = h("button", { type: "button", hidden: true, onclick: () => read() }, "Older comparisons");
  const columns = [{ title: "Started" }, { title: "Runs", numeric: true }, { title: "Ended", numeric: true }];
  const read = async () => {
    try {
      const { data } = await get(`/v1/comparisons${query({ page_token: state.next })}`, view.signal);
      state.rows.push(...items(data));
      state.next = data.next_page_token;
      more.hidden = !state.next;
      list.replaceChildren(
        table(
          "Comparisons",
          columns,
          state.rows.map((row) => [
            h("a", { href: `#/comparisons/${row.id}`, title: row.id }, instant(row.created_at)),
            count(row.runs),
            count(row.ended),
          ]),
          { empty: "No comparisons yet. A job's page can start one: “Compare methods”.", stacked: true },
        ),
      );
    } catch (error) {
      outcome.fail(error);
    }
  };
  view.root.append(
    h("h1", { tabindex: "-1" }, "Comparisons of methods"),
    h(
      "p",
      { class: "quiet" },
      "The same job by several methods and seeds: which of them finds the lowest cost, how often, and what it takes.",
    ),
    outcome.place,
    list,
    more,
  );
  read();
}

export function showComparison(view, id) {
  const outcome = notice();
  const content = h("div", {});
  view.root.append(h("h1", { tabindex: "-1" }, "Comparison of methods"), outcome.place, content);
  follow(view, id, content, outcome).catch(() => {});
}

async function follow(view, id, content, outcome) {
  for (;;) {
    try {
      const { data } = await get(`/v1/comparisons/${id}`, view.signal);
      content.replaceChildren(...parts(data));
      outcome.clear();
      if (data.finished) {
        return;
      }
    } catch (error) {
      outcome.fail(error);
    }
    await pause(REFRESH_MS, view.signal);
  }
}

function spread(statistics, shown) {
  return statistics
    ? [
        shown(statistics.median),
        h("div", { class: "quiet fine" }, `${shown(statistics.least)} … ${shown(statistics.largest)}`),
      ]
    : "–";
}

function parts(comparison) {
  const columns = [
    { title: "Method" },
    { title: "Found the lowest cost", numeric: true },
    { title: "Evaluations", numeric: true },
    { title: "Time", numeric: true },
    { title: "Cost, lowest = 1", numeric: true },
    { title: "Estimates differ by", numeric: true },
  ];
  const rows = comparison.methods.map((method) => [
    methodText(method.method),
    method.runs ? `${method.found} of ${method.runs} (${percent((100 * method.found) / method.runs)})` : "–",
    spread(method.evaluations, (value) => count(Math.round(value))),
    spread(method.seconds, duration),
    spread(method.cost_ratio, (value) => `× ${number(value)}`),
    spread(method.deviation_percent, (value) => `${number(value, 3)} %`),
  ]);
  const names = comparison.jobs
    .slice(0, 10)
    .map(({ id }) => id)
    .join(",");
  return [
    facts([
      ["Created", instant(comparison.created_at)],
      ["Runs", `${comparison.ended} of ${comparison.jobs.length} ended`],
      ["Lowest cost", number(comparison.lowest_cost, 6)],
    ]),
    h(
      "p",
      { class: "quiet" },
      "The numbers of a method are medians over its runs, each with the least and the largest. A run has found the lowest cost when its cost is within 1 % of it. That says nothing about a minimum that none of them found.",
    ),
    h(
      "div",
      { class: "workbench" },
      h(
        "div",
        {},
        h("h2", {}, "Methods"),
        table("Methods", columns, rows, { empty: "No run has ended yet.", stacked: true }),
        h(
          "div",
          { class: "actions" },
          h("a", { class: "button", href: `#/compare?jobs=${names}` }, "Compare the first runs in detail"),
          h(
            "a",
            { class: "button", href: `#/jobs?label=comparison:${comparison.id}` },
            "Show the runs in the list of jobs",
          ),
        ),
      ),
      h(
        "div",
        {},
        h("h2", {}, "Runs"),
        table(
          "Runs",
          [{ title: "Run" }, { title: "Status" }],
          comparison.jobs.map(({ id, method, seed, status }) => [
            h("a", { href: `#/jobs/${id}`, title: id }, `${methodText(method)}, seed ${seed}`),
            badge(status),
          ]),
        ),
      ),
    ),
  ];
}
