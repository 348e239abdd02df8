// @ts-check
// This module writes numbers, times and units as people read them.

const SUPERSCRIPT = {
  "-": "⁻",
  0: "⁰",
  1: "¹",
  2: "²",
  3: "³",
  4: "⁴",
  5: "⁵",
  6: "⁶",
  7: "⁷",
  8: "⁸",
  9: "⁹",
};

const superscript = (exponent) => [...String(exponent)].map((character) => SUPERSCRIPT[character]).join("");

export function power(exponent) {
  return `10${superscript(exponent)}`;
}

// Writes a number with a few significant digits, and a dash where there is no number. Zeros at the end
// are dropped unless they are `kept`, as the digits of a measured value are.
export function number(value, digits = 4, kept = false) {
  const trimmed = (text) => (kept || !text.includes(".") ? text : text.replace(/\.?0+$/, ""));
  if (value === null || value === undefined || !Number.isFinite(value)) {
    return "–";
  }
  if (value === 0) {
    return "0";
  }
  const magnitude = Math.abs(value);
  if (magnitude >= 1e-3 && magnitude < 1e6) {
    const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(magnitude)));
    return minus(trimmed(value.toFixed(Math.min(decimals, 12))));
  }
  const [mantissa, exponent] = value.toExponential(digits - 1).split("e");
  return minus(`${trimmed(mantissa)}·${power(Number(exponent))}`);
}

// Reads a number as people type it, also with a decimal comma; the answer is NaN where the text is no
// number.
export function numberOf(text) {
  const bare = String(text)
    .trim()
    .replace(/[\s\u202f\u00a0]/g, "")
    .replace("−", "-")
    .replace(",", ".");
  return bare === "" ? NaN : Number(bare);
}

export function count(value) {
  return Number.isFinite(value) ? value.toLocaleString("en-GB").replaceAll(",", "\u202f") : "–";
}

export function percent(value) {
  return Number.isFinite(value) ? `${number(value, 4)} %` : "–";
}

// Writes an estimate and its standard error, both to the second digit of the error.
export function withError(estimate, error) {
  if (!Number.isFinite(error) || !Number.isFinite(estimate) || error <= 0) {
    return [number(estimate, 6), "–"];
  }
  const above = Math.floor(Math.log10(Math.max(Math.abs(estimate), error)));
  const digits = Math.min(10, Math.max(2, above - Math.floor(Math.log10(error)) + 2));
  return [number(estimate, digits, true), number(error, 2, true)];
}

export function quantity(text, unit) {
  return unit && unit !== "1" && text !== "–" ? `${text}\u00a0${unitSigns(unit)}` : text;
}

// Writes `N*s/m^2` as N·s/m².
/** @param {string} unit */
export function unitSigns(unit) {
  return unit.replaceAll("*", "·").replace(/\^(-?\d+)/g, (_, exponent) => superscript(exponent));
}

/** @param {string | null | undefined} unit */
export function unitText(unit) {
  return ["1", "-", "", null, undefined].includes(unit) ? "–" : unitSigns(unit ?? "");
}

export function duration(seconds) {
  if (!Number.isFinite(seconds)) {
    return "–";
  }
  if (seconds < 120) {
    return `${number(seconds, 3)} s`;
  }
  const minutes = Math.round(seconds / 60);
  if (minutes < 120) {
    return `${minutes} min`;
  }
  const hours = Math.round(minutes / 60);
  return hours < 72
    ? `${Math.floor(minutes / 60)} h ${minutes % 60} min`
    : `${Math.floor(hours / 24)} d ${hours % 24} h`;
}

// Writes a number of bytes in the largest unit that leaves it above one.
export function size(bytes) {
  const step = Math.min(3, Math.max(0, Math.floor(Math.log2(Math.max(bytes, 1)) / 10)));
  return Number.isFinite(bytes)
    ? `${number(bytes / 1024 ** step, 3)} ${["B", "KiB", "MiB", "GiB"][step]}`
    : "–";
}

/** @type {Map<string, Intl.DateTimeFormat>} */
const instantFormats = new Map();

// A format takes milliseconds to make, so that it is made when the first instant needs it.
/** @param {"short" | "medium"} timeStyle */
function instantFormat(timeStyle) {
  const format =
    instantFormats.get(timeStyle) ?? new Intl.DateTimeFormat(undefined, { dateStyle: "medium", timeStyle });
  instantFormats.set(timeStyle, format);
  return format;
}

/** @type {Intl.DateTimeFormat | null} */
let zoneFormat = null;

// The zone of the reader's clock at an instant, as in UTC or GMT+2.
/** @param {Date} [date] */
export function zoneName(date = new Date()) {
  zoneFormat ??= new Intl.DateTimeFormat(undefined, { timeZoneName: "short" });
  return zoneFormat.formatToParts(date).find(({ type }) => type === "timeZoneName")?.value ?? "";
}

// Writes an instant with its zone to the minute, or to the second where the second tells instants apart.
export function instant(text, toTheSecond = false) {
  if (!text) {
    return "–";
  }
  const element = document.createElement("time");
  element.dateTime = text;
  element.title = text;
  element.textContent = instantText(new Date(text), toTheSecond);
  return element;
}

/** @param {Date} date */
export function instantText(date, toTheSecond = false) {
  return `${instantFormat(toTheSecond ? "medium" : "short").format(date)} ${zoneName(date)}`;
}

// Writes the instants in a sentence of the server by the clock of the reader.
/** @param {string} text */
export const withInstants = (text) =>
  text.split(/(\d{4}-\d\d-\d\dT\d\d:\d\d:[\d.]+Z)/).map((part, k) => (k % 2 ? instant(part, true) : part));

// Writes the span between two instants to the second, with its zone; a day that both share stands once.
export function timeSpan(from, to) {
  return from && to
    ? `${instantFormat("medium").formatRange(new Date(from), new Date(to))} ${zoneName(new Date(to))}`
    : "–";
}

export function words(name) {
  return name.replaceAll("_", " ");
}

const METHODS = { cma_es: "CMA-ES", icra_genetic: "ICRA genetic", multistart_lm: "multistart LM" };

/** Names a method of the search. @param {string} method */
export const methodText = (method) => METHODS[method] ?? words(method);

// Names an assumption in words: `pump.input_gain` is the input gain of pump.
/** @param {string} assumption */
export function assumptionWords(assumption) {
  const [part, about] = assumption.split(".");
  return about ? `${words(about)} of ${words(part)}` : words(part);
}

// Names a model in words. The name of a model of equations ends in their digest, whose first digits tell models of one
// name apart.
/** @param {string} model */
export function modelText(model) {
  const [name, digest] = model.split("@");
  return digest ? `${words(name)} @${digest.slice(0, 4)}` : words(name);
}

function minus(text) {
  return text.replace("-", "−");
}

// Writes text as it stands in markup.
export function escaped(text) {
  const entities = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" };
  return String(text).replace(/[&<>"]/g, (character) => entities[character]);
}
