// @ts-check
// This part of the page of a mapping is the form of its rules. The content of a rule is made when the rule is first
// opened: a mapping may have a thousand rules.

import { cell, titledField } from "../new/fields.js";
import { namesIn, namesOfParameter } from "../shell/description.js";
import { h, smallButton, table } from "../shell/dom.js";
import { pointed } from "../shell/faults.js";
import { words } from "../shell/format.js";
import { emptyField, emptyRule, qualityText, ruleText, tagText } from "./places.js";

const FIELD_COLUMNS = [
  { title: "Field" },
  { title: "Signal" },
  { title: "Unit" },
  { title: "Between samples" },
  { title: "Remove" },
];

const SHOWN_COLUMNS = [
  { title: "Rule", numeric: true },
  { title: "Measurement" },
  { title: "Tags" },
  { title: "Stream" },
  { title: "Field" },
  { title: "Signal" },
  { title: "Unit" },
  { title: "Between samples" },
  { title: "Quality" },
];

// The most fields of a line that say how good its other fields are.
const MOST_QUALITY_FIELDS = 10;
const LEFT_OUT = "as the stream has it";
const NO_CODES = "no codes, words alone";

// Shows the rules to a reader who may not change them.
export function ruleTable(rules) {
  const rows = rules.flatMap(({ measurement, tags, stream, fields, quality }, k) =>
    fields.map(({ field: name, signal, unit, interpolation }) => [
      String(k + 1),
      measurement,
      tagText(tags) || "–",
      h("a", { href: `#/plant/streams/${stream}` }, stream),
      name,
      signal,
      unit || "SI",
      interpolation ?? LEFT_OUT,
      qualityText(quality) || "–",
    ]),
  );
  return table("Rules", SHOWN_COLUMNS, rows, { empty: "No rules yet.", stacked: true });
}

export function ruleForms(page) {
  return [
    page.rules.map((_, k) => ruleForm(page, k)),
    h("button", { type: "button", onclick: () => addRule(page) }, "Add a rule"),
  ];
}

function addRule(page) {
  const place = page.rules.length;
  page.at(["rules", place], { ...emptyRule(), isOpen: true }, true);
  page.focus(`/rules/${place}/measurement`);
}

function ruleForm(page, k) {
  const summary = h("summary", {});
  const content = h("div", {});
  const element = h("details", { class: "panel rule" }, summary, content);
  const tell = () => {
    summary.textContent = `${k + 1}. ${ruleText(page.rules[k])}`;
  };
  const draw = () => {
    tell();
    if (element.open && !content.firstChild) {
      content.append(...ruleFields(page, k, tell));
    }
  };
  element.addEventListener("toggle", () => {
    // The form may have been made anew since the rule was opened.
    if (element.isConnected) {
      page.rules[k].isOpen = element.open;
      draw();
    }
  });
  element.open = page.rules[k].isOpen ?? false;
  draw();
  return pointed(element, ["rules", k]);
}

function ruleFields(page, k, tell) {
  const path = ["rules", k];
  const { measurement, tags, stream, fields } = page.rules[k];
  const put = (member) => (value) => {
    page.at([...path, ...member], value);
    tell();
  };
  // Adds an entry to a list of the rule, and puts the focus on the member of the entry that is typed first.
  const add = (list, entry, ...member) => {
    const place = list.reduce((owner, name) => owner[name], page.rules[k]).length;
    page.at([...path, ...list, place], entry, true);
    page.focus(`/${[...path, ...list, place, ...member].join("/")}`);
  };
  const text = (title, member, value, hint) =>
    pointed(
      titledField(title, value, (typed) => put([member])(typed ?? ""), { text: true, size: "32", hint }),
      [...path, member],
    );
  const rows = fields.map((_, place) => fieldRow(page, k, place, put));
  return [
    h(
      "div",
      { class: "fields" },
      text("Measurement", "measurement", measurement, "rig"),
      text("Stream", "stream", stream, "rig-4"),
    ),
    h(
      "div",
      { class: "fields tags" },
      h("span", { class: "term" }, "Tags"),
      tags.map((_, place) => tagFields(page, k, place, put)),
      smallButton("Add a tag", `Add a tag to rule ${k + 1}`, () =>
        add(["tags"], { name: "", value: "" }, "name"),
      ),
    ),
    table(`Fields of rule ${k + 1}`, FIELD_COLUMNS, rows, { stacked: true }),
    qualityFields(page, k, put, add),
    h(
      "div",
      { class: "actions" },
      smallButton("Add a field", `Add a field to rule ${k + 1}`, () =>
        add(["fields"], emptyField(), "field"),
      ),
      smallButton("Earlier", `Earlier: rule ${k + 1}`, () => move(page, k, k - 1), k === 0),
      smallButton("Later", `Later: rule ${k + 1}`, () => move(page, k, k + 1), k === page.rules.length - 1),
      smallButton("Remove the rule", `Remove the rule ${k + 1}`, () => {
        page.at(path, undefined, true);
        page.form.lastElementChild.focus();
      }),
    ),
  ];
}

