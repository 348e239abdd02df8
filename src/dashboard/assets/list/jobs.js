// @ts-check
// The page lists all jobs. They are searched, filtered, sorted and grouped here, and kept up to date by the
// stream of all jobs. The address has the filter, the order, the grouping and the columns.

import { get, query } from "../shell/api.js";
import { described, namesIn } from "../shell/description.js";
import { h, notice } from "../shell/dom.js";
import { count, instant, methodText, modelText } from "../shell/format.js";
import { FOLLOWS } from "../shell/prepared.js";
import { BulkActions } from "./bulk.js";
import { columnsShown, USUAL } from "./columns.js";
import { arranged, estimatesAsked, fromQuery, matcher, textOf, toQuery } from "./filter.js";
import { entriesOf } from "./groups.js";
import { LayoutFields } from "./layout.js";
import { JobRows } from "./rows.js";
import { startPanel } from "./start.js";
import { keepChoice, lastChoice } from "./views.js";

// The first page fills any screen; further pages are as long as the server allows.
const FIRST_PAGE = 100;
const PAGE = 500;
// While pages are read, the list is drawn again after this time, in milliseconds.
const DRAWN_EACH = 1000;
const MOST = 50_000;
const MOST_LABELS = 40;
const COMPARED = [2, 10];
const SORTED_DOWN = ["created", "started", "finished", "trust", "duration", "generations", "evaluations"];
// What the address leaves out.
const USUAL_LIST = { group: "", columns: USUAL };

// The newest jobs that were asked for before the list is shown.
/** @type {ReturnType<typeof readPage> | null} */
let newest = null;

/** @param {URLSearchParams} address */
export function askAhead(address) {
  newest = readPage({ limit: FIRST_PAGE, estimates: estimatesAsked(filterOf(address)) });
  newest.catch(() => {});
  // The format of instants takes milliseconds to make, in which the server answers.
  instant(new Date().toISOString());
}

// What an address leaves out is as it was chosen last.
const filterOf = (address) => fromQuery(address, { ...USUAL_LIST, ...lastChoice() });

/**
 * @param {{ limit: number, estimates: string[], page_token?: string | null, text?: string }} asked
 * @param {AbortSignal} [signal]
 */
function readPage({ estimates, ...asked }, signal) {
  return get(`/v1/jobs${query({ view: "summary", ...asked, estimates: String(estimates) })}`, signal);
}

export function showJobs(view) {
  const list = new JobList(view);
  view.root.append(
    h(
      "div",
      { class: "title" },
      h("h1", { tabindex: "-1" }, "Jobs"),
      h("a", { class: "button primary for-writers", href: "#/new" }, "New job"),
      list.compare,
      list.bulk.element,
      list.connection,
    ),
    list.bulk.form,
    list.choices,
    list.outcome.place,
    list.summary,
    list.rows.element,
    list.emptyNote,
    list.start,
  );
  list.open();
}

