// @ts-check
// The colours of plots are the colours of the stylesheet, which follow the reader's system.

const dark = matchMedia("(prefers-color-scheme: dark)");
const watchers = new Set();
let cache = new Map();

dark.addEventListener("change", () => {
  cache = new Map();
  for (const watcher of watchers) {
    watcher();
  }
});

// Calls `watcher` when the colours have changed, until the signal is aborted.
export function onTheme(watcher, signal) {
  watchers.add(watcher);
  signal?.addEventListener("abort", () => watchers.delete(watcher), { once: true });
}

// Gives the value of the stylesheet's variable with the name.
export function colour(name) {
  const variable = name === "faint" ? "measured" : name;
  if (!cache.has(variable)) {
    cache.set(variable, getComputedStyle(document.documentElement).getPropertyValue(`--${variable}`).trim());
  }
  return cache.get(variable) || "#888888";
}

export function width(look) {
  return { measured: 2.6, simulated: 1.5, faint: 1.2 }[look] ?? 1.5;
}

export function spanColour(kind) {
  const colours = {
    held: "second",
    bad: "bad",
    missing: "bad",
    window: "first",
    check: "second",
    excluded: "quiet",
    marked: "quiet",
    event: "simulated",
    alarm: "bad",
  };
  // A window that only checks is darker than what is held back within a window.
  return `${colour(colours[kind] ?? "quiet")}${kind === "check" ? "66" : "2b"}`;
}
