// @ts-check
// This module makes the fields of the form of a new job. A field reports a value where its text is one,
// and is marked where it is none.

import { defaultAt, namesIn } from "../shell/description.js";
import { h } from "../shell/dom.js";
import { pointed } from "../shell/faults.js";
import { numberOf, words } from "../shell/format.js";

// Writes a value as a field shows it.
export const shown = (value) => (value === null || value === undefined ? "" : String(value));

// A field without a title of its own, for a table. It reports the number that `read` makes of its text, null where it
// is empty, or the text where `text` is set.
/**
 * @param {string} label
 * @param {unknown} value
 * @param {(value: any) => void} act
 * @param {{ size?: string, hint?: string, text?: boolean, read?: (text: string) => number | bigint }} [options]
 */
export function field(label, value, act, { size = "9", hint, text = false, read = numberOf } = {}) {
  const input = h("input", {
    type: "text",
    inputmode: text ? null : "decimal",
    value: shown(value),
    "aria-label": label,
    size,
    placeholder: hint,
    onchange: () => {
      const bare = input.value.trim();
      const typed = text ? bare : bare === "" ? null : read(bare);
      const wrong = Number.isNaN(typed);
      wrong ? input.setAttribute("aria-invalid", "true") : input.removeAttribute("aria-invalid");
      if (!wrong) {
        act(typed);
      }
    },
  });
  return input;
}

// A field of a text without a title, which has the faults at a path below it.
/**
 * @param {(string | number)[]} path
 * @param {string} label
 * @param {unknown} value
 * @param {(value: any) => void} act
 * @param {{ size?: string, hint?: string }} [options]
 */
export const cell = (path, label, value, act, options = {}) =>
  pointed(h("span", { class: "cell" }, field(label, value, act, { text: true, ...options })), path);

// A field with its title above it. An empty field leaves the specification without the member.
/**
 * @param {string} title
 * @param {unknown} value
 * @param {(value: any) => void} act
 * @param {{ size?: string, hint?: string, text?: boolean, help?: string, read?: (text: string) => number | bigint }} [options]
 */
export function titledField(title, value, act, { help, ...options } = {}) {
  const input = field(
    title,
    value,
    (typed) => act(typed === null || typed === "" ? undefined : typed),
    options,
  );
  return h("label", { title: help }, title, input);
}

// A choice with its title above it. A chosen default leaves the specification without the member.
/**
 * @param {string} title
 * @param {[string, string][]} options
 * @param {string} value
 * @param {(value: string) => void} act
 */
export function choice(title, options, value, act) {
  return h(
    "label",
    {},
    title,
    h(
      "select",
      { onchange: ({ target }) => act(target.value) },
      options.map(([name, text]) => h("option", { value: name, selected: name === value }, text)),
    ),
  );
}

// The members of a job below a path, with the defaults that the server gives them.
export function membersOf(job) {
  const usual = (path) => defaultAt(job.description, "JobSpec", path);
  const at = (path) => path.reduce((owner, name) => owner?.[name], job.spec);
  const put = (path) => (value) => job.at(path, value);
  return {
    usual,
    at,
    put,
    number: (title, path, options = {}) =>
      titledField(title, at(path), put(path), { hint: shown(usual(path)), size: "8", ...options }),
    named: (title, path, schema, titles = {}) => {
      const options = namesIn(job.description, schema).map((name) => [name, titles[name] ?? words(name)]);
      const act = (name) => job.at(path, name === usual(path) ? undefined : name);
      return choice(title, options, at(path) ?? usual(path), act);
    },
  };
}
