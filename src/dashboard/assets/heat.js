// @ts-check
// A matrix whose cells are tinted by their value; the numbers stay.

import { h } from "./dom.js";

// `cell(row, column)` gives { text, value in −1…1, title } or null.
export function heatTable(caption, rows, columns, cell, { corner = "" } = {}) {
  return h("div", { class: "scroll", tabindex: "0", role: "region", "aria-label": caption }, h("table", { class: "heat" },
    h("caption", { class: "unseen" }, caption),
    h("thead", {}, h("tr", {}, h("td", {}, corner), columns.map((name) => h("th", { scope: "col" }, h("span", {}, name))))),
    h("tbody", {}, rows.map((name, i) => h("tr", {}, h("th", { scope: "row" }, name), columns.map((_, k) => {
      const known = cell(i, k);
      const element = h("td", { class: "number", title: known?.title ?? null }, known?.text ?? "");
      if (known && Number.isFinite(known.value) && known.value !== 0) {
        const strength = Math.round(40 * Math.min(1, Math.abs(known.value)));
        element.style.background = `color-mix(in srgb, var(--${known.value < 0 ? "second" : "first"}) ${strength}%, var(--page))`;
      }
      return element;
    }))))));
}
