// The tests call the parts of the page that judge, compare and date jobs, without a page. They run with
// `node --test tests/page/pure_job.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/${name}`, import.meta.url));
const { recordingsOfDraft } = await part("new/draft.js");
const { longestUnused, movedWindow, partWithin, specifiedWindow } = await part("plot/math.js");
const { correlationText } = await part("job/correlation.js");
const { judged } = await part("job/effects.js");
const { faultsInWords, patchOf, wordsOf } = await part("job/naming.js");
const { cellAfter } = await part("job/reading.js");
const { AxisWidths } = await part("plot/axes.js");
const { clockOf } = await part("plot/clock.js");
const { choices, recordedUnit, shownUnit, toShown } = await part("plot/units.js");
const { withGaps } = await part("plot/math.js");
const { toleranceOf } = await part("model/parameters.js");
const { failureList } = await part("list/bulk.js");
const { columnsOffered, columnsShown, USUAL, widthNeeded, widthsIn } = await part("list/columns.js");
const { arranged, estimatesAsked, fromQuery, matches, toQuery } = await part("list/filter.js");
const { entriesOf } = await part("list/groups.js");
const { namesEstimated } = await part("list/layout.js");
const { withView } = await part("list/views.js");
const { parted } = await part("model/equation.js");
const { specOf } = await part("shell/prepared.js");

test("a job that is made from another has the name and the labels that the other has now, and no note", () => {
  const job = {
    name: null,
    labels: { site: "hall 3" },
    note: "valve 7 was replaced",
    spec: {
      name: "first",
      labels: { site: "hall 2" },
      note: "valve 7 was replaced",
      model: "servo",
      seed: 7,
    },
  };
  assert.deepEqual(specOf(job), { name: null, labels: { site: "hall 3" }, model: "servo", seed: 7 });
});

test("a change of what a job is called has only what was changed", () => {
  const job = { name: "rig 4", labels: { site: "hall 2", "a/b": "1", follows: "job_1" }, note: "x\r\ny" };
  const before = wordsOf(job);
  assert.deepEqual(before, {
    name: "rig 4",
    labels: [
      { name: "site", value: "hall 2" },
      { name: "a/b", value: "1" },
    ],
    note: "x\ny",
  });
  assert.deepEqual(patchOf(before, before), {});
  const labels = [
    { name: "a/b", value: "2" },
    { name: "shift", value: "" },
  ];
  assert.deepEqual(patchOf(before, { ...before, labels }), {
    labels: { site: null, "a/b": "2", shift: "" },
  });
  assert.deepEqual(patchOf(before, { ...before, name: "", note: " \n" }), { name: null, note: null });
  assert.deepEqual(patchOf(wordsOf({ name: null, labels: {} }), { ...before, labels: [] }), {
    name: "rig 4",
    note: "x\ny",
  });
  const faults = ["/labels/a~1b", "/labels/gone", "/note"].map((pointer) => ({ pointer, detail: "wrong" }));
  assert.deepEqual(
    faultsInWords(before, faults).map(({ pointer }) => pointer),
    ["/labels/1/value", "/labels/gone", "/note"],
  );
});

test("jobs that an action failed for are named with what failed", () => {
  const full = { message: "a job has 16 labels at the most" };
  const wrong = { message: "The request is wrong", errors: [{ detail: "too long" }] };
  const failures = ["a", "b", "c", "d", "e"].map((name) => ({ job: { name }, error: full }));
  assert.deepEqual(failureList([...failures, { job: { model: "servo" }, error: wrong }]), [
    { detail: "a, b, c and 2 more: a job has 16 labels at the most" },
    { detail: "unnamed, servo: too long" },
  ]);
});

test("an effect is judged by the best model with it against the best model without it", () => {
  const model = (effects, bic) => ({ effects, bic, unknowns: 2, estimation: {}, validation: {} });
  const search = {
    supported: ["friction"],
    compared_on: "validation",
    tried: [
      model(["friction"], 10),
      model(["friction", "delay"], 19),
      model([], 60),
      model(["delay", "dead_band"], null),
    ],
  };
  assert.deepEqual(judged(search), [
    { name: "friction", supported: true, change: -50 },
    { name: "delay", supported: false, change: 9 },
    { name: "dead_band", supported: false, change: null },
  ]);
});

