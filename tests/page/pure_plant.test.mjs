// The tests call the parts of the pages about the plant that need no page. They run with `node --test
// tests/page/pure_plant.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

// The clock of the reader is set before the modules make their formats.
process.env.TZ = "Europe/Berlin";
const part = (name) => import(new URL(`../../src/dashboard/assets/${name}`, import.meta.url));
const { isoText, READER } = await part("plot/clock.js");
const { pause } = await part("shell/api.js");
const { duration, size } = await part("shell/format.js");
const { fieldSeconds, fieldText, isoAfter, isoBefore, secondsOf, wholeOf } = await part("plant/instants.js");
const { columnOf, pointsFor, summaryOf } = await part("plant/samples.js");
const { alarmSpans, mergedWindows, parametersOf, rangeOfWindows, trendOf } = await part("plant/trend.js");
const { driftWith, likeMonitor, missingParts, searchedNames, signalsIn, templateOf } =
  await part("plant/plan.js");
const {
  faultsInForm,
  formOf,
  isNamed,
  nameFaults,
  qualityText,
  ruleText,
  rulesOf,
  streamName,
  textOf,
  withPlaces,
} = await part("plant/places.js");
const { matchingEntries, methodText } = await part("plant/entries.js");

const NOON = secondsOf("2026-03-02T11:00:00Z");

test("the ticks of a clock are round in the zone of the reader", () => {
  const texts = (from, to, steps) => READER.ticks([from, to], steps).map(([, text]) => text);
  // The date stands at the second tick, where the first would cut it off.
  assert.deepEqual(texts(NOON, NOON + 3600, 4).slice(0, 2), ["12:00", "12:15\n2026-03-02"]);
  assert.deepEqual(
    texts(NOON + 0.2, NOON + 1, 4).map((text) => text.split("\n")[0]),
    ["12:00:00.2", "12:00:00.4", "12:00:00.6", "12:00:00.8", "12:00:01.0"],
  );
  const seconds = READER.ticks([NOON, NOON + 20], 4).map(([instant]) => instant - NOON);
  assert.deepEqual(seconds, [0, 5, 10, 15, 20]);
});

test("the ticks of days and months stand at midnight, also when clocks are changed", () => {
  const days = READER.ticks([secondsOf("2026-03-27T12:00:00Z"), secondsOf("2026-03-31T12:00:00Z")], 4);
  assert.deepEqual(
    days.map(([instant]) => new Date(1000 * instant).getHours()),
    [0, 0, 0, 0],
  );
  const months = READER.ticks([secondsOf("2025-11-20T00:00:00Z"), secondsOf("2026-06-20T00:00:00Z")], 4);
  assert.ok(months.every(([instant]) => new Date(1000 * instant).getDate() === 1));
  assert.ok(
    months.some(([, text]) => text.endsWith("\n2026")),
    "the year stands where it begins",
  );
  const years = READER.ticks([secondsOf("1990-01-01T00:00:00Z"), secondsOf("2026-01-01T00:00:00Z")], 5);
  assert.ok(years.length >= 3 && years.length < 12, `${years.length} ticks`);
});

test("an instant is read and written to the millisecond", () => {
  assert.match(READER.text(NOON + 0.25), /12:00:00\.250$/);
  assert.equal(isoText(NOON + 0.25), "2026-03-02T11:00:00.250Z");
  assert.equal(fieldText(NOON), "2026-03-02T12:00:00.000");
  assert.equal(fieldSeconds(fieldText(NOON + 0.125)), NOON + 0.125);
  assert.ok(Number.isNaN(fieldSeconds("")));
  assert.equal(isoBefore(NOON + 0.0104), "2026-03-02T11:00:00.010Z");
  assert.equal(isoAfter(NOON + 0.0104), "2026-03-02T11:00:00.011Z");
  assert.equal(isoBefore(NOON + 0.01), "2026-03-02T11:00:00.010Z");
  assert.equal(isoAfter(NOON + 0.01), "2026-03-02T11:00:00.010Z");
});

test("the whole of a stream has the last sample, though a part ends before its end", () => {
  const [from, to] = wholeOf({ first: "2026-03-02T11:00:00.0004Z", last: "2026-03-02T11:00:05.9996Z" });
  assert.equal(isoText(from), "2026-03-02T11:00:00.000Z");
  assert.equal(isoText(to), "2026-03-02T11:00:06.000Z");
});

