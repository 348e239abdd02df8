// @ts-check
// The table shows many jobs and keeps only the rows in sight in the page. A row is changed in place, so
// that it keeps its focus and its selection.

import { h } from "../shell/dom.js";
import { duration, instant, words } from "../shell/format.js";
import { FOLLOWS } from "../shell/prepared.js";
import { seconds } from "./filter.js";

const ROW = 44;
const ROOM = 12;

const COLUMNS = [
  { key: "status", title: "Status" },
  { key: "trust", title: "Trust" },
  { key: "name", title: "Job" },
  { key: "dataset", title: "Recording", wide: true },
  { key: "model", title: "Model", wide: true },
  { key: "method", title: "Method", wide: true },
  { key: null, title: "Labels", wide: true },
  { key: "duration", title: "Duration", wide: true },
  { key: "created", title: "Created", wide: true },
];

export class JobRows {
  // `sorted(key)` is called when a heading is pressed, `chosen()` when the selection has changed.
  constructor({ sorted, chosen }) {
    this.jobs = [];
    this.rows = new Map();
    this.selected = new Set();
    this.chosen = chosen;
    this.headings = new Map();
    const heading = ({ key, title, wide }) => {
      const cell = h(
        "th",
        { scope: "col", class: wide ? "wide" : null },
        key ? h("button", { type: "button", class: "heading", onclick: () => sorted(key) }, title) : title,
      );
      if (key) {
        this.headings.set(key, cell);
      }
      return cell;
    };
    this.all = h("input", {
      type: "checkbox",
      "aria-label": "Select all jobs that the list shows",
      onchange: ({ target }) => this.selectAll(target.checked),
    });
    // The spacer spans the columns of the narrowest page; more columns would take room there.
    const spacer = () => h("tr", { "aria-hidden": "true" }, h("td", { colspan: "4" }));
    this.above = spacer();
    this.below = spacer();
    this.body = h("tbody", {}, this.above, this.below);
    this.table = h(
      "table",
      { class: "jobs" },
      h("caption", { class: "unseen" }, "Jobs"),
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, this.all), COLUMNS.map(heading))),
      this.body,
    );
    this.element = h(
      "div",
      { class: "rows", tabindex: "0", role: "region", "aria-label": "Jobs", onscroll: () => this.draw() },
      this.table,
    );
  }

  order(key, descending) {
    for (const [name, cell] of this.headings) {
      if (name === key) {
        cell.setAttribute("aria-sort", descending ? "descending" : "ascending");
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
      box.checked = this.selected.has(id);
    }
    this.chosen();
  }

  show(jobs) {
    this.jobs = jobs;
    this.all.checked = jobs.length > 0 && jobs.every(({ id }) => this.selected.has(id));
    this.table.setAttribute("aria-rowcount", String(jobs.length + 1));
    this.draw();
  }

  draw() {
    const tall = this.element.clientHeight || 600;
    const first = Math.max(0, Math.floor(this.element.scrollTop / ROW) - ROOM);
    const last = Math.min(this.jobs.length, Math.ceil((this.element.scrollTop + tall) / ROW) + ROOM);
    const jobs = this.jobs.slice(first, last);
    const ids = new Set(jobs.map(({ id }) => id));
    for (const [id, row] of this.rows) {
      if (!ids.has(id)) {
        row.element.remove();
        this.rows.delete(id);
      }
    }
    this.above.firstChild.style.height = `${first * ROW}px`;
    this.below.firstChild.style.height = `${(this.jobs.length - last) * ROW}px`;
    let after = this.above;
    jobs.forEach((job, k) => {
      const row = this.row(job);
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
      this.fill(row, job);
    }
    return row;
  }

  newRow(job) {
    const box = h("input", {
      type: "checkbox",
      "aria-label": `Select ${job.name || job.id}`,
      checked: this.selected.has(job.id),
      onchange: (event) => {
        event.target.checked ? this.selected.add(job.id) : this.selected.delete(job.id);
        this.chosen();
      },
    });
    const link = h("a", { href: `#/jobs/${job.id}` });
    const cells = COLUMNS.map(({ wide }) => h("td", { class: wide ? "wide" : null }));
    cells[2].append(link);
    cells[8].append(instant(job.created_at));
    return { element: h("tr", {}, h("td", {}, box), cells), box, link, cells, job: null };
  }

  fill(row, job) {
    const { cells, link } = row;
    row.job = job;
    put(cells[0], job.status, () => [badge(job.status), progress(job)]);
    put(cells[1], job.trust ?? "", () => (job.trust ? [trustBadge(job.trust)] : []));
    link.textContent = job.name || `unnamed, ${job.model}`;
    link.title = job.id;
    const recordings = job.datasets.map(({ id, name }) => name ?? id).join(", ");
    text(cells[3], recordings);
    text(cells[4], job.model);
    text(cells[5], words(job.method ?? ""));
    text(
      cells[6],
      Object.entries(job.labels)
        .filter(([name]) => name !== FOLLOWS)
        .map(([name, value]) => `${name}: ${value}`)
        .join(", "),
    );
    const took = seconds(job, Date.now());
    text(cells[7], took === null ? "–" : duration(took));
    if (job.status === "running") {
      cells[0].lastChild.textContent = progress(job);
    }
  }

  forget(id) {
    this.selected.delete(id);
  }
}

function put(cell, key, make) {
  if (cell.dataset.shown !== key) {
    cell.dataset.shown = key;
    cell.replaceChildren(...make());
  }
}

function text(cell, words) {
  if (cell.textContent !== words) {
    cell.textContent = words;
    cell.title = words;
  }
}

function progress(job) {
  return job.status === "running" && job.progress
    ? ` ${Math.round(100 * (job.progress.fraction ?? 0))} %`
    : "";
}

export function badge(status) {
  return h("span", { class: `badge ${status}` }, status);
}

export function trustBadge(trust) {
  return h("span", { class: `badge trust-${trust}` }, trust);
}
