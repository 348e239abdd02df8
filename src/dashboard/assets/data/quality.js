// @ts-check
// The lines of a quality report lead to the places that they are about, and mark these as bad.

import { h, smallButton, warningList } from "../shell/dom.js";
import { canBeMarked, cutShort, reasonOf } from "./marks.js";

/**
 * Lists the warnings of a recording. `show(span, name)` shows a place on the plots, and `mark(place, marked)` opens the
 * form for marks behind an element.
 *
 * @param {import("./marks.js").Warning[]} warnings
 * @param {{
 *   show: (span: { from_s: number, to_s: number }, name: string | null) => void,
 *   mark: (place: Element, marked: any) => void,
 * }} acts
 */
export function qualityList(warnings, { show, mark }) {
  const list = warningList(warnings);
  warnings.forEach((warning, k) => {
    const { spans = [], signal: name = null } = warning;
    const about = `${reasonOf(warning)}${name ? ` in ${name}` : ""}`;
    const marked = { spans, name, reason: reasonOf(warning), hint: cutShort(warning) };
    const buttons = h(
      "span",
      { class: "row-actions" },
      spans.length > 0 && showing(spans, about, (span) => show(span, name)),
      canBeMarked(warning) &&
        h(
          "span",
          { class: "for-writers" },
          smallButton("Mark", `Mark ${about}`, () => mark(buttons, marked)),
        ),
    );
    list.children[k].append(" ", buttons);
  });
  return list;
}

// The button shows a place after the other, and begins anew behind the last.
function showing(spans, about, show) {
  let place = 0;
  const draw = () => {
    const which = spans.length > 1 ? ` ${place + 1} of ${spans.length}` : "";
    button.textContent = `Show${which}`;
    button.setAttribute("aria-label", `Show${which}: ${about}`);
  };
  const button = smallButton("", "", () => {
    show(spans[place]);
    place = (place + 1) % spans.length;
    draw();
  });
  draw();
  return button;
}
