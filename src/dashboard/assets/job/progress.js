// @ts-check
// The panel shows the progress of a job: a bar, the counts, and the two curves of the search.

import { plot } from "../plot/plot.js";
import { facts, h, warningList } from "../shell/dom.js";
import { count, number, words } from "../shell/format.js";
import { isFinished } from "./feed.js";
import { TimeLeft } from "./time_left.js";

export function progressPanel(view) {
  const bar = h("progress", { max: "1", value: "0", "aria-label": "Progress of the job" });
  const numbers = h("div", {});
  const findingsPlace = h("div", {});
  const refinement = h("p", { class: "quiet" });
  const posterior = h("p", { class: "quiet" });
  const cost = plot({
    title: "Cost in the search, by generation",
    signal: view.signal,
    x: { label: "generation", unit: "", whole: true },
    y: { label: "cost", unit: "", log: true },
    series: [
      { name: "best", look: "first" },
      { name: "mean", look: "faint" },
    ],
  });
  const credit = plot({
    title: "Best credit per generation",
    signal: view.signal,
    x: { label: "generation", unit: "", whole: true },
    y: { label: "credit", unit: "" },
    series: [{ name: "best credit", look: "second" }],
  });
  const element = h(
    "section",
    { "aria-label": "Progress", "data-part": "The search" },
    h("h2", {}, "The search"),
    bar,
    numbers,
    findingsPlace,
    h("div", { class: "pair" }, cost.element, credit.element),
    refinement,
    posterior,
  );
  const state = { job: null, last: null };
  const tell = () => state.job && numbers.replaceChildren(counts(state.job, state.last, timeLeft));
  const timeLeft = new TimeLeft(view, () => tell());
  return {
    element,
    job(job) {
      state.job = job;
      timeLeft.follow(job);
      bar.value = job.status === "succeeded" ? 1 : (job.progress?.fraction ?? 0);
      bar.hidden = isFinished(job);
      tell();
    },
    history(rows, { refinements, look, findings }) {
      state.last = rows.at(-1) ?? null;
      tell();
      const column = (name) => rows.map((row) => row[name] ?? null);
      const generations = column("generation");
      cost.set(generations, [column("best_cost"), column("mean_cost")]);
      const credits = column("best_credit");
      // Only one of the methods has credits.
      credit.element.hidden = rows.length > 0 && credits.every((value) => value === null);
      credit.set(generations, [credits]);
      refinement.textContent = refinementText([...refinements.values()]);
      posterior.textContent = look ? posteriorText(look) : "";
      findingsPlace.replaceChildren(...(findings.size ? [warningList([...findings.values()])] : []));
    },
  };
}

// The search's own numbers are those of its last generation; what followed the search has a cost of its
// own, which counts all samples.
function counts(job, last, timeLeft) {
  const { phase, generation, generations, evaluations } = job.progress ?? {};
  // The plots show the generations that have been read, and the numbers beside them are of the last of these.
  const at = last?.generation ?? generation ?? 0;
  const judged = last ? Math.max(last.evaluations, evaluations ?? 0) : evaluations;
  const limit = generations ? ` of at most ${count(generations)}` : "";
  return facts([
    ["Phase", isFinished(job) ? null : words(phase ?? "waiting")],
    ["Generation", job.progress || last ? `${count(at)}${limit}` : null],
    ["Evaluations", judged === undefined ? null : count(judged)],
    ["Best cost in the search", last && number(last.best_cost)],
    ["Best credit", Number.isFinite(last?.best_credit) ? number(last.best_credit, 3) : null],
    ["Time left", timeLeft.text(job)],
  ]);
}

function refinementText(rows) {
  if (rows.length === 0) {
    return "";
  }
  const last = rows.reduce((a, b) => (b.iteration > a.iteration ? b : a));
  return `Refinement: ${rows.length} iterations, cost ${number(last.cost, 6)}.`;
}

function posteriorText({ generation, generations, r_hat, ess_bulk, ess_tail }) {
  const least = Math.min(ess_bulk ?? 0, ess_tail ?? 0);
  return `Draws from the posterior: generation ${count(generation)} of at most ${count(generations)}, R̂ ${number(r_hat, 4)} (below 1.01 is asked for), at least ${number(least, 3)} effective draws (more than 400 are).`;
}
