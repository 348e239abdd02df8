// @ts-check
// This module describes the language of model documents to an editor: the kind of each word of the
// text, and the words that could stand at the cursor. Its functions are pure, so that they can be
// tested without a page.

const WORDS = ["and", "or", "not"];
const FORMULAS = [
  "derivative",
  "expression",
  "initial",
  "otherwise",
  "delay",
  "fastest_rate",
  "valid_while",
  "constraints",
];
const BEGINNING = "first sample of output ";

// A document may have these fields at its top and in each entry of its sections.
const SIGNAL = ["symbol", "unit", "meaning"];
const FIELDS = {
  "": [
    "name",
    "title",
    "summary",
    "source",
    "inputs",
    "parameters",
    "constants",
    "tables",
    "quantities",
    "sampled",
    "states",
    "outputs",
    "options",
  ],
  inputs: SIGNAL,
  parameters: [...SIGNAL, "default", "lower", "upper", "scale", "unknown", "minimum", "maximum", "tolerance"],
  constants: [...SIGNAL, "value"],
  tables: ["x", "y", "x_unit", "y_unit"],
  quantities: [...SIGNAL, "expression"],
  sampled: [...SIGNAL, "expression", "initial"],
  states: [...SIGNAL, "derivative", "initial", "scale"],
  outputs: [...SIGNAL, "expression"],
  options: ["delay", "fastest_rate", "input_hold", "valid_while"],
};
const VALUES = { unknown: ["true", "false"], scale: ["linear", "log"], input_hold: ["zero", "first"] };