class JobList {
  constructor(view) {
    this.view = view;
    this.filter = filterOf(view.query);
    // The names of the estimates that are asked for, and the jobs whose estimates are to be read anew.
    this.estimates = estimatesAsked(this.filter);
    this.outdated = new Set();
    this.isReading = false;
    this.closed = new Set();
    this.labels = new Set();
    this.jobs = new Map();
    this.drawing = false;
    this.sorted = null;
    this.models = new Set();
    this.trusts = [];
    this.loaded = false;
    this.whole = false;
    this.isFitted = null;
    this.asked = null;
    this.outcome = notice();
    this.summary = h("p", { class: "quiet", role: "status" }, "Loading …");
    this.emptyNote = h("p", { hidden: true }, "No job is like this.");
    // Who has no job yet gets to know what this is.
    this.start = h("div", { hidden: true }, startPanel(view));
    this.connection = h("span", { class: "quiet", role: "status" });
    this.rows = new JobRows({
      sorted: (key) => this.sort(key),
      chosen: () => this.choose(),
      toggled: (id) => this.toggle(id),
    });
    this.compare = h(
      "button",
      {
        type: "button",
        disabled: true,
        onclick: () => {
          location.hash = `/compare?jobs=${[...this.rows.selected].join(",")}`;
        },
      },
      "Compare",
    );
    // Only jobs that the list shows are acted on; a filter may hide others that were selected.
    const selected = () => this.rows.jobs.filter(({ id }) => this.rows.selected.has(id));
    this.bulk = new BulkActions({
      selected,
      labels: () => [...this.labels].sort(),
      outcome: this.outcome,
      labelled: (job) => this.takeWords(job),
    });
    this.rows.element.hidden = true;
    this.rows.orderBy(this.filter.sort, this.filter.descending);
    this.rows.setColumns(columnsShown(this.filter.columns));
    this.choices = this.fields();
    addEventListener("resize", () => this.rows.resize(), { signal: view.signal });
  }

  fields() {
    const set = (name) => (event) => {
      this.filter[name] = event.target.value.trim();
      this.changed();
    };
    const places = {};
    const select = (name, title) => {
      places[name] = h("select", { onchange: set(name), "data-filter": name });
      this.offer(places[name], name, []);
      return h("label", {}, title, places[name]);
    };
    this.modelPlace = h("select", { onchange: set("model") });
    this.drawModels();
    const fields = h(
      "search",
      { class: "fields filters" },
      h(
        "label",
        { class: "grow" },
        "Search",
        h("input", {
          type: "search",
          value: this.filter.text,
          placeholder: "name, note, label, id …",
          title: "Words of the name, the note, the recording, the labels, the model or the method, or an id",
          oninput: set("text"),
        }),
      ),
      select("status", "Status"),
      select("trust", "Trust"),
      h("label", {}, "Model", this.modelPlace),
      select("method", "Method"),
      h(
        "label",
        {},
        "Label",
        h("input", {
          type: "text",
          value: this.filter.label,
          size: "10",
          placeholder: "site:hall 2",
          oninput: set("label"),
        }),
      ),
      this.layoutFields(),
    );
    this.offerNames = (description) => {
      this.trusts = namesIn(description, "Trust");
      this.sorted = null;
      this.offer(places.status, "status", namesIn(description, "Status"));
      this.offer(places.trust, "trust", [...this.trusts.toReversed(), "none"]);
      this.offer(places.method, "method", namesIn(description, "MethodName"));
      this.drawSoon();
    };
    return fields;
  }

  // The fields choose how the list is laid out. A layout is kept for the next visit; estimates that it shows for the
  // first time are read.
  layoutFields() {
    const chosen = (groups) => {
      groups && this.closed.clear();
      groups || this.rows.setColumns(columnsShown(this.filter.columns));
      keepChoice({ group: this.filter.group, columns: this.filter.columns });
      this.changed();
      const names = estimatesAsked(this.filter);
      if (names.some((name) => !this.estimates.includes(name))) {
        this.load();
      }
      this.estimates = names;
    };
    this.layout = new LayoutFields({
      filter: this.filter,
      labels: this.labels,
      jobs: () => this.rows.jobs,
      present: () => toQuery(this.filter, USUAL_LIST, true),
      chosen,
      signal: this.view.signal,
    });
    return this.layout.elements;
  }

  toggle(id) {
    this.closed.has(id) ? this.closed.delete(id) : this.closed.add(id);
    this.draw();
  }

  // Offers the values of a filter; the chosen one stays even where it is not among them.
  offer(place, name, values) {
    const chosen = this.filter[name];
    const offered = chosen && !values.includes(chosen) ? [...values, chosen] : values;
    place.replaceChildren(
      h("option", { value: "" }, "all"),
      ...offered.map((value) => h("option", { value, selected: value === chosen }, methodText(value))),
    );
  }

