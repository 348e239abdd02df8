// @ts-check
// This module shows instants, which are seconds since 1970, as the clock of the reader does: as text, and
// as the ticks of an axis.

const DAY_S = 86_400;
const STEPS_S = [
  ...[-3, -2, -1].flatMap((exponent) => [1, 2, 5].map((factor) => factor * 10 ** exponent)),
  ...[1, 2, 5, 10, 15, 30],
  ...[1, 2, 5, 10, 15, 30].map((minutes) => 60 * minutes),
  ...[1, 2, 3, 6, 12].map((hours) => 3600 * hours),
];
const STEPS_DAYS = [1, 2, 7, 14];
const STEPS_MONTHS = [1, 2, 3, 6, 12, 24, 60, 120, 240, 600];

const DAY = new Intl.DateTimeFormat(undefined, { day: "numeric", month: "short" });
const DATE = new Intl.DateTimeFormat(undefined, { dateStyle: "medium" });

const two = (value) => String(value).padStart(2, "0");

// Writes the time of day with as many digits as a step between two instants asks for.
function timeOfDay(date, step) {
  const minutes = `${two(date.getHours())}:${two(date.getMinutes())}`;
  const seconds = step < 60 ? `:${two(date.getSeconds())}` : "";
  const decimals = Math.min(3, Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  const fraction = decimals ? `.${String(date.getMilliseconds()).padStart(3, "0").slice(0, decimals)}` : "";
  return minutes + seconds + fraction;
}

// Writes an instant with its date, to the millisecond.
export function instantText(seconds) {
  const date = dateOf(seconds);
  return `${DATE.format(date)} ${timeOfDay(date, 0.001)}`;
}

export const isoText = (seconds) => dateOf(seconds).toISOString();

function dateOf(seconds) {
  return new Date(Math.round(1000 * seconds));
}

/**
 * Chooses about so many round instants of a range: [seconds, text]. The date stands in a second line of
 * the first text, and wherever another day or year begins.
 *
 * @param {number[]} range
 * @param {number} steps
 * @returns {[number, string][]}
 */
export function clockTicks([from, to], steps) {
  const rough = (to - from) / steps;
  const short = STEPS_S.find((step) => step >= rough);
  if (short) {
    return withDates(evenInstants(from, to, short), (date) => timeOfDay(date, short), DATE_OF_DAY);
  }
  const days = STEPS_DAYS.find((step) => step * DAY_S >= rough);
  if (days) {
    return withDates(calendarInstants(from, to, { days }), (date) => DAY.format(date), YEAR);
  }
  const last = STEPS_MONTHS[STEPS_MONTHS.length - 1];
  const months = STEPS_MONTHS.find((step) => 30.4 * step * DAY_S >= rough) ?? last;
  return withDates(calendarInstants(from, to, { months }), (date) => MONTH.format(date), YEAR);
}

const MONTH = new Intl.DateTimeFormat(undefined, { month: "short" });
const DATE_OF_DAY = (date) => DAY.format(date);
const YEAR = (date) => String(date.getFullYear());

// Even steps begin at the midnight of the reader.
function evenInstants(from, to, step) {
  const shift = -60 * dateOf(from).getTimezoneOffset();
  const first = Math.ceil((from + shift) / step - 1e-9);
  const last = Math.floor((to + shift) / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, k) => (first + k) * step - shift);
}

function calendarInstants(from, to, { days = 0, months = 0 }) {
  const begin = dateOf(from);
  const month = months ? Math.floor(begin.getMonth() / months) * months : begin.getMonth();
  const instants = [];
  for (let k = 0; ; k += 1) {
    const day = months ? 1 : begin.getDate() + k * days;
    const seconds = new Date(begin.getFullYear(), month + k * months, day).getTime() / 1000;
    if (seconds > to) {
      return instants;
    }
    if (seconds >= from) {
      instants.push(seconds);
    }
  }
}

function withDates(instants, text, about) {
  let before = null;
  return instants.map((seconds) => {
    const date = dateOf(seconds);
    const context = about(date);
    const isNew = context !== before;
    before = context;
    return [seconds, isNew ? `${text(date)}\n${context}` : text(date)];
  });
}

// The axis of a plot has about one tick in so many pixels.
const TICK_PIXELS = 95;

/** @returns {any} */
export function clockAxis() {
  let ticks = [];
  return {
    size: 42,
    splits: (chart, _, from, to) => {
      ticks = clockTicks([from, to], Math.max(2, chart.width / TICK_PIXELS));
      return ticks.map(([seconds]) => seconds);
    },
    filter: (_, splits) => splits,
    values: () => ticks.map(([, text]) => text),
  };
}
