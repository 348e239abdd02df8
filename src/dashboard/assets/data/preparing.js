// @ts-check
// The form prepares a recording: its steps make another recording, whose page then opens.

import { get, send } from "../shell/api.js";
import { h, notice, smallButton } from "../shell/dom.js";
import { failBeside, placeFaults, pointed } from "../shell/faults.js";
import { words } from "../shell/format.js";
import { Preview } from "./preview.js";
import {
  draftsOf,
  equationNames,
  faultsOfDrafts,
  KINDS,
  recipeOf,
  signalsAt,
  signalToShow,
  stepOf,
} from "./recipe.js";

export class Preparing {
  /**
   * @param {any} view
   * @param {any} dataset
   */
  constructor(view, dataset) {
    this.view = view;
    this.dataset = dataset;
    this.recorded = dataset.signals.map(({ name }) => name);
    /** @type {import("./recipe.js").StepDraft[]} */
    this.drafts = [];
    this.outcome = notice();
    this.steps = h("ol", { class: "recipe", onchange: () => this.preview.clear() });
    this.name = h("input", {
      type: "text",
      size: "32",
      maxlength: "200",
      value: `${dataset.name ?? dataset.id}, prepared`,
    });
    this.kind = h(
      "select",
      {},
      Object.entries(KINDS).map(([step, { title }]) => h("option", { value: step }, title)),
    );
    this.make = h("button", { type: "submit", class: "primary" }, "Make the recording");
    this.look = h("button", { type: "button", onclick: () => this.show() }, "Preview");
    this.preview = new Preview(view, dataset, (signal) => this.show(signal));
    this.button = h(
      "button",
      { type: "button", class: "for-writers", onclick: () => this.open() },
      "Prepare…",
    );
    this.element = h(
      "form",
      {
        class: "panel mark-form",
        "aria-label": "Prepare",
        hidden: true,
        onsubmit: (event) => this.submit(event),
        onkeydown: (event) => event.key === "Escape" && this.close(),
      },
      this.fields(),
    );
    const like = view.query.get("recipe");
    like && this.outcome.attempt(() => this.openLike(like));
  }

  fields() {
    return [
      h("h2", {}, "Prepare a recording of this one"),
      h(
        "p",
        { class: "quiet" },
        "The steps make another recording; this one stays as it is. Samples that are marked as bad are missing before the first step.",
      ),
      pointed(h("label", {}, "Name", this.name), ["name"]),
      this.steps,
      h(
        "div",
        { class: "actions" },
        h("label", { class: "inline" }, "Next step", this.kind),
        h("button", { type: "button", onclick: () => this.add() }, "Add"),
      ),
      this.outcome.place,
      h(
        "div",
        { class: "actions" },
        this.make,
        this.look,
        h("button", { type: "button", onclick: () => this.close() }, "Cancel"),
      ),
      this.preview.element,
    ];
  }

  open() {
    this.element.hidden = false;
    this.element.scrollIntoView({ block: "nearest" });
    (this.steps.querySelector("input, select") ?? this.kind).focus({ preventScroll: true });
  }

  // Opens the form with the steps of a recording that was prepared from this one.
  async openLike(id) {
    const { data } = await get(`/v1/datasets/${id}`, this.view.signal);
    this.drafts = draftsOf(recipeOf(data)?.steps ?? [], this.recorded);
    this.name.value = data.name ?? "";
    this.draw();
    this.open();
  }

  close() {
    this.element.hidden = true;
    this.button.focus({ preventScroll: true });
  }

  add() {
    this.drafts.push({ step: this.kind.value, texts: {}, signals: [] });
    this.draw();
    const last = /** @type {HTMLElement} */ (this.steps.lastElementChild);
    /** @type {HTMLElement | null} */ (last.querySelector("input, select"))?.focus();
  }

  draw() {
    this.preview.clear();
    placeFaults(this.element, []);
    this.steps.replaceChildren(...this.drafts.map((draft, k) => this.step(draft, k)));
  }

  step(draft, k) {
    const kind = KINDS[draft.step];
    const signals = signalsAt(this.recorded, this.drafts.slice(0, k));
    const path = ["steps", k];
    return h(
      "li",
      { "aria-label": `Step ${k + 1}: ${kind.title}` },
      h("strong", {}, kind.title),
      " ",
      k > 0 && smallButton("Earlier", `Do step ${k + 1} earlier`, () => this.swap(k)),
      smallButton("×", `Leave step ${k + 1} out`, () => this.drop(k)),
      h(
        "div",
        { class: "span-row" },
        kind.fields.map((field) => this.field(draft, field, [...path, field.member])),
      ),
      draft.step === "calculate" && h("p", { class: "quiet" }, namesText(signals)),
      kind.signals && this.choice(draft, kind, signals, [...path, kind.signals]),
    );
  }