  drawModels() {
    const names = [...new Set([...this.models, this.filter.model].filter(Boolean))].sort();
    this.modelPlace.replaceChildren(
      h("option", { value: "" }, "all"),
      ...names.map((name) =>
        h("option", { value: name, selected: name === this.filter.model }, modelText(name)),
      ),
    );
  }

  sort(key) {
    const same = this.filter.sort === key;
    this.filter.descending = same ? !this.filter.descending : SORTED_DOWN.includes(key);
    this.filter.sort = key;
    this.sorted = null;
    this.rows.orderBy(key, this.filter.descending);
    this.changed();
  }

  choose() {
    const chosen = this.rows.selected.size;
    this.compare.disabled = chosen < COMPARED[0] || chosen > COMPARED[1];
    this.compare.textContent = chosen ? `Compare ${chosen}` : "Compare";
    this.compare.title = this.compare.disabled ? "Select two to ten jobs" : "";
    this.bulk.draw();
  }

  // The address follows the filter, without a step in the history for each letter.
  changed() {
    history.replaceState(null, "", `#/jobs${toQuery(this.filter, USUAL_LIST)}`);
    this.draw();
  }

  // Many changes make a single drawing in each frame.
  drawSoon() {
    if (!this.drawing) {
      this.drawing = true;
      requestAnimationFrame(() => {
        this.drawing = false;
        this.draw();
      });
    }
  }

  draw() {
    // The sorted list is kept until a job changes, so that a typed letter only filters.
    const { sort, descending } = this.filter;
    this.sorted ??= arranged(this.jobs.values(), { sort, descending, trusts: this.trusts }, Date.now());
    const shown = this.sorted.filter(matcher(this.filter));
    this.rows.element.hidden = shown.length === 0;
    this.rows.show(entriesOf(shown, this.filter.group, this.closed));
    // The widths follow the first jobs, and all jobs once all are there.
    if (shown.length > 0 && this.isFitted !== this.whole) {
      this.isFitted = this.whole;
      this.rows.fit();
    }
    this.bulk.draw();
    const all = this.jobs.size;
    const counted =
      shown.length === all ? `${count(all)} jobs` : `${count(shown.length)} of ${count(all)} jobs`;
    this.summary.textContent = this.whole ? counted : `${counted}, reading more …`;
    this.emptyNote.hidden = !this.whole || all === 0 || shown.length > 0;
    // Without a job there is nothing to choose among and to compare.
    const isEmpty = this.loaded && all === 0;
    this.start.hidden = !isEmpty;
    for (const element of [this.choices, this.summary, this.compare]) {
      element.hidden = isEmpty;
    }
    // The names of the filters are asked for once the first jobs are on the screen.
    if (all > 0) {
      this.asked ??= described().then(this.offerNames, (error) => this.outcome.fail(error));
    }
  }

  take(told) {
    const before = this.jobs.get(told.id);
    const job = { ...told, estimates: told.estimates ?? before?.estimates };
    this.sorted = null;
    this.jobs.set(job.id, job);
    // The text that is searched is made while the list is read, so that the first letter finds it.
    textOf(job);
    if (!this.models.has(job.model)) {
      this.models.add(job.model);
      this.drawModels();
    }
    const names = Object.keys(job.labels).filter((name) => name !== FOLLOWS && !this.labels.has(name));
    if (names.length && this.labels.size < MOST_LABELS) {
      for (const name of names) {
        this.labels.add(name);
      }
      this.layout.draw();
    }
  }

  // Takes the name, the labels and the note of a job; the list has the rest.
  takeWords({ id, name, labels, note }) {
    const job = this.jobs.get(id);
    if (job) {
      this.take({ ...job, name, labels, note });
      this.drawSoon();
    }
  }

