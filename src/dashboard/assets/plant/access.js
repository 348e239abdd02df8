// @ts-check
// The page says who the reader is to the server, and where tokens and limits come from.

import { get } from "../shell/api.js";
import { facts, h, notice, table } from "../shell/dom.js";
import { plantHead } from "./head.js";

const SCOPES = [
  ["append", "to append samples to streams, as agents do, and nothing else"],
  ["read", "to look at everything of the project"],
  ["submit", "that, and to store, submit, steer and delete"],
  ["admin", "that, and webhooks and the audit log"],
];

const COMMANDS = [
  ["greybox token create --name mes --scope submit --project hall-2", "makes a token and shows it once"],
  [
    "greybox token create --name hall-2-telegraf --scope append --streams rig-4,rig-5",
    "makes a token of an agent, for these streams alone",
  ],
  ["greybox token list", "shows scope, project, end and last use of each token"],
  ["greybox token revoke mes", "ends a token"],
];

export function showAccess(view) {
  const outcome = notice();
  const about = h("div", {});
  plantHead(view, "/plant/access", "Access");
  view.root.append(
    outcome.place,
    about,
    h("h2", {}, "What a scope allows"),
    table(
      "Scopes",
      [{ title: "Scope" }, { title: "Allows" }],
      SCOPES.map(([scope, text]) => [h("code", {}, scope), text]),
    ),
    h("h2", {}, "Tokens"),
    h(
      "p",
      {},
      "Tokens are made and ended on the machine of the server alone, by whoever runs it. The server keeps a digest of each and shows no list of them here.",
    ),
    table(
      "Commands for tokens",
      [{ title: "Command" }, { title: "What it does" }],
      COMMANDS.map(([command, text]) => [h("code", {}, command), text]),
    ),
    h("h2", {}, "Limits"),
    h(
      "p",
      {},
      "How much a project may store, submit and compute in a day is set when the server is started. What goes beyond a limit is refused with a sentence that names it. ",
      h("a", { href: "/docs/running#what-they-may-use" }, "All limits"),
    ),
  );
  get("/v1/session", view.signal).then(
    ({ data }) => about.replaceChildren(...aboutReader(data)),
    (error) => outcome.fail(error),
  );
}

function aboutReader({ who, project, scope }) {
  const isAnybody = who === "local";
  return [
    facts([
      ["You are", isAnybody ? "anybody on this machine" : who],
      ["Scope", scope],
      ["Project", project],
    ]),
    isAnybody ? h("p", {}, "This server asks nobody who they are: no token was made yet.") : "",
  ];
}