const KEY = /^(?:"(?:[^"\\]|\\.)*"(?=\s*:)|'[^']*'(?=\s*:)|[\p{L}_][\p{L}\p{N}_.@/-]*(?=\s*:(?:\s|$)))/u;
const NAME = /^[\p{L}_][\p{L}\p{N}_]*/u;
const NUMBER = /^(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?/;

// The tokenizer tells the words of a document in YAML or JSON apart, a line at a time.
export const MODEL_WORDS = {
  name: "model",
  startState: () => ({ key: "", quote: "" }),
  copyState: (state) => ({ ...state }),
  languageData: { commentTokens: { line: "#" }, closeBrackets: { brackets: ["(", "[", "{", '"'] } },
  token(stream, state) {
    if (stream.eatSpace()) {
      return null;
    }
    if (!state.quote) {
      if (stream.peek() === "#" && (stream.sol() || /\s/.test(stream.string[stream.pos - 1]))) {
        stream.skipToEnd();
        return "comment";
      }
      const key = stream.match(KEY);
      if (key) {
        state.key = key[0].replace(/["']/g, "");
        return "propertyName";
      }
    }
    const next = stream.peek();
    if (next === '"' || next === "'") {
      if (state.quote === next) {
        state.quote = "";
      } else if (FORMULAS.includes(state.key)) {
        state.quote = next;
      } else {
        return quoted(stream, next);
      }
      stream.next();
      return "string";
    }
    return FORMULAS.includes(state.key) ? formula(stream) : plain(stream);
  },
};

function quoted(stream, quote) {
  stream.next();
  while (!stream.eol()) {
    const character = stream.next();
    if (character === "\\" && quote === '"') {
      stream.next();
    } else if (character === quote) {
      break;
    }
  }
  return "string";
}

function formula(stream) {
  if (stream.match(/^first sample of output\b/)) {
    return "keyword";
  }
  if (stream.match(NUMBER)) {
    return "number";
  }
  const name = stream.match(NAME);
  if (name) {
    const called = /^\s*\(/.test(stream.string.slice(stream.pos));
    return WORDS.includes(name[0]) ? "keyword" : called ? "variableName.function" : "variableName";
  }
  return "+-*/^<>=".includes(stream.next()) ? "operator" : "punctuation";
}

function plain(stream) {
  if (stream.match(/^[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?=\s*(?:[,}\]#]|$))/)) {
    return "number";
  }
  if (stream.match(/^(?:true|false|null)(?=\s*(?:[,}\]#]|$))/)) {
    return "bool";
  }
  if (stream.match(/^[{}[\],:]/)) {
    return "punctuation";
  }
  stream.match(/^(?:[^,}\]#]|(?<=\S)#)+/) || stream.next();
  return "string";
}

// Lists the names that an expression of a document may use, [{ name, kind, unit, entry }]; a symbol
// follows the name of its entry.
export function namesOf(document) {
  const kinds = [
    ["inputs", "input"],
    ["parameters", "parameter"],
    ["constants", "constant"],
    ["quantities", "quantity"],
    ["sampled", "sampled"],
    ["states", "state"],
    ["tables", "table"],
  ];
  const names = kinds.flatMap(([section, kind]) =>
    Object.entries(isObject(document?.[section]) ? document[section] : {}).flatMap(([name, entry]) => {
      const unit = String(entry?.unit ?? "");
      return [
        { name, kind, unit, entry: name },
        ...(typeof entry?.symbol === "string" ? [{ name: entry.symbol, kind, unit, entry: name }] : []),
      ];
    }),
  );
  return [
    ...names,
    { name: "pi", kind: "constant", unit: "1", entry: "pi" },
    { name: "sample_time", kind: "constant", unit: "s", entry: "sample_time" },
  ];
}

const isObject = (value) => value !== null && typeof value === "object" && !Array.isArray(value);

// Completes `before`, the text up to the cursor: the answer is { from, options } or null. The language
// has `functions`, [name, arguments] each, and `units` that are usual.
export function wordsAt(before, document, { functions, units }) {
  const line = before.slice(before.lastIndexOf("\n") + 1);
  const [typed] = /[\p{L}\p{N}_]*$/u.exec(line);
  const from = before.length - typed.length;
  const key = /([\p{L}\p{N}_]+)["']?\s*:\s[^:]*$/u.exec(line)?.[1];
  const inEntry = key && !/[,{]\s*["']?[\p{L}\p{N}_]*$/u.test(line.slice(line.lastIndexOf(`${key}`)));
  if (key && FORMULAS.includes(key) && (inEntry || /\([^)]*$/.test(line))) {
    return { from, options: formulaWords(key, document, functions) };
  }
  if (key && inEntry && key in VALUES) {
    return { from, options: VALUES[key].map((label) => ({ label, type: "constant" })) };
  }
  if (key === "unit" && inEntry) {
    const [unit] = /[^\s:,{}"']*$/.exec(line);
    return {
      from: before.length - unit.length,
      options: units.map((label) => ({ label: /^\d/.test(label) ? `"${label}"` : label, type: "constant" })),
    };
  }
  const section = sectionOf(before, line);
  if (section === null || inEntry) {
    return null;
  }
  return {
    from,
    options: FIELDS[section].map((label) => ({ label, type: "property", apply: `${label}: ` })),
  };
}

function formulaWords(key, document, functions) {
  const names = namesOf(document).map(({ name, kind, unit, entry }) => ({
    label: name,
    type: "variable",
    detail: `${kind}${entry === name ? "" : ` ${entry}`}${unit && ` [${unit}]`}`,
  }));
  const calls = functions.map(([label, values]) => ({
    label,
    type: "function",
    detail: `(${values.join(", ")})`,
    apply: `${label}(`,
  }));
  const beginnings =
    key === "initial" && isObject(document?.outputs)
      ? Object.keys(document.outputs).map((output) => ({ label: `${BEGINNING}${output}`, type: "keyword" }))
      : [];
  return [...names, ...calls, ...beginnings];
}

// The section of the cursor is "" at the top of the document, and null where the reader chooses a name.
function sectionOf(before, line) {
  const indent = /^ */.exec(line)[0].length;
  if (indent === 0 && !line.includes(":")) {
    return "";
  }
  const section = [...before.matchAll(/^([a-z_]+):[^\n]*$/gm)].at(-1)?.[1];
  if (!(section in FIELDS)) {
    return null;
  }
  return section === "options" || indent >= 4 || /\{[^}]*$/.test(line) ? section : null;
}

// Writes a document as equations: quantities first, then states, then outputs.
export function equationsOf(document) {
  const section = (name) =>
    Object.entries(isObject(document?.[name]) ? document[name] : {}).filter(([, entry]) => isObject(entry));
  const called = ([name, entry]) => (typeof entry.symbol === "string" ? entry.symbol : name);
  return [
    ...[...section("quantities"), ...section("sampled")].map(
      (entry) => `${called(entry)} = ${entry[1].expression ?? "?"}`,
    ),
    ...section("states").map((entry) => `${called(entry)}' = ${entry[1].derivative ?? "?"}`),
    ...section("outputs").map((entry) => `${called(entry)} = ${entry[1].expression ?? "?"}`),
  ];
}

// Describes a document in the form of the catalogue, as far as the document has the fields for it.
export function describedBy(document) {
  const section = (name) =>
    Object.entries(isObject(document?.[name]) ? document[name] : {}).filter(([, entry]) => isObject(entry));
  const signal = ([name, entry]) => ({
    name,
    symbol: entry.symbol,
    unit: String(entry.unit ?? "1"),
    meaning: entry.meaning ?? "",
  });
  const parameters = section("parameters")
    .map(([name, entry]) => ({
      ...signal([name, entry]),
      symbol: entry.symbol ?? name,
      default: entry.default,
      lower: entry.lower ?? entry.default,
      upper: entry.upper ?? entry.default,
      scale: entry.scale ?? "linear",
      unknown_by_default: entry.unknown === true,
      minimum: entry.minimum ?? null,
      maximum: entry.maximum ?? null,
    }))
    .filter((parameter) => Number.isFinite(parameter.default));
  return {
    name: document?.name ?? "",
    inputs: section("inputs").map(signal),
    outputs: section("outputs").map(signal),
    states: section("states").map(signal),
    input_sets: [],
    parameters,
  };
}
