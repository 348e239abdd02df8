// @ts-check
// These fields choose how the list of jobs is laid out: the grouping, the columns, and saved views. Estimates are
// offered as columns by the names that the jobs of the list estimate, and by any name that is typed.

import { get } from "../shell/api.js";
import { h } from "../shell/dom.js";
import { columnsOffered, columnsShown } from "./columns.js";
import { dropdown } from "./dropdown.js";
import { ESTIMATE, estimatesAsked, LABEL, MOST_ESTIMATES } from "./filter.js";
import { groupingsOffered } from "./groups.js";
import { viewMenu } from "./views.js";

// The most models of which a job is asked for the names of its estimates.
const MOST_MODELS = 12;

// Lists the names that a job estimates, by its specification: `load[1]` is the load of the second experiment alone.
/** @param {any} spec @returns {string[]} */
export function namesEstimated({ parameters, experiments = [] }) {
  const free = (named) =>
    Object.entries(named ?? {})
      .filter(([, parameter]) => parameter?.estimate)
      .map(([name]) => name);
  return [
    ...free(parameters),
    ...experiments.flatMap((experiment, k) => free(experiment.parameters).map((name) => `${name}[${k}]`)),
  ];
}

export class LayoutFields {
  /**
   * The fields change the grouping and the columns of `filter`, and call `chosen` after that. `labels` are those that
   * can be chosen, `jobs()` gives the jobs of the list, and `present()` the query of the present view.
   *
   * @param {{
   *   filter: any,
   *   labels: Set<string>,
   *   jobs: () => any[],
   *   present: () => string,
   *   chosen: (groups: boolean) => void,
   *   signal: AbortSignal,
   * }} options
   */
  constructor({ filter, labels, jobs, present, chosen, signal }) {
    this.filter = filter;
    this.labels = labels;
    this.jobs = jobs;
    this.chosen = chosen;
    this.signal = signal;
    this.estimates = new Set();
    this.models = new Set();
    this.group = h("select", {
      onchange: ({ target }) => {
        filter.group = target.value;
        chosen(true);
      },
    });
    this.list = h("div", {});
    this.heading = h("p", { class: "quiet" }, "Estimates");
    this.boxes = new Map();
    const columns = dropdown("Columns", h("div", { class: "columns" }, this.list, this.nameForm()), signal);
    columns.addEventListener("toggle", () => columns.open && this.askNames());
    this.elements = [
      h("label", {}, "Group by", this.group),
      columns,
      dropdown("Views", viewMenu(present), signal),
    ];
    this.draw();
  }

  // An estimate whose name is typed becomes a column.
  nameForm() {
    this.name = h("input", {
      type: "text",
      size: "16",
      required: true,
      pattern: "[^,\\s]+",
      placeholder: "mass",
    });
    this.add = h("button", { type: "submit" }, "Add");
    const submit = (event) => {
      event.preventDefault();
      const name = this.name.value.trim();
      this.name.value = "";
      this.estimates.add(name);
      this.choose(`${ESTIMATE}${name}`, true);
      this.draw();
    };
    return h(
      "form",
      { class: "fields", onsubmit: submit },
      h("label", {}, "Estimate by its name", this.name),
      this.add,
    );
  }

  // Asks one job of each model that the list shows what it estimates.
  async askNames() {
    const asked = [];
    for (const { id, method, model } of this.jobs()) {
      if (method && !this.models.has(model) && this.models.size < MOST_MODELS) {
        this.models.add(model);
        asked.push(id);
      }
    }
    const names = await Promise.all(
      asked.map((id) =>
        get(`/v1/jobs/${id}`, this.signal).then(
          ({ data }) => namesEstimated(data.spec),
          () => [],
        ),
      ),
    );
    for (const name of names.flat()) {
      this.estimates.add(name);
    }
    this.draw();
  }

  choose(key, isChosen) {
    const keys = new Set(this.filter.columns);
    isChosen ? keys.add(key) : keys.delete(key);
    this.filter.columns = columnsShown([...keys]).map((column) => column.key);
    this.limit();
    this.chosen(false);
  }

  // No more estimates are chosen than the API gives.
  limit() {
    const isFull = estimatesAsked(this.filter).length >= MOST_ESTIMATES;
    for (const box of this.list.querySelectorAll("input")) {
      box.disabled =
        box.dataset.fixed !== undefined || (isFull && !box.checked && box.name.startsWith(ESTIMATE));
    }
    this.name.disabled = isFull;
    this.add.disabled = isFull;
  }

  // Offers what the jobs have: the groupings, the labels and the estimates.
  draw() {
    const { group, columns } = this.filter;
    const keys = [group, ...columns];
    const chosen = (prefix) =>
      keys.filter((key) => key.startsWith(prefix)).map((key) => key.slice(prefix.length));
    const labels = new Set([...this.labels, ...chosen(LABEL)]);
    const estimates = new Set([...this.estimates, ...chosen(ESTIMATE)]);
    this.group.replaceChildren(
      h("option", { value: "" }, "nothing"),
      ...groupingsOffered(labels).map(({ key, title }) =>
        h("option", { value: key, selected: key === group }, title),
      ),
    );
    const offered = columnsOffered(labels, estimates);
    const boxes = [
      ...offered.filter(({ estimate }) => !estimate).map((column) => this.box(column)),
      this.heading,
      ...offered.filter(({ estimate }) => estimate).map((column) => this.box(column)),
    ];
    boxes.forEach((box, k) => {
      const there = this.list.children[k] ?? null;
      there === box || this.list.insertBefore(box, there);
    });
    while (this.list.children.length > boxes.length) {
      this.list.lastElementChild.remove();
    }
    this.limit();
  }

  // A column has the same box as long as the list is there, so that a click and the focus always meet it.
  /** @param {import("./columns.js").Column} column */
  box({ key, title, fixed }) {
    const isChosen = fixed || this.filter.columns.includes(key);
    const box =
      this.boxes.get(key) ??
      h(
        "label",
        { class: "inline" },
        h("input", {
          type: "checkbox",
          name: key,
          "data-fixed": fixed,
          onchange: ({ target }) => this.choose(key, target.checked),
        }),
        title,
      );
    box.querySelector("input").checked = isChosen;
    this.boxes.set(key, box);
    return box;
  }
}
