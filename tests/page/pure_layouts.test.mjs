// The tests call the parts of the page about saved layouts that need no page. They run with `node --test
// tests/page/pure_layouts.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/data/${name}`, import.meta.url));
const { faultsOfName, optionsOf, parametersOf } = await part("layouts.js");
const { answersIn, askedFor, OPTIONS, textOfOptions } = await part("options.js");
const { isLeftOut, rangesIn, withLine, withoutLine } = await part("lines.js");
const { changesOfKind, changesOfRole, changesOfRow, kindOfRow, sentenceOf, withRolesOfOptions } =
  await part("roles.js");
const { unitsIn, unitsSupposed, unitsText, withUnit } = await part("units.js");

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

test("a column that is called like an option is not asked for, and an option is named by its value too", () => {
  const unclear = { code: "time_unit_needed", column: "time", detail: "`time` may be days; say `time_unit`" };
  assert.deepEqual(askedFor([unclear]), ["time_unit"]);
  assert.deepEqual(askedFor([{ parameter: "time", column: "time", detail: "no column" }]), ["time"]);
  assert.deepEqual(askedFor([{ detail: "say decimal=, or decimal=." }]), ["decimal"]);
});

test("the words of the server give answers", () => {
  const answers = {
    "its comma may stand between thousands: say decimal=, or decimal=.; and 5 more like it": [
      ["decimal", ","],
      ["decimal", "."],
    ],
    "the text is not UTF-8; say its encoding, such as encoding=windows-1252": [["encoding", "windows-1252"]],
    "or say `header_row=none`, and the columns are called `column_1`": [["header_row", "none"]],
    "If they stand for missing ones, say missing=-9999.5": [["missing", "-9999.5"]],
    "say which with `units`, such as `units=name:unit`": [],
    "`flow=7` is no number": [],
  };
  for (const [words, expected] of Object.entries(answers)) {
    assert.deepEqual(answersIn(words), expected, words);
  }
});

test("the units of signals are read and written as the option takes them", () => {
  const units = { "p, in": "bar", "a:b": "m", q: "l/min" };
  assert.deepEqual(unitsIn(unitsText(units)), units);
  assert.equal(unitsText({ p: "bar", "a:b": "m" }), "p:bar, a:b:m");
  assert.deepEqual(unitsIn("p:bar, a:b:m"), { p: "bar", "a:b": "m" });
  assert.deepEqual(unitsIn(""), {});
  assert.deepEqual(unitsIn("{"), {});
  const column = { name: "p", unit: "bar" };
  assert.equal(withUnit("q:m", column, "MPa"), "q:m, p:MPa");
  for (const unit of ["", "bar"]) {
    assert.equal(withUnit("q:m, p:MPa", column, unit), "q:m");
  }
});

test("a fault about a unit tells the units that are supposed", () => {
  assert.deepEqual(unitsSupposed("unit `mPa` may be what its letters say or `MPa`: say `units`"), ["MPa"]);
  assert.deepEqual(unitsSupposed("unit `kp/qcm` is not known; did you mean `kp/cm2`?: say"), ["kp/cm2"]);
  assert.deepEqual(unitsSupposed("unit `skt` is not known: say which with `units`"), []);
});

const columnsOf = (...roles) => roles.map((role, k) => ({ title: `c${k}`, name: `c${k}`, unit: null, role }));
const answerOf = (format, ...roles) => ({ format, columns: columnsOf(...roles), rows: [], faults: [] });
const rolesIn = ({ columns }) => columns.map(({ role }) => role);

test("a column has the role that an option says where the server still shows a signal", () => {
  const paired = answerOf("paired_csv", "time", "signal", "signal");
  const values = valuesOf({ ignore: "c2" });
  const drawn = withRolesOfOptions(paired, values);
  assert.deepEqual(rolesIn(drawn), ["time", "signal", "left_out"]);
  assert.deepEqual(changesOfRole({ answer: drawn, values }, 2, "signal"), { ignore: "" });
  const long = answerOf("long_csv", "time", "signal", "signal", "signal");
  const options = valuesOf({ tag: "c1", value: "c3", ignore: "c2" });
  assert.deepEqual(rolesIn(withRolesOfOptions(long, options)), ["time", "tag", "signal", "value"]);
});

test("rows with a time beside each signal are read otherwise, and as before", () => {
  const cleared = { tag: "", value: "", quality: "" };
  const guess = answerOf("paired_csv", "time", "signal");
  const layout = { answer: guess, values: valuesOf({}), guess };
  assert.deepEqual(changesOfKind(layout, "wide"), { ...cleared, format: "wide_csv" });
  assert.deepEqual(changesOfKind(layout, "paired"), { ...cleared, format: "" });
});

test("lines that are left out are written as ranges", () => {
  assert.deepEqual(rangesIn("7, 3-5,22-, x, -4"), [
    { first: 3, last: 5 },
    { first: 7, last: 7 },
    { first: 22, last: Number.POSITIVE_INFINITY },
  ]);
  assert.equal(withLine("", 4), "4");
  assert.equal(withLine("3-5, 7", 6), "3-7");
  assert.equal(withLine("22-", 30), "22-");
  assert.equal(withoutLine("3-5", 4), "3, 5");
  assert.equal(withoutLine("22-", 22), "23-");
  assert.equal(withoutLine("4", 4), "");
  assert.deepEqual(
    [3, 4, 100].map((line) => isLeftOut("4, 50-", line)),
    [false, true, true],
  );
});

test("a line that is left out is read again by what it is then said to be", () => {
  const answer = { header_row: 1, unit_row: null, first_row: 2, columns: [], rows: [], faults: [] };
  const layout = (values) => ({ answer, values: valuesOf(values), rowGuess: answer });
  assert.equal(kindOfRow(answer, 4, "4"), "skipped");
  assert.deepEqual(changesOfRow(layout({}), 4, "skipped"), { skip: "4" });
  assert.deepEqual(changesOfRow(layout({ unit_row: "2" }), 2, "skipped"), { unit_row: "", skip: "2" });
  assert.deepEqual(changesOfRow(layout({ skip: "2-4" }), 3, "data"), { skip: "2, 4" });
  assert.deepEqual(changesOfRow(layout({ skip: "2" }), 2, "units"), { skip: "", unit_row: "2" });
});

test("the rows of a workbook are told apart by their columns alone", () => {
  const answer = {
    file: "excel",
    format: "wide_csv",
    columns: [
      { title: "t", role: "time" },
      { title: "a", role: "signal" },
    ],
  };
  const layout = {
    answer: { ...answer, rows: [], faults: [], first_row: 2 },
    values: valuesOf({ tag: "a" }),
    guess: { ...answer, format: "long_csv" },
  };
  assert.equal(changesOfKind(layout, "wide").format, "");
  assert.equal(
    sentenceOf({ delimiter: null, sheet: "Data", header_row: 3, unit_row: null, first_row: 4 }),
    "Worksheet Data, read as: titles in line 3, samples from line 4 on.",
  );
});
