// @ts-check
// This module writes the choices at the first rows of a file as options of the import: what each row is, what
// each column is, and what a row holds. An option that says no more than the server tells by itself stays
// empty.

import { isLeftOut, withLine, withoutLine } from "./lines.js";

const WIDE = ["time", "signal", "left_out"];
const PAIRED = ["signal", "left_out"];
const LONG = ["time", "tag", "value", "quality", "left_out"];
const DELIMITERS = {
  ",": "commas",
  ";": "semicolons",
  "\t": "tabs",
  " ": "spaces",
  "|": "bars",
};
// The rows that can be called titles or units end after the first row of data, and are at least so many.
const NAMED_ROWS = 5;

export const ROLE_WORDS = {
  time: "Time",
  signal: "Signal",
  tag: "Tag (name of the signal)",
  value: "Value",
  quality: "Quality",
  unit: "Unit",
  left_out: "Left out",
};

// The table sets these options.
export const ROLE_OPTIONS = ["time", "tag", "value", "quality", "ignore", "format"];
export const LAYOUT_OPTIONS = ["header_row", "unit_row", "skip", ...ROLE_OPTIONS];

/**
 * @typedef {{ title: string, name: string, unit: string | null, role: string }} Column
 * @typedef {{ format: string, file: string | null, sheet: string | null, sheets: string[], delimiter: string | null, header_row: number | null, unit_row: number | null,
 *   first_row: number | null, columns: Column[], rows: { line: number, fields: string[] }[],
 *   warnings: any[], faults: any[] }} Answer
 * The layout is the answer of the server to the values of the options, beside what the server tells by
 * itself: `rowGuess` without any option of the table, and `guess` with the lines that the options name.
 * @typedef {{ answer: Answer, values: Record<string, string>, guess?: Answer, rowGuess?: Answer }} Layout
 */

// A document of JSON has no lines to look at.
export const isTable = (name) => !/\.json(\.gz)?$/i.test(name);

// A workbook and a Parquet file are looked at as a whole, and a text by its beginning.
export const isWhole = (name) => /\.(xlsx|parquet)$/i.test(name);

