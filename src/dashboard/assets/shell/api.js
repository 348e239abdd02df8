// @ts-check
// This module sends requests to the server. A failure of any kind is a Problem that can be shown as it
// is.

import { readJson } from "./json.js";

export class Problem extends Error {
  constructor(status, body) {
    super(body.detail || body.title || `The server answered ${status}.`);
    this.status = status;
    this.title = body.title;
    this.errors = body.errors ?? [];
    this.requestId = body.request_id;
  }
}

async function problemOf(response) {
  const text = await response.text();
  try {
    return new Problem(response.status, JSON.parse(text));
  } catch {
    return new Problem(response.status, { title: response.statusText, detail: text.slice(0, 300) });
  }
}

export const SIGNED_OUT = "greybox-signed-out";
/** @type {string | null} */
let csrfToken = null;
/** @type {string | null} */
let wayIn = null;

/**
 * Where a reader whom the server does not know signs in at the identity provider of the plant; null where there is
 * none.
 */
export const identityProvider = () => wayIn;

/**
 * What requests that change something bring from now on.
 *
 * @param {string | null} token
 */
export function bringCsrfToken(token) {
  csrfToken = token;
}

/**
 * @param {string} method
 * @param {string} path
 * @param {{ body?: BodyInit, headers?: Record<string, string>, signal?: AbortSignal }} options
 * @returns {Promise<{ data: any, headers: Headers, status: number }>}
 */
export async function request(method, path, { body, headers = {}, signal } = {}) {
  let response;
  if (csrfToken && method !== "GET") {
    headers = { ...headers, "x-csrf-token": csrfToken };
  }
  try {
    response = await fetch(path, { method, body, headers, signal, cache: "no-cache" });
  } catch (error) {
    if (error.name === "AbortError") {
      throw error;
    }
    throw new Problem(0, { title: "No answer", detail: "The server cannot be reached." });
  }
  if (response.status === 401) {
    wayIn = /<([^>]+)>; rel="sign-in"/.exec(response.headers.get("link") ?? "")?.[1] ?? null;
  }
  if (response.status === 401 && path !== "/v1/session") {
    dispatchEvent(new Event(SIGNED_OUT));
    throw new DOMException("The session is over.", "AbortError");
  }
  if (!response.ok) {
    throw await problemOf(response);
  }
  const type = response.headers.get("content-type") ?? "";
  const data = type.includes("json") ? readJson(await response.text()) : await response.text();
  return { data, headers: response.headers, status: response.status };
}

/**
 * @template {string} Address
 * @param {Address} path
 * @param {AbortSignal} [signal]
 * @returns {Promise<{ data: import("page/api").Answered<Address>, headers: Headers, status: number }>}
 */
export function get(path, signal) {
  return request("GET", path, { signal, headers: { accept: "application/json" } });
}

/**
 * @param {string} method
 * @param {string} path
 * @param {unknown} [value]
 * @param {{ headers?: Record<string, string>, signal?: AbortSignal }} [options]
 */
export function send(method, path, value, { signal, headers = {} } = {}) {
  const body = value === undefined ? undefined : JSON.stringify(value);
  const type = body === undefined ? {} : { "content-type": "application/json" };
  return request(method, path, { body, signal, headers: { ...type, ...headers } });
}

// A body that comes again has the idempotency key that it had before, however often the reader presses the button.
/** @returns {(body: string) => string} */
export function repeatKey() {
  let [key, of] = ["", null];
  return (body) => {
    if (body !== of) {
      of = body;
      key = Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) =>
        byte.toString(16).padStart(2, "0"),
      ).join("");
    }
    return key;
  };
}

// Gives the list of a collection, whether it comes in pages or whole.
/**
 * @template Item
 * @param {Item[] | { items: Item[] }} data
 * @returns {Item[]}
 */
export function items(data) {
  return Array.isArray(data) ? data : (data.items ?? []);
}

/**
 * @param {Record<string, string | number | boolean | null | undefined>} parameters
 * @returns {"" | `?${string}`}
 */
export function query(parameters) {
  const present = Object.entries(parameters).filter(([, value]) => value != null && value !== "");
  return present.length
    ? `?${new URLSearchParams(present.map(([name, value]) => [name, String(value)]))}`
    : "";
}

// Waits for some milliseconds, and rejects when the reader leaves the view or has left the view.
export function pause(milliseconds, signal) {
  return new Promise((resolve, reject) => {
    signal.throwIfAborted();
    const stop = () => {
      clearTimeout(timer);
      reject(signal.reason);
    };
    const timer = setTimeout(() => {
      signal.removeEventListener("abort", stop);
      resolve();
    }, milliseconds);
    signal.addEventListener("abort", stop, { once: true });
  });
}
