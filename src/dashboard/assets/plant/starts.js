// @ts-check
// These parts of a form say where the states of a model start in every window, and which times are left out.

import { h } from "../shell/dom.js";
import { pointed } from "../shell/faults.js";
import { unitSigns, words } from "../shell/format.js";
import { choice, instantField, numberField, part } from "./fields.js";
import { firstEstimated, kindOfStart, startChoices, startOf, valueOfStart } from "./plan.js";

export function startsPart(page) {
  const hint =
    "A window begins wherever the running plant then is. A window is left out where the model would start away from its first samples.";
  return part("3. Where windows begin", hint, () =>
    page.model
      ? page.model.states.map((state) => startFields(page, state))
      : [h("p", { class: "quiet" }, "Choose a job first.")],
  );
}

function startFields(page, state) {
  const { model, job, spec } = page;
  const path = ["initial_state", state.name];
  const kind = kindOfStart(spec.initial_state?.[state.name]);
  const choose = (chosen) => {
    page.at(path, startOf(chosen, firstEstimated(job).initial_state?.[state.name]));
    page.redraw();
  };
  const name = words(state.name);
  const label = choice(`${name} begins`, startChoices(model, state, job), kind, choose);
  label.title = state.meaning;
  const fields = { estimate: rangeFields, value: valueField }[kind];
  return h("div", { class: "fields start-of-state" }, pointed(label, path), fields?.(page, state, path));
}

const titled = (text, unit) => (unit === "1" ? text : `${text}, ${unitSigns(unit)}`);

function rangeFields(page, { name, unit }, path) {
  const side = (member, word) => {
    const put = (value) => {
      const start = page.spec.initial_state[name];
      page.at(path, { ...start, estimate: { ...start.estimate, [member]: value } });
    };
    const title = titled(`${words(name)} ${word}`, unit);
    return numberField(page, title, [...path, "estimate", member], { put });
  };
  return pointed(h("div", { class: "fields" }, side("lower", "from"), side("upper", "to")), [
    ...path,
    "estimate",
  ]);
}

// A start that is a bare number becomes an object, in which the field has its place.
function valueField(page, { name, unit }, path) {
  const value = valueOfStart(page.spec.initial_state[name]);
  const put = (typed) => page.at(path, { ...page.spec.initial_state[name], value: typed });
  return numberField(page, titled(words(name), unit), [...path, "value"], { put, value });
}

const mostTimes = ({ components }) => components.schemas.SelectionDocument.properties.exclude.maxItems;

export function excludedTimes(page) {
  const times = page.spec.exclude ?? [];
  const put = (changed) => {
    page.at(["exclude"], changed.length ? changed : undefined);
    page.redraw();
  };
  const add = () => {
    put([...times, {}]);
    page.form.querySelector(`[data-pointer="/exclude/${times.length}/from"] input`).focus();
  };
  const remove = (place) => {
    put(times.filter((_, other) => other !== place));
    page.form.querySelector(".excluded > .actions button").focus();
  };
  const isFull = times.length >= mostTimes(page.description);
  return h(
    "div",
    { class: "excluded" },
    times.map((_, place) => timeFields(page, place, () => remove(place))),
    times.length > 0 &&
      h("p", { class: "quiet" }, "A window that reaches into a time that is left out is not looked at."),
    h(
      "div",
      { class: "actions" },
      h("button", { type: "button", disabled: isFull, onclick: add }, "Leave out a time"),
    ),
  );
}

function timeFields(page, place, remove) {
  const path = ["exclude", place];
  const fields = h(
    "div",
    { class: "fields", role: "group", "aria-label": `Time ${place + 1} that is left out` },
    instantField(page, "Left out from", [...path, "from"]),
    instantField(page, "Left out to", [...path, "to"]),
    h("button", { type: "button", "aria-label": `Remove time ${place + 1}`, onclick: remove }, "Remove"),
  );
  return pointed(fields, path);
}
