// The tests call the parts of the page about saved layouts that need no page. They run with `node --test
// tests/page/pure_layouts.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/data/${name}`, import.meta.url));
const { faultsOfName, optionsOf, parametersOf } = await part("layouts.js");
const { askedFor, OPTIONS, textOfOptions } = await part("options.js");

const LAYOUT = {
  name: "historian",
  options: { tag: "Messstelle", decimal: ",", tz: "Europe/Berlin" },
  created_at: "2026-01-01T00:00:00Z",
  changed_at: "2026-01-01T00:00:00Z",
};
const valuesOf = (options) => ({
  ...Object.fromEntries(Object.keys(OPTIONS).map((option) => [option, ""])),
  ...options,
});

test("a file is read by the name of a layout, and what was chosen beside it wins", () => {
  assert.deepEqual(parametersOf(valuesOf(LAYOUT.options), LAYOUT), { layout: "historian" });
  assert.deepEqual(parametersOf(valuesOf({ ...LAYOUT.options, tz: "UTC", missing: "-9999" }), LAYOUT), {
    layout: "historian",
    tz: "UTC",
    missing: "-9999",
  });
});

test("every option stands by itself without a layout, and where an option is taken out of one", () => {
  assert.deepEqual(parametersOf(valuesOf({ tz: "UTC" }), null), { tz: "UTC" });
  assert.deepEqual(parametersOf(valuesOf({ ...LAYOUT.options, tag: "" }), LAYOUT), {
    decimal: ",",
    tz: "Europe/Berlin",
  });
  assert.deepEqual(parametersOf(valuesOf({}), LAYOUT), {});
});

test("an option without a text says nothing in a layout either", () => {
  const layout = { ...LAYOUT, options: { ...LAYOUT.options, missing: "" } };
  assert.deepEqual(parametersOf(valuesOf(LAYOUT.options), layout), { layout: "historian" });
});

test("a layout keeps the options that say something", () => {
  assert.deepEqual(optionsOf(valuesOf(LAYOUT.options)), LAYOUT.options);
  assert.deepEqual(optionsOf(valuesOf({})), {});
});

test("a layout has a name that can stand in an address", () => {
  for (const name of ["historian", "Hall 2: north?", "..x", "100 %"]) {
    assert.deepEqual(faultsOfName(name), [], name);
  }
  for (const name of ["", "a/b", ".", ".."]) {
    assert.deepEqual(
      faultsOfName(name).map(({ pointer }) => pointer),
      ["/name"],
      name,
    );
  }
});

test("the options of a layout are told in the words of their fields", () => {
  assert.equal(
    textOfOptions({ ...LAYOUT.options, format: "long_csv" }),
    "Time zone of its clock: Europe/Berlin; Column that names the signal: Messstelle; Decimal sign: comma; Format: long csv",
  );
  assert.equal(textOfOptions({ time_unit: "weeks" }), "What its times are: weeks");
  assert.equal(textOfOptions({}), "");
});

test("the server asks for an option by a parameter, by its words, or by the path in a layout", () => {
  const faults = [
    { parameter: "tz", detail: "times of day have no zone" },
    { detail: "say `tag`, such as `Messstelle`" },
    { pointer: "/options/decimal", detail: "a point or a comma" },
    { pointer: "/signals/missing", detail: "no samples" },
  ];
  assert.deepEqual(askedFor(faults), ["tz", "tag", "decimal"]);
});
