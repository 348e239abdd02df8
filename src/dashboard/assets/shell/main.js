// @ts-check
// The router shows the view that the part of the address after # names; it fetches the modules of a
// view when the view is first shown. Each view gets a signal that is aborted when the reader leaves the
// view; its requests, timers and event streams end with the signal.

import { get, SIGNED_OUT } from "./api.js";
import { h } from "./dom.js";
import { isKnown, showSignIn } from "./session.js";

/** @type {[RegExp, () => Promise<any>, string][]} */
const VIEWS = [
  [/^\/$/, () => import("../list/start.js"), "showStart"],
  [/^\/jobs$/, () => import("../list/jobs.js"), "showJobs"],
  [/^\/jobs\/([^/]+)$/, () => import("../job/job.js"), "showJob"],
  [/^\/datasets$/, () => import("../data/datasets.js"), "showDatasets"],
  [/^\/datasets\/([^/]+)$/, () => import("../data/datasets.js"), "showDataset"],
  [/^\/compare$/, () => import("../compare/jobs.js"), "showCompare"],
  [/^\/comparisons$/, () => import("../compare/methods.js"), "showComparisons"],
  [/^\/comparisons\/([^/]+)$/, () => import("../compare/methods.js"), "showComparison"],
  [/^\/models$/, () => import("../model/models.js"), "showModels"],
  [/^\/equations$/, () => import("../model/editor.js"), "showModelEditor"],
  [/^\/models\/([^/]+)$/, () => import("../model/models.js"), "showModel"],
  [/^\/plant$/, () => import("../plant/monitors.js"), "showMonitors"],
  [/^\/plant\/monitors\/new$/, () => import("../plant/watch.js"), "showNewMonitor"],
  [/^\/plant\/monitors\/([^/]+)$/, () => import("../plant/monitor.js"), "showMonitor"],
  [/^\/plant\/streams$/, () => import("../plant/streams.js"), "showStreams"],
  [/^\/plant\/streams\/([^/]+)$/, () => import("../plant/stream.js"), "showStream"],
  [/^\/plant\/windows\/new$/, () => import("../plant/find.js"), "showFindWindows"],
  [/^\/plant\/sources$/, () => import("../plant/sources.js"), "showSources"],
  [/^\/plant\/agents$/, () => import("../plant/agents.js"), "showAgents"],
  [/^\/plant\/agents\/([^/]+)$/, () => import("../plant/mapping.js"), "showMapping"],
  [/^\/plant\/webhooks$/, () => import("../plant/webhooks.js"), "showWebhooks"],
  [/^\/plant\/webhooks\/([^/]+)$/, () => import("../plant/webhooks.js"), "showWebhook"],
  [/^\/plant\/audit$/, () => import("../plant/audit.js"), "showAudit"],
  [/^\/plant\/access$/, () => import("../plant/access.js"), "showAccess"],
  [/^\/new$/, () => import("../new/job.js"), "showNewJob"],
];

const main = document.getElementById("main");
let leave = new AbortController();
// The first pages come without the styles of all others.
const FIRST = ["showStart", "showJobs"];
/** @type {Promise<void[]> | null} */
let styling = null;

// Has the browser fetch the stylesheets that the document leaves for later, each at its place among the others.
function styled() {
  styling ??= Promise.all(
    Array.from(document.head.querySelectorAll("template"), (template) => {
      const link = template.content.querySelector("link");
      return new Promise((resolve) => {
        link.onload = () => resolve();
        link.onerror = () => resolve();
        template.replaceWith(link);
      });
    }),
  );
  return styling;
}

// The path and the query that the address names after #.
const addressed = () => (location.hash.slice(1) || "/jobs").split("?");

async function route() {
  leave.abort();
  leave = new AbortController();
  const [path, query] = addressed();
  main.replaceChildren();
  markCurrent(path);
  const { signal } = leave;
  for (const [pattern, load, show] of VIEWS) {
    const match = pattern.exec(path);
    if (match) {
      const [modules] = await Promise.all([load(), FIRST.includes(show) ? null : styled()]);
      // The reader may have gone elsewhere while the modules were fetched.
      if (!signal.aborted) {
        modules[show](
          { root: main, signal, query: new URLSearchParams(query) },
          ...match.slice(1).map(decodeURIComponent),
        );
        announce();
      }
      return;
    }
  }
  main.append(h("h1", { tabindex: "-1" }, "Not here"), h("p", {}, `There is no page ${path}.`));
  announce();
}

// Pages that no link of the header names belong to the list that leads to them.
const LISTS = { "/compare": "/jobs", "/equations": "/models" };

function markCurrent(path) {
  const place = LISTS[path] ?? path;
  for (const link of /** @type {NodeListOf<HTMLAnchorElement>} */ (
    document.querySelectorAll("header nav a")
  )) {
    const here = link.hash && place.startsWith(link.hash.slice(1));
    here ? link.setAttribute("aria-current", "page") : link.removeAttribute("aria-current");
  }
}

// Puts the focus on the heading, so that a screen reader reads the name of the new view.
function announce() {
  const heading = main.querySelector("h1");
  if (heading) {
    heading.focus({ preventScroll: true });
    document.title = `${heading.textContent} · greybox`;
  }
  scrollTo(0, 0);
}

async function showVersion() {
  const { data } = await get("/version");
  document.getElementById("version").textContent = `greybox ${data.version ?? ""}`;
}

// Where the server asks who calls, signing in comes first. Meanwhile the modules of the view come, and a view
// that exports `askAhead` asks for its first data.
async function begin() {
  const [path, query] = addressed();
  const view = VIEWS.find(([pattern]) => pattern.test(path));
  view?.[1]().then(
    (modules) => modules.askAhead?.(new URLSearchParams(query)),
    () => {},
  );
  (await isKnown()) ? route() : signIn();
}

function signIn() {
  if (!main.querySelector("form.sign-in")) {
    leave.abort();
    main.replaceChildren();
    showSignIn(main, begin);
    announce();
  }
}

addEventListener("hashchange", route);
addEventListener(SIGNED_OUT, signIn);
begin()
  .then(showVersion)
  .catch(() => {});
