// @ts-check
// This module shows the faults of a form beside the fields that they are about.

import { h } from "./dom.js";

/** @typedef {{ pointer?: string, detail: string, code?: string }} Fault */

// Notes the path of a field, so that the faults of the server find the field.
export function pointed(label, path) {
  label.dataset.pointer = `/${path.join("/")}`;
  return label;
}

// Shows faults beside their fields, in place of the faults before, and gives the faults that have no field. The
// field of a fault is the first in the element whose path is nearest to the fault's.
export function placeFaults(form, faults) {
  for (const before of form.querySelectorAll(".fault")) {
    before.previousElementSibling.removeAttribute("aria-invalid");
    before.previousElementSibling.removeAttribute("aria-describedby");
    before.remove();
  }
  const labels = [...form.querySelectorAll("[data-pointer]")].sort(
    (a, b) => b.dataset.pointer.length - a.dataset.pointer.length,
  );
  return faults.filter(({ pointer = "", detail }, k) => {
    const label = labels.find(({ dataset }) => `${pointer}/`.startsWith(`${dataset.pointer}/`));
    const field = label?.querySelector("input, select, textarea");
    if (field) {
      const id = `fault-${k}`;
      field.setAttribute("aria-invalid", "true");
      field.setAttribute("aria-describedby", id);
      field.after(h("span", { class: "fault bad fine", id }, detail));
    }
    return !field;
  });
}

// Shows a failure: faults stand beside their fields in the form, and the notice has what is left.
export function failBeside(form, outcome, error) {
  const faults = error.errors ?? [];
  const unplaced = placeFaults(form, faults);
  const isPlaced = unplaced.length < faults.length;
  const message = "What is wrong stands beside the fields.";
  outcome.fail(isPlaced ? { title: error.title, message, errors: unplaced } : error);
}

/**
 * Lists which names in a form cannot be those of the members of an object: empty names, and names that stand twice.
 * `pointer(place)` gives the path of the field of a name.
 *
 * @param {string[]} names
 * @param {string} what
 * @param {string} owner
 * @param {(place: number) => string} pointer
 * @returns {Fault[]}
 */
export function faultsOfNames(names, what, owner, pointer) {
  return names.flatMap((name, place) => {
    const isTwice = names.indexOf(name) < place;
    const detail =
      name === "" ? `the ${what} has no name` : isTwice && `the ${owner} has this ${what} already`;
    return detail ? [{ pointer: pointer(place), detail }] : [];
  });
}