test("a clock tells the local time of each sample, also over a change of summer time", () => {
  assert.equal(clockOf({ start: null }), null);
  const clock = clockOf({ start: "2026-03-29T00:30:00Z", zone: "Europe/Berlin" });
  assert.equal(clock.text(0, 0), "2026-03-29 01:30:00");
  assert.equal(clock.text(0.25, 3), "2026-03-29 01:30:00.250");
  // At 02:00 clocks went on to 03:00.
  assert.equal(clock.text(3600, 0), "2026-03-29 03:30:00");
  assert.equal(clockOf({ start: "2026-03-29T00:30:00Z" }).text(60, 0), "2026-03-29 00:31:00");
  assert.equal(clockOf({ start: "2026-03-29T00:30:00Z", zone: "Nowhere/At_all" }).zone, "UTC");
});

test("ticks of a clock stand at round local times, and name the day where it begins", () => {
  const clock = clockOf({ start: "2026-01-01T22:52:10Z", zone: "+01:00" });
  const texts = (range, steps) => clock.ticks(range, steps).map(([, text]) => text);
  assert.deepEqual(texts([0, 1200], 5), ["23:55\n2026-01-01", "00:00\n2026-01-02", "00:05", "00:10"]);
  // The day is not cut off at the left edge.
  assert.deepEqual(texts([170, 1200], 4), ["23:55", "00:00\n2026-01-02", "00:05", "00:10"]);
  assert.deepEqual(texts([0, 2], 4), [
    "23:52:10.0",
    "23:52:10.5\n2026-01-01",
    "23:52:11.0",
    "23:52:11.5",
    "23:52:12.0",
  ]);
});

test("a signal is shown in the unit that it was recorded in, until the reader chooses another", () => {
  const signal = { recorded_unit: "degC", conversion: { factor: 1, offset: 273.15 } };
  const recorded = recordedUnit(signal);
  assert.equal(toShown(293.15, shownUnit("K", { recorded })), 20);
  assert.equal(recordedUnit({ recorded_unit: "" }), null);
  // A difference of temperatures has no zero.
  assert.deepEqual(
    choices("K", { recorded, difference: true }).map(({ name }) => name),
    ["K"],
  );
  const share = recordedUnit({ recorded_unit: "%", conversion: { factor: 0.01, offset: 0 } });
  assert.equal(toShown(0.5, shownUnit("1", { recorded: share })), 50);
});

test("a tolerance is a number, a share, or nothing", () => {
  assert.equal(toleranceOf("0,5"), 0.5);
  assert.equal(toleranceOf("1 %"), "1 %");
  assert.equal(toleranceOf(" "), undefined);
});

test("a number in a search is no part of an id", () => {
  const job = { id: "job_0198777", name: "rig 4", model: "servo", labels: {}, datasets: [] };
  assert.ok(!matches(job, { text: "777" }));
  assert.ok(matches(job, { text: "job_0198" }));
  assert.ok(!matches(job, { text: "job_777" }));
});

test("a word has no index", () => {
  assert.deepEqual(parted("area"), ["area", ""]);
  assert.deepEqual(parted("lag"), ["lag", ""]);
  assert.deepEqual(parted("Km"), ["K", "m"]);
  assert.deepEqual(parted("p1"), ["p", "1"]);
  assert.deepEqual(parted("Rth"), ["R", "th"]);
});

test("no line crosses a span without samples", () => {
  const spans = [
    { from: 2, to: 8 },
    { from: 20, to: 30 },
  ];
  assert.deepEqual(withGaps([0, 1, 2, 8, 9], [1, 2, 3, 4, 5], spans), [
    [0, 1, 2, 5, 8, 9],
    [1, 2, 3, null, 4, 5],
  ]);
  assert.deepEqual(withGaps([0, 1], [1, 2], []), [
    [0, 1],
    [1, 2],
  ]);
});

test("a correlation near one is written with its distance from one", () => {
  assert.equal(correlationText(-0.997), "−0.997");
  assert.equal(correlationText(0.5), "0.5");
  assert.equal(correlationText(null), "–");
});

test("arrow keys go from value to value of a picture, and stop at its edges", () => {
  const lengths = [3, 1, 2];
  assert.deepEqual(cellAfter(lengths, [0, 0], "ArrowRight"), [0, 1]);
  assert.equal(cellAfter(lengths, [0, 2], "ArrowRight"), null);
  assert.deepEqual(cellAfter(lengths, [0, 2], "ArrowDown"), [1, 0]);
  assert.equal(cellAfter(lengths, [0, 0], "ArrowUp"), null);
  assert.deepEqual(cellAfter(lengths, [2, 0], "End"), [2, 1]);
  assert.equal(cellAfter(lengths, [2, 0], "x"), null);
});