  // The newest jobs are on the screen before anything else is asked for: the stream of changes needs a moment
  // to open.
  async open() {
    const asked = newest ?? readPage({ limit: FIRST_PAGE, estimates: this.estimates }, this.view.signal);
    newest = null;
    try {
      const { data } = await asked;
      if (this.view.signal.aborted) {
        return;
      }
      this.takePage(data);
    } catch (error) {
      if (this.view.signal.aborted) {
        return;
      }
      this.outcome.fail(error);
    }
    this.follow();
  }

  /** @param {{ items: any[], next_page_token?: string }} data */
  takePage({ items, next_page_token: token }) {
    for (const job of items) {
      this.take(job);
    }
    if (!this.loaded) {
      this.loaded = true;
      this.whole = !token;
      this.draw();
    }
  }

  // The stream opens before the whole list is read, so that every later change is heard.
  follow() {
    const stream = new EventSource("/v1/events");
    this.view.signal.addEventListener("abort", () => stream.close(), { once: true });
    stream.onopen = () => {
      this.connection.textContent = "live";
      this.load();
    };
    stream.onerror = () => {
      this.connection.textContent = "connection lost, trying again";
      if (stream.readyState === EventSource.CLOSED && !this.view.signal.aborted) {
        setTimeout(() => this.view.signal.aborted || this.follow(), 3000);
      }
    };
    stream.addEventListener("job", (event) => {
      const job = JSON.parse(event.data);
      this.readEstimatesOf(job);
      this.take(job);
      this.drawSoon();
    });
    stream.addEventListener("removed", (event) => {
      const { id } = JSON.parse(event.data);
      this.jobs.delete(id);
      this.sorted = null;
      this.rows.forget(id);
      this.choose();
      this.drawSoon();
    });
  }

  // An event has no estimates: those of a job with another result are read, one job after the other.
  async readEstimatesOf({ id, status, trust }) {
    const before = this.jobs.get(id);
    if (!trust || this.estimates.length === 0 || (before?.status === status && before?.trust === trust)) {
      return;
    }
    this.outdated.add(id);
    if (this.isReading) {
      return;
    }
    this.isReading = true;
    for (const text of this.outdated) {
      // A job that changes meanwhile is read once more.
      this.outdated.delete(text);
      try {
        const asked = { limit: 1, text, estimates: this.estimates };
        const { data } = await readPage(asked, this.view.signal);
        this.takePage(data);
        this.drawSoon();
      } catch (error) {
        this.outcome.fail(error);
      }
    }
    this.isReading = false;
  }

  // Reads all jobs. Each page is asked for before the page ahead of it is handled, and the list is drawn once
  // a second, since the rows in sight rarely change meanwhile.
  async load() {
    this.loading?.abort();
    const loading = new AbortController();
    this.loading = loading;
    this.view.signal.addEventListener("abort", () => loading.abort(), { once: true });
    const before = [...this.jobs.keys()];
    const seen = new Set();
    // A list that is read again, for another estimate, is drawn with its first page.
    let drawn = this.whole ? 0 : performance.now();
    const asked = { limit: PAGE, estimates: estimatesAsked(this.filter) };
    try {
      let next = readPage(asked, loading.signal);
      while (next) {
        const { data } = await next;
        const token = data.next_page_token;
        const length = seen.size + data.items.length;
        next = token && length < MOST ? readPage({ ...asked, page_token: token }, loading.signal) : null;
        this.isCut = Boolean(token);
        for (const { id } of data.items) {
          seen.add(id);
        }
        this.takePage(data);
        if (performance.now() - drawn > DRAWN_EACH) {
          drawn = performance.now();
          this.drawSoon();
        }
      }
      for (const id of before.filter((id) => !this.isCut && !seen.has(id))) {
        this.jobs.delete(id);
      }
      this.sorted = null;
      this.whole = true;
      this.isFitted = null;
      this.drawSoon();
      this.outcome.clear();
    } catch (error) {
      this.outcome.fail(error);
    }
  }
}
