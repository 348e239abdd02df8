// @ts-check
// This module finds what differs between specifications, and places intervals on a common range. Its
// functions are pure.

// Gives every leaf of a document by its JSON pointer. A member that a document leaves out has no leaf.
export function leaves(value, pointer = "", values = new Map()) {
  if (value !== null && typeof value === "object") {
    const entries = Object.entries(value);
    if (entries.length === 0) {
      values.set(pointer, Array.isArray(value) ? "[]" : "{}");
    }
    for (const [key, member] of entries) {
      leaves(member, `${pointer}/${key.replaceAll("~", "~0").replaceAll("/", "~1")}`, values);
    }
  } else {
    values.set(pointer, value);
  }
  return values;
}

// Gives [pointer, [value of each document]] for every leaf that is not the same in all documents.
export function differences(documents) {
  const all = documents.map((document) => leaves(document));
  const pointers = [...new Set(all.flatMap((leavesOfDocument) => [...leavesOfDocument.keys()]))];
  return pointers
    .map((pointer) => [pointer, all.map((leavesOfDocument) => leavesOfDocument.get(pointer))])
    .filter(([, values]) => values.some((value) => value !== values[0]));
}

// The key of a parameter distinguishes it from all other parameters of a result.
export const keyOf = ({ name, experiment }) =>
  experiment === undefined || experiment === null ? name : `${name}[${experiment}]`;

// Lists by parameter what each result estimates or foretells: [{ key, unit, symbol, parameters: [parameter or null]
// }]. Parameters of one name and of different units stand apart.
export function sideBySide(results) {
  const rows = new Map();
  for (const [k, result] of results.entries()) {
    for (const parameter of result?.parameters ?? foretold(result)) {
      const key = keyOf(parameter);
      const place = `${key} ${parameter.unit}`;
      const row = rows.get(place) ?? {
        key,
        unit: parameter.unit,
        symbol: parameter.symbol,
        parameters: results.map(() => null),
      };
      row.parameters[k] = parameter;
      row.symbol ??= parameter.symbol;
      rows.set(place, row);
    }
  }
  return [...rows.values()];
}

// A design foretells the errors after its best experiment, a selection those of an estimate from its windows. Both
// estimate nothing: their parameters have no `estimate`.
export const foretold = (result) => result?.proposals?.[0]?.after ?? result?.with_chosen ?? [];

// What a specification says by the names of its model: such lines differ between models in any case.
const OF_THE_MODEL =
  /^\/(experiments\/\d+\/)?(parameters|outputs|signals|initial_state|tolerances|process_noise|model_search|constraints|priors)(\/|$)/;

export const isOfTheModel = (pointer) => OF_THE_MODEL.test(pointer);

// The interval of an estimate counts the errors of assumed values where the result has that interval,
// else noise alone.
export function intervalOf(parameter) {
  const interval = parameter?.total_interval ?? parameter?.confidence_interval;
  return interval ? { lower: interval.lower, upper: interval.upper, level: interval.level } : null;
}

// The common range shows all intervals of a row: it reaches over the ends of the intervals that have
// ends and over every estimate, a little further, and is logarithmic where those values spread over
// decades.
export function commonRange(parameters) {
  const estimates = parameters.filter(Boolean);
  const ends = estimates
    .flatMap((parameter) => {
      const interval = intervalOf(parameter);
      return [parameter.estimate, interval?.lower, interval?.upper];
    })
    .filter((value) => Number.isFinite(value));
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

// Places a value on a range, from 0 to 1; a value outside the range stands at its end.
export function place(value, { log, low, high }) {
  const at = log
    ? Math.log(Math.max(value, 1e-300) / low) / Math.log(high / low)
    : (value - low) / (high - low);
  return Math.min(1, Math.max(0, at));
}
