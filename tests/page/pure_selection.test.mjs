// The tests call the parts of the page about selections of windows that need no page. They run with `node --test
// tests/page/pure_selection.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/${name}`, import.meta.url));
const {
  addressOfWindow,
  conclusion,
  errorText,
  expectationOf,
  LEFT_OUT,
  laneTitle,
  lookedText,
  reasonText,
  shadeOf,
  sharesOf,
  spanOf,
  stretchesOf,
  streamAddress,
  windowAfter,
  windowAt,
  windowText,
  windowUnder,
} = await part("job/windows.js");
const { partNamed, secondsOf } = await part("plant/instants.js");
const {
  kindOfStart,
  missingOfSelection,
  offeredJobs,
  sharedEstimates,
  startChoices,
  startOf,
  startText,
  usualLength,
  valueOfStart,
  windowsIn,
} = await part("plant/plan.js");

const HOUR = 3600;
const BEGIN = secondsOf("2026-01-01T00:00:00Z");
const known = (gain, constant) => [
  { name: "gain", unit: "1", value: 2, total_standard_error: gain },
  { name: "time_constant", unit: "s", value: 50, total_standard_error: constant },
];
const chosen = (window) => ({ window, samples: 3600, adds: { gain: 0.5 }, moved: ["valve"] });

// The selection has ten windows of an hour, of which the last is half an hour long.
const selectionOf = (more = {}) => ({
  stream: "press 7",
  from: "2026-01-01T00:00:00Z",
  to: "2026-01-01T09:30:00Z",
  window_s: HOUR,
  finished: true,
  wanted: [{ name: "gain", target: 0.04 }],
  reached: true,
  samples: 7200,
  chosen: [chosen(2), chosen(7)],
  with_chosen: known(0.038, 1),
  with_random: known(0.28, null),
  with_all: known(0.012, 0.5),
  windows: {
    count: 10,
    alone: { gain: [null, 0.4, 0.05, null, null, 0.1, 0.2, 0.06, null, 0.5] },
    left_out: ["no_samples", null, null, "gaps", "gaps", null, null, null, "inputs_stood_still", null],
  },
  ...more,
});

test("the sentence says what the chosen windows fix, beside random windows and all", () => {
  const plain = (selection) => conclusion(selection).replaceAll("\u00a0", " ");
  assert.equal(
    plain(selectionOf()),
    "2 of 10 windows fix gain to ± 1.9 %, as closely as was asked; 2 random windows: ± 14 %; all windows: ± 0.6 %.",
  );
  const both = [
    { name: "gain", target: null },
    { name: "time_constant", target: null },
  ];
  assert.equal(
    plain(selectionOf({ wanted: both, reached: null })),
    "2 of 10 windows fix gain to ± 1.9 % and time constant to ± 2 %, with 7\u202f200 samples; " +
      "2 random windows: ± 14 % and not fixed; all windows: ± 0.6 % and ± 1 %.",
  );
  assert.match(plain(selectionOf({ reached: false })), /, not as closely as was asked;/);
  assert.match(plain(selectionOf({ chosen: [chosen(2)] })), /^1 of 10 windows fixes .*; 1 random window: /);
  assert.equal(plain(selectionOf({ chosen: [] })), "None of 10 windows says enough of gain.");
  assert.match(
    plain(selectionOf({ wanted: both, with_chosen: known(0.038, null) })),
    /fix gain to ± 1.9 % but not time constant,/,
  );
  const four = ["gain", "time_constant", "gain", "gain"].map((name) => ({ name, target: null }));
  assert.doesNotMatch(plain(selectionOf({ wanted: four })), /random/);
});

test("an error is a share of the value, and a number where the value is zero", () => {
  const text = (...parameters) => errorText(...parameters).replaceAll("\u00a0", " ");
  assert.equal(text(0.1, { value: -4, unit: "bar" }), "± 2.5 %");
  assert.equal(text(80, { value: 2, unit: "bar" }), "± 4\u202f000 %");
  assert.equal(text(0.1, { value: 0, unit: "bar" }), "± 0.1 bar");
  assert.equal(text(null, { value: 2, unit: "bar" }), "not fixed");
  // The value is known also where the chosen windows do not fix the parameter.
  const { chosen: none, all } = expectationOf(selectionOf({ with_chosen: [] }), "gain");
  assert.deepEqual([none, all.replaceAll("\u00a0", " ")], ["not fixed", "± 0.6 %"]);
});

