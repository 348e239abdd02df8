// @ts-check
// The search on the pages of the guides: hits are listed below the field as it is typed into. The slash key leads to
// the field, Enter to the first hit, Escape empties the field. The index comes from the server when it is needed first.

import { hitsOf } from "./matching.js";

const SHOWN = 20;
const search = /** @type {HTMLElement} */ (document.querySelector("search"));
const field = /** @type {HTMLInputElement} */ (search.querySelector("input"));
const status = /** @type {HTMLElement} */ (search.querySelector("[role=status]"));
const list = /** @type {HTMLElement} */ (search.querySelector("ol"));

/** @type {Promise<import("./matching.js").Chapter[]> | null} */
let index = null;

async function read() {
  const answer = await fetch("/docs/index.json");
  if (!answer.ok) {
    throw new Error(`The index of the docs is not to be had (${answer.status}).`);
  }
  const { guides, operations } = await answer.json();
  return [
    ...guides.flatMap(({ title: page, to, chapters }) =>
      chapters.map(({ title, anchor, text }) => ({ page, title, to: `${to}#${anchor}`, text })),
    ),
    ...operations.map((operation) => ({ page: "API reference", ...operation })),
  ];
}

async function look() {
  const words = field.value.trim();
  address(words);
  if (words === "") {
    show([], "");
    return;
  }
  index ??= read();
  try {
    const hits = hitsOf(await index, words);
    if (words !== field.value.trim()) {
      return;
    }
    const more = hits.length > SHOWN ? `, the best ${SHOWN} are shown` : "";
    show(hits.slice(0, SHOWN), `${hits.length} ${hits.length === 1 ? "hit" : "hits"}${more}`);
  } catch (error) {
    index = null;
    show([], String(/** @type {Error} */ (error).message));
  }
}

// The address keeps the words, so that the way back from a hit leads to the list again.
/** @param {string} words */
function address(words) {
  const url = new URL(location.href);
  words ? url.searchParams.set("q", words) : url.searchParams.delete("q");
  history.replaceState(null, "", url);
}

/**
 * @param {import("./matching.js").Hit[]} hits
 * @param {string} words
 */
function show(hits, words) {
  status.textContent = words;
  list.replaceChildren(...hits.map(item));
}

/** @param {import("./matching.js").Hit} hit */
function item({ chapter: { page, title, to }, snippet }) {
  const link = document.createElement("a");
  link.href = to;
  link.textContent = title;
  const place = document.createElement("span");
  place.className = "quiet";
  place.textContent = ` ${page}`;
  const text = document.createElement("p");
  text.append(
    ...snippet.map((piece, k) => {
      if (k % 2 === 0) {
        return piece;
      }
      const mark = document.createElement("mark");
      mark.textContent = piece;
      return mark;
    }),
  );
  const entry = document.createElement("li");
  entry.append(link, place, text);
  return entry;
}

field.addEventListener("input", look);
field.addEventListener("keydown", (event) => {
  if (event.key === "Enter") {
    list.querySelector("a")?.click();
  } else if (event.key === "Escape") {
    field.value = "";
    look();
  }
});
document.addEventListener("keydown", (event) => {
  const isTyping = event.target instanceof Element && event.target.matches("input, textarea, select");
  if (event.key === "/" && !isTyping && !event.ctrlKey && !event.metaKey && !event.altKey) {
    event.preventDefault();
    field.focus();
  }
});
field.value = new URL(location.href).searchParams.get("q") ?? "";
if (field.value) {
  look();
}
