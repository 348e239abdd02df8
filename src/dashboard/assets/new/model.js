// @ts-check
// This part of the form chooses the model of a new job from a gallery, and shows its equations.

import { described } from "../model/description.js";
import { responsePicture } from "../model/picture.js";
import { h } from "../shell/dom.js";
import { count } from "../shell/format.js";
import { keep } from "../shell/prepared.js";

export function modelPart(job) {
  const search = h("input", {
    type: "search",
    placeholder: "servo, tank, heat …",
    oninput: () => draw(),
    "aria-label": "Search the models",
  });
  const cards = h("div", { class: "cards", role: "radiogroup", "aria-label": "Model" });
  const about = h("div", {});
  const all = h(
    "button",
    {
      type: "button",
      hidden: true,
      onclick: () => {
        opened = true;
        draw();
      },
    },
    "Choose another model",
  );
  const write = h(
    "button",
    {
      type: "button",
      onclick: () => {
        const [experiment] = job.spec.experiments ?? [];
        const dataset = experiment ? `&dataset=${experiment.dataset}` : "";
        location.hash = `/equations?prepared=${keep(job.spec)}${dataset}`;
      },
    },
    "Write your own equations",
  );
  const element = h(
    "section",
    { "aria-label": "Model" },
    h("h2", {}, "2. Model"),
    h("div", { class: "actions" }, search, write),
    cards,
    all,
    about,
  );
  let opened = false;
  let shown = null;

  const draw = () => {
    const { model } = job;
    const closed = model && !opened && !search.value;
    search.hidden = closed;
    all.hidden = !closed;
    const text = search.value.toLowerCase();
    const listed = [...job.models.values()].filter((candidate) =>
      closed
        ? candidate === model
        : `${candidate.name} ${candidate.title} ${candidate.summary}`.toLowerCase().includes(text),
    );
    cards.replaceChildren(
      ...listed.map((candidate) =>
        card(job, candidate, () => {
          opened = false;
          search.value = "";
        }),
      ),
    );
    if (shown !== model) {
      shown = model;
      about.replaceChildren(...(model ? described(model) : []));
    }
  };
  return { element, draw };
}

function card(job, model, chosen) {
  const current = job.spec.model === model.name;
  const unknown = model.parameters.filter((parameter) => parameter.unknown_by_default).length;
  return h(
    "button",
    {
      type: "button",
      role: "radio",
      "aria-checked": String(current),
      class: "card",
      onclick: () => {
        chosen();
        job.chooseModel(model.name);
      },
    },
    responsePicture(model),
    h("strong", {}, model.title || model.name),
    h("span", {}, model.summary),
    h(
      "span",
      { class: "quiet" },
      `${count(model.parameters.length)} parameters, ${count(unknown)} of them unknown as a rule`,
    ),
  );
}