test("a window says a share of what the best window says", () => {
  const shares = sharesOf([null, 0.2, 0.1, 0.4]);
  assert.deepEqual(
    shares.map((share) => Number(share.toFixed(9))),
    [0, 0.25, 1, 0.0625],
  );
  assert.deepEqual(sharesOf([null, null]), [0, 0]);
  assert.deepEqual([0, 0.01, 0.0999, 0.25, 0.5, 0.75, 1].map(shadeOf), [0, 1, 1, 3, 4, 5, 5]);
  assert.match(laneTitle(selectionOf(), "gain"), /^gain: the best window by itself ±.2\.5.%$/);
  const none = { ...selectionOf().windows, alone: { gain: [null] } };
  assert.match(laneTitle(selectionOf({ windows: none }), "gain"), /no window fixes it by itself/);
});

test("a pixel has the shade of the window that says most, and is left out where all its windows are", () => {
  const selection = selectionOf();
  const shares = sharesOf(selection.windows.alone.gain);
  const range = [BEGIN, BEGIN + 10 * HOUR];
  assert.deepEqual(stretchesOf(selection, shares, range, 10), [
    { from: 0, to: 1, shade: LEFT_OUT },
    { from: 1, to: 2, shade: 1 },
    { from: 2, to: 3, shade: 5 },
    { from: 3, to: 5, shade: LEFT_OUT },
    { from: 5, to: 6, shade: 3 },
    { from: 6, to: 7, shade: 1 },
    { from: 7, to: 8, shade: 4 },
    { from: 8, to: 9, shade: LEFT_OUT },
    { from: 9, to: 10, shade: 1 },
  ]);
  // With two windows a pixel, a window that says something is seen beside a window that was left out.
  assert.deepEqual(
    stretchesOf(selection, shares, range, 5).map(({ shade }) => shade),
    [1, 5, 3, 4, 1],
  );
  // A window that is wider than a pixel is a single stretch.
  const close = [BEGIN + 2 * HOUR, BEGIN + 4 * HOUR];
  assert.deepEqual(stretchesOf(selection, shares, close, 100), [
    { from: 0, to: 50, shade: 5 },
    { from: 50, to: 100, shade: LEFT_OUT },
  ]);
});

test("a pixel of many windows stands for a chosen window, else for the window that says most", () => {
  const selection = selectionOf();
  const shares = sharesOf(selection.windows.alone.gain);
  const under = (from, to) => windowUnder(selection, shares, [BEGIN + from * HOUR, BEGIN + to * HOUR]);
  assert.equal(under(6, 10), 7);
  assert.equal(under(3, 7), 5);
  assert.equal(under(3, 5), 3);
  assert.equal(under(4.2, 4.3), 4);
});

test("windows have their place in time, also at the ends", () => {
  const selection = selectionOf();
  assert.deepEqual(spanOf(selection, 9), [BEGIN + 9 * HOUR, BEGIN + 9.5 * HOUR]);
  assert.equal(windowAt(selection, BEGIN + 3 * HOUR), 3);
  assert.equal(windowAt(selection, BEGIN + 3 * HOUR - 1), 2);
  assert.deepEqual(
    [BEGIN - 5, BEGIN + 99 * HOUR].map((seconds) => windowAt(selection, seconds)),
    [0, 9],
  );
});

test("the arrow keys go from window to window, and Page Up and Page Down to chosen windows", () => {
  const after = (window, key) => windowAfter(selectionOf(), window, key);
  assert.deepEqual([after(0, "ArrowRight"), after(0, "ArrowLeft")], [1, null]);
  assert.deepEqual([after(9, "ArrowRight"), after(9, "ArrowLeft")], [null, 8]);
  assert.deepEqual([after(4, "Home"), after(4, "End")], [0, 9]);
  assert.deepEqual([after(2, "PageDown"), after(7, "PageDown")], [7, null]);
  assert.deepEqual([after(7, "PageUp"), after(2, "PageUp")], [2, null]);
  assert.equal(after(4, "x"), null);
});

