// @ts-check
// The contents of a job's page stand beside it on a wide screen, and above it on a narrow screen. A part of
// the page is an element with the attribute `data-part`, whose value is its title.

import { h } from "../shell/dom.js";

const LOOKED_AT = 0.4;
const LEAST_PARTS = 3;

/**
 * @param {HTMLElement} root The element that has the parts.
 * @param {AbortSignal} signal
 */
export function contentsOf(root, signal) {
  const list = h("ul", {});
  const element = h("nav", { class: "contents", "aria-label": "Parts of this job", hidden: true }, list);
  /** @type {Map<Element, HTMLElement>} */
  const entries = new Map();
  // The part that the reader looks at is the lowest of those that begin above this share of the window.
  const mark = () => {
    const tops = [...entries.keys()].map(
      (part) => /** @type {[Element, number]} */ ([part, part.getBoundingClientRect().top]),
    );
    const [first] = entries.keys();
    const begun = tops.filter(([, top]) => top < LOOKED_AT * innerHeight);
    const [current] = begun.reduce(
      (lowest, next) => (next[1] > lowest[1] ? next : lowest),
      [first, -Infinity],
    );
    for (const [part, button] of entries) {
      part === current ? button.setAttribute("aria-current", "true") : button.removeAttribute("aria-current");
    }
  };
  let isMarking = false;
  const markSoon = () => {
    if (!isMarking) {
      isMarking = true;
      requestAnimationFrame(() => {
        isMarking = false;
        mark();
      });
    }
  };
  addEventListener("scroll", markSoon, { signal, passive: true });
  const go = (part) => {
    if (part instanceof HTMLDetailsElement) {
      part.open = true;
    }
    part.scrollIntoView({ block: "start" });
    const heading = part.matches("h3") ? part : part.querySelector("summary, h2, h3");
    if (!heading.matches("summary")) {
      heading.setAttribute("tabindex", "-1");
    }
    heading.focus({ preventScroll: true });
  };
  return {
    element,
    // Lists the parts that the page has now.
    draw() {
      const parts = [...root.querySelectorAll("[data-part]")].filter((part) => !part.closest("[hidden]"));
      entries.clear();
      for (const part of parts) {
        const onclick = () => go(part);
        entries.set(
          part,
          h(
            "button",
            { type: "button", class: "link", onclick },
            /** @type {HTMLElement} */ (part).dataset.part,
          ),
        );
      }
      list.replaceChildren(...[...entries.values()].map((button) => h("li", {}, button)));
      element.hidden = parts.length < LEAST_PARTS;
      mark();
    },
  };
}
