// @ts-check
// These pages show the models: a gallery, and a single model with its equations, signals and
// parameters.

import { get, items } from "../shell/api.js";
import { h, notice } from "../shell/dom.js";
import { described } from "./description.js";
import { responsePicture } from "./picture.js";
import { trialPart } from "./trial.js";

export function showModels(view) {
  const outcome = notice();
  const cards = h("div", { class: "cards" });
  view.root.append(
    h("h1", { tabindex: "-1" }, "Models"),
    h(
      "p",
      { class: "quiet" },
      "Models of the program, and those that were written as equations here. ",
      h("a", { href: "/docs/equations" }, "How to write one"),
      ".",
    ),
    h(
      "div",
      { class: "actions" },
      h("a", { class: "button primary", href: "#/equations" }, "Write your own equations"),
    ),
    outcome.place,
    cards,
  );
  get("/v1/models", view.signal)
    .then(({ data }) => {
      cards.append(
        ...items(data).map((model) =>
          h(
            "a",
            { class: "card button", href: `#/models/${encodeURIComponent(model.name)}` },
            responsePicture(model),
            h("strong", {}, model.title || model.name),
            h("span", {}, model.summary),
          ),
        ),
      );
    })
    .catch((error) => outcome.fail(error));
}

export function showModel(view, name) {
  const heading = h("h1", { tabindex: "-1" }, name);
  const outcome = notice();
  const content = h("div", {});
  view.root.append(heading, outcome.place, content);
  get(`/v1/models/${encodeURIComponent(name)}`, view.signal)
    .then(({ data }) => {
      heading.textContent = data.title || data.name;
      document.title = `${heading.textContent} · greybox`;
      const parts = described(data);
      parts.forEach((part) => {
        if (part.tagName === "DETAILS") {
          part.open = true;
        }
      });
      content.append(
        h("p", {}, data.summary),
        h(
          "div",
          { class: "actions" },
          h(
            "a",
            { class: "button primary", href: `#/new?model=${encodeURIComponent(data.name)}` },
            "New job with this model",
          ),
          data.document &&
            h(
              "a",
              { class: "button", href: `#/equations?from=${encodeURIComponent(data.name)}` },
              "Change its equations",
            ),
        ),
        h("div", { class: "workbench" }, h("div", {}, ...parts), response(view, data)),
        ...(data.document
          ? [
              h(
                "details",
                {},
                h("summary", {}, "The document"),
                h("pre", { tabindex: "0" }, JSON.stringify(data.document, null, 2)),
              ),
            ]
          : []),
      );
    })
    .catch((error) => outcome.fail(error));
}

// The response shows the model under a step or a recording, with a slider for each of its parameters.
function response(view, model) {
  let asking = new AbortController();
  view.signal.addEventListener("abort", () => asking.abort(), { once: true });
  const trial = trialPart(view, () => {
    asking.abort();
    asking = new AbortController();
    trial.run(model.name, asking.signal, model).catch((error) => trial.fail(error));
  });
  trial.run(model.name, asking.signal, model).catch((error) => trial.fail(error));
  return trial.element;
}
