// @ts-check
// The page shows who did what: every change, and whoever was refused.

import { h, notice, table } from "../shell/dom.js";
import { count, instant } from "../shell/format.js";
import { isRefusal, matchingEntries, methodText } from "./entries.js";
import { plantHead, readAsAdmin } from "./head.js";
import { pagedList } from "./paged.js";

const PAGE = 200;

const COLUMNS = [
  { title: "When" },
  { title: "Who" },
  { title: "From" },
  { title: "Asked" },
  { title: "Of what" },
  { title: "Answered", numeric: true },
  { title: "Request" },
];

export function showAudit(view) {
  const outcome = notice();
  const filter = { text: "", method: "", outcome: "" };
  const summary = h("p", { class: "quiet", role: "status" });
  const methods = h("select", { onchange: (event) => choose("method", event) });
  const content = h("div", { hidden: true });
  const list = pagedList({
    view,
    address: "/v1/audit",
    more: "Older entries",
    limit: PAGE,
    failed: (error) => outcome.fail(error),
    draw: (rows) => {
      content.hidden = false;
      offerMethods(methods, rows, filter.method);
      const shown = matchingEntries(rows, filter);
      summary.textContent = `${count(shown.length)} of the ${count(rows.length)} entries that were read.`;
      return table("Entries", COLUMNS, shown.map(entryRow), {
        empty: rows.length ? "No entry is like this." : "Nothing was written yet.",
      });
    },
  });
  const choose = (name, event) => {
    filter[name] = event.target.value;
    list.show();
  };
  content.append(
    filterFields(methods, choose),
    summary,
    list.element,
    h(
      "p",
      { class: "quiet" },
      "All of it as CSV or as lines of JSON: ",
      h("code", {}, "GET /v1/audit"),
      " with ",
      h("code", {}, "Accept: text/csv"),
      " or ",
      h("code", {}, "application/x-ndjson"),
      ".",
    ),
  );
  plantHead(view, "/plant/audit", "Audit log");
  view.root.append(
    h(
      "p",
      { class: "quiet" },
      "Every change and every refusal, the newest first. A server that asks nobody who they are writes refusals alone.",
    ),
    outcome.place,
    content,
  );
  readAsAdmin({ view, what: "The audit log", outcome, read: list.read });
}

function filterFields(methods, choose) {
  return h(
    "search",
    { class: "fields filters" },
    h(
      "label",
      { class: "grow" },
      "Search in what was read",
      h("input", {
        type: "search",
        placeholder: "who, address, path, status, request",
        oninput: (event) => choose("text", event),
      }),
    ),
    h("label", {}, "Asked", methods),
    h(
      "label",
      {},
      "Outcome",
      h(
        "select",
        { onchange: (event) => choose("outcome", event) },
        [
          ["", "all"],
          ["done", "done"],
          ["refused", "refused or failed"],
        ].map(([value, text]) => h("option", { value }, text)),
      ),
    ),
  );
}

function offerMethods(place, rows, chosen) {
  const names = [...new Set([...rows.map(({ method }) => method), chosen].filter(Boolean))].sort();
  place.replaceChildren(
    h("option", { value: "" }, "all"),
    ...names.map((name) => h("option", { value: name, selected: name === chosen }, methodText(name))),
  );
}

function entryRow(entry) {
  const { at, who, address, method, path, status, request_id: request, left_out: left } = entry;
  return [
    instant(at, true),
    left > 0 ? [who, h("span", { class: "quiet" }, ` and ${count(left)} more before it`)] : who,
    address,
    methodText(method),
    h("code", { class: "digest" }, path),
    h("span", { class: isRefusal(entry) ? "bad" : null }, String(status)),
    h("code", { class: "digest" }, request),
  ];
}