// The first rule that fits decides, so that the order of the rules counts.
function move(page, from, to) {
  const rules = [...page.rules];
  rules.splice(to, 0, ...rules.splice(from, 1));
  page.at(["rules"], rules, true);
  // The focus stays with the rule, on a button that can be pressed.
  const canGoOn = to > 0 && to < rules.length - 1;
  page.focus(`/rules/${to}`, `[aria-label^="${to < from === canGoOn ? "Earlier" : "Later"}"]`);
}

function remove(page, path, then) {
  page.at(path, undefined, true);
  page.focus(`/rules/${path[1]}`, `[aria-label^="${then}"]`);
}

function tagFields(page, k, place, put) {
  const { name, value } = page.rules[k].tags[place];
  const member = ["tags", place];
  const path = ["rules", k, ...member];
  const label = `tag ${place + 1} of rule ${k + 1}`;
  return h(
    "div",
    { class: "together", role: "group", "aria-label": `Tag ${place + 1} of rule ${k + 1}` },
    cell([...path, "name"], `Name of ${label}`, name, put([...member, "name"]), { hint: "hall", size: "12" }),
    "=",
    cell([...path, "value"], `Value of ${label}`, value, put([...member, "value"]), {
      hint: "2",
      size: "16",
    }),
    smallButton("×", `× remove ${label}`, () => remove(page, path, "Add a tag")),
  );
}

function qualityFields(page, k, put, add) {
  const { fields, codes } = page.rules[k].quality;
  const path = ["rules", k, "quality"];
  const entries = fields.map((name, place) => {
    const label = `field of quality ${place + 1} of rule ${k + 1}`;
    const member = ["quality", "fields", place];
    return h(
      "div",
      { class: "together" },
      cell([...path, "fields", place], `Name of ${label}`, name, put(member), {
        hint: "Quality",
        size: "14",
      }),
      smallButton("×", `× remove ${label}`, () =>
        remove(page, [...path, "fields", place], "Add a field of quality"),
      ),
    );
  });
  const schemes = namesOfParameter(page.description, "/v1/datasets", "post", "quality_scheme");
  const choices = h(
    "select",
    {
      "aria-label": `Codes of quality of rule ${k + 1}`,
      onchange: ({ target }) => put(["quality", "codes"])(target.value || undefined),
    },
    ["", ...schemes].map((scheme) =>
      h("option", { value: scheme, selected: scheme === (codes ?? "") }, scheme ? words(scheme) : NO_CODES),
    ),
  );
  const list = h("div", { class: "fields" }, entries);
  return pointed(
    h(
      "div",
      { class: "fields tags" },
      h("span", { class: "term" }, "Quality"),
      entries.length > 0 && pointed(list, [...path, "fields"]),
      smallButton(
        "Add a field of quality",
        `Add a field of quality to rule ${k + 1}`,
        () => add(["quality", "fields"], ""),
        fields.length >= MOST_QUALITY_FIELDS,
      ),
      h(
        "div",
        { class: "together" },
        h("span", { class: "term" }, "Codes"),
        pointed(h("span", { class: "cell" }, choices), [...path, "codes"]),
      ),
    ),
    path,
  );
}

function fieldRow(page, k, place, put) {
  const { fields } = page.rules[k];
  const { field: name, signal, unit, interpolation } = fields[place];
  const path = ["rules", k, "fields", place];
  const label = `field ${place + 1} of rule ${k + 1}`;
  const textCell = (member, title, value, options) =>
    cell([...path, member], `${title} of ${label}`, value, put(["fields", place, member]), options);
  const between = h(
    "select",
    {
      "aria-label": `Between samples of ${label}`,
      onchange: ({ target }) => put(["fields", place, "interpolation"])(target.value || undefined),
    },
    ["", ...namesIn(page.description, "Interpolation")].map((choice) =>
      h("option", { value: choice, selected: choice === (interpolation ?? "") }, choice || LEFT_OUT),
    ),
  );
  return [
    textCell("field", "Name", name, { size: "18", hint: "position" }),
    textCell("signal", "Signal", signal, { size: "18", hint: "position" }),
    textCell("unit", "Unit", unit, { size: "8", hint: "SI" }),
    pointed(h("span", { class: "cell" }, between), [...path, "interpolation"]),
    smallButton("×", `× remove ${label}`, () => remove(page, path, "Add a field to"), fields.length === 1),
  ];
}
