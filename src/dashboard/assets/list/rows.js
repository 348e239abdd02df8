// @ts-check
// The table shows many jobs and keeps only the rows in sight in the page. A row is changed in place, so
// that it keeps its focus and its selection.

import { h } from "../shell/dom.js";
import { count, instant } from "../shell/format.js";
import { titleOf, widthNeeded, widthsIn } from "./columns.js";
import { isHeading } from "./groups.js";

const ROW = 44;
const ROOM = 12;
const BOX_WIDTH = 42;
const STAMPS = { created: "created_at", started: "started_at", finished: "finished_at" };
// What has no order to sort by.
const UNSORTED = ["labels"];

const isPhone = () => matchMedia("(max-width: 60rem)").matches;

export class JobRows {
  // `sorted(key)` is called when a heading is pressed, `chosen()` when the selection has changed, and
  // `toggled(id)` when a group is opened or closed.
  constructor({ sorted, chosen, toggled }) {
    this.callbacks = { sorted, chosen, toggled };
    this.entries = [];
    this.jobs = [];
    this.chosenColumns = [];
    this.columns = [];
    this.rows = new Map();
    this.selected = new Set();
    this.headings = new Map();
    this.order = { sort: null, descending: false };
    this.all = h("input", {
      type: "checkbox",
      "aria-label": "Select all jobs that the list shows",
      onchange: ({ target }) => this.selectAll(target.checked),
    });
    const spacer = () => h("tr", { "aria-hidden": "true" }, h("td", {}));
    this.above = spacer();
    this.below = spacer();
    this.body = h("tbody", {}, this.above, this.below);
    this.widths = h("colgroup", {});
    this.head = h("tr", {});
    this.table = h(
      "table",
      { class: "jobs" },
      h("caption", { class: "unseen" }, "Jobs"),
      this.widths,
      h("thead", {}, this.head),
      this.body,
    );
    this.element = h(
      "div",
      { class: "rows", tabindex: "0", role: "region", "aria-label": "Jobs", onscroll: () => this.draw() },
      this.table,
    );
  }

  // Shows other columns; a phone shows the narrow ones among them.
  /** @param {import("./columns.js").Column[]} columns */
  setColumns(columns) {
    this.chosenColumns = columns;
    this.columns = isPhone() ? columns.filter(({ narrow }) => narrow) : columns;
    this.headings.clear();
    const heading = ({ key, title, numeric }) => {
      const onclick = () => this.callbacks.sorted(key);
      const cell = h(
        "th",
        { scope: "col", class: numeric ? "number" : null },
        UNSORTED.includes(key) ? title : h("button", { type: "button", class: "heading", onclick }, title),
      );
      this.headings.set(key, cell);
      return cell;
    };
    this.head.replaceChildren(h("th", { scope: "col" }, this.all), ...this.columns.map(heading));
    for (const { element } of this.rows.values()) {
      element.remove();
    }
    this.rows.clear();
    const span = String(this.columns.length + 1);
    this.above.firstChild.setAttribute("colspan", span);
    this.below.firstChild.setAttribute("colspan", span);
    this.mark();
    this.fit();
    this.draw();
  }

  // Follows the width of the window.
  resize() {
    if (isPhone() !== this.columns.length < this.chosenColumns.length) {
      this.setColumns(this.chosenColumns);
    }
    this.fit();
    this.draw();
  }

  // Gives each column the width that its texts need.
  fit() {
    const room = (this.element.clientWidth || innerWidth) - BOX_WIDTH;
    const needs = this.columns.map((column) => widthNeeded(column, this.jobs, Date.now(), isPhone()));
    const widths = [BOX_WIDTH, ...widthsIn(needs, room)];
    this.widths.replaceChildren(
      ...widths.map((width) => {
        const column = h("col", {});
        column.style.width = `${width}px`;
        return column;
      }),
    );
    this.table.style.width = `${Math.max(
      room + BOX_WIDTH,
      widths.reduce((sum, width) => sum + width, 0),
    )}px`;
  }

  orderBy(sort, descending) {
    this.order = { sort, descending };
    this.mark();
  }

  mark() {
    for (const [name, cell] of this.headings) {
      if (name === this.order.sort) {
        cell.setAttribute("aria-sort", this.order.descending ? "descending" : "ascending");
      } else {
        cell.removeAttribute("aria-sort");
      }
    }
  }

  selectAll(wanted) {
    for (const { id } of this.jobs) {
      wanted ? this.selected.add(id) : this.selected.delete(id);
    }
    for (const [id, { box }] of this.rows) {
      if (box) {
        box.checked = this.selected.has(id);
      }
    }
    this.callbacks.chosen();
  }

  // Shows jobs and the headings of groups. The jobs of closed groups are not among the entries.
  show(entries) {
    this.entries = entries;
    this.jobs = entries.some(isHeading) ? entries.filter((entry) => !isHeading(entry)) : entries;
    this.all.checked = this.jobs.length > 0 && this.jobs.every(({ id }) => this.selected.has(id));
    this.table.setAttribute("aria-rowcount", String(entries.length + 1));
    this.draw();
  }

