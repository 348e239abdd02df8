// The tests call the parts of the page about marks on recordings that need no page. They run with `node --test
// tests/page/pure_marks.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/${name}`, import.meta.url));
const {
  canBeMarked,
  counted,
  cutShort,
  draggedSpan,
  faultsInForm,
  faultsOfDraft,
  isAbsence,
  markText,
  marksOf,
  numberOfVersion,
  overtakenText,
  partAround,
  reasonOf,
  spanText,
  versionName,
} = await part("data/marks.js");
const { marksLeftOut, newerText, versionText } = await part("new/version.js");
const { recordingsOfDraft } = await part("new/draft.js");
const { templateOf } = await part("plant/plan.js");
const { isAbout, sampleAt, shadedSpans } = await part("plot/math.js");

const SPIKE = { from_s: 1.2, to_s: 1.2, signals: ["pump_pressure"], reason: "spike" };
const PAUSE = { from_s: 3, to_s: 4.5, reason: "maintenance" };
const VERSIONS = [
  { number: 2, marks: [SPIKE, PAUSE] },
  { number: 1, marks: [SPIKE] },
];

test("a mark is said in words", () => {
  assert.equal(spanText(SPIKE), "1.2 s");
  assert.equal(markText(SPIKE), "pump pressure, 1.2 s, spike");
  assert.equal(markText(PAUSE), "all signals, 3 to 4.5 s, maintenance");
  assert.deepEqual(
    [0, 1, 2].map((count) => counted(count, "mark")),
    ["0 marks", "1 mark", "2 marks"],
  );
  assert.equal(versionName(VERSIONS[1]), "version 1 (1 mark)");
  assert.equal(versionName({ number: 7 }), "version 7");
  assert.equal(versionName({ number: 0, marks: [] }), "nothing that is marked");
});

test("a warning gives a reason, and is marked where samples stand", () => {
  const spans = [{ from_s: 1, to_s: 2 }];
  assert.equal(reasonOf({ code: "spikes" }), "spike");
  assert.equal(reasonOf({ code: "frozen_signal" }), "sensor frozen");
  assert.equal(reasonOf({ code: "clock_set_back" }), "clock set back");
  assert.ok(canBeMarked({ code: "spikes", spans }));
  assert.ok(!canBeMarked({ code: "no_unit" }));
  for (const code of ["gap", "missing_samples", "bad_samples"]) {
    assert.ok(!canBeMarked({ code, spans }), code);
  }
  assert.ok(isAbsence("gap") && !isAbsence("spikes"));
  assert.equal(cutShort({ spans }), "");
  assert.match(cutShort({ spans: Array(100).fill(spans[0]) }), /first 100 places/);
});

test("what is dragged becomes a span of the recording, as fine as its samples", () => {
  const dataset = { duration_s: 6, sample_time_s: 0.01 };
  assert.deepEqual(draggedSpan([2.498_765, 1.234_567], dataset), { from_s: 1.2346, to_s: 2.4988 });
  assert.deepEqual(draggedSpan([-1, 7], dataset), { from_s: 0, to_s: 6 });
  const long = { duration_s: 1e6, sample_time_s: 0.001 };
  assert.deepEqual(draggedSpan([654_321.123_4, 654_321.223_4], long), {
    from_s: 654_321.1234,
    to_s: 654_321.2234,
  });
  assert.deepEqual(partAround({ from_s: 1.5, to_s: 1.5 }, 0.01), [1.25, 1.75]);
  assert.deepEqual(partAround({ from_s: 10, to_s: 20 }, 0.01), [5, 25]);
});

test("a click is about the sample under it, and a spike has it before its neighbours", () => {
  const at = (x, y) => [10 * x, 100 - y];
  const xs = [0, 0.1, 0.2, 0.3];
  assert.equal(sampleAt(xs, [10, 10, 90, 10], [3, 12], at), 2);
  assert.equal(sampleAt(xs, [10, 10, 90, 10], [3, 90], at), 3);
  assert.equal(sampleAt(xs, [10, null, null, undefined], [3, 12], at), 0);
  assert.equal(sampleAt([], [], [3, 12], at), null);
});

