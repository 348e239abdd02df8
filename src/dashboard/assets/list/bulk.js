// @ts-check
// The buttons act on all selected jobs at once: each action is offered with the number of jobs that it can
// be done to.

import { send } from "../shell/api.js";
import { h, problemBox } from "../shell/dom.js";
import { count } from "../shell/format.js";
import { titleOf } from "./columns.js";

const AT_ONCE = 6;
// The most jobs that are named where an action failed for several with the same words.
const NAMED = 3;

const CANCEL = {
  title: "Cancel",
  done: "cancelled",
  can: (job) => !job.finished_at,
  act: (job) => send("POST", `/v1/jobs/${job.id}/cancel`),
  danger: false,
};
const DELETE = {
  title: "Delete",
  done: "deleted",
  can: (job) => Boolean(job.finished_at),
  act: (job) => send("DELETE", `/v1/jobs/${job.id}`),
  danger: true,
};
const LABEL = { title: "Label…", can: () => true };

// An empty value takes the label from the jobs.
const labelAction = (name, value) => ({
  title: "Label",
  done: value ? "labelled" : "without the label",
  act: (job) => send("PATCH", `/v1/jobs/${job.id}`, { labels: { [name]: value || null } }),
  danger: false,
});

// Lists what failed in words, with the jobs that it failed for.
/**
 * @param {{ job: any, error: any }[]} failures
 * @returns {{ detail: string }[]}
 */
export function failureList(failures) {
  const groups = new Map();
  for (const failure of failures) {
    const faults = (failure.error.errors ?? []).map(({ detail }) => detail).join("; ");
    const words = faults || failure.error.message;
    groups.set(words, [...(groups.get(words) ?? []), failure]);
  }
  return [...groups].map(([words, group]) => {
    const names = group.slice(0, NAMED).map(({ job }) => titleOf(job));
    const rest = group.length - names.length;
    return { detail: `${names.join(", ")}${rest ? ` and ${count(rest)} more` : ""}: ${words}` };
  });
}

export class BulkActions {
  // `selected()` gives the selected jobs, `labels()` the names of labels to offer, `outcome` takes what was done,
  // and `labelled(job)` is called with each job that has got other labels. The buttons stay the same elements while
  // jobs change, so that a click always meets its button.
  constructor({ selected, labels, outcome, labelled }) {
    this.selected = selected;
    this.labels = labels;
    this.outcome = outcome;
    this.labelled = labelled;
    const button = (action, onclick) => ({
      action,
      button: h(
        "button",
        { type: "button", hidden: true, class: action.danger ? "danger" : null, onclick },
        action.title,
      ),
    });
    this.buttons = [
      ...[CANCEL, DELETE].map((action) =>
        button(action, ({ target }) => this.run(action, this.able(action), target)),
      ),
      button(LABEL, () => this.openForm(this.form.hidden)),
    ];
    this.opener = this.buttons.at(-1).button;
    this.opener.setAttribute("aria-expanded", "false");
    this.element = h(
      "span",
      { class: "actions for-writers" },
      this.buttons.map((entry) => entry.button),
    );
    this.form = this.labelForm();
  }

  labelForm() {
    const offered = h("datalist", { id: "labels-of-jobs" });
    this.offered = offered;
    const name = h("input", {
      type: "text",
      required: true,
      size: "16",
      placeholder: "site",
      list: offered.id,
      autocomplete: "off",
    });
    const value = h("input", { type: "text", size: "20", placeholder: "hall 2" });
    const button = h("button", { type: "submit", class: "primary" }, "Set the label");
    const submit = async (event) => {
      event.preventDefault();
      const action = labelAction(name.value.trim(), value.value.trim());
      const isDone = await this.run(action, this.able(LABEL), button, ({ data }) => this.labelled(data));
      isDone && this.openForm(false);
    };
    const close = (event) => event.key === "Escape" && this.openForm(false);
    return h(
      "form",
      { class: "panel", hidden: true, "aria-label": "Label jobs", onsubmit: submit, onkeydown: close },
      h(
        "div",
        { class: "fields" },
        h("label", {}, "Label", name, offered),
        h("label", {}, "Value (empty: the label is removed)", value),
        button,
        h("button", { type: "button", onclick: () => this.openForm(false) }, "Close"),
      ),
    );
  }

  // The focus goes into the form, and back to the button that opened the form.
  openForm(isOpen) {
    this.form.hidden = !isOpen;
    this.opener.setAttribute("aria-expanded", String(isOpen));
    if (isOpen) {
      this.offered.replaceChildren(...this.labels().map((name) => h("option", { value: name })));
    }
    (isOpen ? this.form.querySelector("input") : this.opener).focus();
  }

  able({ can }) {
    return this.selected().filter(can);
  }

  draw() {
    for (const { action, button } of this.buttons) {
      const { length } = this.able(action);
      button.hidden = length === 0;
      button.textContent = `${action.title} ${count(length)}`;
    }
    if (this.opener.hidden && !this.form.hidden) {
      this.form.hidden = true;
      this.opener.setAttribute("aria-expanded", "false");
    }
  }

  // A few requests are under way at once; a fault of one leaves the others to go on. Answers whether the action was
  // done to all jobs; `answered` gets the answer for each job.
  async run({ title, done, act, danger }, jobs, button, answered = (_answer) => {}) {
    if (danger && !confirm(`${title} ${count(jobs.length)} jobs and their results?`)) {
      return false;
    }
    button.disabled = true;
    const waiting = [...jobs];
    const failures = [];
    const work = async () => {
      for (let job = waiting.shift(); job; job = waiting.shift()) {
        await act(job).then(answered, (error) => failures.push({ job, error }));
      }
    };
    await Promise.all(Array.from({ length: AT_ONCE }, work));
    this.tell(done, jobs.length, failures);
    button.disabled = false;
    this.draw();
    return failures.length === 0;
  }

  // Says how many jobs the action was done to, and what failed. A reader who is asked to sign in is told nothing else.
  tell(done, length, failures) {
    if (failures.some(({ error }) => error.name === "AbortError")) {
      return;
    }
    const rest = length - failures.length;
    const words = `${count(rest)} of ${count(length)} jobs ${rest === 1 ? "is" : "are"} ${done}.`;
    this.outcome.show(
      failures.length
        ? problemBox({ message: words, errors: failureList(failures) })
        : h("p", { role: "status" }, words),
    );
  }
}