test("axes below each other are as wide as the widest of them needs", () => {
  let drawings = 0;
  const axes = new AxisWidths(() => {
    drawings += 1;
  });
  assert.equal(axes.widthOf("position", 40), 40);
  assert.equal(axes.widthOf("residual", 80), 80);
  assert.equal(axes.widthOf("position", 40), 80);
  assert.equal(drawings, 2);
  assert.equal(axes.widthOf("residual", 30), 40);
});

const listed = (id, more) => ({
  id,
  name: null,
  model: "servo",
  status: "succeeded",
  labels: {},
  datasets: [],
  created_at: "2026-01-01T00:00:00Z",
  ...more,
});

test("the list has the chosen columns, labels among them, and always the name", () => {
  const keys = (columns) => columns.map(({ key }) => key);
  assert.deepEqual(keys(columnsShown(["label:site", "status"])), ["status", "name", "label:site"]);
  assert.deepEqual(keys(columnsOffered(["site", "follows", "batch"])).slice(-2), [
    "label:batch",
    "label:site",
  ]);
  const text = (key, job) => columnsShown([key]).at(-1).text(job, 0);
  const job = listed("job_1", {
    labels: { site: "hall 2" },
    progress: { evaluations: 12_000, best_cost: 0.25 },
  });
  assert.equal(text("label:site", job), "hall 2");
  assert.equal(text("evaluations", job), "12\u202f000");
  assert.equal(text("cost", job), "0.25");
  assert.equal(text("cost", listed("job_2")), "–");
});

test("an estimate is a column like a label, and is asked for by its name", () => {
  const spec = {
    parameters: { mass: { estimate: { lower: 1 } }, damping: { value: 20 } },
    experiments: [{ dataset: "ds_1" }, { parameters: { load: { estimate: {} } } }],
  };
  assert.deepEqual(namesEstimated(spec), ["mass", "load[1]"]);
  const columns = ["status", "name", "estimate:mass", "estimate:load[1]"];
  const filter = fromQuery(new URLSearchParams(toQuery({ ...fromQuery(new URLSearchParams()), columns })));
  assert.deepEqual(estimatesAsked(filter), ["mass", "load[1]"]);
  assert.deepEqual(estimatesAsked({ columns: ["status"], sort: "estimate:mass" }), ["mass"]);
  const many = Array.from({ length: 30 }, (_, k) => `estimate:p${k}`);
  assert.equal(estimatesAsked({ columns: many, sort: "created" }).length, 20);

  const [, , load, mass] = columnsShown(columns);
  assert.deepEqual([mass.title, load.title, mass.numeric], ["mass", "load, experiment 2", true]);
  const job = (id, estimate) => listed(id, { estimates: estimate ? { mass: estimate } : {} });
  const about = { value: 95.0112, unit: "kg", total_error: 0.42, trust: "high" };
  assert.equal(mass.text(job("job_1", about), 0), "95.01 ± 0.42\u00a0kg");
  assert.equal(mass.text(job("job_1", { ...about, unit: null, total_error: null }), 0), "95.0112");
  assert.equal(mass.text(job("job_2"), 0), "");
  assert.equal(mass.text(listed("job_3"), 0), "");
  // A number is never cut: the least width has room for the longest.
  assert.ok(widthNeeded(mass, [job("job_1", about)], 0).least > 7 * 15);
});

test("jobs are sorted by an estimate, and those without it come last in either direction", () => {
  const value = (id, mass) => listed(id, { estimates: mass === null ? {} : { mass: { value: mass } } });
  const jobs = [value("job_1", null), value("job_2", -3), value("job_3", 40), value("job_4", 5)];
  const order = (descending) =>
    arranged(jobs, { sort: "estimate:mass", descending }, 0).map(({ id }) => id.slice(-1));
  assert.deepEqual(order(false), ["2", "4", "3", "1"]);
  assert.deepEqual(order(true), ["3", "4", "2", "1"]);
});

test("a job is found by words of its note", () => {
  const job = listed("job_1", { name: "press 7", note: "The valve was\nreplaced before this." });
  assert.ok(matches(job, { text: "REPLACED press" }));
  assert.ok(!matches(job, { text: "pump" }));
});

test("columns are as wide as their texts where there is room, and give way where there is not", () => {
  const [name] = columnsShown([]);
  const long = "x".repeat(40);
  const { least, wanted } = widthNeeded(name, [listed("job_1", { name: long })], 0);
  assert.ok(wanted > least && wanted > 7 * 40);
  const needs = [
    { least: 50, wanted: 100 },
    { least: 50, wanted: 300 },
  ];
  assert.deepEqual(widthsIn(needs, 800), [200, 600]);
  assert.deepEqual(widthsIn(needs, 250), [75, 175]);
  assert.deepEqual(widthsIn(needs, 10), [50, 50]);
});

