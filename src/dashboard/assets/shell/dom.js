// @ts-check
// This module makes elements without markup in strings, so that text from a server is never read as
// markup.

const SVG = "http://www.w3.org/2000/svg";

function fill(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) {
      continue;
    }
    if (name.startsWith("on")) {
      element.addEventListener(name.slice(2), value);
    } else {
      element.setAttribute(name, value === true ? "" : value);
    }
  }
  element.append(
    ...children.flat(Infinity).filter((child) => child !== null && child !== undefined && child !== false),
  );
  return element;
}

export function h(tag, attributes = {}, ...children) {
  return fill(document.createElement(tag), attributes, children);
}

export function svg(tag, attributes = {}, ...children) {
  return fill(document.createElementNS(SVG, tag), attributes, children);
}

// The table scrolls by itself where the page is narrow; a stacked table has its cells below each other there, each
// with the title of its column beside its content.
export function table(caption, columns, rows, { empty = "Nothing here yet.", stacked = false } = {}) {
  if (rows.length === 0) {
    return h("p", { class: "quiet" }, empty);
  }
  const cell = (column, content) =>
    h(
      "td",
      { class: column.numeric ? "number" : null, "data-title": stacked ? column.title : null },
      stacked ? h("div", {}, content) : content,
    );
  return h(
    "div",
    { class: "scroll", tabindex: "0", role: "region", "aria-label": caption },
    h(
      "table",
      { class: stacked ? "stacked" : null },
      h("caption", { class: "unseen" }, caption),
      h(
        "thead",
        {},
        h(
          "tr",
          {},
          columns.map((column) =>
            h("th", { scope: "col", class: column.numeric ? "number" : null }, column.title),
          ),
        ),
      ),
      h(
        "tbody",
        {},
        rows.map((row) =>
          h(
            "tr",
            {},
            row.map((content, k) => cell(columns[k], content)),
          ),
        ),
      ),
    ),
  );
}

export const smallButton = (text, label, act, disabled = false) =>
  h("button", { type: "button", class: "small", "aria-label": label, disabled, onclick: act }, text);

// Lists names and their values.
export function facts(pairs) {
  const shown = pairs.filter(([, value]) => value !== null && value !== undefined && value !== "");
  return h(
    "dl",
    { class: "facts" },
    shown.map(([name, value]) => h("div", {}, h("dt", {}, name), h("dd", {}, value))),
  );
}

// The box shows a problem with every fault and its place.
export function problemBox(problem) {
  const faults = problem.errors ?? [];
  return h(
    "div",
    { class: "problem", role: "alert" },
    h(
      "p",
      {},
      problem.title && problem.title !== problem.message
        ? [h("strong", {}, problem.title), ` – ${problem.message ?? problem.detail}`]
        : (problem.message ?? problem.detail),
    ),
    faults.length > 0 &&
      h(
        "ul",
        {},
        faults.map((fault) =>
          h(
            "li",
            {},
            fault.pointer && [h("code", {}, fault.pointer), " "],
            fault.detail,
            fault.code && h("span", { class: "quiet" }, ` (${fault.code})`),
          ),
        ),
      ),
    problem.requestId && h("p", { class: "quiet" }, `Request ${problem.requestId}`),
  );
}

export function warningList(warnings) {
  return h(
    "ul",
    { class: "warnings" },
    warnings.map((warning) =>
      h(
        "li",
        {},
        h("code", {}, warning.code),
        warning.signal && [" in ", h("strong", {}, warning.signal)],
        ": ",
        quoted(warning.detail),
      ),
    ),
  );
}

// Makes code of the names that stand between back-ticks in a text, or what `said` makes of them, and writes numbers
// below zero with a minus.
/** @param {string} text @param {(name: string) => any} [said] */
export function quoted(text, said = () => null) {
  return text
    .split("`")
    .map((part, k) => (k % 2 ? (said(part) ?? h("code", {}, part)) : part.replace(/(?<=[ (])-(?=\d)/g, "−")));
}

// A notice is the place for the outcome of the last action; a new outcome replaces the former.
export function notice() {
  const place = h("div", { "aria-live": "polite" });
  return {
    place,
    clear: () => place.replaceChildren(),
    show: (...content) => place.replaceChildren(...content),
    fail(error) {
      if (error.name !== "AbortError") {
        place.replaceChildren(problemBox(error));
      }
    },
    // Clears the notice, acts, and shows where the action failed.
    async attempt(act) {
      try {
        place.replaceChildren();
        await act();
      } catch (error) {
        this.fail(error);
        place.scrollIntoView({ block: "nearest" });
      }
    },
  };
}

// Draws a part of the page anew without taking the focus from the reader: the control that then stands
// in the place of the focused control gets the focus.
export function keepingFocus(root, draw) {
  const controls = () => [...root.querySelectorAll("input, select, button, textarea, summary, a")];
  const named = (element) => {
    const label = element.getAttribute("aria-label") ?? element.closest("label")?.firstChild?.textContent;
    return `${element.tagName} ${label ?? element.textContent}`;
  };
  const active = root.contains(document.activeElement) ? document.activeElement : null;
  const name = active && named(active);
  const place =
    active &&
    controls()
      .filter((element) => named(element) === name)
      .indexOf(active);
  draw();
  if (active && !active.isConnected) {
    controls()
      .filter((element) => named(element) === name)
      [place]?.focus({ preventScroll: true });
  }
}