test("long spans and sizes are written as people say them", () => {
  assert.equal(duration(48 * 3600), "48 h 0 min");
  assert.equal(duration(100 * 3600), "4 d 4 h");
  assert.deepEqual(
    [size(300), size(252_000), size(5 * 1024 ** 3), size(0)],
    ["300 B", "246 KiB", "5 GiB", "0 B"],
  );
});

const SAMPLES = {
  start: "2026-03-02T11:00:00Z",
  samples: {
    time_s: [0, 1, 2, 4],
    signals: { slow: { values: [1, null, null, 3] }, quick: { values: [0, 5, -5, 0] } },
  },
};

test("a signal has the instants at which it was sampled, and a mean over time", () => {
  const slow = columnOf(SAMPLES, "slow");
  assert.deepEqual(slow, [
    [NOON, NOON + 4],
    [1, 3],
  ]);
  const all = [NOON, NOON + 4];
  assert.deepEqual(summaryOf(slow, all), { least: 1, mean: 2, greatest: 3 });
  assert.deepEqual(summaryOf(columnOf(SAMPLES, "quick"), all), { least: -5, mean: -0.625, greatest: 5 });
  assert.deepEqual(summaryOf(slow, [NOON + 3, NOON + 9]), { least: 3, mean: 3, greatest: 3 });
  assert.equal(summaryOf(slow, [NOON + 5, NOON + 9]).mean, null);
  assert.deepEqual(columnOf({ start: null, samples: null }, "slow"), [[], []]);
});

test("a stream of many signals is asked for fewer instants", () => {
  assert.equal(pointsFor(2, 1000), 10_000);
  assert.equal(pointsFor(10, 1000), 20_000);
  assert.equal(pointsFor(400, 1000), 5000);
});

const windowOf = (number, estimate, more = {}) => ({
  number,
  from: `2026-03-02T11:0${number}:00Z`,
  to: `2026-03-02T11:0${number + 1}:00Z`,
  parameters: estimate === null ? [] : [{ name: "mass", unit: "kg", estimate, ...more }],
});

test("a parameter over the windows has the total interval, else that of the data", () => {
  const windows = [
    windowOf(0, 95, {
      total_interval: { lower: 94, upper: 96 },
      confidence_interval: { lower: 94.5, upper: 95.5 },
    }),
    windowOf(1, null),
    windowOf(2, 99, { total_interval: null, confidence_interval: { lower: 98, upper: 100 } }),
  ];
  const { times, columns } = trendOf(windows, "mass");
  assert.equal(times[0], NOON + 30);
  assert.deepEqual(columns, [
    [95, null, 99],
    [94, null, 98],
    [96, null, 100],
  ]);
  assert.deepEqual(parametersOf(windows), [{ name: "mass", unit: "kg" }]);
  const [from, to] = rangeOfWindows(windows);
  assert.ok(from < NOON && to > NOON + 180);
});

test("an alarm stands in the plot of what has changed, and an alarm about a window in all", () => {
  const windows = [windowOf(0, 95), windowOf(1, 99)];
  const alarms = [
    { kind: "change", window: 1, change: { parameter: "mass" } },
    { kind: "trust_fell", window: 0 },
    { kind: "data_stopped" },
  ];
  assert.equal(alarmSpans(alarms, windows, "mass").length, 2);
  assert.deepEqual(alarmSpans(alarms, windows, "friction"), [{ from: NOON, to: NOON + 60, kind: "alarm" }]);
});

test("a newer state of a window takes the place of the former state", () => {
  const merged = mergedWindows([windowOf(1, null), windowOf(2, 7)], [windowOf(1, 95), windowOf(0, 94)]);
  assert.deepEqual(
    merged.map(({ number, parameters }) => [number, parameters[0].estimate]),
    [
      [0, 94],
      [1, 95],
      [2, 7],
    ],
  );
});

const MODEL = {
  inputs: [{ name: "force", symbol: "F", unit: "N" }],
  outputs: [{ name: "position", symbol: "x", unit: "m" }],
  parameters: [
    { name: "mass", unit: "kg", default: 50, lower: 20, upper: 120, scale: "log", unknown_by_default: true },
    { name: "delay", unit: "s", default: 0, lower: 0, upper: 1, scale: "linear", unknown_by_default: false },
  ],
};
const STREAM = {
  signals: [
    { name: "drive_force", unit: "N" },
    { name: "position", unit: "m" },
  ],
};

