// @ts-check
// The heat table is a matrix of numbers whose cells are tinted by their value.

import { h } from "../shell/dom.js";

// `cell(row, column)` gives { text, value in −1…1, title } or null.
export function heatTable(caption, rows, columns, cell, { corner = "" } = {}) {
  return h(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": caption },
    h(
      "table",
      { class: "heat" },
      h("caption", { class: "unseen" }, caption),
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          h("td", {}, corner),
          columns.map((name) => h("th", { scope: "col" }, h("span", {}, name))),
        ),
      ),
      h(
        "tbody",
        {},
        rows.map((name, i) =>
          h(
            "tr",
            {},
            h("th", { scope: "row" }, name),
            columns.map((_, k) => {
              const content = cell(i, k);
              const element = h(
                "td",
                { class: "number", title: content?.title ?? null },
                content?.text ?? "",
              );
              if (content && Number.isFinite(content.value) && content.value !== 0) {
                const tint = content.value < 0 ? "second" : "first";
                const strength = Math.round(40 * Math.min(1, Math.abs(content.value)));
                element.style.background = `color-mix(in srgb, var(--${tint}) ${strength}%, var(--page))`;
              }
              return element;
            }),
          ),
        ),
      ),
    ),
  );
}
