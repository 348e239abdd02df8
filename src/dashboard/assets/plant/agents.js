// @ts-check
// The page lists the mappings, which say where the series of agents go, with the addresses that agents write to, and
// has a form for a new mapping.

import { get, items, send } from "../shell/api.js";
import { h, notice, table } from "../shell/dom.js";
import { count, instant } from "../shell/format.js";
import { mayWrite } from "../shell/session.js";
import { plantHead } from "./head.js";

const COLUMNS = [
  { title: "Mapping" },
  { title: "Rules", numeric: true },
  { title: "Streams" },
  { title: "Changed" },
  { title: "Agents write to" },
];
const STREAMS_NAMED = 4;

const addressOf = (name) => `/v1/mappings/${encodeURIComponent(name)}`;
const pageOf = (name) => `/plant/agents/${encodeURIComponent(name)}`;

export function showAgents(view) {
  const outcome = notice();
  const form = h("div", {});
  const list = h("div", {});
  plantHead(view, "/plant/agents", "Agents");
  view.root.append(
    h(
      "p",
      { class: "quiet" },
      "Telegraf, Node-RED and clients of InfluxDB write to greybox as they write to InfluxDB, AVEVA's adapters and other senders of the Open Message Format (OMF) as they write to a PI server. A mapping says which stream and signal each of their series goes to; an agent names the mapping as its database or bucket, or in its address. ",
      h("a", { href: "/docs/agents" }, "How agents are set up"),
    ),
    h(
      "p",
      { class: "quiet" },
      "An agent brings a token with the scope ",
      h("code", {}, "append"),
      ". ",
      h("a", { href: "#/plant/access" }, "How tokens are made"),
    ),
    outcome.place,
    form,
    list,
  );
  read(view, form, list).catch((error) => outcome.fail(error));
}

async function read(view, form, list) {
  const [{ data }, writes] = await Promise.all([get("/v1/mappings", view.signal), mayWrite(view)]);
  const rows = items(data).map(mappingRow);
  form.replaceChildren(writes ? mappingForm(view) : "");
  list.replaceChildren(
    h("h2", {}, "Mappings of the project"),
    table("Mappings", COLUMNS, rows, { empty: "No mappings yet.", stacked: true }),
  );
}

function mappingRow({ name, rules, changed_at: changed }) {
  return [
    h("a", { href: `#${pageOf(name)}` }, name),
    count(rules.length),
    streamLinks(rules),
    instant(changed),
    h(
      "div",
      {},
      writeAddresses(name).map(([kind, address]) => h("div", {}, `${kind}: `, address)),
    ),
  ];
}

function streamLinks(rules) {
  const names = [...new Set(rules.map(({ stream }) => stream))];
  const links = names
    .slice(0, STREAMS_NAMED)
    .map((name, k) => [k > 0 && ", ", h("a", { href: `#/plant/streams/${name}` }, name)]);
  const rest = names.length - links.length;
  return names.length ? h("span", {}, links, rest > 0 && ` and ${count(rest)} more`) : "–";
}

// A sender of OMF that names no mapping writes by the mapping of this name.
const USUAL_OF_OMF = "omf";

/**
 * Lists the addresses at which agents write by a mapping.
 *
 * @param {string} name
 * @returns {[string, any][]}
 */
export function writeAddresses(name) {
  const text = encodeURIComponent(name);
  /** @type {[string, string][]} */
  const paths = [
    ["InfluxDB 1", `/write?db=${text}`],
    ["InfluxDB 2", `/api/v2/write?bucket=${text}`],
    ["OMF", name === USUAL_OF_OMF ? "/omf" : `/omf/${text}`],
  ];
  return paths.map(([kind, path]) => [kind, h("code", { class: "digest" }, `${location.origin}${path}`)]);
}

function mappingForm(view) {
  const outcome = notice();
  const name = h("input", {
    type: "text",
    required: true,
    maxlength: "100",
    size: "28",
    placeholder: "plant",
  });
  const make = async () => {
    const typed = name.value.trim();
    // A mapping that is stored under a name takes the place of the mapping before.
    const { data } = await get("/v1/mappings", view.signal);
    if (items(data).some((mapping) => mapping.name === typed)) {
      throw Object.assign(new Error(`There is a mapping ${typed} already.`), { title: "The name is taken" });
    }
    await send("PUT", addressOf(typed), { rules: [] });
    location.hash = pageOf(typed);
  };
  const submit = (event) => {
    event.preventDefault();
    return outcome.attempt(make);
  };
  return h(
    "form",
    { class: "panel", onsubmit: submit },
    h(
      "div",
      { class: "fields" },
      h("label", {}, "Name, which agents give as database or bucket", name),
      h("button", { type: "submit", class: "primary" }, "Make the mapping"),
    ),
    outcome.place,
  );
}