test("the job of a monitor leaves out what belongs to a recording", () => {
  const job = {
    name: "commissioning",
    seed: 7,
    model: "drive",
    validation: { fraction: 0.25 },
    experiments: [
      { dataset: "ds_1", role: "validation" },
      {
        dataset: "ds_2",
        window: { from_s: 1 },
        role: "estimation",
        exclude: { classes: ["outliers"], spans: [{ from_s: 1, to_s: 2 }] },
        initial_state: { velocity: 0 },
        signals: { force: "drive_force", position: "position" },
      },
    ],
  };
  assert.deepEqual(templateOf(job, STREAM, MODEL), {
    model: "drive",
    validation: { fraction: 0.25 },
    experiments: [
      {
        exclude: { classes: ["outliers"] },
        initial_state: { velocity: 0 },
        signals: { force: "drive_force", position: "position" },
      },
    ],
  });
});

test("signals that a stream has not are looked for by name and unit", () => {
  const signals = { force: "u", position: "y" };
  assert.deepEqual(signalsIn(STREAM, signals, MODEL), { force: "drive_force", position: "position" });
  assert.deepEqual(signalsIn(null, signals, MODEL), signals);
});

test("the form knows what is looked for and what is still needed", () => {
  assert.deepEqual(
    searchedNames(MODEL, { parameters: { delay: { estimate: {} } } }).map(({ name }) => name),
    ["mass", "delay"],
  );
  assert.deepEqual(missingParts({ stream: "rig", window: {} }), ["a job", "the length of a window"]);
  const like = likeMonitor({ stream: "rig", window: { length_s: 6, from: "2026-03-02T11:00:00Z" } });
  assert.deepEqual(like, { stream: "rig", window: { length_s: 6 } });
});

test("a drift is that of a day unless another time is said", () => {
  assert.deepEqual(driftWith(undefined, 0.5), { per_s: 86_400, std: 0.5 });
  assert.deepEqual(driftWith({ std: 0.5, per_s: 60 }, 2), { per_s: 60, std: 2 });
  assert.equal(driftWith({ std: 0.5, per_s: 60 }, undefined), undefined);
});

test("entries of the audit log are searched by every word, by method and by outcome", () => {
  const entries = [
    { who: "token mes", method: "POST", path: "/v1/jobs", status: 201 },
    { who: "unknown", method: "GET", path: "/v1/jobs", status: 401 },
    { who: "operator", method: "COMMAND", path: "token create --name mes", status: 200 },
  ];
  const count = (filter) => matchingEntries(entries, filter).length;
  assert.equal(count({}), 3);
  assert.equal(count({ text: "MES jobs" }), 1);
  assert.equal(count({ text: "mes" }), 2);
  assert.equal(count({ method: "GET" }), 1);
  assert.equal(count({ outcome: "refused" }), 1);
  assert.equal(count({ outcome: "done", text: "jobs" }), 1);
  assert.equal(methodText("COMMAND"), "a command");
});

test("nobody waits for a view that was left", async () => {
  await assert.rejects(pause(0, AbortSignal.abort()), { name: "AbortError" });
});

const SERIES = [
  { measurement: "rig", tags: { hall: "2", line: "a" }, field: "position", last_value: 101.2 },
  { measurement: "rig", tags: { hall: "2", line: "a" }, field: "on", last_value: true },
  { measurement: "rig", tags: { hall: "2", line: "a" }, field: "state", last_value: "idle" },
  { measurement: "rig", tags: { hall: "2" }, field: "position", last_value: 3 },
];

test("series that no rule names get places, those of the same measurement and tags in the same rule", () => {
  const rules = withPlaces([], SERIES);
  assert.deepEqual(rulesOf(rules), [
    {
      measurement: "rig",
      tags: { hall: "2", line: "a" },
      stream: "rig-2-a",
      signals: { position: { signal: "position" }, on: { signal: "on" } },
    },
    {
      measurement: "rig",
      tags: { hall: "2" },
      stream: "rig-2",
      signals: { position: { signal: "position" } },
    },
  ]);
  assert.equal(ruleText(rules[0]), "rig, hall=2, line=a → rig-2-a: position, on");
  assert.equal(withPlaces(rules, SERIES), rules, "a series with a place gets no further one");
  assert.ok(!isNamed(rules, SERIES[2]), "a stream has no texts");
  assert.ok(
    isNamed(formOf([{ measurement: "rig", stream: "s", signals: { on: { signal: "on" } } }]), SERIES[1]),
  );
});