  /**
   * @param {import("./recipe.js").StepDraft} draft
   * @param {import("./recipe.js").StepField} shown
   * @param {(string | number)[]} path
   */
  field(draft, { member, title, choices, kind, wide }, path) {
    const keep = (event) => {
      draft.texts[member] = event.target.value;
      // A name changes which signals the later steps can choose.
      member === "signal" && this.redrawAfter(draft);
    };
    if (choices) {
      draft.texts[member] ||= choices[0][0];
    }
    const input = choices
      ? h(
          "select",
          { onchange: keep },
          choices.map(([value, text]) =>
            h("option", { value, selected: value === draft.texts[member] }, text),
          ),
        )
      : h("input", {
          type: "text",
          class: wide ? "wide" : null,
          inputmode: kind === "number" ? "decimal" : null,
          value: draft.texts[member] ?? "",
          autocomplete: "off",
          spellcheck: "false",
          onchange: keep,
        });
    return pointed(h("label", { class: "inline" }, title, input), path);
  }

  choice(draft, kind, signals, path) {
    const box = (name) =>
      h(
        "label",
        { class: "inline" },
        h("input", {
          type: "checkbox",
          checked: draft.signals.includes(name),
          onchange: (event) => {
            const kept = draft.signals.filter((signal) => signal !== name);
            draft.signals = event.target.checked ? [...kept, name] : kept;
            draft.step === "remove" && this.redrawAfter(draft);
          },
        }),
        words(name),
      );
    return pointed(
      h("fieldset", {}, h("legend", {}, kind.signalsTitle), h("div", { class: "choices" }, signals.map(box))),
      path,
    );
  }

  redrawAfter(draft) {
    const from = this.drafts.indexOf(draft) + 1;
    this.drafts.slice(from).forEach((later, k) => {
      this.steps.children[from + k].replaceWith(this.step(later, from + k));
    });
  }

  swap(k) {
    [this.drafts[k - 1], this.drafts[k]] = [this.drafts[k], this.drafts[k - 1]];
    this.draw();
  }

  drop(k) {
    this.drafts.splice(k, 1);
    this.draw();
    this.kind.focus();
  }

  // The steps that the form stands for, without which nothing is asked.
  recipe() {
    const errors = faultsOfDrafts(this.drafts);
    if (errors.length) {
      throw { title: "Nothing is made yet", errors };
    }
    return this.drafts.map((draft, k) => stepOf(draft, signalsAt(this.recorded, this.drafts.slice(0, k))));
  }

  async attempt(act) {
    this.make.disabled = true;
    this.look.disabled = true;
    placeFaults(this.element, []);
    this.outcome.clear();
    try {
      await act();
    } catch (error) {
      failBeside(this.element, this.outcome, error);
      this.element.scrollIntoView({ block: "nearest" });
    }
    this.make.disabled = false;
    this.look.disabled = false;
  }

  submit(event) {
    event.preventDefault();
    return this.attempt(async () => {
      const body = { name: this.name.value.trim() || null, steps: this.recipe() };
      const { data } = await send("POST", `/v1/datasets/${this.dataset.id}/prepared`, body, {
        signal: this.view.signal,
      });
      location.hash = `/datasets/${data.id}`;
    });
  }

  show(signal = signalToShow(this.recorded, this.drafts)) {
    return this.attempt(() => this.preview.show(this.recipe(), signal));
  }
}

// Says which names an equation may use.
function namesText(signals) {
  const names = [...equationNames(signals)].map(([name, signal]) =>
    name === signal ? name : `${name} for ${signal}`,
  );
  return `Names: ${names.join(", ")}.`;
}

/**
 * Says what a prepared recording was made of, as pairs of a list of facts; none for other recordings.
 *
 * @param {any} dataset
 */
export function origin(dataset) {
  const recipe = recipeOf(dataset);
  if (!recipe) {
    return [];
  }
  const address = `#/datasets/${recipe.dataset}`;
  return [
    [
      "Prepared from",
      h(
        "span",
        {},
        h("a", { href: address }, "another recording"),
        recipe.version > 0 ? `, version ${recipe.version} of its marks` : "",
        ", ",
        h("a", { class: "for-writers", href: `${address}?recipe=${dataset.id}` }, "do other steps"),
      ),
    ],
  ];
}
