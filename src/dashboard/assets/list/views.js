// @ts-check
// A view is a filter, an order, a grouping and columns of the list of jobs under a name. Views are kept in
// the browser of the person, as are the columns and the grouping that were chosen last.

import { h } from "../shell/dom.js";

const VIEWS = "greybox.views";
const LAST = "greybox.list";
const MOST_VIEWS = 50;
const LONGEST_NAME = 60;

/**
 * @param {string} name
 * @param {any} otherwise
 */
function stored(name, otherwise) {
  try {
    return JSON.parse(localStorage.getItem(name)) ?? otherwise;
  } catch {
    return otherwise;
  }
}

function store(name, value) {
  try {
    localStorage.setItem(name, JSON.stringify(value));
  } catch {
    // A browser that stores nothing still shows the choice until the reader leaves the page.
  }
}

/** @returns {{ columns?: string[], group?: string }} */
export const lastChoice = () => stored(LAST, {});

/** @param {{ columns: string[], group: string }} choice */
export const keepChoice = (choice) => store(LAST, choice);

/**
 * The views with another one, which takes the place of a view of the same name.
 *
 * @param {{ name: string, query: string }[]} views
 * @param {{ name: string, query: string }} view
 */
export function withView(views, view) {
  return [...views.filter(({ name }) => name !== view.name), view]
    .sort((a, b) => a.name.localeCompare(b.name))
    .slice(0, MOST_VIEWS);
}

// Lists the views to go to, and saves the present one: `present()` gives its query.
/** @param {() => string} present */
export function viewMenu(present) {
  const place = h("div", {});
  const name = h("input", { type: "text", maxlength: String(LONGEST_NAME), size: "18", required: true });
  const draw = () => {
    const views = stored(VIEWS, []);
    const go = (query) => () => {
      location.hash = `/jobs${query}`;
    };
    const remove = (view) => () => {
      store(
        VIEWS,
        views.filter((kept) => kept.name !== view.name),
      );
      draw();
      name.focus();
    };
    place.replaceChildren(
      views.length
        ? h(
            "ul",
            { class: "views" },
            views.map((view) =>
              h(
                "li",
                {},
                h("button", { type: "button", class: "link", onclick: go(view.query) }, view.name),
                h(
                  "button",
                  {
                    type: "button",
                    class: "small",
                    "aria-label": `Remove the view ${view.name}`,
                    onclick: remove(view),
                  },
                  "Remove",
                ),
              ),
            ),
          )
        : h("p", { class: "quiet" }, "No view is saved in this browser."),
    );
  };
  draw();
  const save = (event) => {
    event.preventDefault();
    store(VIEWS, withView(stored(VIEWS, []), { name: name.value.trim(), query: present() }));
    name.value = "";
    draw();
  };
  return h(
    "div",
    {},
    place,
    h(
      "form",
      { class: "fields", onsubmit: save },
      h("label", {}, "Name of the present view", name),
      h("button", { type: "submit" }, "Save"),
    ),
  );
}