test("a window is told in words, with the reason where it was left out", () => {
  const clock = { text: (seconds) => `${(seconds - BEGIN) / HOUR} h` };
  const told = (window) => windowText(selectionOf(), window, clock).replaceAll("\u00a0", " ");
  assert.equal(told(2), "2 h to 3 h · window 3 of 10 · chosen · by itself gain ± 2.5 %");
  assert.equal(told(9), "9 h to 9.5 h · window 10 of 10 · by itself gain ± 25 %");
  assert.equal(told(8), "8 h to 9 h · window 9 of 10 · left out: no input moved");
  assert.equal(reasonText("starts_elsewhere"), "the model starts elsewhere than the first samples");
  assert.equal(reasonText("a_new_reason"), "a new reason");
});

test("a window leads to its part of the stream, which the page of the stream reads", () => {
  const address = addressOfWindow(selectionOf(), 9);
  assert.ok(address.startsWith("#/plant/streams/press%207?"));
  const query = new URLSearchParams(address.split("?")[1]);
  assert.deepEqual(partNamed(query), [BEGIN + 9 * HOUR, BEGIN + 9.5 * HOUR]);
  assert.equal(streamAddress("rig"), "#/plant/streams/rig");
  assert.equal(partNamed(new URLSearchParams("from=2026-01-01T00:00:00Z")), null);
  assert.equal(partNamed(new URLSearchParams("from=2026-01-02T00:00:00Z&to=2026-01-01T00:00:00Z")), null);
});

test("the progress counts windows before the first event and after an old event", () => {
  const job = {
    progress: { evaluations: 48 },
    spec: { from: "2026-01-01T00:00:00Z", to: "2026-01-30T23:59:40Z", selection: { window_s: HOUR } },
  };
  assert.equal(lookedText(job, null), "48 of 720 windows");
  assert.equal(lookedText(job, { looked: 120, windows: 720 }), "120 of 720 windows");
  assert.equal(lookedText(job, { looked: 16, windows: 720 }), "48 of 720 windows");
  assert.equal(lookedText({ ...job, progress: null }, null), "0 of 720 windows");
});

test("the form knows what a selection needs and how many windows it has", () => {
  assert.deepEqual(missingOfSelection({ stream: "rig", window_s: 60 }), [
    "a job",
    "how closely a parameter is to be known, or a number of samples",
  ]);
  const whole = { stream: "rig", job: "job_1", window_s: 60 };
  assert.deepEqual(missingOfSelection({ ...whole, target: { gain: "5 %" } }), []);
  assert.deepEqual(missingOfSelection({ ...whole, budget_samples: 900 }), []);
  const stream = { first: "2026-01-01T00:00:00Z", last: "2026-01-31T00:00:00Z", samples: 2_592_000 };
  assert.deepEqual(windowsIn(stream, { window_s: HOUR }), { windows: 720, samples: 3600 });
  assert.equal(windowsIn(stream, { window_s: HOUR, from: "2026-01-30T00:00:00Z" }).windows, 24);
  assert.equal(windowsIn(stream, { window_s: HOUR, from: "2026-02-02T00:00:00Z" }), null);
  assert.equal(windowsIn(stream, { window_s: undefined }), null);
  assert.equal(windowsIn({ first: null }, { window_s: HOUR }), null);
  // A month is divided into hours, and a minute into the shortest windows there are.
  assert.equal(usualLength(stream), HOUR);
  assert.equal(usualLength({ first: "2026-01-01T00:00:00Z", last: "2026-01-01T00:01:00Z" }), 1);
});

// A drive whose position is measured, and a valve whose start the model has.
const DRIVE = {
  states: [
    { name: "position", unit: "m", initial: { estimated_from_output: { output: 0 } } },
    { name: "velocity", unit: "m/s", initial: { estimated_from_slope: { output: 0 } } },
    { name: "valve_opening", unit: "1", initial: "model" },
  ],
  outputs: [{ name: "position" }, { name: "velocity" }],
};

