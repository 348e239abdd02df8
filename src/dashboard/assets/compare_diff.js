// @ts-check
// What differs between specifications, and where intervals lie on a common range. Pure.

// Every leaf of a document by its JSON pointer. The model's own defaults are long and the same; what
// is left out of a document is undefined.
export function leaves(value, pointer = "", found = new Map()) {
  if (value !== null && typeof value === "object") {
    const entries = Object.entries(value);
    if (entries.length === 0) {
      found.set(pointer, Array.isArray(value) ? "[]" : "{}");
    }
    entries.forEach(([key, member]) => leaves(member, `${pointer}/${key.replaceAll("~", "~0").replaceAll("/", "~1")}`, found));
  } else {
    found.set(pointer, value);
  }
  return found;
}

// [pointer, [value of each document]] where they are not all the same.
export function differences(documents) {
  const all = documents.map((document) => leaves(document));
  const pointers = [...new Set(all.flatMap((of) => [...of.keys()]))];
  return pointers.map((pointer) => [pointer, all.map((of) => of.get(pointer))])
    .filter(([, values]) => values.some((value) => value !== values[0]));
}

// The key of a parameter that no other of a result has.
export const keyOf = ({ name, experiment }) => (experiment === undefined || experiment === null ? name : `${name}[${experiment}]`);

// By parameter, what each result says of it: [{ key, unit, symbol, of: [parameter or null] }].
export function sideBySide(results) {
  const rows = new Map();
  results.forEach((result, k) => (result?.parameters ?? []).forEach((parameter) => {
    const key = keyOf(parameter);
    const row = rows.get(key) ?? { key, unit: parameter.unit, symbol: parameter.symbol, of: results.map(() => null) };
    row.of[k] = parameter;
    rows.set(key, row);
  }));
  return [...rows.values()];
}

// The interval of an estimate that counts what was taken as known, else that of noise alone.
export function intervalOf(parameter) {
  const of = parameter?.total_interval ?? parameter?.confidence_interval;
  return of ? { lower: of.lower, upper: of.upper, level: of.level } : null;
}

// The range that shows all intervals of a row: the ends of the intervals that have any, and every
// estimate, a little wider, and on a logarithmic axis where that spreads over decades.
export function commonRange(parameters) {
  const known = parameters.filter(Boolean);
  const ends = known.flatMap((parameter) => {
    const of = intervalOf(parameter);
    return [parameter.estimate, of?.lower, of?.upper];
  }).filter((value) => Number.isFinite(value));
  if (ends.length === 0) {
    return null;
  }
  const [low, high] = [Math.min(...ends), Math.max(...ends)];
  if (low > 0 && high / low > 50) {
    return { log: true, low: low / 1.2, high: high * 1.2 };
  }
  const room = high > low ? 0.06 * (high - low) : Math.abs(low) * 0.05 || 1;
  return { log: false, low: low - room, high: high + room };
}

// 0…1 on a range, cut off at its ends.
export function place(value, { log, low, high }) {
  const at = log ? Math.log(Math.max(value, 1e-300) / low) / Math.log(high / low) : (value - low) / (high - low);
  return Math.min(1, Math.max(0, at));
}
