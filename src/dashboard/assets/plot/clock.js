// @ts-check
// The clock of a recording tells the time of day of its samples, in the time zone that their source
// counted in.

const DAY = 86_400;
// A day is cut off at a tick that is nearer to the left edge than this share of the step between ticks.
const EDGE = 0.3;
// The steps between two ticks of a clock [s].
const STEPS = [
  0.001,
  0.002,
  0.005,
  0.01,
  0.02,
  0.05,
  0.1,
  0.2,
  0.5,
  1,
  2,
  5,
  10,
  15,
  30,
  60,
  120,
  300,
  600,
  900,
  1800,
  3600,
  7200,
  10_800,
  21_600,
  43_200,
  DAY,
  2 * DAY,
  7 * DAY,
  14 * DAY,
  30 * DAY,
  90 * DAY,
  365 * DAY,
];

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

  // The local time so many seconds after the first sample: the day, and the milliseconds since its midnight.
  local(seconds) {
    const instant = this.start + 1000 * seconds + this.shift;
    const part = Object.fromEntries(
      this.parts.formatToParts(new Date(instant)).map(({ type, value }) => [type, value]),
    );
    const [hours, minutes, whole] = [part.hour, part.minute, part.second].map(Number);
    const fraction = ((instant % 1000) + 1000) % 1000;
    return {
      day: `${part.year}-${part.month}-${part.day}`,
      ms: 1000 * (3600 * hours + 60 * minutes + whole) + fraction,
    };
  }

  // The day and the time of day, with so many decimals of a second.
  text(seconds, decimals = 3) {
    // The text is that of the nearest instant that the decimals can write.
    const unit = 10 ** -decimals;
    const { day, ms } = this.local(Math.round(seconds / unit) * unit);
    return `${day} ${timeOf(ms, decimals)}`;
  }

  // The ticks between two instants, at round local times: at most so many.
  ticks(from, to, most) {
    const step = STEPS.find((size) => (to - from) / size <= most) ?? STEPS.at(-1);
    const sinceMidnight = this.local(from).ms / 1000;
    const offset = step >= DAY ? sinceMidnight : sinceMidnight % step;
    const ticks = [];
    for (let tick = from - offset; tick <= to; tick += step) {
      if (tick >= from) {
        ticks.push(tick);
      }
    }
    return ticks;
  }

  // The texts of ticks: the time of day, and the day where a tick is the first of it. A first tick that stands at
  // the left edge, which begins at `from`, leaves the day to the second.
  texts(ticks, from = -Infinity) {
    const step = ticks.length > 1 ? ticks[1] - ticks[0] : 1;
    const isAtEdge = ticks.length > 1 && ticks[0] - from < EDGE * step;
    const decimals = step >= 0.999 ? 0 : step >= 0.0999 ? 1 : step >= 0.00999 ? 2 : 3;
    let before = null;
    return ticks.map((tick, k) => {
      const { day, ms } = this.local(tick);
      const isFirst = day !== before && !(k === 0 && isAtEdge);
      before = isFirst ? day : before;
      const time = step >= 60 ? timeOf(ms, 0).slice(0, 5) : timeOf(ms, decimals);
      return step >= DAY ? day : isFirst ? `${time}\n${day}` : time;
    });
  }
}

function formatOf(timeZone) {
  return new Intl.DateTimeFormat("en-GB", {
    timeZone,
    hourCycle: "h23",
    year: "numeric",
    month: "2-digit",
    day: "2-digit",
    hour: "2-digit",
    minute: "2-digit",
    second: "2-digit",
  });
}

function timeOf(ms, decimals) {
  const two = (value) => String(Math.floor(value)).padStart(2, "0");
  const seconds = (ms % 60_000) / 1000;
  const tail = decimals > 0 ? seconds.toFixed(decimals).padStart(3 + decimals, "0") : two(seconds);
  return `${two(ms / 3_600_000)}:${two((ms / 60_000) % 60)}:${tail}`;
}