test("the form says where each state of the job starts, in words", () => {
  const measured = { position: "encoder" };
  const told = (starts, signals = measured) => {
    const experiments = [
      { role: "validation", initial_state: { position: 9 } },
      { role: "estimation", signals, initial_state: starts },
    ];
    const text = (state) => startText(DRIVE, state, { experiments }).replaceAll("\u00a0", " ");
    return DRIVE.states.map(text);
  };
  assert.deepEqual(told({}), [
    "estimated near the first sample of position",
    "estimated near the first slope of position",
    "the model's own start",
  ]);
  assert.deepEqual(told({ position: "first_sample", velocity: { value: 0 }, valve_opening: 0.25 }), [
    "the first measured sample",
    "0 m/s",
    "0.25",
  ]);
  assert.equal(told({ position: { estimate: { lower: -1, upper: 2 } } })[0], "estimated, from −1 m to 2 m");
  // Without a measured position there is nothing to estimate near.
  const own = "the model's own start";
  assert.deepEqual(told({}, { velocity: "tacho" }), [own, own, own]);
});

test("a start at the first sample is offered for states that are measured outputs", () => {
  const job = { experiments: [{ signals: { position: "encoder" } }] };
  const kinds = DRIVE.states.map((state) => startChoices(DRIVE, state, job).map(([kind]) => kind));
  assert.deepEqual(kinds, [
    ["", "estimate", "first_sample", "value"],
    ["", "estimate", "value"],
    ["", "estimate", "value"],
  ]);
  assert.equal(startChoices(DRIVE, DRIVE.states[2], job)[0][1], "as the job says (the model's own start)");
});

test("a start is of a kind, and another kind begins with what the job says", () => {
  const range = { estimate: { lower: 0, upper: 6 } };
  assert.deepEqual([undefined, "first_sample", range, 3, { value: 3, tolerance: "1 %" }].map(kindOfStart), [
    "",
    "first_sample",
    "estimate",
    "value",
    "value",
  ]);
  assert.deepEqual([3, { value: 4 }, undefined].map(valueOfStart), [3, 4, undefined]);
  assert.deepEqual(startOf("estimate", range), range);
  assert.deepEqual(startOf("estimate", 3), { estimate: {} });
  assert.deepEqual(startOf("value", range), { value: undefined });
  assert.equal(startOf("first_sample", range), "first_sample");
  assert.equal(startOf("", undefined), undefined);
});

test("a start needs its numbers, and a time that is left out its ends", () => {
  const whole = { stream: "rig", job: "job_1", window_s: 60, budget_samples: 900 };
  const lack = (more) => missingOfSelection({ ...whole, ...more });
  const where = ["where valve opening begins"];
  const starts = (start) => lack({ initial_state: { position: "first_sample", valve_opening: start } });
  assert.deepEqual(starts({ estimate: {} }), where);
  assert.deepEqual(starts({ estimate: { lower: 0 } }), where);
  assert.deepEqual(starts({ value: undefined }), where);
  for (const start of [{ estimate: { lower: 0, upper: 1 } }, { value: 0 }, 0]) {
    assert.deepEqual(starts(start), []);
  }
  const time = { from: "2026-01-01T00:00:00Z", to: "2026-01-02T00:00:00Z" };
  const ends = ["the beginning and the end of each time that is left out"];
  assert.deepEqual(lack({ exclude: [time, {}] }), ends);
  assert.deepEqual(lack({ exclude: [{ from: time.from }] }), ends);
  assert.deepEqual(lack({ exclude: [time] }), []);
});

test("a selection can ask for parameters that all experiments of a finished job share", () => {
  const job = {
    parameters: { gain: { estimate: {} }, offset: { estimate: {} }, delay: { value: 0 } },
    experiments: [{}, { parameters: { offset: { estimate: {} } } }],
  };
  const parameters = [
    { name: "gain", estimate: 2 },
    { name: "offset", experiment: 0, estimate: 1 },
    { name: "offset", experiment: 1, estimate: 2 },
  ];
  assert.deepEqual(
    sharedEstimates(job, { parameters }).map(({ name }) => name),
    ["gain"],
  );
  const jobs = [
    { id: 1, method: "cma_es", labels: {} },
    { id: 2, method: null, labels: {} },
    { id: 3, method: "cma_es", labels: { monitor: "mon_1" } },
  ];
  assert.deepEqual(
    offeredJobs(jobs).map(({ id }) => id),
    [1],
  );
});
