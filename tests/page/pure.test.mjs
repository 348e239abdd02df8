// The tests call the parts of the page that need no page. They run with `node --test
// tests/page/pure.test.mjs`.

import assert from "node:assert/strict";
import test from "node:test";

const part = (name) => import(new URL(`../../src/dashboard/assets/${name}`, import.meta.url));
const { changed, conditionsOf, conditionText, labelText, labelsOf, patched, priorOfResult, withModel } =
  await part("new/draft.js");
const { entryOf, parameterRows } = await part("model/parameters.js");
const { inputSet, likeness, suggestSignals } = await part("model/signals.js");
const { numberOf } = await part("shell/format.js");
const { arranged, fromQuery, matches, seconds, toQuery } = await part("list/filter.js");
const { commonRange, differences, place, sideBySide } = await part("compare/differences.js");
const { parse, parted } = await part("model/equation.js");
const { describedBy, equationsOf, MODEL_WORDS, namesOf, wordsAt } = await part("model/language.js");
const { asYaml, placed, readText } = await part("text/document.js");
const { excitationOf, STEP_SAMPLES, stepOf } = await part("model/excitation.js");
const { lineOf } = await part("model/picture.js");
const { profileCurve } = await part("plot/math.js");
const yaml = await part("vendor/codemirror-6.43.15.min.js");

const MASS = {
  name: "mass",
  symbol: "M",
  unit: "kg",
  default: 50,
  lower: 20,
  upper: 120,
  scale: "linear",
  unknown_by_default: true,
};
const SUPPLY = {
  name: "supply_pressure",
  symbol: "ps",
  unit: "Pa",
  default: 7e6,
  lower: 1e6,
  upper: 3e7,
  scale: "linear",
  unknown_by_default: false,
};
const MODEL = {
  name: "servo",
  parameters: [MASS, SUPPLY],
  inputs: [
    { name: "reference", symbol: "r", unit: "m" },
    { name: "command", symbol: "u", unit: "1" },
  ],
  input_sets: [["reference"], ["command"]],
  outputs: [
    { name: "position", symbol: "x", unit: "m" },
    { name: "pressure", symbol: "p1", unit: "Pa" },
  ],
};

test("signals are found by name, symbol and unit", () => {
  const recorded = [
    { name: "Valve_Command", unit: "1" },
    { name: "cyl.position", unit: "m" },
    { name: "p1", unit: "Pa" },
  ];
  assert.deepEqual(suggestSignals(MODEL, recorded), {
    inputs: ["command"],
    signals: { command: "Valve_Command", position: "cyl.position", pressure: "p1" },
    score: suggestSignals(MODEL, recorded).score,
  });
  assert.ok(likeness(MODEL.outputs[0], { name: "speed", unit: "m/s" }) < 2);
  assert.ok(
    likeness(MODEL.outputs[0], { name: "position", unit: "m" }) >
      likeness(MODEL.outputs[0], { name: "position_filtered", unit: "m" }),
  );
});

test("the set of inputs is the one whose signals are named", () => {
  assert.deepEqual(inputSet(MODEL, { command: "u" }), ["command"]);
  assert.deepEqual(inputSet(MODEL, {}), ["reference"]);
});

test("a change at a path leaves the rest alone and leaves out what is empty", () => {
  const spec = { model: "servo", experiments: [{ dataset: "a" }, { dataset: "b" }] };
  const windowed = changed(spec, ["experiments", 1, "window", "from_s"], 3);
  assert.deepEqual(windowed.experiments, [{ dataset: "a" }, { dataset: "b", window: { from_s: 3 } }]);
  assert.deepEqual(changed(windowed, ["experiments", 1, "window", "from_s"], undefined), spec);
  assert.deepEqual(changed(spec, ["experiments", 0], undefined).experiments, [{ dataset: "b" }]);
  assert.deepEqual(spec.experiments.length, 2);
});

