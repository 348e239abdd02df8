// @ts-check
// The page of the API reference shows this server's own description in the vendored viewer. The viewer
// loads no fonts.

import "/assets/vendor/rapidoc-9.3.8-min.js";

const dark = matchMedia("(prefers-color-scheme: dark)");
const viewer = document.createElement("rapi-doc");

const ATTRIBUTES = {
  "spec-url": "/openapi.json",
  "load-fonts": "false",
  "regular-font": "system-ui, sans-serif",
  "mono-font": "ui-monospace, monospace",
  "render-style": innerWidth < 800 ? "view" : "read",
  "schema-style": "table",
  "show-header": "false",
  "allow-authentication": "false",
  "allow-server-selection": "false",
  "allow-spec-url-load": "false",
  "allow-spec-file-load": "false",
  "use-path-in-nav-bar": "true",
  "show-method-in-nav-bar": "as-colored-text",
};

const THEMES = {
  light: {
    "bg-color": "#ffffff",
    "text-color": "#1b2127",
    "primary-color": "#1769aa",
    "nav-bg-color": "#f4f6f8",
    "nav-text-color": "#1b2127",
    "nav-hover-bg-color": "#e4e9ee",
    "nav-hover-text-color": "#1b2127",
  },
  dark: {
    "bg-color": "#14181c",
    "text-color": "#e4e8ec",
    "primary-color": "#7cbcf2",
    "nav-bg-color": "#1e242a",
    "nav-text-color": "#e4e8ec",
    "nav-hover-bg-color": "#38424c",
    "nav-hover-text-color": "#e4e8ec",
  },
};

function set(attributes) {
  for (const [name, value] of Object.entries(attributes)) {
    viewer.setAttribute(name, value);
  }
}
function followTheme() {
  const theme = dark.matches ? "dark" : "light";
  set({ theme, ...THEMES[theme] });
}

dark.addEventListener("change", followTheme);
set(ATTRIBUTES);
followTheme();
document.body.append(viewer);

// The viewer leaves its fields and its list of operations without names for screen readers, and colours
// methods too faintly for the ground of the list. This module adds the names and darkens the colours.
const LEGIBLE = `
  :is(.nav-method, .method-fg).get { color: var(--link) !important; }
  :is(.nav-method, .method-fg).post { color: var(--good) !important; }
  :is(.nav-method, .method-fg):is(.put, .head) { color: var(--warn) !important; }
  :is(.nav-method, .method-fg).delete { color: var(--bad) !important; }
`;
const UNNAMED = ":is(input, select, textarea):not([aria-label], [aria-hidden])";
const watched = new WeakSet();
let waiting = false;

function nameParts(root) {
  if (!watched.has(root)) {
    watched.add(root);
    new MutationObserver(nameSoon).observe(root, { childList: true, subtree: true });
    const sheet = new CSSStyleSheet();
    sheet.replaceSync(LEGIBLE);
    root.adoptedStyleSheets = [...root.adoptedStyleSheets, sheet];
  }
  for (const field of root.querySelectorAll(UNNAMED)) {
    const kind =
      field.tagName === "SELECT" ? "Kind of body" : field.tagName === "TEXTAREA" ? "Body" : "Value";
    field.setAttribute("aria-label", field.dataset.pname || field.getAttribute("placeholder") || kind);
  }
  for (const [k, list] of root.querySelectorAll("nav:not([aria-label])").entries()) {
    list.setAttribute("aria-label", k ? `List of operations ${k + 1}` : "Operations");
  }
  for (const { shadowRoot } of root.querySelectorAll("*")) {
    if (shadowRoot) {
      nameParts(shadowRoot);
    }
  }
}

function nameSoon() {
  if (!waiting) {
    waiting = true;
    setTimeout(() => {
      waiting = false;
      nameParts(viewer.shadowRoot);
    }, 100);
  }
}

customElements.whenDefined("rapi-doc").then(() => nameParts(viewer.shadowRoot));
