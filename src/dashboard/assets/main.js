// The router: the part of the address after # names a view. Each view gets a signal that is aborted
// when the reader leaves it; requests, timers and event streams hang on that signal.

import { get } from "./api.js";
import { h } from "./dom.js";
import { showCompare } from "./compare.js";
import { showComparison, showComparisons } from "./comparisons.js";
import { showDataset, showDatasets } from "./datasets.js";
import { showJob } from "./job.js";
import { showJobs } from "./jobs.js";
import { showModel, showModels } from "./models.js";
import { showNewJob } from "./new_job.js";

const VIEWS = [
  [/^\/jobs$/, showJobs],
  [/^\/jobs\/([^/]+)$/, showJob],
  [/^\/datasets$/, showDatasets],
  [/^\/datasets\/([^/]+)$/, showDataset],
  [/^\/compare$/, showCompare],
  [/^\/comparisons$/, showComparisons],
  [/^\/comparisons\/([^/]+)$/, showComparison],
  [/^\/models$/, showModels],
  [/^\/models\/([^/]+)$/, showModel],
  [/^\/new$/, showNewJob],
];

const main = document.getElementById("main");
let leave = new AbortController();

function route() {
  leave.abort();
  leave = new AbortController();
  const [path, query] = (location.hash.slice(1) || "/jobs").split("?");
  main.replaceChildren();
  markCurrent(path);
  for (const [pattern, show] of VIEWS) {
    const match = pattern.exec(path);
    if (match) {
      const view = { root: main, signal: leave.signal, query: new URLSearchParams(query) };
      show(view, ...match.slice(1).map(decodeURIComponent));
      announce();
      return;
    }
  }
  main.append(h("h1", { tabindex: "-1" }, "Not here"), h("p", {}, `There is no page ${path}.`));
  announce();
}

function markCurrent(path) {
  for (const link of document.querySelectorAll("nav a")) {
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

addEventListener("hashchange", route);
route();
showVersion().catch(() => {});
