// @ts-check
// A paged list shows a table of what the server gives in pages, the newest first.

import { get, query } from "../shell/api.js";
import { h, keepingFocus } from "../shell/dom.js";

/**
 * `draw(rows)` gives the element for all rows that were read; `failed(error)` takes what goes wrong, and
 * `recovered()` is called when a list can be read again.
 *
 * @param {{
 *   view: { signal: AbortSignal },
 *   address: string,
 *   draw: (rows: any[]) => any,
 *   failed: (error: any) => void,
 *   recovered?: () => void,
 *   more?: string,
 *   limit?: number,
 * }} options
 */
export function pagedList({
  view,
  address,
  draw,
  failed,
  recovered = () => {},
  more = "Older ones",
  limit = 50,
}) {
  const place = h("div", {});
  const button = h("button", { type: "button", hidden: true, onclick: () => read() }, more);
  const element = h("div", { class: "on-a-line" }, place, button);
  const state = { rows: [], next: null, lost: false };
  const show = () => {
    button.hidden = !state.next;
    keepingFocus(element, () => place.replaceChildren(draw(state.rows)));
  };
  // Takes a page into the list, and tells of a failure and of its end.
  const load = async (token, take) => {
    try {
      const { data } = await get(`${address}${query({ limit, page_token: token })}`, view.signal);
      take(data.items, data.next_page_token);
      state.lost && recovered();
      state.lost = false;
      show();
    } catch (error) {
      state.lost = true;
      failed(error);
    }
  };
  const read = () =>
    load(state.next, (items, next) => {
      state.rows = [...state.rows, ...items];
      state.next = next;
    });
  // The first page takes the place of its former state; the rows behind it stay.
  const refresh = () =>
    load(null, (items, next) => {
      const last = state.rows.findIndex(({ id }) => id === items.at(-1)?.id);
      const later = last < 0 ? [] : state.rows.slice(last + 1);
      state.rows = [...items, ...later];
      state.next = later.length ? state.next : next;
    });
  return { element, read, refresh, show, rows: () => state.rows };
}
