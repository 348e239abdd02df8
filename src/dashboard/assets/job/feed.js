// @ts-check
// The feed keeps the state of a single job up to date. It polls the state, reads the generations and
// the refinement from the history first, and then hears of new ones from the event stream, which
// replays what came in between.

import { get, items, pause, query } from "../shell/api.js";

const POLL_MS = 2000;
const PAGE = 1000;
const MOST_PAGES = 100;

// A job at its end has the time of the end, and a job at work can be paused.
export const isFinished = (job) => Boolean(job.finished_at);
export const isAtRest = (job) => !job.actions.includes("pause");

export class JobFeed {
  // The feed calls job(), history() and connection(text) of the `observer` when that part has changed,
  // failed(error) when a request fails, and recovered() when a request succeeds after a failure.
  constructor(id, signal, observer) {
    this.id = id;
    this.signal = signal;
    this.observer = observer;
    this.job = null;
    this.refinements = new Map();
    // The last look at the chains of a posterior.
    this.look = null;
    this.findings = new Map();
    this.rows = new Map();
    // The last event of a design or of a selection that says how far the job came.
    this.latest = null;
    this.drawing = false;
    // The number of changes of the job that were saved on this page.
    this.changes = 0;
  }

  async start() {
    try {
      await this.refresh();
      await this.readHistory();
    } catch (error) {
      this.observer.failed(error);
    }
    if (this.job && !isFinished(this.job) && !this.signal.aborted) {
      this.listen();
      this.poll().catch(() => {});
    }
  }

  // Gives the generations in order.
  generations() {
    return [...this.rows.values()].sort((a, b) => a.generation - b.generation);
  }

  async refresh() {
    const { changes } = this;
    const { data } = await get(`/v1/jobs/${this.id}`, this.signal);
    // An answer that was asked for before a change may not have the change.
    if (changes === this.changes) {
      this.job = data;
      this.observer.job();
    }
  }

  // Takes the job as it is after a change that was saved.
  change(job) {
    this.changes += 1;
    this.job = job;
    this.observer.job();
  }

  async readHistory() {
    let after = null;
    for (let page = 0; page < MOST_PAGES; page += 1) {
      const address = `/v1/jobs/${this.id}/generations${query({ after, limit: PAGE })}`;
      const { data } = await get(address, this.signal);
      const rows = items(data);
      for (const row of rows) {
        this.rows.set(row.generation, row);
      }
      if (rows.length < PAGE) {
        break;
      }
      after = rows.at(-1).generation;
    }
    this.observer.history();
  }

  listen() {
    const stream = new EventSource(`/v1/jobs/${this.id}/events`);
    this.stream = stream;
    this.signal.addEventListener("abort", () => stream.close(), { once: true });
    const on = (name, act) => stream.addEventListener(name, (event) => act(JSON.parse(event.data)));
    stream.onopen = () => this.observer.connection("live");
    stream.onerror = () => {
      const closed = stream.readyState === EventSource.CLOSED;
      this.observer.connection(closed ? "" : "connection lost, trying again");
    };
    on("finding", (finding) => {
      this.findings.set(`${finding.code} ${finding.pointer}`, finding);
      this.draw();
    });
    on("generation", (row) => {
      this.rows.set(row.generation, row);
      this.draw();
    });
    for (const name of ["design", "selection"]) {
      on(name, (latest) => {
        this.latest = latest;
        this.draw();
      });
    }
    on("refinement", (row) => {
      this.refinements.set(row.iteration, row);
      this.draw();
    });
    on("posterior", (look) => {
      this.look = look;
      this.draw();
    });
    on("state", ({ status }) => {
      if (status !== this.job.status) {
        this.refreshSoon();
      }
    });
    on("end", () => {
      stream.close();
      this.observer.connection("");
      this.refreshSoon();
    });
  }

  // Many events of the stream make a single drawing in each frame.
  draw() {
    if (!this.drawing) {
      this.drawing = true;
      requestAnimationFrame(() => {
        this.drawing = false;
        this.observer.history();
      });
    }
  }

  // A replay of many states makes a single request.
  refreshSoon() {
    this.refreshing ??= Promise.resolve()
      .then(() => this.refresh())
      .catch((error) => this.observer.failed(error))
      .finally(() => {
        this.refreshing = null;
      });
  }

  async refreshOrSay() {
    try {
      await this.refresh();
      if (this.lost) {
        this.lost = false;
        this.observer.recovered();
      }
    } catch (error) {
      this.lost = true;
      this.observer.failed(error);
    }
  }

  async poll() {
    while (!isFinished(this.job)) {
      await pause(POLL_MS, this.signal);
      await this.refreshOrSay();
      // A browser does not reconnect by itself after an answer that was no stream.
      if (this.stream.readyState === EventSource.CLOSED && !isFinished(this.job)) {
        this.listen();
      }
    }
    await this.readHistory();
  }
}
