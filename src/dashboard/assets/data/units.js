// @ts-check
// The units of signals that the reader says stand in a single option, which the fields above the columns write.

// Reads the units of signals: `name:unit` separated by commas, or a JSON object.
/**
 * @param {string} text
 * @returns {Record<string, string>}
 */
export function unitsIn(text) {
  if (text.trim().startsWith("{")) {
    try {
      const units = Object.entries(JSON.parse(text));
      return Object.fromEntries(units.map(([name, unit]) => [name, String(unit)]));
    } catch {
      return {};
    }
  }
  const pairs = text.split(",").map((pair) => {
    const colon = pair.lastIndexOf(":");
    return [pair.slice(0, Math.max(colon, 0)).trim(), pair.slice(colon + 1).trim()];
  });
  return Object.fromEntries(pairs.filter(([name]) => name !== ""));
}

// Writes the units of signals as the option takes them, as a JSON object where commas do not part them.
/** @param {Record<string, string>} units */
export function unitsText(units) {
  const pairs = Object.entries(units);
  const isPlain = ([name, unit]) => !/^\s|^\{|,|\s$/.test(name) && !/[,:]/.test(unit);
  return pairs.every(isPlain)
    ? pairs.map(([name, unit]) => `${name}:${unit}`).join(", ")
    : JSON.stringify(units);
}

// Gives the option with another unit of a signal; the unit that the file has is not said.
/**
 * @param {string} text
 * @param {{ name: string, unit: string | null }} column
 * @param {string} unit
 */
export function withUnit(text, column, unit) {
  const { [column.name]: _, ...rest } = unitsIn(text);
  const isTold = unit === "" || unit === column.unit;
  return unitsText(isTold ? rest : { ...rest, [column.name]: unit });
}

// Lists the units that the server supposes in a fault: the likely meaning of an unknown unit.
/** @param {string} detail */
export const unitsSupposed = (detail) =>
  [...detail.matchAll(/\b(?:did you mean|letters say or) `([^`]+)`/g)].map(([, unit]) => unit);