test("a place leaves the streams and signals of other series alone", () => {
  const [rule] = withPlaces([], [SERIES[3]]);
  const renamed = [{ ...rule, fields: [{ field: "position", signal: "speed" }] }];
  const [extended] = withPlaces(renamed, [{ ...SERIES[3], field: "speed" }]);
  assert.deepEqual(
    extended.fields.map(({ signal }) => signal),
    ["speed", "speed-2"],
  );
  const alike = withPlaces([rule], [{ measurement: "rig", tags: { line: "2" }, field: "x" }]);
  assert.equal(alike[1].stream, "rig-2-2");
});

test("the name of a stream has the characters that a stream may have", () => {
  assert.equal(streamName({ measurement: "Öl druck", tags: { at: "hall/2 °C" } }), "Ol_druck-hall_2_C");
  assert.match(streamName({ measurement: "x".repeat(300), tags: {} }), /^x{100}$/);
  const long = { measurement: "x".repeat(300), field: "f" };
  const names = withPlaces(
    [],
    [
      { ...long, tags: { a: "1" } },
      { ...long, tags: { a: "2" } },
    ],
  ).map(({ stream }) => stream);
  assert.deepEqual(names, ["x".repeat(100), `${"x".repeat(98)}-2`]);
});

test("the rules of a form are those of the mapping, and faults come to their fields", () => {
  const stored = [
    {
      measurement: "rig",
      tags: { "a/b": "" },
      stream: "rig",
      signals: { on: { signal: "on", unit: "", interpolation: "hold" }, "p~q": { signal: "", unit: "zz" } },
    },
  ];
  const rules = formOf(stored);
  const [{ signals }] = rulesOf(rules);
  assert.deepEqual(signals.on, { signal: "on", interpolation: "hold" });
  assert.equal(textOf(rules), textOf(formOf(rulesOf(rules))));
  const faults = ["tags/a~1b", "signals/p~0q/unit", "signals/on", "stream"].map((place) => ({
    pointer: `/rules/0/${place}`,
    detail: "wrong",
  }));
  assert.deepEqual(
    faultsInForm(rules, faults).map(({ pointer }) => pointer),
    ["tags/0/value", "fields/1/unit", "fields/0", "stream"].map((place) => `/rules/0/${place}`),
  );
  assert.deepEqual(nameFaults(rules), []);
  const fields = [...rules[0].fields, { field: "on", signal: "x" }, { field: "", signal: "y" }];
  assert.deepEqual(nameFaults([{ ...rules[0], fields }]), [
    { pointer: "/rules/0/fields/2/field", detail: "the rule has this field already" },
    { pointer: "/rules/0/fields/3/field", detail: "the field has no name" },
  ]);
});

test("a rule keeps what says how good its fields are, and leaves out a quality that says nothing", () => {
  const rule = { measurement: "rig", tags: {}, stream: "rig", signals: { codes: { signal: "p" } } };
  const quality = { fields: ["Quality", "Status"], codes: "opc_ua" };
  const stored = [
    { ...rule, quality },
    { ...rule, quality: { codes: "words" } },
    { ...rule, quality: { fields: ["Quality"] } },
    rule,
  ];
  const rules = formOf(stored);
  assert.deepEqual(rulesOf(rules), stored);
  assert.deepEqual(rulesOf(formOf([{ ...rule, quality: {} }])), [rule]);
  assert.equal(new Set(rules.map((shown) => textOf([shown]))).size, stored.length);
  assert.deepEqual(
    rules.map((shown) => qualityText(shown.quality)),
    ["Quality, Status: opc ua", "words", "Quality", ""],
  );
  const quick = { measurement: "rig", tags: {}, field: "Quality", last_value: "Good" };
  assert.ok(isNamed([rules[0]], quick) && !isNamed([rules[1]], quick));
  // A field of the rule may be called as a member of the quality.
  const pointers = ["quality/codes", "quality/fields/0", "signals/codes"].map((place) => `/rules/0/${place}`);
  assert.deepEqual(
    faultsInForm(
      rules,
      pointers.map((pointer) => ({ pointer, detail: "wrong" })),
    ).map(({ pointer }) => pointer),
    ["quality/codes", "quality/fields/0", "fields/0"].map((place) => `/rules/0/${place}`),
  );
});
