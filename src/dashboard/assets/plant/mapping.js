// @ts-check
// The page of a mapping has its rules, and the series that came and that no rule names, which get a place by a
// button.

import { changed } from "../new/draft.js";
import { get, pause, send } from "../shell/api.js";
import { described } from "../shell/description.js";
import { facts, h, keepingFocus, notice, table } from "../shell/dom.js";
import { failBeside, placeFaults } from "../shell/faults.js";
import { count, instant, number } from "../shell/format.js";
import { mayWrite } from "../shell/session.js";
import { writeAddresses } from "./agents.js";
import { nameHeading, plantHead } from "./head.js";
import {
  faultsInForm,
  formOf,
  isNamed,
  isText,
  nameFaults,
  rulesOf,
  tagsText,
  textOf,
  withPlaces,
} from "./places.js";
import { ruleForms, ruleTable } from "./rules.js";

const POLL_MS = 5000;
// The rules of a mapping with more rules are closed at first.
const RULES_OPEN = 12;

const SERIES_COLUMNS = [
  { title: "Measurement" },
  { title: "Tags" },
  { title: "Field" },
  { title: "Samples", numeric: true },
  { title: "Last value" },
  { title: "Last instant" },
];

export function showMapping(view, name) {
  const page = new MappingPage(view, name);
  nameHeading(plantHead(view, "/plant/agents", name), name);
  view.root.append(page.reading.place, page.element);
  page.start().catch((error) => page.reading.fail(error));
}

class MappingPage {
  constructor(view, name) {
    this.view = view;
    this.name = name;
    this.address = `/v1/mappings/${encodeURIComponent(name)}`;
    // The notice of failures to read stands above the page, and the notice of saving below the rules.
    this.reading = notice();
    this.outcome = notice();
    this.lost = false;
    this.isEnding = false;
    // The flag says that the rules were changed elsewhere since the reader began to change rules.
    this.isOverwriting = false;
    this.writes = false;
    this.description = null;
    // The mapping is the answer of the server, and the rules are those of the form. The text is that of the rules
    // which the server has.
    this.mapping = null;
    this.rules = [];
    this.storedText = textOf([]);
    // The text is that of the series which the list shows; each row has what is offered for a series.
    this.seriesText = "";
    this.rows = [];
    this.facts = h("div", {});
    this.form = h("div", { oninput: () => this.hearTyping() });
    this.state = h("span", { role: "status", class: "quiet" });
    this.save = h(
      "button",
      { type: "button", class: "primary", onclick: () => this.store() },
      "Save the rules",
    );
    this.discard = h("button", { type: "button", onclick: () => this.takeStored() }, "Discard the changes");
    this.giveAll = h(
      "button",
      { type: "button", onclick: () => this.give(this.unplaced()) },
      "Give all of them a place",
    );
    this.list = h("div", { class: "within on-a-line" });
    this.rest = h("p", { class: "quiet" });
    this.element = h("div", { hidden: true });
  }

  async start() {
    const [description, writes] = await Promise.all([described(), mayWrite(this.view)]);
    this.description = description;
    this.writes = writes;
    const { data } = await get(this.address, this.view.signal);
    this.element.append(...this.parts());
    this.take(data);
    this.element.hidden = false;
    await this.follow();
  }

  parts() {
    const remove = h(
      "button",
      { type: "button", class: "danger", onclick: () => this.remove() },
      "Remove the mapping",
    );
    return [
      this.writes ? h("div", { class: "actions" }, remove) : "",
      this.facts,
      h("h2", {}, "Rules"),
      h(
        "p",
        { class: "quiet" },
        "A rule fits the lines of its measurement that have all of its tags; they may have others too. The first rule that fits and names a field decides. A unit that is left empty is SI, or what a sender of OMF declares. Fields of quality say how good the other fields are; a sender of OMF may mark them itself.",
      ),
      this.form,
      this.outcome.place,
      this.writes ? h("div", { class: "actions saving" }, this.save, this.discard, this.state) : "",
      h("h2", {}, "Series that no rule names"),
      h(
        "p",
        { class: "quiet" },
        "Samples of these series are not stored until a rule names them. Rules that are saved begin the list anew.",
      ),
      this.writes ? h("div", { class: "actions" }, this.giveAll) : "",
      this.list,
      this.rest,
    ].filter(Boolean);
  }

  // Samples come while the list is looked at. A failure is shown until the mapping can be read again.
  async follow() {
    for (;;) {
      await pause(POLL_MS, this.view.signal);
      try {
        const { data } = await get(this.address, this.view.signal);
        // An answer may come behind that of a later change.
        if (!this.isEnding && Date.parse(data.changed_at) >= Date.parse(this.mapping.changed_at)) {
          this.take(data);
        }
        this.lost && this.reading.clear();
        this.lost = false;
      } catch (error) {
        this.lost = !this.isEnding;
        this.isEnding || this.reading.fail(error);
      }
    }
  }

  get isChanged() {
    return textOf(this.rules) !== this.storedText;
  }

  // Takes the mapping as the server has it. Rules that the reader has changed stay in the form.
  take(mapping) {
    const isNew = mapping.changed_at !== this.mapping?.changed_at;
    this.mapping = mapping;
    if (isNew) {
      this.isOverwriting = this.isChanged;
      this.storedText = textOf(formOf(mapping.rules));
      this.drawFacts();
      this.isOverwriting || this.takeStored();
    }
    this.drawSeries();
    this.tell();
  }

  drawFacts() {
    const { created_at: made, changed_at: altered } = this.mapping;
    this.facts.replaceChildren(
      facts([...writeAddresses(this.name), ["Made", instant(made)], ["Changed", instant(altered)]]),
    );
  }

