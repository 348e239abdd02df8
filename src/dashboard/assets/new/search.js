// @ts-check
// This part of the form says how the parameters are looked for, what is held back, what holds between
// them, and what the job is called.

import { get } from "../shell/api.js";
import { h } from "../shell/dom.js";
import { seedOf } from "../shell/json.js";
import { conditionsOf, conditionText, labelsOf, labelText, priorOfResult } from "./draft.js";
import { membersOf, titledField } from "./fields.js";

const METHODS = {
  icra_genetic: "ICRA credits and a genetic search",
  cma_es: "CMA-ES",
  multistart_lm: "least squares from many starts",
};
const INTERVALS = {
  fisher: "as usual",
  profile: "likelihood profile",
  posterior: "draws from the posterior",
};
const HELD_BACK = ["validation", "fraction"];

// Gives the share of each recording that is held back, as the server will take it.
export function heldBack(job) {
  const { at, usual } = membersOf(job);
  return at(HELD_BACK) ?? usual(HELD_BACK);
}

export function searchPart(job) {
  const place = h("div", {});
  const element = h("section", {}, h("h2", {}, "5. Search and name"), place);
  let isOpen = false;

  const draw = () => {
    const { spec } = job;
    const { named, number: whole, put } = membersOf(job);
    const text = (title, path, value, read, options) =>
      titledField(title, value, (written) => job.at(path, read(written ?? "")), { text: true, ...options });
    const share = (percent) => put(HELD_BACK)(percent === undefined ? undefined : percent / 100);
    place.replaceChildren(
      h(
        "div",
        { class: "fields" },
        text("Name of the job", ["name"], spec.name, (name) => name || undefined, {
          size: "24",
          hint: "rig 4, commissioning",
        }),
        text("Labels", ["labels"], labelText(spec.labels), labelsOf, {
          size: "20",
          hint: "site=hall 2, rig=4",
        }),
        titledField("Held back to check, %", Number((100 * heldBack(job)).toPrecision(6)), share, {
          size: "6",
          help: "The last part of each recording, which the estimation does not see. 0 holds nothing back.",
        }),
        text("Conditions", ["constraints"], conditionText(spec.constraints), conditionsOf, {
          size: "28",
          hint: "tau1 < tau2; k1 + k2 <= 1",
        }),
        knownFromJob(job),
      ),
      h(
        "details",
        {
          open: isOpen,
          ontoggle: ({ target }) => {
            isOpen = target.open;
          },
        },
        h("summary", {}, "Settings of the search"),
        h(
          "div",
          { class: "fields" },
          named("Method", ["method", "name"], "MethodName", METHODS),
          whole("Candidates", ["method", "population"]),
          whole("Generations at the most", ["method", "generations"]),
          whole("Searches", ["method", "restarts"], { size: "6" }),
          named("Intervals", ["uncertainty", "intervals"], "Intervals", INTERVALS),
          whole("Fits of a Monte Carlo analysis", ["uncertainty", "monte_carlo_samples"]),
          whole("Next steps to try", ["uncertainty", "tried_steps"], {
            size: "6",
            help: "So many of the changes that the verdict offers are fitted before they are offered.",
          }),
          whole("Longest computing time, s", ["limits", "max_duration_s"]),
          whole("Seed", ["seed"], { size: "20", hint: "drawn", read: seedOf }),
        ),
      ),
    );
  };
  return { element, draw };
}

// The estimate of an earlier job, with its correlations, becomes a prior of this job.
function knownFromJob(job) {
  const priors = job.spec.priors ?? [];
  if (priors.length > 0) {
    const names = priors
      .flatMap(({ parameters }) => parameters)
      .map((name) => name.replaceAll("_", " "))
      .join(", ");
    return h(
      "p",
      {},
      `Known beforehand: ${names} `,
      h("button", { type: "button", onclick: () => job.at(["priors"], undefined) }, "Forget"),
    );
  }
  const take = async (id) => {
    if (id === undefined) {
      return;
    }
    try {
      /** @type {{ data: any }} */
      const { data } = await get(`/v1/jobs/${encodeURIComponent(id)}/result`, job.view.signal);
      const names = new Set((job.model?.parameters ?? []).map(({ name }) => name));
      const prior = priorOfResult({
        ...data,
        parameters: (data.parameters ?? []).filter(({ name }) => names.has(name)),
      });
      job.outcome.clear();
      job.at(["priors"], prior && [prior]);
    } catch (error) {
      job.outcome.fail(error);
    }
  };
  return titledField("Known from a job", "", take, { text: true, size: "28", hint: "job_…" });
}
