// @ts-check
// The page asks for the windows of a stream that fix the parameters of a finished job best: how closely each
// parameter is to be known, or how many samples there may be. A selection can be asked for again.

import { listed } from "../job/verdict.js";
import { errorText, windowsText } from "../job/windows.js";
import { toleranceOf } from "../model/parameters.js";
import { changed } from "../new/draft.js";
import { titledField } from "../new/fields.js";
import { get, items, repeatKey, send } from "../shell/api.js";
import { defaultAt, described } from "../shell/description.js";
import { h, keepingFocus, notice } from "../shell/dom.js";
import { failBeside, placeFaults, pointed } from "../shell/faults.js";
import { count, duration, number, quantity, unitSigns, words } from "../shell/format.js";
import { choice, instantField, jobText, numberField, part } from "./fields.js";
import { plantHead } from "./head.js";
import { missingOfSelection, offeredJobs, sharedEstimates, usualLength, windowsIn } from "./plan.js";
import { excludedTimes, startsPart } from "./starts.js";

const JOBS_OFFERED = 200;

export function showFindWindows(view) {
  const outcome = notice();
  const place = h("div", {}, h("p", { class: "quiet" }, "Loading …"));
  plantHead(view, "/plant/streams", "Find windows");
  view.root.append(place);
  load(view)
    .then((start) => {
      const page = new FindWindows(view, start, outcome);
      place.replaceChildren(...page.elements());
      page.redraw();
    })
    .catch((error) => {
      place.replaceChildren(outcome.place);
      outcome.fail(error);
    });
}

async function load({ signal, query }) {
  const selection = query.get("selection");
  /** @type {any[]} */
  const [streams, jobs, description, before] = await Promise.all([
    get("/v1/streams?limit=500", signal),
    get(`/v1/jobs?view=summary&limit=${JOBS_OFFERED}`, signal),
    described(),
    selection ? get(`/v1/jobs/${encodeURIComponent(selection)}`, signal) : null,
  ]);
  const offered = new Map(items(streams.data).map((stream) => [stream.name, stream]));
  const spec = before?.data.spec.selection ?? {};
  return {
    streams: offered,
    jobs: offeredJobs(jobs.data.items).filter((job) => job.finished_at),
    description,
    // The stream of a selection may have been deleted since.
    spec: offered.has(spec.stream) ? spec : changed(spec, ["stream"], undefined),
    stream: query.get("stream"),
    job: query.get("job"),
  };
}

class FindWindows {
  constructor(view, { streams, jobs, description, spec, stream, job }, outcome) {
    this.view = view;
    this.streams = streams;
    this.jobs = jobs;
    this.description = description;
    this.outcome = outcome;
    this.keyOf = repeatKey();
    /** @type {any} */
    this.spec = spec;
    // The chosen job and its model.
    this.job = null;
    this.model = null;
    // The parameters of the chosen job that can be asked for.
    this.estimates = [];
    // The length of windows that the page suggested for the stream.
    this.suggested = undefined;
    this.planned = h("p", { role: "status", class: "quiet" });
    this.wanted = h("p", { class: "quiet" });
    this.parts = [choicePart, timePart, startsPart, targetPart, limitPart].map((make) => make(this));
    this.form = h(
      "div",
      { class: "steps" },
      this.parts.map(({ element }) => element),
    );
    this.lack = h("p", { role: "status", class: "quiet" });
    this.button = h(
      "button",
      { type: "button", class: "primary", onclick: () => this.submit() },
      "Find the windows",
    );
    if (stream) {
      this.takeStream(stream);
    }
    if (job) {
      this.chooseJob(job);
    } else if (spec.job) {
      this.readJob(spec.job);
    }
  }

  elements() {
    return [this.form, this.outcome.place, this.lack, h("div", { class: "actions" }, this.button)];
  }

  get stream() {
    return this.streams.get(this.spec.stream) ?? null;
  }

  at(path, value) {
    this.spec = changed(this.spec, path, value);
    this.tell();
  }

  redraw() {
    keepingFocus(this.form, () => {
      for (const { draw } of this.parts) {
        draw();
      }
    });
    this.tell();
  }

  tell() {
    const missing = missingOfSelection(this.spec);
    this.lack.textContent = missing.length ? `Still needed: ${missing.join("; ")}.` : "";
    this.button.disabled = missing.length > 0;
    const plan = windowsIn(this.stream, this.spec);
    this.planned.textContent = plan
      ? `${windowsText(plan.windows)} of ${duration(this.spec.window_s)}, each with about ${roundText(plan.samples)} samples.`
      : "";
    const { wanted, target } = this.spec;
    this.wanted.textContent =
      wanted && !target ? `What matters, as before: ${listed(wanted.map(words))}.` : "";
  }

  // A length that the reader has typed stays when another stream is chosen.
  takeStream(name) {
    this.spec = changed(this.spec, ["stream"], name || undefined);
    if (this.stream?.first && this.spec.window_s === this.suggested) {
      this.suggested = usualLength(this.stream);
      this.spec = changed(this.spec, ["window_s"], this.suggested);
    }
  }

  chooseStream(name) {
    this.takeStream(name);
    this.redraw();
  }

