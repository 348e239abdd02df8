// @ts-check
// Every page about the plant begins with links to all of them and a heading.

import { get } from "../shell/api.js";
import { h } from "../shell/dom.js";
import { words } from "../shell/format.js";

const PAGES = [
  ["/plant", "Monitors"],
  ["/plant/streams", "Streams"],
  ["/plant/agents", "Agents"],
  ["/plant/sources", "Sources"],
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

/**
 * Reads what administrators alone may read. Whoever may not is told so in a sentence, and nothing is
 * asked for.
 *
 * @param {{ view: any, what: string, outcome: any, read: () => Promise<any> }} options
 */
export async function readAsAdmin({ view, what, outcome, read }) {
  try {
    const { data } = await get("/v1/session", view.signal);
    if (data.scope === "admin") {
      await read();
    } else {
      outcome.show(refusal(what, data));
    }
  } catch (error) {
    outcome.fail(error);
  }
}

function refusal(what, { who, scope, project }) {
  return h(
    "p",
    { role: "status" },
    `${what} is for the scope `,
    h("code", {}, "admin"),
    `; ${who} has the scope `,
    h("code", {}, scope),
    ` in ${project}. Whoever runs the server makes tokens with `,
    h("code", {}, "greybox token create --scope admin"),
    ".",
  );
}

const LOOKS = {
  working: "running",
  running: "running",
  waiting: "",
  estimated: "succeeded",
  delivered: "succeeded",
  following: "succeeded",
  refused: "failed",
  away: "failed",
  failed: "failed",
  given_up: "failed",
  data_stopped: "failed",
};

export function stateBadge(state) {
  return h("span", { class: `badge ${LOOKS[state] ?? ""}` }, words(state));
}