test("a specification says of a parameter only what the model does not", () => {
  const [mass, supply] = parameterRows(MODEL, {});
  assert.equal(entryOf(mass), undefined);
  assert.equal(entryOf(supply), undefined);
  assert.deepEqual(entryOf({ ...mass, upper: 90 }), { estimate: { upper: 90 } });
  assert.deepEqual(entryOf({ ...mass, start: 60 }), { estimate: { start: 60 } });
  assert.deepEqual(entryOf({ ...mass, free: false, value: 58, tolerance: "1 %" }), {
    value: 58,
    tolerance: "1 %",
  });
  assert.deepEqual(entryOf({ ...supply, free: true, prior: { range_95: [6e6, 8e6] } }), {
    estimate: {},
    prior: { range_95: [6e6, 8e6] },
  });
  assert.deepEqual(entryOf({ ...supply, tolerance: "7e4" }), { value: 7e6, tolerance: 7e4 });
  const entries = { mass: { estimate: { upper: 90 } } };
  assert.deepEqual(entryOf(parameterRows(MODEL, entries)[0]), entries.mass);
});

test("another model keeps the recordings and looks for its own signals", () => {
  const datasets = new Map([
    [
      "ds",
      {
        id: "ds",
        signals: [
          { name: "command", unit: "1" },
          { name: "position", unit: "m" },
        ],
      },
    ],
  ]);
  const spec = withModel(
    {
      name: "n",
      parameters: { old: {} },
      experiments: [{ dataset: "ds", window: { to_s: 5 }, parameters: { old: {} } }],
    },
    MODEL,
    datasets,
  );
  assert.deepEqual(spec, {
    name: "n",
    model: "servo",
    experiments: [
      { dataset: "ds", window: { to_s: 5 }, signals: { command: "command", position: "position" } },
    ],
  });
});

test("conditions are parted by semicolons, and forgotten with the model", () => {
  assert.deepEqual(conditionsOf(" tau1 < tau2 ; k1 + k2 <= 1;"), ["tau1 < tau2", "k1 + k2 <= 1"]);
  assert.equal(conditionsOf(" ; "), undefined);
  assert.equal(conditionText(["a < b", "b < c"]), "a < b; b < c");
  const spec = { constraints: ["a < b"], priors: [{ parameters: ["a"] }], experiments: [] };
  assert.deepEqual(withModel(spec, MODEL, new Map()), { model: "servo", experiments: [] });
});

test("what a job found is a prior with its total errors and correlations", () => {
  const estimateOf = (name, estimate, rest) => ({ name, estimate, experiment: null, ...rest });
  const result = {
    parameters: [
      estimateOf("mass", 58, { standard_error: 1, total_standard_error: 2 }),
      estimateOf("damping", 400, { standard_error: 9 }),
      estimateOf("offset", 3, { standard_error: null }),
      { ...estimateOf("mass", 4, { standard_error: 1 }), experiment: 1 },
    ],
    correlation: {
      names: ["mass", "offset", "damping"],
      matrix: [
        [1, 0.1, 0.3],
        [0.1, 1, null],
        [0.3, null, 1],
      ],
    },
  };
  assert.deepEqual(priorOfResult(result), {
    parameters: ["mass", "damping"],
    mean: [58, 400],
    std: [2, 9],
    correlation: [
      [1, 0.3],
      [0.3, 1],
    ],
  });
  assert.equal(priorOfResult({ parameters: [estimateOf("offset", 3, { standard_error: null })] }), undefined);
});

test("labels and numbers are read as people type them", () => {
  assert.deepEqual(labelsOf("site=hall 2, rig:4, urgent"), { site: "hall 2", rig: "4", urgent: "" });
  assert.equal(labelText({ site: "hall 2", urgent: "" }), "site=hall 2, urgent");
  assert.equal(labelsOf("  "), undefined);
  assert.deepEqual(["1,5", "−2e3", " 7 000 "].map(numberOf), [1.5, -2000, 7000]);
  assert.ok(Number.isNaN(numberOf("")) && Number.isNaN(numberOf("1.2.3")));
});

