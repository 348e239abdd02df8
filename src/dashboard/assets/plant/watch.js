// @ts-check
// The page makes a new monitor from the specification of a job and a stream. The form and the text of
// the specification are two views of the same specification.

import { MODEL_WORDS } from "../model/language.js";
import { changed } from "../new/draft.js";
import { get, items, repeatKey, send } from "../shell/api.js";
import { described } from "../shell/description.js";
import { h, keepingFocus, notice } from "../shell/dom.js";
import { readJson } from "../shell/json.js";
import { specOf } from "../shell/prepared.js";
import { placed, readText } from "../text/document.js";
import { Editor, editorLibrary } from "../text/editor.js";
import { alarmsPart, choicePart, driftPart, signalsPart, windowsPart } from "./fields.js";
import { plantHead } from "./head.js";
import { likeMonitor, missingParts, offeredJobs, signalsIn, templateOf } from "./plan.js";

const JOBS_OFFERED = 200;

export function showNewMonitor(view) {
  const outcome = notice();
  const place = h("div", {}, h("p", { class: "quiet" }, "Loading …"));
  plantHead(view, "/plant", "New monitor");
  view.root.append(place);
  load(view)
    .then((start) => {
      const page = new NewMonitor(view, start, outcome);
      place.replaceChildren(...page.elements());
      page.redraw();
    })
    .catch((error) => {
      place.replaceChildren(outcome.place);
      outcome.fail(error);
    });
}

async function load(view) {
  const { signal } = view;
  const [streams, jobs, description] = await Promise.all([
    get("/v1/streams?limit=500", signal),
    get(`/v1/jobs?view=summary&limit=${JOBS_OFFERED}`, signal),
    described(),
  ]);
  const start = {
    streams: new Map(items(streams.data).map((stream) => [stream.name, stream])),
    jobs: offeredJobs(jobs.data.items),
    description,
    spec: { stream: view.query.get("stream") ?? undefined, window: {} },
    model: null,
    job: view.query.get("job"),
  };
  const monitor = view.query.get("monitor");
  if (monitor) {
    const { data } = await get(`/v1/monitors/${encodeURIComponent(monitor)}`, signal);
    start.spec = likeMonitor(data.spec);
    start.model = await modelOf(start.spec.job, signal);
  }
  return start;
}

async function modelOf(job, signal) {
  const name = job?.model;
  if (typeof name !== "string") {
    return name ?? null;
  }
  /** @type {{ data: any }} */
  const { data } = await get(`/v1/models/${encodeURIComponent(name)}`, signal);
  return data;
}

class NewMonitor {
  constructor(view, { streams, jobs, description, spec, model, job }, outcome) {
    this.view = view;
    this.streams = streams;
    this.jobs = jobs;
    this.description = description;
    this.spec = spec;
    this.model = model;
    this.job = job;
    this.outcome = outcome;
    this.keyOf = repeatKey();
    this.parts = [choicePart, signalsPart, windowsPart, driftPart, alarmsPart].map((part) => part(this));
    this.text = null;
    this.form = h(
      "div",
      { class: "steps" },
      this.parts.map(({ element }) => element),
    );
    this.lack = h("p", { role: "status", class: "quiet" });
    this.button = h(
      "button",
      { type: "button", class: "primary", onclick: () => this.submit() },
      "Start to watch",
    );
    if (job) {
      this.chooseJob(job);
    }
  }

  elements() {
    return [
      this.form,
      this.textPart(),
      this.outcome.place,
      this.lack,
      h("div", { class: "actions" }, this.button),
    ];
  }

  // The editor is made when the reader first asks for the text.
  textPart() {
    const element = h("details", {}, h("summary", {}, "The specification as text"));
    const open = () => {
      this.text = new Editor({
        label: "Specification of the monitor as JSON",
        value: this.asText(),
        signal: this.view.signal,
        changed: () => this.takeText(),
        language: MODEL_WORDS,
        words: () => null,
      });
      element.append(this.text.element);
    };
    element.addEventListener("toggle", open, { once: true });
    return element;
  }

  asText() {
    return JSON.stringify(this.spec, null, 2);
  }

  get stream() {
    return this.streams.get(this.spec.stream) ?? null;
  }

  // Fields of plain values show what was typed by themselves; other choices draw the form anew.
  at(path, value, redraws = false) {
    this.spec = changed(this.spec, path, value);
    redraws ? this.redraw() : this.tell();
  }

  // A field that is being typed in reports its text before the form is drawn anew.
  redraw() {
    const typed = document.activeElement;
    if (typed instanceof HTMLInputElement && this.form.contains(typed)) {
      typed.dispatchEvent(new Event("change"));
    }
    keepingFocus(this.form, () => {
      for (const part of this.parts) {
        part.draw();
      }
    });
    this.tell();
  }

  tell(isTyped = false) {
    if (!isTyped && this.text) {
      this.text.value = this.asText();
      this.text.mark([]);
    }
    const missing = missingParts(this.spec);
    this.lack.textContent = missing.length ? `Still needed: ${missing.join(", ")}.` : "";
    this.button.disabled = missing.length > 0;
  }

  chooseStream(name) {
    this.spec = changed(this.spec, ["stream"], name || undefined);
    if (this.spec.job) {
      const { signals } = this.spec.job.experiments?.[0] ?? {};
      const path = ["job", "experiments", 0, "signals"];
      this.spec = changed(this.spec, path, signalsIn(this.stream, signals, this.model));
    }
    this.redraw();
  }

  async chooseJob(id) {
    this.job = id;
    try {
      /** @type {{ data: any }} */
      const { data } = await get(`/v1/jobs/${encodeURIComponent(id)}`, this.view.signal);
      if (!this.jobs.some((job) => job.id === id)) {
        this.jobs = [data, ...this.jobs];
      }
      this.model = await modelOf(data.spec, this.view.signal);
      this.spec = { ...this.spec, job: templateOf(specOf(data), this.stream, this.model) };
      this.outcome.clear();
      this.redraw();
    } catch (error) {
      this.outcome.fail(error);
    }
  }

  takeText() {
    try {
      const spec = readJson(this.text.value);
      if (spec === null || typeof spec !== "object" || Array.isArray(spec)) {
        throw new SyntaxError("a monitor is an object");
      }
      this.spec = spec;
      this.text.mark([]);
      this.outcome.clear();
      for (const part of this.parts) {
        part.draw();
      }
      this.tell(true);
    } catch (error) {
      this.outcome.fail({ title: "Not JSON", message: error.message });
    }
  }

  async submit() {
    this.button.disabled = true;
    try {
      const { data } = await send("POST", "/v1/monitors", this.spec, {
        signal: this.view.signal,
        headers: { "idempotency-key": this.keyOf(JSON.stringify(this.spec)) },
      });
      location.hash = `/plant/monitors/${data.id}`;
    } catch (error) {
      this.outcome.fail(error);
      await this.markFaults(error.errors ?? []);
    }
    this.button.disabled = false;
  }

  // The faults that the server finds are marked at their places in the text, where it is shown.
  async markFaults(faults) {
    if (this.text) {
      const library = await editorLibrary();
      this.text.mark(placed(readText(library, this.text.value), this.text.value, faults));
    }
  }
}