test("grouping and columns go into the address, and a view says them even where they are usual", () => {
  const usual = { group: "", columns: USUAL };
  const read = (query) => fromQuery(new URLSearchParams(query), usual);
  const filter = read("text=rig&group=label:site&columns=status,name,label:site&sort=label:site:up");
  assert.equal(filter.sort, "label:site");
  assert.deepEqual(read(toQuery(filter, usual).slice(1)), filter);
  assert.equal(toQuery(read(""), usual), "");
  assert.match(toQuery(read(""), usual, true), /group=&columns=status/);
});

test("jobs are sorted by a label, and grouped by it under headings that can be closed", () => {
  const jobs = [
    listed("job_1", { labels: { site: "hall 10" } }),
    listed("job_2", { labels: { site: "hall 2" } }),
    listed("job_3"),
    listed("job_4", { labels: { site: "hall 2" } }),
  ];
  const sorted = arranged(jobs, { sort: "label:site", descending: false }, 0);
  assert.deepEqual(
    sorted.map(({ id }) => id),
    ["job_3", "job_1", "job_4", "job_2"],
  );
  const shown = (closed) =>
    entriesOf(jobs, "label:site", new Set(closed)).map(({ id, title, size }) => (title ? [title, size] : id));
  assert.deepEqual(shown([]), [
    ["hall 2", 2],
    "job_2",
    "job_4",
    ["hall 10", 1],
    "job_1",
    ["none", 1],
    "job_3",
  ]);
  assert.deepEqual(shown(["group hall 2"]).slice(0, 2), [
    ["hall 2", 2],
    ["hall 10", 1],
  ]);
  assert.deepEqual(
    entriesOf(jobs, "", new Set()).map(({ id }) => id),
    jobs.map(({ id }) => id),
  );
});

test("a saved view takes the place of a view of the same name", () => {
  const views = withView(withView([], { name: "low", query: "?trust=low" }), { name: "all", query: "" });
  assert.deepEqual(withView(views, { name: "low", query: "?trust=low&group=model" }), [
    { name: "all", query: "" },
    { name: "low", query: "?trust=low&group=model" },
  ]);
});

test("windows of a recording keep within it, and the longest unused part is told", () => {
  assert.deepEqual(partWithin([7, -1], 6), [0, 6]);
  const window = { from: 1, to: 3, role: "validation" };
  assert.deepEqual(movedWindow(window, 10, 6), { from: 4, to: 6, role: "validation" });
  assert.deepEqual(movedWindow(window, -10, 6), { from: 0, to: 2, role: "validation" });
  assert.deepEqual(longestUnused([], 6), [0, 6]);
  assert.deepEqual(
    longestUnused(
      [
        { from: 3, to: 4 },
        { from: 0, to: 1 },
      ],
      6,
    ),
    [1, 3],
  );
  assert.equal(longestUnused([{ from: 0, to: 6 }], 6), null);
  assert.equal(specifiedWindow({ from: 0, to: 6 }, 6), undefined);
  assert.deepEqual(specifiedWindow({ from: 1, to: 6 }, 6), { from_s: 1 });
});

test("experiments of the same recording and signals are windows of it", () => {
  const drive = { dataset: "ds_1", signals: { force: "F" } };
  const experiments = [
    { ...drive, window: { to_s: 1 } },
    { dataset: "ds_2" },
    { ...drive, window: { from_s: 2 }, role: "validation" },
    { dataset: "ds_1", signals: { force: "G" } },
  ];
  assert.deepEqual(recordingsOfDraft(experiments), [
    { dataset: "ds_1", places: [0, 2] },
    { dataset: "ds_2", places: [1] },
    { dataset: "ds_1", places: [3] },
  ]);
});

test("the time left is told by jobs that took longer, where these are enough, and by the limit of the job", async () => {
  const { timeLeftText } = await part("job/time_left.js");
  const left = { jobs: 40, longer: 12, half_s: 8, nine_in_ten_s: 30 };
  assert.equal(
    timeLeftText(left, 240),
    "of 12 jobs of this model that took longer than this has, half ended within 8 s, nine in ten within 30 s; at most 4 min",
  );
  const few = { jobs: 3, longer: 2, half_s: null, nine_in_ten_s: null };
  assert.equal(timeLeftText(few, 240), "at most 4 min; most searches end earlier");
  assert.equal(timeLeftText(null, null), "");
});
