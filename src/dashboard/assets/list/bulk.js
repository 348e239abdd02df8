// @ts-check
// The buttons act on all selected jobs at once: each action is offered with the number of jobs that it can
// be done to.

import { send } from "../shell/api.js";
import { h } from "../shell/dom.js";
import { count } from "../shell/format.js";

const AT_ONCE = 6;

const ACTIONS = [
  {
    title: "Cancel",
    can: (job) => !job.finished_at,
    act: (job) => send("POST", `/v1/jobs/${job.id}/cancel`),
    danger: false,
  },
  {
    title: "Delete",
    can: (job) => Boolean(job.finished_at),
    act: (job) => send("DELETE", `/v1/jobs/${job.id}`),
    danger: true,
  },
];

export class BulkActions {
  // `selected()` gives the selected jobs, and `outcome` takes the faults. The buttons stay the same elements
  // while jobs change, so that a click always meets its button.
  constructor(selected, outcome) {
    this.selected = selected;
    this.outcome = outcome;
    this.buttons = ACTIONS.map((action) =>
      h(
        "button",
        {
          type: "button",
          hidden: true,
          class: action.danger ? "danger" : null,
          onclick: ({ target }) => this.run(action, this.able(action), target),
        },
        action.title,
      ),
    );
    this.element = h("span", { class: "actions" }, this.buttons);
  }

  able({ can }) {
    return this.selected().filter(can);
  }

  draw() {
    ACTIONS.forEach((action, k) => {
      const { length } = this.able(action);
      this.buttons[k].hidden = length === 0;
      this.buttons[k].textContent = `${action.title} ${count(length)}`;
    });
  }

  // A few requests are under way at once; a fault of one leaves the others to go on, and the first is shown.
  async run({ title, act, danger }, jobs, button) {
    if (danger && !confirm(`${title} ${count(jobs.length)} jobs and their results?`)) {
      return;
    }
    button.disabled = true;
    const waiting = [...jobs];
    const faults = [];
    const work = async () => {
      for (let job = waiting.shift(); job; job = waiting.shift()) {
        await act(job).catch((error) => faults.push(error));
      }
    };
    await Promise.all(Array.from({ length: AT_ONCE }, work));
    faults.length ? this.outcome.fail(faults[0]) : this.outcome.clear();
    button.disabled = false;
    this.draw();
  }
}