// Writes names as an option takes them: separated by commas, or as a JSON array where commas do not part them.
export function listText(names) {
  const isPlain = names.every((name) => !/^\s|^\[|,|\s$/.test(name));
  return isPlain ? names.join(", ") : JSON.stringify(names);
}

// Reads names as an option has them.
export function namesIn(text) {
  if (text.trim().startsWith("[")) {
    try {
      return JSON.parse(text).map(String);
    } catch {
      return [];
    }
  }
  return text
    .split(",")
    .map((name) => name.trim())
    .filter(Boolean);
}

// Says what a line of the file is: "skipped" where an option leaves it out, else "titles", "units", "left_out" or
// "data".
/**
 * @param {Answer} answer
 * @param {number} line
 * @param {string} [skip]
 */
export function kindOfRow({ header_row: titles, unit_row: units, first_row: first }, line, skip) {
  if (isLeftOut(skip, line)) {
    return "skipped";
  }
  if (line === titles) {
    return "titles";
  }
  if (line === units) {
    return "units";
  }
  return line >= (first ?? Math.max(titles ?? 0, units ?? 0)) ? "data" : "left_out";
}

// Lists the lines that can be called titles or units.
/** @param {Answer} answer */
export function namedLines({ rows, first_row: first }) {
  const data = rows.findIndex(({ line }) => first !== null && line >= first);
  return rows.slice(0, Math.max(NAMED_ROWS, data + 1)).map(({ line }) => line);
}

// Answers whether the server leaves an option to the reader, so that its guess is not enough.
/**
 * @param {Answer | undefined} answer
 * @param {string | undefined} option
 */
export const isOpen = (answer, option) =>
  option !== undefined && (answer?.faults ?? []).some(({ parameter }) => parameter === option);

// Gives the answer with the roles that the options say for columns which the server shows as signals: it does so
// with the formats of programs, and while it asks for other columns.
/**
 * @param {Answer} answer
 * @param {Record<string, string>} values
 * @returns {Answer}
 */
export function withRolesOfOptions(answer, values) {
  const ignored = namesIn(values.ignore);
  const ofValues = namesIn(values.value);
  const roleOf = ({ title, name }) =>
    isLong(answer)
      ? (["time", "tag", "quality"].find((role) => values[role] === title && title !== "") ??
        (ofValues.includes(title) ? "value" : "signal"))
      : ignored.includes(name)
        ? "left_out"
        : "signal";
  const columns = answer.columns.map((column) =>
    column.role === "signal" ? { ...column, role: roleOf(column) } : column,
  );
  return { ...answer, columns };
}

const nothingIn = (changes) => (Object.keys(changes).length ? changes : null);

// Gives the options that make titles or units of a line, or neither, or leave it out, and null where no option says
// it.
/**
 * @param {Layout} layout
 * @param {number} line
 * @param {string} kind
 * @returns {Record<string, string> | null}
 */
export function changesOfRow({ answer, values, rowGuess }, line, kind) {
  const text = String(line);
  if (kind === "skipped") {
    const named = ["header_row", "unit_row"].filter((option) => values[option] === text);
    return { ...Object.fromEntries(named.map((option) => [option, ""])), skip: withLine(values.skip, line) };
  }
  const readAgain = isLeftOut(values.skip, line) ? { skip: withoutLine(values.skip, line) } : null;
  if (readAgain) {
    const option = { titles: "header_row", units: "unit_row" }[kind];
    return option ? { ...readAgain, [option]: text } : readAgain;
  }
  const isSaid = values.header_row === text;
  if (kind === "titles") {
    const isGuess = rowGuess?.header_row === line && !isOpen(rowGuess, "header_row");
    return {
      header_row: isGuess ? "" : text,
      ...(values.unit_row === text ? { unit_row: "" } : {}),
    };
  }
  const isTold = rowGuess?.header_row === line;
  if (answer.header_row === line && (!isSaid || isTold)) {
    return kind === "units" ? null : { header_row: "none" };
  }
  const isGuess = (unitRow) =>
    rowGuess?.unit_row === unitRow && !isOpen(rowGuess, "unit_row") && (isSaid || !values.header_row);
  const freed = isSaid ? { header_row: "" } : {};
  if (kind === "units") {
    return { ...freed, unit_row: isGuess(line) ? "" : text };
  }
  return answer.unit_row === line ? { unit_row: isGuess(null) ? "" : "none" } : nothingIn(freed);
}

// Answers whether each row holds a sample of a single signal.
/** @param {Answer} answer */
export const isLong = ({ format }) => format === "long_csv";

// Lists the roles that a column can have; the layouts of programs have theirs from the program, and leave
// signals out at the most.
/** @param {Answer} answer */
export function rolesOf({ format }, { role }) {
  const roles = { wide_csv: WIDE, long_csv: LONG }[format] ?? PAIRED;
  return roles.includes(role) ? roles : [role, ...roles];
}

const titlesOf = (answer, role) =>
  answer.columns.filter((column) => column.role === role).map(({ title }) => title);

// An option names a column by its title, which has to be there and to come first.
const isNamed = ({ columns }, k) =>
  columns[k].title !== "" && columns.findIndex(({ title }) => title === columns[k].title) === k;

// Leaves the options empty that say what the server tells by itself.
function withoutGuesses(changes, guess) {
  const isTold = ([option, text]) => {
    const titles = guess && !isOpen(guess, option) ? titlesOf(guess, option) : [];
    return option === "value" ? titles.length > 0 && listText(titles) === text : titles[0] === text;
  };
  return Object.fromEntries(
    Object.entries(changes).map((change) => [change[0], isTold(change) ? "" : change[1]]),
  );
}

// Gives the options that take the role from a column before the column gets the role `next`, and null where
// no option does.
function withdrawal({ answer, values }, { title, name, role }, next) {
  const isSaid = values[role] === title;
  if (role === "time" || role === "tag") {
    return isSaid ? { [role]: "" } : null;
  }
  if (role === "quality" && (isSaid || next === "left_out")) {
    return { quality: isSaid ? "" : "none" };
  }
  if (role === "value" && (next === "left_out" || values.value)) {
    const rest = titlesOf(answer, "value").filter((value) => value !== title);
    return rest.length || next !== "left_out" ? { value: listText(rest) } : null;
  }
  if (role === "left_out" && !isLong(answer)) {
    const names = namesIn(values.ignore);
    const isIgnored = names.includes(name);
    const rest = listText(names.filter((ignored) => ignored !== name));
    return isIgnored ? { ignore: rest } : next === "signal" ? null : {};
  }
  return {};
}

// Gives the options that give a role to a column, and null where no option does.
function assignment({ answer, values }, k, role) {
  const { columns } = answer;
  const { title, name } = columns[k];
  if (role === "left_out") {
    return isLong(answer) ? {} : { ignore: listText([...namesIn(values.ignore), name]) };
  }
  if (role === "signal") {
    return {};
  }
  if (!isNamed(answer, k)) {
    return null;
  }
  const isValue = (column, place) => column.role === "value" || place === k;
  const titles = columns.filter(isValue).map((column) => column.title);
  return { [role]: role === "value" ? listText(titles) : title };
}

// Gives the options that make another role of the role of a column, and null where no option says it: there is
// no recording without a time, so that a column stays the time until another is.
/**
 * @param {Layout} layout
 * @param {number} k
 * @param {string} role
 * @returns {Record<string, string> | null}
 */
export function changesOfRole(layout, k, role) {
  const column = layout.answer.columns[k];
  if (column.role === role && !isOpen(layout.answer, role)) {
    return {};
  }
  const before = column.role === role ? {} : withdrawal(layout, column, role);
  const after = assignment(layout, k, role);
  return before && after ? nothingIn(withoutGuesses({ ...before, ...after }, layout.guess)) : null;
}

const isNumber = (text) => /^[-+\d.,eE\s]+$/.test(text);

// The column that names the signals is the column that the server asks about, or the first with words in it.
/** @param {Answer} answer */
export function likelyTag({ columns, rows, faults, first_row: first }) {
  const asked = faults.filter(({ parameter }) => parameter === "tag").map(({ detail }) => detail);
  const data = rows.filter(({ line }) => first === null || line >= first);
  const hasWords = (k) =>
    data.some(({ fields }) => fields[k] && !isNumber(fields[k]) && fields[k] !== columns[k].title);
  const candidates = [...columns.keys()].filter((k) => columns[k].role !== "time" && columns[k].title);
  const isAsked = (k) => asked.some((detail) => detail.includes(`\`${columns[k].title}\``));
  const k = candidates.find(isAsked) ?? candidates.find(hasWords) ?? candidates[0];
  return columns[k]?.title ?? "";
}

// Gives the options for rows that hold a sample of every signal ("wide"), of every signal with a time or a quality
// of its own ("paired"), or of a single signal ("long").
/**
 * @param {Layout} layout
 * @param {string} kind
 * @returns {Record<string, string>}
 */
export function changesOfKind({ answer, values, guess }, kind) {
  const cleared = { tag: "", value: "", quality: "", format: "" };
  if (kind === "long") {
    return guess && isLong(guess) ? cleared : { ...cleared, tag: likelyTag(answer) };
  }
  // The rows of a file that is no text are told apart by their columns alone.
  if (answer.file) {
    return cleared;
  }
  const guessed = guess?.format ?? (values.tag || values.value ? "wide_csv" : "");
  const format = `${kind}_csv`;
  return { ...cleared, format: guessed === format ? "" : format };
}

// Says in words where the titles, the units and the samples are.
/** @param {Answer} answer */
export function sentenceOf({ delimiter, sheet, header_row: titles, unit_row: units, first_row: first }) {
  const parts = [
    titles ? `titles in line ${titles}` : "no titles",
    units && `units in line ${units}`,
    first && `samples from line ${first} on`,
  ].filter(Boolean);
  const separated = delimiter && `; ${DELIMITERS[delimiter] ?? delimiter} separate the columns`;
  const place = sheet ? `Worksheet ${sheet}, read as` : "Read as";
  return `${place}: ${parts.join(", ")}${separated ?? ""}.`;
}
