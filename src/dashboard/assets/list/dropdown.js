// @ts-check
// A dropdown shows its content below its button, over the page. Escape and a click elsewhere close it.

import { h } from "../shell/dom.js";

/**
 * @param {string} title
 * @param {Node} content
 * @param {AbortSignal} signal
 */
export function dropdown(title, content, signal) {
  const summary = h("summary", { class: "button" }, title);
  const details = h("details", { class: "dropdown" }, summary, h("div", { class: "sheet" }, content));
  details.addEventListener("keydown", (event) => {
    if (event.key === "Escape" && details.open) {
      details.open = false;
      summary.focus();
    }
  });
  const close = ({ target }) => {
    if (!details.contains(target)) {
      details.open = false;
    }
  };
  addEventListener("pointerdown", close, { signal });
  return details;
}
