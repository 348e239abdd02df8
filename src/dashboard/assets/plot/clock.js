// @ts-check
// A clock tells the local time of instants, as text and as the ticks of an axis. The clock of a recording
// counts from its first sample, in the time zone that its source counted in; the clock of the reader counts
// from 1970.

const DAY_MS = 86_400_000;
const STEPS_MS = [
  ...[0, 1, 2].flatMap((exponent) => [1, 2, 5].map((factor) => factor * 10 ** exponent)),
  ...[1, 2, 5, 10, 15, 30].map((seconds) => 1000 * seconds),
  ...[1, 2, 5, 10, 15, 30].map((minutes) => 60_000 * minutes),
  ...[1, 2, 3, 6, 12].map((hours) => 3_600_000 * hours),
];
const STEPS_DAYS = [1, 2, 7, 14];
const STEPS_MONTHS = [1, 2, 3, 6, 12, 24, 60, 120, 240, 600];
// The axis of a plot has about one tick in so many pixels.
const TICK_PIXELS = 100;
// A date is cut off at a tick that is nearer to the left edge than this share of the step between ticks.
const EDGE = 0.3;

// Local times are kept as the instants at which clocks of UTC show them.
const DAY = new Intl.DateTimeFormat(undefined, { timeZone: "UTC", day: "numeric", month: "short" });
const MONTH = new Intl.DateTimeFormat(undefined, { timeZone: "UTC", month: "short" });
const isoDay = (wall) => new Date(wall).toISOString().slice(0, 10);
const year = (wall) => String(new Date(wall).getUTCFullYear());

export const secondsOf = (text) => Date.parse(text) / 1000;
export const isoText = (seconds) => new Date(Math.round(1000 * seconds)).toISOString();

// Gives the clock of a recording, and null where its source did not say when it begins.
/** @param {{ start?: string | null, zone?: string | null } | null | undefined} recording */
export function clockOf(recording) {
  const start = Date.parse(recording?.start ?? "");
  return Number.isFinite(start) ? new Clock(start, recording.zone || "UTC") : null;
}

class Clock {
  /** @param {number} start milliseconds since 1970 @param {string} zone */
  constructor(start, zone) {
    this.start = start;
    this.zone = zone;
    const [, sign, hours, minutes] = /^([+-])(\d\d):?(\d\d)$/.exec(zone) ?? [];
    // Not every browser knows offsets as zones; local times of an offset are those of UTC, shifted.
    this.shift = sign ? Number(`${sign}1`) * (60 * Number(hours) + Number(minutes)) * 60_000 : 0;
    try {
      this.parts = formatOf(sign ? "UTC" : zone);
    } catch {
      // A zone that the browser does not know is counted as UTC.
      this.zone = "UTC";
      this.parts = formatOf("UTC");
    }
  }

  // The local time so many seconds after the start [ms].
  wall(seconds) {
    const instant = Math.round(this.start + 1000 * seconds) + this.shift;
    const part = Object.fromEntries(
      this.parts.formatToParts(new Date(instant)).map(({ type, value }) => [type, Number(value)]),
    );
    const whole = Date.UTC(part.year, part.month - 1, part.day, part.hour, part.minute, part.second);
    return whole + (((instant % 1000) + 1000) % 1000);
  }

  // The seconds after the start at which clocks show a local time, near an instant whose offset is taken first.
  instant(wall, near) {
    const by = (seconds) => this.wall(seconds) - Math.round(this.start + 1000 * seconds);
    const guess = (wall - by(near) - this.start) / 1000;
    return (wall - by(guess) - this.start) / 1000;
  }

  // The day and the time of day, with so many decimals of a second.
  text(seconds, decimals = 3) {
    const wall = this.wall(seconds);
    return `${isoDay(wall)} ${timeOf(wall, 10 ** (3 - decimals))}`;
  }

  /**
   * Chooses about so many round instants of a range: [seconds, text]. The date stands in a second line of
   * the first text, and wherever another day or year begins; a first tick that stands at the left edge leaves
   * the date to the second.
   *
   * @param {number[]} range
   * @param {number} steps
   * @returns {[number, string][]}
   */
  ticks([from, to], steps) {
    const rough = (1000 * (to - from)) / steps;
    const short = STEPS_MS.find((step) => step >= rough);
    const days = STEPS_DAYS.find((step) => step * DAY_MS >= rough);
    const months = STEPS_MONTHS.find((step) => 30.4 * step * DAY_MS >= rough) ?? STEPS_MONTHS.at(-1);
    const [walls, text, about] = short
      ? [evenWalls(this.wall(from), this.wall(to), short), (wall) => timeOf(wall, short), isoDay]
      : days
        ? [evenWalls(this.wall(from), this.wall(to), days * DAY_MS), (wall) => DAY.format(wall), year]
        : [monthWalls(this.wall(from), this.wall(to), months), (wall) => MONTH.format(wall), year];
    const instants = walls.map((wall) => this.instant(wall, from));
    const isAtEdge = instants.length > 1 && instants[0] - from < EDGE * (instants[1] - instants[0]);
    let before = null;
    return walls.map((wall, k) => {
      const context = about(wall);
      const isNew = context !== before && !(k === 0 && isAtEdge);
      before = isNew ? context : before;
      return [instants[k], isNew ? `${text(wall)}\n${context}` : text(wall)];
    });
  }

  // The axis of a plot, as the library of the plots takes it.
  /** @returns {any} */
  axis() {
    let ticks = [];
    return {
      size: 44,
      splits: (chart, _, from, to) => {
        ticks = this.ticks([from, to], Math.max(2, chart.width / TICK_PIXELS));
        return ticks.map(([seconds]) => seconds);
      },
      filter: (_, splits) => splits,
      values: () => ticks.map(([, text]) => text),
    };
  }
}

// The clock of the reader, for instants in seconds since 1970.
export const READER = new Clock(0, Intl.DateTimeFormat().resolvedOptions().timeZone);

function formatOf(timeZone) {
  const [digits, two] = ["numeric", "2-digit"];
  return new Intl.DateTimeFormat("en-GB", {
    timeZone,
    hourCycle: "h23",
    .../** @type {any} */ ({ year: digits, month: two, day: two, hour: two, minute: two, second: two }),
  });
}

// Writes the time of day with as many digits as a step between two instants asks for.
function timeOf(wall, step) {
  const length = step >= 60_000 ? 5 : step >= 1000 ? 8 : step >= 100 ? 10 : step >= 10 ? 11 : 12;
  return new Date(wall).toISOString().slice(11, 11 + length);
}

function evenWalls(from, to, step) {
  const first = Math.ceil(from / step - 1e-9);
  const last = Math.floor(to / step + 1e-9);
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, k) => (first + k) * step);
}

function monthWalls(from, to, months) {
  const begin = new Date(from);
  const first = Math.floor((12 * begin.getUTCFullYear() + begin.getUTCMonth()) / months) * months;
  const walls = [];
  for (let month = first; ; month += months) {
    const wall = Date.UTC(Math.floor(month / 12), month % 12);
    if (wall > to) {
      return walls;
    }
    if (wall >= from) {
      walls.push(wall);
    }
  }
}
