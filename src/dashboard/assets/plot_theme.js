// @ts-check
// Colours of plots: those of the stylesheet, which follow the reader's system.

const dark = matchMedia("(prefers-color-scheme: dark)");
const watchers = new Set();
let known = new Map();

dark.addEventListener("change", () => {
  known = new Map();
  watchers.forEach((watcher) => watcher());
});

// Calls `watcher` when the colours have changed, until the signal is aborted.
export function onTheme(watcher, signal) {
  watchers.add(watcher);
  signal?.addEventListener("abort", () => watchers.delete(watcher), { once: true });
}

// The value of the stylesheet's variable of that name.
export function colour(name) {
  const variable = name === "faint" ? "measured" : name;
  if (!known.has(variable)) {
    known.set(variable, getComputedStyle(document.documentElement).getPropertyValue(`--${variable}`).trim());
  }
  return known.get(variable) || "#888888";
}

export function width(look) {
  return { measured: 2.6, simulated: 1.5, faint: 1.2 }[look] ?? 1.5;
}

export function spanColour(kind) {
  const of = { held: "second", bad: "bad", missing: "bad", window: "first", excluded: "quiet" };
  return `${colour(of[kind] ?? "quiet")}2b`;
}