  takeStored() {
    const rules = formOf(this.mapping.rules);
    const isFew = rules.length <= RULES_OPEN;
    this.rules = rules.map((rule, k) => ({ ...rule, isOpen: this.rules[k]?.isOpen ?? isFew }));
    this.isOverwriting = false;
    this.redraw();
  }

  at(path, value, redraws = false) {
    this.rules = changed({ rules: this.rules }, path, value).rules;
    redraws ? this.redraw() : this.tell();
  }

  redraw() {
    this.outcome.clear();
    keepingFocus(this.form, () => {
      this.form.replaceChildren(...(this.writes ? ruleForms(this).flat() : [ruleTable(this.rules)]));
    });
    this.tell();
  }

  // Puts the focus on a control at a place of the rules.
  focus(pointer, control = "input") {
    this.form.querySelector(`[data-pointer="${pointer}"] ${control}`)?.focus();
  }

  // A reader who types may press a button next, before the field reports the text.
  hearTyping() {
    this.outcome.clear();
    this.allowSaving(true);
  }

  allowSaving(isAllowed) {
    this.save.disabled = !isAllowed;
    this.discard.disabled = !isAllowed;
  }

  // Parts that depend on the rules in the form change in place, and no button moves: the reader may be on the way to
  // a button.
  tell() {
    const { isChanged } = this;
    this.state.textContent = isChanged ? stateText(this.isOverwriting) : "";
    this.allowSaving(isChanged);
    for (const { series, offer, text } of this.rows) {
      const hasPlace = isNamed(this.rules, series);
      offer.hidden = hasPlace;
      text.hidden = !hasPlace;
    }
    this.giveAll.disabled = this.unplaced().length === 0;
  }

  async store() {
    this.save.disabled = true;
    placeFaults(this.form, []);
    try {
      this.outcome.clear();
      const errors = nameFaults(this.rules);
      if (errors.length) {
        throw { title: "The rules are not saved", errors };
      }
      const sent = textOf(this.rules);
      const { data } = await send(
        "PUT",
        this.address,
        { rules: rulesOf(this.rules) },
        { signal: this.view.signal },
      );
      this.storedText = sent;
      this.take(data);
      this.isOverwriting = false;
      this.outcome.show(h("p", { role: "status" }, "The rules are saved."));
    } catch (error) {
      this.fail(error);
    }
    this.tell();
  }

  // The rules in which something is wrong are opened, so that their faults are seen.
  fail(error) {
    const errors = faultsInForm(this.rules, error.errors ?? []);
    const wrong = new Set(errors.map(({ pointer }) => Number(pointer.split("/")[2])));
    this.rules = this.rules.map((rule, k) => (wrong.has(k) ? { ...rule, isOpen: true } : rule));
    this.redraw();
    failBeside(this.form, this.outcome, Object.assign(error, { errors }));
  }

  remove() {
    return this.outcome.attempt(async () => {
      const question = `Remove the mapping ${this.name}? Agents that name it are answered 404 from then on. Streams and their samples stay.`;
      if (confirm(question)) {
        this.isEnding = true;
        await send("DELETE", this.address).catch((error) => {
          this.isEnding = false;
          throw error;
        });
        location.hash = "/plant/agents";
      }
    });
  }

  unplaced() {
    return (this.mapping?.unmapped ?? []).filter((series) => !isText(series) && !isNamed(this.rules, series));
  }

  // Makes or extends the rules for some series, and leads to the first of the rules.
  give(list) {
    const before = new Set(this.rules);
    this.rules = withPlaces(this.rules, list);
    const places = [...this.rules.keys()].filter((k) => !before.has(this.rules[k]));
    for (const k of places.slice(0, RULES_OPEN)) {
      this.rules[k].isOpen = true;
    }
    this.redraw();
    this.focus(`/rules/${places[0]}/stream`);
  }

  drawSeries() {
    const { unmapped, unlisted } = this.mapping;
    this.giveAll.hidden = unmapped.length === 0;
    this.rest.textContent = unlisted
      ? `${count(unlisted)} samples of further series came, which the list has no room for.`
      : "";
    const text = JSON.stringify(unmapped);
    if (text === this.seriesText) {
      return;
    }
    this.seriesText = text;
    this.rows = [];
    const columns = this.writes ? [...SERIES_COLUMNS, { title: "Place" }] : SERIES_COLUMNS;
    const rows = unmapped.map((series) => [
      ...seriesCells(series),
      ...(this.writes ? [this.placeOf(series)] : []),
    ]);
    const empty = "No such series came since the rules were last changed.";
    keepingFocus(this.list, () =>
      this.list.replaceChildren(table("Series", columns, rows, { empty, stacked: true })),
    );
  }

  placeOf(series) {
    const offer = isText(series)
      ? h("span", { class: "quiet" }, "none: a stream has numbers")
      : this.placeButton(series);
    const text = h("span", { class: "quiet" }, "in the rules above");
    this.rows.push({ series, offer, text });
    return h("span", {}, offer, text);
  }

  placeButton(series) {
    const name = [series.measurement, tagsText(series), series.field].filter(Boolean).join(" ");
    return h(
      "button",
      {
        type: "button",
        class: "small",
        "aria-label": `Give it a place: ${name}`,
        onclick: () => this.give([series]),
      },
      "Give it a place",
    );
  }
}

const stateText = (isOverwriting) =>
  `The changes are not saved yet.${isOverwriting ? " The mapping was changed elsewhere meanwhile: these rules would take the place of those." : ""}`;

function seriesCells(series) {
  const { measurement, field, samples, last_value: value, last_at: last } = series;
  return [
    measurement,
    h("span", { class: "sentence" }, tagsText(series) || "–"),
    field,
    count(samples),
    typeof value === "number" ? number(value) : h("span", { class: "digest" }, String(value)),
    instant(last, true),
  ];
}
