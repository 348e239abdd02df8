// @ts-check
// A running job says how long it may go on, by how long jobs like it took.

import { get } from "../shell/api.js";
import { count, duration } from "../shell/format.js";

// The times of other jobs are asked for so often at the most.
const EVERY_MS = 10_000;

/** @typedef {{ jobs: number, longer: number, half_s?: number | null, nine_in_ten_s?: number | null }} Left */

/**
 * Says how long a job may go on: by jobs like it where these are enough, and by the limits of the job.
 *
 * @param {Left | null} left
 * @param {number | null | undefined} limit the time after which the limits of the job end it, in s
 */
export function timeLeftText(left, limit) {
  const most = Number.isFinite(limit) ? `at most ${duration(limit)}` : "";
  if (left?.half_s === null || left?.half_s === undefined) {
    return most && `${most}; most searches end earlier`;
  }
  const likely = `of ${count(left.longer)} jobs of this model that took longer than this has, half ended within ${duration(left.half_s)}, nine in ten within ${duration(left.nine_in_ten_s)}`;
  return [likely, most].filter(Boolean).join("; ");
}

export class TimeLeft {
  /**
   * `changed()` is called when the answer of the server has come.
   *
   * @param {any} view
   * @param {() => void} changed
   */
  constructor(view, changed) {
    this.view = view;
    this.changed = changed;
    /** @type {Left | null} */
    this.left = null;
    this.asked = Number.NEGATIVE_INFINITY;
  }

  /** @param {any} job */
  follow(job) {
    const now = performance.now();
    if (job.status !== "running" || now - this.asked < EVERY_MS) {
      return;
    }
    this.asked = now;
    get(`/v1/jobs/${job.id}/time-left`, this.view.signal).then(
      ({ data }) => {
        this.left = data;
        this.changed();
      },
      // A job that ended meanwhile has no time left, and the limit of the job stands without the answer.
      () => {},
    );
  }

  /** @param {any} job */
  text(job) {
    return job.status === "running" ? timeLeftText(this.left, job.progress?.eta_s) || null : null;
  }
}