  // What is said of the parameters and states of a job does not suit another job.
  chooseJob(id) {
    const { target, wanted, initial_state: starts, ...rest } = this.spec;
    this.spec = changed(rest, ["job"], id || undefined);
    return this.readJob(id);
  }

  async readJob(id) {
    this.job = null;
    this.model = null;
    this.estimates = [];
    try {
      this.outcome.clear();
      if (id) {
        const { signal } = this.view;
        const address = `/v1/jobs/${encodeURIComponent(id)}`;
        /** @type {{ data: any }[]} */
        const [{ data: job }, { data: result }] = await Promise.all([
          get(address, signal),
          get(`${address}/result`, signal),
        ]);
        if (!this.jobs.some((offered) => offered.id === id)) {
          this.jobs = [job, ...this.jobs];
        }
        const { data: model } = await get(`/v1/models/${encodeURIComponent(job.model)}`, signal);
        // The reader may have chosen another job meanwhile.
        if (this.spec.job !== id) {
          return;
        }
        this.job = job.spec;
        this.model = model;
        this.estimates = sharedEstimates(job.spec, result);
      }
    } catch (error) {
      this.outcome.fail(error);
    }
    this.redraw();
  }

  async submit() {
    this.button.disabled = true;
    placeFaults(this.form, []);
    try {
      this.outcome.clear();
      const { data } = await send("POST", "/v1/selections", this.spec, {
        signal: this.view.signal,
        headers: { "idempotency-key": this.keyOf(JSON.stringify(this.spec)) },
      });
      location.hash = `/jobs/${data.id}`;
    } catch (error) {
      failBeside(this.form, this.outcome, error);
    }
    this.button.disabled = false;
  }
}

const roundText = (value) => (value < 10 ? number(value, 2) : count(Math.round(value)));

function choicePart(page) {
  const hint =
    "A stream of months has many hours in which nothing moves. The windows that tell most about the parameters of a finished job are looked for.";
  return part("1. Stream and job", hint, () => {
    const none = /** @type {[string, string]} */ (["", "– choose –"]);
    const streams = [...page.streams.keys()].map((name) => [name, name]);
    const jobs = page.jobs.map((job) => [job.id, jobText(job)]);
    const { stream, job } = page.spec;
    return [
      h(
        "div",
        { class: "fields" },
        pointed(
          choice("Stream", [none, ...streams], stream, (name) => page.chooseStream(name)),
          ["stream"],
        ),
        pointed(
          choice("Finished job", [none, ...jobs], job, (id) => page.chooseJob(id)),
          ["job"],
        ),
      ),
      streams.length === 0 && h("p", {}, "There is no stream yet: the plant has to append samples first."),
      jobs.length === 0 &&
        h("p", {}, "No job has ended yet. ", h("a", { href: "#/new" }, "Make the first one"), "."),
    ];
  });
}

function timePart(page) {
  return part("2. Windows", null, () => [
    h(
      "div",
      { class: "fields" },
      instantField(page, "From (empty: the oldest sample)", ["from"]),
      instantField(page, "To (empty: the newest sample)", ["to"]),
      numberField(page, "Length of a window, s", ["window_s"], { hint: "3600" }),
    ),
    page.planned,
    excludedTimes(page),
  ]);
}

function targetPart(page) {
  const hint =
    "How closely each parameter is to be known: a share of its value, as 5 %, or a number in its unit. Parameters that are left empty do not matter; where all are left empty, all matter.";
  return part("4. Parameters", hint, () =>
    page.estimates.length
      ? [
          h(
            "div",
            { class: "fields targets" },
            page.estimates.map((estimate) => targetField(page, estimate)),
          ),
          page.wanted,
        ]
      : [
          h(
            "p",
            { class: "quiet" },
            page.spec.job
              ? "The job estimates nothing that all its experiments share."
              : "Choose a job first.",
          ),
        ],
  );
}

// The value that the job came to stands below the field. The parameters with a target are those that matter.
function targetField(page, parameter) {
  const { name, unit, estimate, standard_error: noise, total_standard_error: total } = parameter;
  const path = ["target", name];
  const title = unit === "1" ? words(name) : `${words(name)}, % or ${unitSigns(unit)}`;
  const label = titledField(
    `${title}: ± at the most`,
    page.spec.target?.[name],
    (text) => {
      page.at(["wanted"], undefined);
      page.at(path, toleranceOf(text));
    },
    { text: true, hint: "5 %", size: "12" },
  );
  const error = errorText(total ?? noise ?? null, { value: estimate, unit });
  label.append(h("span", { class: "quiet fine" }, `now ${quantity(number(estimate, 4), unit)}, ${error}`));
  return pointed(label, path);
}

function limitPart(page) {
  const most = defaultAt(page.description, "SelectionDocument", ["max_windows"]);
  return part(
    "5. Limits",
    "The fewest windows are chosen that reach what is asked for, within these limits.",
    () => [
      h(
        "div",
        { class: "fields" },
        numberField(page, "Samples at the most, all chosen windows together", ["budget_samples"], {
          hint: "no limit",
        }),
        numberField(page, "Windows at the most", ["max_windows"], { hint: most ? String(most) : "" }),
      ),
    ],
  );
}