const job = (id, more) => ({
  id,
  name: null,
  labels: {},
  status: "succeeded",
  model: "servo",
  method: "cma_es",
  datasets: [],
  trust: null,
  created_at: "2026-01-01T00:00:00Z",
  started_at: null,
  finished_at: null,
  ...more,
});

test("jobs are found by every word, by trust, label and recording", () => {
  const cylinder = job("job_1", {
    name: "Rig 4",
    labels: { site: "hall 2" },
    datasets: [{ id: "ds_1", name: "run 3" }],
    trust: "low",
  });
  const passes = (query) => matches(cylinder, fromQuery(new URLSearchParams(query)));
  assert.ok(
    passes("text=rig run") &&
      passes("text=HALL") &&
      passes("trust=low") &&
      passes("label=site") &&
      passes("label=site:hall 2") &&
      passes("dataset=ds_1"),
  );
  assert.ok(
    !passes("text=rig run 5") &&
      !passes("trust=none") &&
      !passes("label=site:hall 3") &&
      !passes("model=tank") &&
      !passes("status=failed"),
  );
  assert.ok(matches(job("job_2"), fromQuery(new URLSearchParams("trust=none"))));
});

test("what is looked for goes into the address and comes back", () => {
  const filter = fromQuery(new URLSearchParams("text=rig+4&trust=low&sort=duration:up"));
  assert.deepEqual(fromQuery(new URLSearchParams(toQuery(filter).slice(1))), filter);
  assert.equal(toQuery(fromQuery(new URLSearchParams(""))), "");
});

test("jobs are sorted, alike ones newest first", () => {
  const jobs = [
    job("job_1", { trust: "low" }),
    job("job_2", { trust: "high" }),
    job("job_3", { trust: "low" }),
  ];
  const trusts = ["low", "moderate", "high"];
  const ids = (query) =>
    arranged(jobs, { ...fromQuery(new URLSearchParams(query)), trusts }, 0).map(({ id }) => id);
  assert.deepEqual(ids(""), ["job_3", "job_2", "job_1"]);
  assert.deepEqual(ids("sort=trust:down"), ["job_2", "job_3", "job_1"]);
  assert.deepEqual(ids("sort=trust:up"), ["job_3", "job_1", "job_2"]);
  assert.equal(seconds({ started_at: "2026-01-01T00:00:00Z", finished_at: "2026-01-01T00:01:30Z" }, 0), 90);
});

test("specifications are told apart leaf by leaf", () => {
  const changes = differences([{ a: { b: 1, "c/d": [1, 2] }, e: {} }, { a: { b: 1, "c/d": [1, 3] } }]);
  assert.deepEqual(changes, [
    ["/a/c~1d/1", [2, 3]],
    ["/e", ["{}", undefined]],
  ]);
});

test("estimates stand side by side on a range that shows them all", () => {
  const result = (estimate, lower, upper) => ({
    parameters: [{ name: "mass", unit: "kg", estimate, confidence_interval: { lower, upper } }],
  });
  const [row] = sideBySide([result(10, 9, 11), null, result(12, 11, null)]);
  assert.equal(row.key, "mass");
  assert.equal(row.parameters[1], null);
  const range = commonRange(row.parameters);
  assert.ok(!range.log && range.low < 9 && range.high > 12);
  assert.equal(place(range.low, range), 0);
  const wide = commonRange(sideBySide([result(1, 0.1, 1000)])[0].parameters);
  assert.ok(wide.log && Math.abs(place(10, wide) - 0.5) < 1e-9);
});

test("equations are read with their precedence", () => {
  assert.deepEqual(parse("x' = -a*b^2/c"), [
    "row",
    ["primed", ["name", "x"], 1],
    ["relation", "="],
    [
      "fraction",
      ["infix", "*", ["prefix", "-", ["name", "a"]], ["power", ["name", "b"], ["number", "2"]]],
      ["name", "c"],
    ],
  ]);
  assert.equal(parse("two words"), null);
  assert.equal(parse("(a"), null);
  assert.deepEqual(
    [parted("Km"), parted("tau1"), parted("v"), parted("command")],
    [
      ["K", "m"],
      ["τ", "1"],
      ["v", ""],
      ["command", ""],
    ],
  );
});

