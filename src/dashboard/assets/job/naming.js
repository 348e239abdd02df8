// @ts-check
// The form changes what people call a job: its name, its labels and a note. The server gets what was changed
// alone, so that two people who change different labels keep the changes of each other.

import { changed } from "../new/draft.js";
import { cell, titledField } from "../new/fields.js";
import { send } from "../shell/api.js";
import { h, notice, smallButton } from "../shell/dom.js";
import { failBeside, faultsOfNames, placeFaults, pointed } from "../shell/faults.js";
import { FOLLOWS } from "../shell/prepared.js";
import { namesOnTheWay } from "../text/document.js";

/**
 * In the form the labels have an order, and two of them may have the same name.
 *
 * @typedef {{ name: string, labels: { name: string, value: string }[], note: string }} Words
 */

// Gives what people call a job, as the form has it. The job that this one follows is shown with the result, and is
// not changed here.
/** @returns {Words} */
export function wordsOf({ name, labels, note }) {
  return {
    name: name ?? "",
    labels: Object.entries(labels ?? {})
      .filter(([label]) => label !== FOLLOWS)
      .map(([label, value]) => ({ name: label, value })),
    note: (note ?? "").replaceAll("\r\n", "\n"),
  };
}

// Gives the change from some words to others as a merge patch: null removes, and what stays is left out.
/**
 * @param {Words} before
 * @param {Words} after
 * @returns {{ name?: string | null, labels?: Record<string, string | null>, note?: string | null }}
 */
export function patchOf(before, after) {
  const old = new Map(before.labels.map(({ name, value }) => [name, value]));
  const kept = new Map(after.labels.map(({ name, value }) => [name, value]));
  /** @type {[string, string | null][]} */
  const removed = [...old.keys()].filter((name) => !kept.has(name)).map((name) => [name, null]);
  const labels = [...removed, ...[...kept].filter(([name, value]) => old.get(name) !== value)];
  return {
    ...(after.name !== before.name && { name: after.name || null }),
    ...(labels.length > 0 && { labels: Object.fromEntries(labels) }),
    ...(after.note !== before.note && { note: after.note.trim() ? after.note : null }),
  };
}

// Gives the faults that the server finds in a change with the places that they have in the form.
/**
 * @param {Words} words
 * @param {import("../shell/faults.js").Fault[]} faults
 */
export function faultsInWords({ labels }, faults) {
  return faults.map((fault) => {
    const [member, label] = namesOnTheWay(fault.pointer ?? "");
    const place = member === "labels" ? labels.findIndex(({ name }) => name === label) : -1;
    return place < 0 ? fault : { ...fault, pointer: `/labels/${place}/value` };
  });
}

/**
 * Makes the form. `saved(job)` is called with the job as it then is, and `closed()` when the form is done.
 *
 * @param {any} view
 * @param {{ job: any, saved: (job: any) => void, closed: () => void }} options
 */
export function wordsForm(view, { job, saved, closed }) {
  const before = wordsOf(job);
  let words = before;
  const outcome = notice();
  const put = (path) => (value) => {
    words = changed(words, path, value);
  };
  const list = pointed(h("div", { class: "fields tags" }), ["labels"]);
  const draw = () => list.replaceChildren(...labelFields(words.labels, put, add, remove));
  const add = () => {
    const place = words.labels.length;
    put(["labels", place])({ name: "", value: "" });
    draw();
    list.querySelector(`[data-pointer="/labels/${place}/name"] input`).focus();
  };
  const remove = (place) => {
    put(["labels", place])(undefined);
    placeFaults(form, []);
    draw();
    list.lastElementChild.focus();
  };
  const button = h("button", { type: "submit", class: "primary" }, "Save");
  const save = async (event) => {
    event.preventDefault();
    button.disabled = true;
    placeFaults(form, []);
    outcome.clear();
    try {
      const errors = faultsOfNames(
        words.labels.map(({ name }) => name),
        "label",
        "job",
        (place) => `/labels/${place}/name`,
      );
      if (errors.length) {
        throw { title: "Nothing is saved", errors };
      }
      const patch = patchOf(before, words);
      if (Object.keys(patch).length) {
        const { data } = await send("PATCH", `/v1/jobs/${job.id}`, patch, { signal: view.signal });
        saved(data);
      }
      closed();
    } catch (error) {
      const errors = faultsInWords(words, error.errors ?? []);
      failBeside(form, outcome, Object.assign(error, { errors }));
    }
    button.disabled = false;
  };
  const note = h("textarea", { rows: "4", onchange: () => put(["note"])(note.value) });
  note.value = words.note;
  const name = titledField("Name", words.name, (text) => put(["name"])(text ?? ""), {
    text: true,
    size: "40",
    hint: "rig 4, commissioning",
  });
  const form = h(
    "form",
    { class: "panel words", "aria-label": "Name, labels and note of the job", onsubmit: save },
    h("div", { class: "fields" }, pointed(name, ["name"])),
    list,
    pointed(h("label", { class: "block" }, "Note", note), ["note"]),
    outcome.place,
    h("div", { class: "actions" }, button, h("button", { type: "button", onclick: closed }, "Cancel")),
  );
  draw();
  return form;
}

function labelFields(labels, put, add, remove) {
  const rows = labels.map(({ name, value }, place) => {
    const path = ["labels", place];
    const label = `label ${place + 1}`;
    return h(
      "div",
      { class: "together", role: "group", "aria-label": `Label ${place + 1}` },
      cell([...path, "name"], `Name of ${label}`, name, put([...path, "name"]), { hint: "site", size: "12" }),
      "=",
      cell([...path, "value"], `Value of ${label}`, value, put([...path, "value"]), {
        hint: "hall 2",
        size: "16",
      }),
      smallButton("×", `× remove ${label}`, () => remove(place)),
    );
  });
  return [h("span", { class: "term" }, "Labels"), ...rows, smallButton("Add a label", "Add a label", add)];
}
