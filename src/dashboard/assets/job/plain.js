// @ts-check
// The panel of a job that is not an estimation shows a bar and the counts while the job is at work, and the
// result once the job is at rest.

import { get } from "../shell/api.js";
import { facts, h, notice } from "../shell/dom.js";
import { isAtRest, isFinished } from "./feed.js";
import { TimeLeft } from "./time_left.js";

/**
 * `counts(job, latest)` lists the facts about the work, `report(result, job)` gives the elements of the result, and
 * `interim(latest)` gives those of the best that has been found so far, where an event of the job has it.
 *
 * @param {{ signal: AbortSignal }} view
 * @param {{
 *   label: string,
 *   title: string,
 *   counts: (job: any, latest: any) => any[],
 *   report: (result: any, job: any) => any[],
 *   interim?: (latest: any) => any[],
 * }} options
 */
export function plainPanel(view, { label, title, counts, report, interim }) {
  const bar = h("progress", { max: "1", value: "0", "aria-label": `Progress: ${label}` });
  const numbers = h("div", {});
  const outcome = notice();
  const content = h("div", {});
  const element = h(
    "section",
    { "aria-label": label },
    h("h2", {}, title),
    bar,
    numbers,
    outcome.place,
    content,
  );
  const state = { job: null, latest: null, shown: null };
  const timeLeft = new TimeLeft(view, () => tell());
  const tell = () => {
    const { job, latest } = state;
    numbers.replaceChildren(facts([...counts(job, latest), ["Time left", timeLeft.text(job)]]));
  };
  return {
    element,
    async job(job) {
      state.job = job;
      timeLeft.follow(job);
      bar.value = job.progress?.fraction ?? 0;
      bar.hidden = isFinished(job);
      tell();
      if (isAtRest(job) && state.shown !== job.status) {
        state.shown = job.status;
        await get(`/v1/jobs/${job.id}/result`, view.signal).then(
          ({ data }) => content.replaceChildren(...report(data, job).filter(Boolean)),
          (error) => error.status === 409 || outcome.fail(error),
        );
      }
    },
    // Takes the latest event that says how far the job came.
    history(latest) {
      state.latest = latest;
      if (state.job) {
        tell();
      }
      if (latest && interim && state.shown === null) {
        content.replaceChildren(...interim(latest));
      }
    },
  };
}