const { conclusions, listed } = await part("job/verdict.js");

const RULES = [
  { code: "misfit", family: "misfit", title: "The model misses an effect", advice: "Free one." },
  { code: "residuals_not_white", family: "misfit", title: "Residuals with a memory", advice: "" },
  { code: "not_identifiable", family: "not_identifiable", title: "Not fixed", advice: "Give one." },
  { code: "correlated", family: "not_identifiable", title: "Known together", advice: "" },
];
const step = (label) => ({ label, why: "", patch: {} });

test("reasons of one family about the same parameters become one sentence with their next steps", () => {
  const reason = (code, concerns, ...labels) => ({
    code,
    detail: `${code} detail`,
    concerns,
    next: labels.map(step),
  });
  const reasons = [
    reason("misfit", undefined, "Free friction"),
    reason("correlated", ["mass", "gain"], "Fix mass", "Fix gain"),
    reason("not_identifiable", ["stiffness"], "Fix stiffness"),
    reason("correlated", ["gain", "stiffness"], "Fix gain", "Fix stiffness"),
    reason("residuals_not_white", undefined, "Free friction"),
    reason("correlated", ["a", "b[0]"]),
  ];
  const points = conclusions({ verdict: { reasons } }, RULES);
  assert.deepEqual(
    points.map(({ codes, next }) => [codes, next.map(({ label }) => label)]),
    [
      [["misfit", "residuals_not_white"], ["Free friction"]],
      [
        ["correlated", "not_identifiable"],
        ["Fix mass", "Fix gain", "Fix stiffness"],
      ],
      [["correlated"], []],
    ],
  );
  assert.equal(points[0].text, "misfit detail (1 more like this below)");
  assert.equal(points[1].text, "Not fixed: mass, gain and stiffness. Give one.");
  assert.equal(points[2].text, "correlated detail");
  assert.equal(listed(["load[1]"]), "load in experiment 2");
  assert.equal(conclusions({ verdict: { reasons } }, []).length, 5);
});

test("a change of the server sets, replaces and removes members of a specification", () => {
  const spec = { parameters: { mass: { estimate: { lower: 1, upper: 2 } } }, experiments: [1, 2], seed: 3 };
  const patch = {
    parameters: { mass: { estimate: null, value: 57 } },
    experiments: [4],
    outputs: { y: { noise_std: 1 } },
  };
  assert.deepEqual(patched(spec, patch), {
    parameters: { mass: { value: 57 } },
    experiments: [4],
    outputs: { y: { noise_std: 1 } },
    seed: 3,
  });
  assert.equal(spec.parameters.mass.estimate.upper, 2);
});

const LAG = `name: lag
inputs:
  u: {unit: V}
parameters:
  time: {symbol: T, unit: s, default: 1, lower: 0.1, upper: 10, scale: log, unknown: true}
states:
  y: {unit: V, derivative: "(u - y)/T", initial: 0}
outputs:
  measured:
    unit: V
    expression: y
`;

test("what the server says of a document is shown at its line and column", () => {
  const read = readText(yaml, LAG);
  assert.deepEqual(read.faults, []);
  assert.equal(read.value.states.y.derivative, "(u - y)/T");
  const where = (fault) =>
    placed(read, LAG, [{ detail: "", ...fault }], "/model").map(({ from, to, line, column }) => [
      line,
      column,
      LAG.slice(from, to),
    ])[0];
  assert.deepEqual(where({ pointer: "/model/states/y/derivative", line: 1, column: "9" }), [7, 37, "T"]);
  assert.deepEqual(where({ pointer: "/model/outputs/measured/expression", line: 1, column: 1 }), [
    11,
    17,
    "y",
  ]);
  assert.deepEqual(where({ pointer: "/model/states/y/scale" }), [7, 3, "y"]);
  assert.deepEqual(where({ pointer: "/model/parameters/time/lower" }), [5, 49, "0.1"]);
  assert.deepEqual(where({ pointer: "/model" }), [1, 1, "name: lag"]);
  assert.equal(readText(yaml, "name: a\n  b: [\nc").faults.length > 0, true);
  assert.deepEqual(readText(yaml, '{"a": [1, {"b": true}]}').value, { a: [1, { b: true }] });
});

