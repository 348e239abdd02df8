// @ts-check
// A specification goes from one page of this tab to another through the storage of the tab.

import { readJson } from "./json.js";

// The label of a prepared job that names the job before it.
export const FOLLOWS = "follows";

// Gives the specification of a job to make another like it: the job may have got another name and other labels since
// it was made. A note is about the job alone.
/** @param {any} job */
export function specOf({ spec, name, labels }) {
  const { note, ...rest } = spec;
  return { ...rest, name, labels };
}

// Stores a specification for another page of this tab, and gives the key that the page finds it by.
export function keep(spec) {
  const key = `prepared-${Date.now().toString(36)}`;
  sessionStorage.setItem(key, JSON.stringify(spec));
  return key;
}

// Gives the specification that another page has stored under the key in the address.
export function prepared(view) {
  const key = view.query.get("prepared");
  const text = key && sessionStorage.getItem(key);
  return text ? readJson(text) : null;
}

export function prepare(spec) {
  location.hash = `/new?prepared=${keep(spec)}`;
}
