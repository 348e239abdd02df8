// Requests to the server. A failure of any kind is a Problem that can be shown as it is.

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

export async function request(method, path, { body, headers = {}, signal } = {}) {
  let response;
  try {
    response = await fetch(path, { method, body, headers, signal, cache: "no-cache" });
  } catch (error) {
    if (error.name === "AbortError") {
      throw error;
    }
    throw new Problem(0, { title: "No answer", detail: "The server cannot be reached." });
  }
  if (!response.ok) {
    throw await problemOf(response);
  }
  const type = response.headers.get("content-type") ?? "";
  const data = type.includes("json") ? await response.json() : await response.text();
  return { data, headers: response.headers, status: response.status };
}

export function get(path, signal) {
  return request("GET", path, { signal, headers: { accept: "application/json" } });
}

export function send(method, path, value, { signal, headers = {} } = {}) {
  const body = value === undefined ? undefined : JSON.stringify(value);
  const type = body === undefined ? {} : { "content-type": "application/json" };
  return request(method, path, { body, signal, headers: { ...type, ...headers } });
}

// The list of a collection, whether it comes in pages or whole.
export function items(data) {
  return Array.isArray(data) ? data : data.items ?? [];
}

export function query(parameters) {
  const present = Object.entries(parameters).filter(([, value]) => value != null && value !== "");
  return present.length ? `?${new URLSearchParams(present)}` : "";
}

// Waits, or rejects when the view is left.
export function pause(milliseconds, signal) {
  return new Promise((resolve, reject) => {
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