test("a form becomes marks, and faults come to its fields", () => {
  const spans = [
    { from_s: 1, to_s: 2 },
    { from_s: 5, to_s: 5 },
  ];
  assert.deepEqual(marksOf({ spans, signals: ["a"], reason: " spike " }), [
    { from_s: 1, to_s: 2, signals: ["a"], reason: "spike" },
    { from_s: 5, to_s: 5, signals: ["a"], reason: "spike" },
  ]);
  assert.deepEqual(Object.keys(marksOf({ spans, signals: null, reason: "spike" })[0]), [
    "from_s",
    "to_s",
    "reason",
  ]);
  assert.deepEqual(faultsOfDraft({ spans, signals: null, reason: "" }), []);
  assert.deepEqual(
    faultsOfDraft({ spans: [{ from_s: 1, to_s: NaN }], signals: [], reason: "" }).map(
      ({ pointer }) => pointer,
    ),
    ["/spans/0/to_s", "/signals"],
  );
  assert.equal(faultsOfDraft({ spans: [], signals: null, reason: "" }).length, 1);
  const pointers = [
    "/marks/3/reason",
    "/marks/4/to_s",
    "/marks/4/signals/0",
    "/marks/4",
    "/marks/1/reason",
    "/marks",
  ];
  assert.deepEqual(
    faultsInForm(
      pointers.map((pointer) => ({ pointer, detail: "" })),
      3,
    ).map(({ pointer }) => pointer),
    ["/reason", "/spans/1/to_s", "/signals", "/spans/1/from_s", "/marks/1/reason", "/marks"],
  );
});

test("a version that came from elsewhere is told with what it brought", () => {
  const text = overtakenText({ number: 4, marks: [SPIKE, PAUSE], made_by: "person ben" }, [SPIKE]);
  assert.match(text, /^Version 4 by person ben is the newest now, with 2 marks\. /);
  assert.match(text, /New there: all signals, 3 to 4\.5 s, maintenance\. /);
  const many = Array.from({ length: 5 }, (_, k) => ({ ...SPIKE, from_s: k }));
  assert.match(overtakenText({ number: 4, marks: many }, []), /; and 2 marks more\. /);
  assert.doesNotMatch(overtakenText({ number: 4, marks: [] }, [SPIKE]), /New there/);
});

test("an experiment has a version as a number, as an object or not at all", () => {
  const object = { number: 1, marks: [SPIKE] };
  assert.deepEqual([3, 0, object, undefined, null].map(numberOfVersion), [3, 0, 1, undefined, undefined]);
  assert.deepEqual(marksLeftOut(VERSIONS, undefined), [SPIKE, PAUSE]);
  assert.deepEqual(marksLeftOut(VERSIONS, 1), [SPIKE]);
  assert.deepEqual(marksLeftOut(VERSIONS, 0), []);
  assert.deepEqual(marksLeftOut([], undefined), []);
  assert.deepEqual(marksLeftOut([], object), [SPIKE]);
  assert.equal(marksLeftOut(VERSIONS, 7), null);
  assert.equal(versionText(VERSIONS, undefined), "Leaves out what is marked as bad: version 2 (2 marks)");
  assert.equal(versionText(VERSIONS, object), "Leaves out what is marked as bad: version 1 (1 mark)");
  assert.equal(versionText(VERSIONS, 0), "Nothing that is marked as bad is left out");
  assert.equal(newerText(VERSIONS, object), "version 2 is newer");
  assert.deepEqual(
    [undefined, 2].map((asked) => newerText(VERSIONS, asked)),
    ["", ""],
  );
});

test("windows of a recording share their version, and a monitor has none", () => {
  const experiment = (version) => ({ dataset: "ds_1", signals: {}, version });
  const places = (...versions) =>
    recordingsOfDraft(versions.map(experiment)).map((recording) => recording.places);
  assert.deepEqual(places(1, { number: 1, marks: [SPIKE] }, 2, undefined), [[0, 1], [2], [3]]);
  assert.deepEqual(places(0, undefined), [[0], [1]]);
  const { experiments } = templateOf({ experiments: [experiment(3)] }, null, null);
  assert.equal(experiments[0].version, undefined);
});

test("spans are shaded on the plots of their signals", () => {
  const spans = shadedSpans([SPIKE, PAUSE], "marked");
  assert.deepEqual(spans[0], { from: 1.2, to: 1.2, kind: "marked", signals: ["pump_pressure"] });
  assert.deepEqual(
    ["pump_pressure", "flow"].map((name) => spans.filter(isAbout(name)).length),
    [2, 1],
  );
  assert.deepEqual(shadedSpans(undefined), []);
});