test("a document is the same after it was written as YAML", () => {
  const { value } = readText(yaml, LAG);
  const text = asYaml(yaml, value);
  assert.deepEqual(readText(yaml, text).value, value);
  assert.match(text, /^ {2}time: \{symbol: T/m);
});

test("words are offered where they can stand", () => {
  const { value } = readText(yaml, LAG);
  const language = {
    functions: [
      ["soft_sign", ["v", "width"]],
      ["clip", ["x", "lower", "upper"]],
    ],
    units: ["1", "m"],
  };
  const labels = (before) => wordsAt(before, value, language)?.options.map(({ label }) => label) ?? null;
  const formula = labels("states:\n  y: {unit: V, derivative: (u - ");
  for (const name of ["u", "T", "time", "y", "pi", "soft_sign", "clip"]) {
    assert.ok(formula.includes(name), name);
  }
  assert.ok(labels('states:\n  y: {unit: V, derivative: "clip(u, ').includes("T"));
  assert.ok(labels("states:\n  y: {unit: V, initial: f").includes("first sample of output measured"));
  assert.deepEqual(labels("parameters:\n  a: {scale: l"), ["linear", "log"]);
  assert.deepEqual(labels("parameters:\n  a: {unit: "), ['"1"', "m"]);
  assert.ok(labels("parameters:\n  a: {unit: m, def").includes("default"));
  assert.ok(labels("states:\n  y:\n    der").includes("derivative"));
  assert.ok(labels("name: a\nsta").includes("states"));
  assert.equal(labels("states:\n  y"), null);
  assert.deepEqual(wordsAt("outputs:\n  a: {expression: soft_s", value, language).from, 27);
});

test("a document is told as equations, names and parameters", () => {
  const { value } = readText(yaml, LAG);
  assert.deepEqual(equationsOf(value), ["y' = (u - y)/T", "measured = y"]);
  assert.deepEqual(
    namesOf(value).filter(({ entry }) => entry === "time"),
    [
      { name: "time", kind: "parameter", unit: "s", entry: "time" },
      { name: "T", kind: "parameter", unit: "s", entry: "time" },
    ],
  );
  assert.deepEqual(
    describedBy(value).parameters.map(({ name, lower, unknown_by_default: unknown }) => [
      name,
      lower,
      unknown,
    ]),
    [["time", 0.1, true]],
  );
  assert.deepEqual(equationsOf(null), []);
  assert.deepEqual(describedBy({ parameters: "x" }).parameters, []);
});

test("each word of a document has its kind", () => {
  const kinds = (line) => {
    const parser = yaml.StreamLanguage.define(MODEL_WORDS).parser;
    const marks = [];
    const tree = parser.parse(line);
    tree.iterate({
      enter: ({ name, from, to }) => {
        name !== "Document" && marks.push([line.slice(from, to), name]);
      },
    });
    return marks;
  };
  const words = kinds('y: {derivative: "(u - 2.5e-3*y)/soft_sign(T, 1)", unit: m} # held');
  const kind = (word) => words.find(([text]) => text === word)?.[1];
  assert.equal(kind("derivative"), "propertyName");
  assert.equal(kind("2.5e-3"), "number");
  assert.equal(kind("u"), "variableName");
  assert.match(kind("soft_sign"), /function/);
  assert.equal(kind("m"), "string");
  assert.equal(kind("# held"), "comment");
});

test("a model is shown under a step of one set of its inputs", () => {
  const unknown = excitationOf(MODEL);
  assert.deepEqual(
    [unknown.seconds, unknown.before, unknown.after],
    [10, { reference: 0 }, { reference: 1 }],
  );
  const { sample_time_s: every, signals } = stepOf(unknown);
  assert.equal(every * STEP_SAMPLES, 10);
  assert.deepEqual(
    [signals.reference.unit, signals.reference.values[0], signals.reference.values.at(-1)],
    ["m", 0, 1],
  );
  assert.equal(lineOf([0, 1], [2, 4], { width: 100, height: 20, edge: 0 }), "M0.0 20.0L100.0 0.0");
  assert.equal(lineOf([0, 1], [2, 2], { width: 100, height: 20, edge: 0 }), "M0.0 10.0L100.0 10.0");
});

test("the profile of a linear model is drawn as the parabola that it is", () => {
  const fits = [-1, -0.5, 0, 1].map((off) => ({ value: 5 + 2 * off, excess: off * off }));
  const points = profileCurve(fits);
  assert.deepEqual(
    points.filter(([, , fit]) => fit !== null).map(([value, rise]) => [value, rise]),
    fits.map(({ value, excess }) => [value, excess]),
  );
  assert.ok(points.length > 50);
  for (const [value, rise] of points) {
    assert.ok(Math.abs(rise - ((value - 5) / 2) ** 2) < 1e-12);
  }
});

const { barCounts, cornerColumn } = await part("job/posterior.js");

test("a corner plot shows the range of nearly all draws, and how many fall into each bar", () => {
  const rows = Array.from({ length: 1001 }, (_, k) => [k / 1000, 7]);
  rows[500] = [1e6, 7];
  const draws = { names: ["spring_rate", "fixed"], units: ["N/m", "1"], rows };
  const column = cornerColumn(draws, 0);
  assert.equal(column.label, "spring rate [N/m]");
  assert.ok(column.low < 0.01 && column.high > 0.99 && column.high < 1.1);
  const counts = barCounts(column.places);
  assert.equal(counts.length, 20);
  assert.ok(counts.every((count) => count >= 48 && count <= 52));
  // Draws that are all one number have no range.
  assert.equal(cornerColumn(draws, 1), null);
});

const { sentence } = await part("job/disturbance_words.js");

test("a disturbance is told in the plant's words", () => {
  const number = (estimate, standard_error) => ({ estimate, standard_error, confidence_interval: null });
  const memory = {
    acts_on: { state: "rod_velocity" },
    kind: "memory",
    unit: "m/s/s",
    std: number(0.2041, 0.021),
    strength: number(0.2, 0.01),
    time_constant_s: number(0.5, null),
    share_of_output: { position: 0.1423 },
  };
  assert.equal(
    sentence(memory),
    "The rate of rod velocity wanders by 0.204 ± 0.021\u00a0m/s² (one standard deviation) and forgets within " +
      "0.5\u00a0s. This makes 14 % of the variance of position.",
  );
  const white = { ...memory, kind: "white", std: null, time_constant_s: null, share_of_output: {} };
  assert.equal(
    sentence(white),
    "The rate of rod velocity wanders by white noise of 0.200 ± 0.010\u00a0m/s²·√s.",
  );
  const sensor = { ...memory, acts_on: { output: "position" }, unit: "m" };
  assert.match(sentence(sensor), /^The sensor of position drifts by 0.204 ± 0.021\u00a0m /);
});

const { changesOfKind, changesOfRole, changesOfRow, isTable, kindOfRow, likelyTag, listText, namedLines } =
  await part("data/roles.js");
const { isWhole, namesIn, rolesOf, sentenceOf } = await part("data/roles.js");

const column = (title, role) => ({ title, name: title.replace(/ \[.*/, ""), unit: null, role });
const NOTHING_SAID = {
  header_row: "",
  unit_row: "",
  time: "",
  tag: "",
  value: "",
  quality: "",
  ignore: "",
  format: "",
};
const WIDE_ROWS = {
  format: "wide_csv",
  delimiter: ";",
  header_row: 3,
  unit_row: 4,
  first_row: 5,
  columns: [column("t", "time"), column("PT [bar]", "signal"), column("a,b", "signal"), column("", "signal")],
  rows: [1, 3, 4, 5, 6, 7].map((line) => ({ line, fields: [String(line), "1", "2", "3"] })),
  warnings: [],
  faults: [],
};
const LONG_ROWS = {
  ...WIDE_ROWS,
  format: "long_csv",
  columns: [column("time", "time"), column("machine", "tag"), column("p", "value"), column("T", "value")],
};
const layoutOf = (answer, values = {}, guess = answer) => ({
  answer,
  values: { ...NOTHING_SAID, ...values },
  guess,
  rowGuess: guess,
});

test("a table has first rows to show, and a document of JSON has none", () => {
  const names = ["a.csv", "a.txt", "a", "a.csv.gz", "a.XLSX", "a.parquet", "a.json", "a.json.gz"];
  assert.deepEqual(names.filter(isTable), ["a.csv", "a.txt", "a", "a.csv.gz", "a.XLSX", "a.parquet"]);
  assert.deepEqual(names.filter(isWhole), ["a.XLSX", "a.parquet"]);
});

test("a list of names is written so that a comma in a name does not part it", () => {
  assert.equal(listText(["a", "b"]), "a, b");
  assert.equal(listText(["a,b", "c"]), '["a,b","c"]');
  for (const names of [[], ["a", "b"], ["a,b"], ["[a]", " b"]]) {
    assert.deepEqual(namesIn(listText(names)), names);
  }
});

test("the rows of a file are told apart by their lines", () => {
  const kinds = WIDE_ROWS.rows.map(({ line }) => kindOfRow(WIDE_ROWS, line));
  assert.deepEqual(kinds, ["left_out", "titles", "units", "data", "data", "data"]);
  assert.deepEqual(namedLines(WIDE_ROWS), [1, 3, 4, 5, 6]);
  assert.equal(kindOfRow({ ...WIDE_ROWS, header_row: null, unit_row: null, first_row: null }, 1), "data");
  assert.equal(
    sentenceOf(WIDE_ROWS),
    "Read as: titles in line 3, units in line 4, samples from line 5 on; semicolons separate the columns.",
  );
});

test("a line becomes titles or units by the options for it", () => {
  const layout = layoutOf(WIDE_ROWS);
  assert.deepEqual(changesOfRow(layout, 1, "titles"), { header_row: "1" });
  assert.deepEqual(changesOfRow(layout, 5, "units"), { unit_row: "5" });
  assert.deepEqual(changesOfRow(layout, 4, "neither"), { unit_row: "none" });
  // A file may have no titles, and titles are not units.
  assert.deepEqual(changesOfRow(layout, 3, "neither"), { header_row: "none" });
  assert.equal(changesOfRow(layout, 3, "units"), null);
  // What the server tells by itself stays unsaid.
  const altered = layoutOf(
    { ...WIDE_ROWS, header_row: 1, unit_row: null, first_row: 3 },
    { header_row: "1", unit_row: "none" },
    WIDE_ROWS,
  );
  assert.deepEqual(changesOfRow(altered, 3, "titles"), { header_row: "" });
  assert.deepEqual(changesOfRow(altered, 1, "neither"), { header_row: "" });
  const withUnits = layoutOf(WIDE_ROWS, { unit_row: "4" });
  assert.deepEqual(changesOfRow(withUnits, 4, "titles"), { header_row: "4", unit_row: "" });
});

test("a column of a table of signals becomes the time, or is left out by its name", () => {
  const layout = layoutOf(WIDE_ROWS);
  assert.deepEqual(changesOfRole(layout, 1, "time"), { time: "PT [bar]" });
  assert.deepEqual(changesOfRole(layout, 1, "left_out"), { ignore: "PT" });
  assert.deepEqual(changesOfRole(layoutOf(WIDE_ROWS, { ignore: "PT" }), 2, "left_out"), {
    ignore: '["PT","a,b"]',
  });
  // A recording has a time, and a column without a title cannot be named.
  assert.equal(changesOfRole(layout, 0, "signal"), null);
  assert.equal(changesOfRole(layout, 3, "time"), null);
  const moved = { ...WIDE_ROWS, columns: [column("t", "signal"), column("PT [bar]", "time")] };
  const altered = layoutOf(moved, { time: "PT [bar]" }, WIDE_ROWS);
  assert.deepEqual(changesOfRole(altered, 0, "time"), { time: "" });
  assert.deepEqual(changesOfRole(altered, 1, "signal"), { time: "" });
  const without = { ...WIDE_ROWS, columns: [column("t", "time"), column("PT", "left_out")] };
  assert.deepEqual(changesOfRole(layoutOf(without, { ignore: "PT, x" }), 1, "signal"), { ignore: "x" });
  // The server leaves a column of words out by itself.
  assert.equal(changesOfRole(layoutOf(without), 1, "signal"), null);
});

test("columns of a table of samples are named by their titles", () => {
  const layout = layoutOf(LONG_ROWS);
  assert.deepEqual(changesOfRole(layout, 3, "left_out"), { value: "p" });
  assert.deepEqual(changesOfRole(layout, 3, "quality"), { quality: "T" });
  const withQuality = { ...LONG_ROWS, columns: LONG_ROWS.columns.with(3, column("T", "quality")) };
  assert.deepEqual(changesOfRole(layoutOf(withQuality), 3, "left_out"), { quality: "none" });
  assert.deepEqual(changesOfRole(layout, 2, "tag"), { tag: "p" });
  assert.equal(changesOfRole(layout, 1, "left_out"), null);
  const without = { ...LONG_ROWS, columns: [...LONG_ROWS.columns.slice(0, 3), column("T", "left_out")] };
  const altered = layoutOf(without, { value: "p" }, LONG_ROWS);
  assert.deepEqual(changesOfRole(altered, 3, "value"), { value: "" });
  assert.equal(changesOfRole(altered, 2, "left_out"), null);
  assert.deepEqual(rolesOf(LONG_ROWS, column("u", "unit"))[0], "unit");
  assert.deepEqual(rolesOf({ ...LONG_ROWS, format: "paired_csv" }, column("u", "time"))[0], "time");
});

test("a guess that the server asks about is confirmed by the option for it", () => {
  const faults = ["header_row", "time"].map((parameter) => ({ detail: "may both be", parameter }));
  const unclear = layoutOf({ ...WIDE_ROWS, faults });
  assert.deepEqual(changesOfRow(unclear, 3, "titles"), { header_row: "3" });
  assert.deepEqual(changesOfRole(unclear, 0, "time"), { time: "t" });
  assert.deepEqual(changesOfRow(layoutOf(WIDE_ROWS), 3, "titles"), { header_row: "" });
});

test("rows with a sample of one signal need the column that names it", () => {
  const columns = LONG_ROWS.columns.map(({ title }, k) => column(title, k ? "signal" : "time"));
  const rows = [
    { line: 5, fields: ["0", "press 1", "1", "2"] },
    { line: 6, fields: ["0", "press 2", "1", "2"] },
  ];
  const wide = { ...LONG_ROWS, format: "wide_csv", columns, rows };
  assert.equal(likelyTag(wide), "machine");
  const faults = [{ detail: "rows of one time differ by `T`", parameter: "tag" }];
  assert.equal(likelyTag({ ...wide, faults }), "T");
  const cleared = { tag: "", value: "", quality: "", format: "" };
  assert.deepEqual(changesOfKind(layoutOf(wide), "long"), { ...cleared, tag: "machine" });
  assert.deepEqual(changesOfKind(layoutOf(LONG_ROWS, { tag: "machine" }, wide), "wide"), cleared);
  assert.deepEqual(changesOfKind(layoutOf(LONG_ROWS), "wide"), { ...cleared, format: "wide_csv" });
  assert.deepEqual(changesOfKind(layoutOf(wide, { format: "wide_csv" }, LONG_ROWS), "long"), cleared);
});