  draw() {
    const tall = this.element.clientHeight || 600;
    const first = Math.max(0, Math.floor(this.element.scrollTop / ROW) - ROOM);
    const last = Math.min(this.entries.length, Math.ceil((this.element.scrollTop + tall) / ROW) + ROOM);
    const entries = this.entries.slice(first, last);
    const ids = new Set(entries.map(({ id }) => id));
    for (const [id, row] of this.rows) {
      if (!ids.has(id)) {
        row.element.remove();
        this.rows.delete(id);
      }
    }
    this.above.firstChild.style.height = `${first * ROW}px`;
    this.below.firstChild.style.height = `${(this.entries.length - last) * ROW}px`;
    let after = this.above;
    entries.forEach((entry, k) => {
      const row = isHeading(entry) ? this.groupRow(entry) : this.row(entry);
      row.element.setAttribute("aria-rowindex", String(first + k + 2));
      if (after.nextSibling !== row.element) {
        after.after(row.element);
      }
      after = row.element;
    });
  }

  row(job) {
    let row = this.rows.get(job.id);
    if (!row) {
      row = this.newRow(job);
      this.rows.set(job.id, row);
    }
    if (row.job !== job || !job.finished_at) {
      row.job = job;
      row.box.setAttribute("aria-label", `Select ${job.name || job.id}`);
      for (const [k, column] of this.columns.entries()) {
        fill(row.cells[k], column, job);
      }
    }
    return row;
  }

  groupRow({ id, title, size, isOpen }) {
    let row = this.rows.get(id);
    if (!row) {
      const onclick = () => this.callbacks.toggled(id);
      const button = h("button", { type: "button", class: "heading group", onclick });
      const cell = h("th", { scope: "rowgroup", colspan: String(this.columns.length + 1) }, button);
      row = { element: h("tr", { class: "group" }, cell), button };
      this.rows.set(id, row);
    }
    const words = `${title} · ${count(size)} ${size === 1 ? "job" : "jobs"}`;
    if (row.button.textContent !== words) {
      row.button.textContent = words;
    }
    row.button.setAttribute("aria-expanded", String(isOpen));
    return row;
  }

  newRow(job) {
    const box = h("input", {
      type: "checkbox",
      checked: this.selected.has(job.id),
      onchange: (event) => {
        event.target.checked ? this.selected.add(job.id) : this.selected.delete(job.id);
        this.callbacks.chosen();
      },
    });
    const cells = this.columns.map(({ numeric }) => h("td", { class: numeric ? "number" : null }));
    return { element: h("tr", {}, h("td", {}, box), cells), box, cells, job: null };
  }

  forget(id) {
    this.selected.delete(id);
  }
}

/**
 * Writes what a column says of a job into a cell.
 *
 * @param {HTMLElement} cell
 * @param {import("./columns.js").Column} column
 * @param {any} job
 */
function fill(cell, { key, text, estimate }, job) {
  if (key === "status") {
    put(cell, job.status + progress(job), () => [badge(job.status), progress(job)]);
  } else if (key === "trust") {
    put(cell, job.trust ?? "", () => (job.trust ? [trustBadge(job.trust)] : []));
  } else if (key === "name") {
    put(cell, titleOf(job), () => [lines(h("a", { href: `#/jobs/${job.id}`, title: job.id }, titleOf(job)))]);
  } else if (key in STAMPS) {
    const stamp = job[STAMPS[key]];
    put(cell, stamp ?? "", () => [stamp ? instant(stamp) : "–"]);
  } else if (estimate) {
    const { trust } = job.estimates?.[estimate] ?? {};
    const words = [text(job, Date.now()), trust && `trust ${trust}`].filter(Boolean).join(", ");
    put(cell, words, () =>
      words ? [h("div", { class: "estimate" }, text(job, Date.now()), " ", trust && trustBadge(trust))] : [],
    );
    cell.title = words;
  } else {
    const words = text(job, Date.now());
    put(cell, words, () => [lines(words)]);
    cell.title = words;
  }
}

// A text has two lines at the most; a name parts behind an underscore rather than within a word.
function lines(content) {
  const parts = typeof content === "string" ? content.split(/(?<=_)/) : [content];
  return h(
    "span",
    { class: "lines" },
    parts.map((part, k) => (k ? [h("wbr"), part] : part)),
  );
}

function put(cell, key, make) {
  if (cell.dataset.shown !== key) {
    cell.dataset.shown = key;
    cell.replaceChildren(...make());
  }
}

// A design and a selection of windows, which have no method, do not know how far they are.
function progress(job) {
  return job.status === "running" && job.method && job.progress
    ? ` ${Math.round(100 * (job.progress.fraction ?? 0))} %`
    : "";
}

export function badge(status) {
  return h("span", { class: `badge ${status}` }, status);
}

export function trustBadge(trust) {
  return h("span", { class: `badge trust-${trust}` }, trust);
}
