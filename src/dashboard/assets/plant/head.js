// @ts-check
// Every page about the plant begins with the links to the others and its heading.

import { get } from "../shell/api.js";
import { h, quoted } from "../shell/dom.js";
import { words } from "../shell/format.js";

const PAGES = [
  ["/plant", "Monitors"],
  ["/plant/streams", "Streams"],
  ["/plant/webhooks", "Webhooks"],
  ["/plant/audit", "Audit log"],
  ["/plant/access", "Access"],
];

/**
 * Shows the links, with the page at `here` marked, and a heading with what stands beside it. Gives the
 * heading.
 *
 * @param {any} view
 * @param {string} here
 * @param {string} title
 * @param {any[]} beside
 */
export function plantHead(view, here, title, ...beside) {
  const heading = h("h1", { tabindex: "-1" }, title);
  const link = ([address, name]) =>
    h("a", { href: `#${address}`, "aria-current": address === here ? "page" : null }, name);
  view.root.append(
    h("nav", { class: "places", "aria-label": "Plant" }, PAGES.map(link)),
    h("div", { class: "title" }, heading, beside),
  );
  return heading;
}

export function nameHeading(heading, name) {
  heading.textContent = name;
  document.title = `${name} · greybox`;
}

// Shows why a list for administrators is not shown: a refusal is a sentence that names who asks.
export async function showRefusal(error, what, outcome) {
  if (error.status !== 403) {
    outcome.fail(error);
    return;
  }
  const session = await get("/v1/session").then(
    ({ data }) => data,
    () => null,
  );
  const who = session
    ? `${session.who} has the scope ${session.scope} in ${session.project}`
    : "you have less";
  outcome.show(
    h(
      "p",
      { role: "status" },
      quoted(
        `${what} can be read with the scope \`admin\`; ${who}. Whoever runs the server makes tokens with `,
      ),
      h("code", {}, "greybox token create --scope admin"),
      ".",
    ),
  );
}

const LOOKS = {
  working: "running",
  running: "running",
  waiting: "",
  estimated: "succeeded",
  delivered: "succeeded",
  failed: "failed",
  given_up: "failed",
  data_stopped: "failed",
};

export function stateBadge(state) {
  return h("span", { class: `badge ${LOOKS[state] ?? ""}` }, words(state));
}
