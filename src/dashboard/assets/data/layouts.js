// @ts-check
// A layout is saved by name on the server: the options of an import, for the next export of the same kind. The
// upload form reads a file by a saved layout, saves the options in force, and lists what is saved.

import { get, items, send } from "../shell/api.js";
import { h, keepingFocus, notice, smallButton, table } from "../shell/dom.js";
import { failBeside, placeFaults, pointed } from "../shell/faults.js";
import { instant } from "../shell/format.js";
import { OPTIONS, textOfOptions } from "./options.js";

const LONGEST_NAME = 100;
const COLUMNS = [{ title: "Layout" }, { title: "Options" }, { title: "Changed" }, { title: "Action" }];

/**
 * @typedef {{ name: string, options: Record<string, string>, created_at: string, changed_at: string }} Saved
 */

// Gives the options that say something.
/** @param {Record<string, string>} values */
export const optionsOf = (values) =>
  Object.fromEntries(Object.entries(values).filter(([, value]) => value !== ""));

// Gives the parameters of a request that reads a file: the name of the layout with the options that differ from it.
// No parameter takes an option out of a layout, so that all options stand by themselves where one is taken out.
/**
 * @param {Record<string, string>} values
 * @param {Saved | null} layout
 * @returns {Record<string, string>}
 */
export function parametersOf(values, layout) {
  const options = optionsOf(values);
  const isWhole = layout && Object.keys(optionsOf(layout.options)).every((option) => options[option]);
  if (!isWhole) {
    return options;
  }
  const changes = Object.entries(options).filter(([option, value]) => value !== layout.options[option]);
  return { layout: layout.name, ...Object.fromEntries(changes) };
}

// Lists what is wrong with the name of a layout. A browser takes dots alone for a way in the address.
/**
 * @param {string} name
 * @returns {import("../shell/faults.js").Fault[]}
 */
export function faultsOfName(name) {
  const isUnnamed = name === "" && "the layout has no name";
  const isPath =
    (name.includes("/") || /^\.\.?$/.test(name)) &&
    "a layout is not called . or .., and its name has no slash in it";
  const detail = isUnnamed || isPath;
  return detail ? [{ pointer: "/name", detail }] : [];
}

// The parts of the upload form for saved layouts: `choice` to read by one, `saving` to save one, and the `list`.
// `form.values()` gives the options by their names, `form.put(values)` sets them, and `form.refused(faults)` is
// called with what the server refuses to save.
export class SavedLayouts {
  constructor(form, signal) {
    this.form = form;
    this.signal = signal;
    /** @type {Saved[]} */
    this.layouts = [];
    this.select = h("select", { class: "layout-name", onchange: () => this.choose() });
    this.choice = h("label", { hidden: true }, "Layout", this.select);
    this.name = h("input", { type: "text", maxlength: String(LONGEST_NAME), size: "28" });
    this.name.addEventListener("input", () => this.drawButton());
    this.name.addEventListener("keydown", (event) => this.enter(event));
    this.button = h("button", { type: "button", onclick: () => this.save() });
    this.outcome = notice();
    const name = pointed(h("label", {}, "Save this layout as", this.name), ["name"]);
    this.fields = h("div", { class: "fields" }, name, this.button);
    this.saving = h("div", { class: "saving-layout" }, this.fields, this.outcome.place);
    this.removed = notice();
    this.rows = h("div", {});
    this.summary = h("summary", {});
    this.list = h(
      "details",
      { class: "saved-layouts", hidden: true },
      this.summary,
      this.removed.place,
      this.rows,
    );
    this.draw();
    this.read().catch((error) => this.outcome.fail(error));
  }

  get chosen() {
    return this.named(this.select.value);
  }

  named(name) {
    return this.layouts.find((layout) => layout.name === name) ?? null;
  }

  // Reads what is saved, and has a layout chosen where there is one of the name.
  async read(name = this.select.value) {
    const { data } = await get("/v1/layouts", this.signal);
    this.layouts = items(data);
    this.drawChoice(name);
    this.drawList();
    this.drawButton();
  }

  // The fields get what the layout says, and can then say otherwise.
  choose() {
    const options = this.chosen?.options ?? {};
    this.name.value = this.chosen?.name ?? "";
    this.form.put(Object.fromEntries(Object.keys(OPTIONS).map((option) => [option, options[option] ?? ""])));
  }

  // Draws what follows from the options in force.
  draw() {
    this.fields.hidden = Object.keys(optionsOf(this.form.values())).length === 0;
    this.outcome.clear();
    this.drawButton();
  }

  drawButton() {
    this.button.textContent = this.named(this.name.value.trim()) ? "Replace" : "Save";
  }

  drawChoice(name) {
    const choices = this.layouts.map((layout) => h("option", { value: layout.name }, layout.name));
    this.select.replaceChildren(h("option", { value: "" }, "as the file says"), ...choices);
    this.select.value = this.named(name) ? name : "";
    this.choice.hidden = choices.length === 0;
  }

  // An open list stays when its last layout is removed, and so does the focus.
  drawList() {
    const { length } = this.layouts;
    this.list.hidden = length === 0 && !this.list.open;
    this.summary.textContent = `Saved layouts (${length})`;
    const rows = this.layouts.map(({ name, options, changed_at: changed }) => [
      h("span", {}, name),
      h("span", {}, textOfOptions(options)),
      instant(changed),
      smallButton("Remove", `Remove the layout ${name}`, () => this.remove(name)),
    ]);
    const empty = "No layouts are saved.";
    keepingFocus(this.list, () =>
      this.rows.replaceChildren(table("Saved layouts", COLUMNS, rows, { empty, stacked: true })),
    );
  }

  // The fields stand in the form of the upload, which the key would send.
  enter(event) {
    if (event.key === "Enter") {
      event.preventDefault();
      this.save();
    }
  }

  async save() {
    const name = this.name.value.trim();
    const faults = faultsOfName(name);
    this.outcome.clear();
    placeFaults(this.fields, faults);
    if (faults.length) {
      this.name.focus();
      return;
    }
    try {
      await this.put(name);
    } catch (error) {
      failBeside(this.fields, this.outcome, error);
      this.form.refused(error.errors ?? []);
    }
  }

  // Other people save layouts too, so that the names are read before one is replaced.
  async put(name) {
    await this.read();
    if (this.named(name) && !confirm(`Replace the layout “${name}”?`)) {
      return;
    }
    const address = `/v1/layouts/${encodeURIComponent(name)}`;
    const options = optionsOf(this.form.values());
    const { status } = await send("PUT", address, { options }, { signal: this.signal });
    await this.read(name);
    this.choose();
    const said = status === 200 ? "Replaced" : "Saved";
    this.outcome.show(h("p", { role: "status" }, `${said}. The next file of the kind is read by “${name}”.`));
  }

  remove(name) {
    if (!confirm(`Remove the layout “${name}”? Recordings that were read by it stay.`)) {
      return;
    }
    this.removed.attempt(async () => {
      await send("DELETE", `/v1/layouts/${encodeURIComponent(name)}`, undefined, { signal: this.signal });
      await this.read();
      this.outcome.clear();
      this.summary.focus();
    });
  }
}
