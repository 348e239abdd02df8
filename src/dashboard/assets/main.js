// @ts-check
// The router: the part of the address after # names a view, whose modules are fetched when it is first
// shown. Each view gets a signal that is aborted
// when the reader leaves it; requests, timers and event streams hang on that signal.

import { get, SIGNED_OUT } from "./api.js";
import { h } from "./dom.js";
import { isKnown, showSignIn } from "./session.js";

/** @type {[RegExp, () => Promise<any>, string][]} */
const VIEWS = [
  [/^\/jobs$/, () => import("./jobs.js"), "showJobs"],
  [/^\/jobs\/([^/]+)$/, () => import("./job.js"), "showJob"],
  [/^\/datasets$/, () => import("./datasets.js"), "showDatasets"],
  [/^\/datasets\/([^/]+)$/, () => import("./datasets.js"), "showDataset"],
  [/^\/compare$/, () => import("./compare.js"), "showCompare"],
  [/^\/comparisons$/, () => import("./comparisons.js"), "showComparisons"],
  [/^\/comparisons\/([^/]+)$/, () => import("./comparisons.js"), "showComparison"],
  [/^\/models$/, () => import("./models.js"), "showModels"],
  [/^\/equations$/, () => import("./model_editor.js"), "showModelEditor"],
  [/^\/models\/([^/]+)$/, () => import("./models.js"), "showModel"],
  [/^\/new$/, () => import("./new_job.js"), "showNewJob"],
];

const main = document.getElementById("main");
let leave = new AbortController();

async function route() {
  leave.abort();
  leave = new AbortController();
  const [path, query] = (location.hash.slice(1) || "/jobs").split("?");
  main.replaceChildren();
  markCurrent(path);
  const { signal } = leave;
  for (const [pattern, load, show] of VIEWS) {
    const match = pattern.exec(path);
    if (match) {
      const modules = await load();
      // Someone may have gone elsewhere meanwhile.
      if (!signal.aborted) {
        modules[show]({ root: main, signal, query: new URLSearchParams(query) }, ...match.slice(1).map(decodeURIComponent));
        announce();
      }
      return;
    }
  }
  main.append(h("h1", { tabindex: "-1" }, "Not here"), h("p", {}, `There is no page ${path}.`));
  announce();
}

function markCurrent(path) {
  for (const link of /** @type {NodeListOf<HTMLAnchorElement>} */ (document.querySelectorAll("nav a"))) {
    const here = link.hash && path.startsWith(link.hash.slice(1));
    here ? link.setAttribute("aria-current", "page") : link.removeAttribute("aria-current");
  }
}

// Puts the focus on the heading, so that a screen reader says where it is now.
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

// Where callers have to say who they are, that comes first.
async function begin() {
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
begin();
showVersion().catch(() => {});
