// @ts-check
// A paged list shows a table of what the server gives in pages, the newest first.

import { get, query } from "../shell/api.js";
import { h, keepingFocus } from "../shell/dom.js";

/**
 * `draw(rows)` gives the element for all rows that were read; `failed(error)` takes what goes wrong.
 *
 * @param {{
 *   view: { signal: AbortSignal },
 *   address: string,
 *   draw: (rows: any[]) => any,
 *   failed: (error: any) => void,
 *   more?: string,
 *   limit?: number,
 * }} options
 */
export function pagedList({ view, address, draw, failed, more = "Older ones", limit = 50 }) {
  const place = h("div", {});
  const button = h("button", { type: "button", hidden: true, onclick: () => read() }, more);
  const element = h("div", { class: "on-a-line" }, place, button);
  const state = { rows: [], next: null, isRead: false };
  const show = () => {
    button.hidden = !state.next;
    keepingFocus(element, () => place.replaceChildren(draw(state.rows)));
  };
  const page = async (token) => {
    const { data } = await get(`${address}${query({ limit, page_token: token })}`, view.signal);
    return data;
  };
  const read = async () => {
    try {
      const { items, next_page_token: next } = await page(state.next);
      state.rows = [...state.rows, ...items];
      state.next = next;
      state.isRead = true;
      show();
    } catch (error) {
      failed(error);
    }
  };
  // What came since is put before what was read; rows that changed take the place of their former state.
  const refresh = async (key = "id") => {
    try {
      const { items, next_page_token: next } = await page(null);
      const fresh = new Set(items.map((row) => row[key]));
      const later = state.rows.slice(items.length).filter((row) => !fresh.has(row[key]));
      const isLonger = state.rows.length > items.length;
      state.rows = isLonger ? [...items, ...later] : items;
      state.next = isLonger ? state.next : next;
      state.isRead = true;
      show();
    } catch (error) {
      failed(error);
    }
  };
  return { element, read, refresh, show, rows: () => state.rows };
}
