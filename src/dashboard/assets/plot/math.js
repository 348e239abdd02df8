// @ts-check
// This module has the computations of plots. Its functions are pure.

// Gives the index of the value in a sorted column that is nearest to `value`.
export function nearest(xs, value) {
  let low = 0;
  let high = xs.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (xs[middle] < value) {
      low = middle;
    } else {
      high = middle;
    }
  }
  return high < 0 || Math.abs(xs[low] - value) <= Math.abs(xs[high] - value) ? low : high;
}

// A click is aimed across more carefully than upwards: a pixel across counts like so many pixels up.
const ACROSS = 4;

/**
 * Gives the index of the sample that a click at a point in pixels is about, or null where there are no samples.
 * `at(x, y)` gives the pixels of a sample.
 *
 * @param {number[]} xs
 * @param {(number | null | undefined)[]} ys
 * @param {[number, number]} point
 * @param {(x: number, y: number) => number[]} at
 * @returns {number | null}
 */
export function sampleAt(xs, ys, point, at) {
  let [index, least] = [/** @type {number | null} */ (null), Infinity];
  xs.forEach((x, k) => {
    const y = ys[k];
    if (y !== null && y !== undefined) {
      const [across, up] = at(x, y);
      const distance = Math.hypot(ACROSS * (across - point[0]), up - point[1]);
      if (distance < least) {
        [index, least] = [k, distance];
      }
    }
  });
  return index;
}

// The curve has so many points between two fits.
const BETWEEN = 24;

/**
 * Draws the curve of a likelihood profile through its fits: [value, rise, rise of the fit or null]. The
 * root of the rise is nearly straight in the value, so the root is drawn straight between two fits.
 *
 * @param {{ value: number, excess: number }[]} profile
 */
export function profileCurve(profile) {
  const middle = profile.findIndex(({ excess }) => excess === 0);
  const root = (k) => Math.sqrt(profile[k].excess) * (k < middle ? -1 : 1);
  /** @type {[number, number, number | null][]} */
  const points = [];
  profile.forEach(({ value, excess }, k) => {
    const last = k + 1 === profile.length;
    for (let part = 0; part < (last ? 1 : BETWEEN); part += 1) {
      const share = part / BETWEEN;
      const rise = share === 0 ? excess : (root(k) + share * (root(k + 1) - root(k))) ** 2;
      points.push([
        share === 0 ? value : value + share * (profile[k + 1].value - value),
        rise,
        share === 0 ? excess : null,
      ]);
    }
  });
  return points;
}

// Puts a gap into a column wherever a span without samples lies between two instants, so that no line is drawn
// across the span: gives the instants and the values.
/**
 * @param {number[]} xs
 * @param {(number | null)[]} ys
 * @param {{ from: number, to: number }[]} spans
 */
export function withGaps(xs, ys, spans) {
  const middles = spans.map(({ from, to }) => (from + to) / 2).sort((a, b) => a - b);
  const [times, values] = [[], []];
  let next = 0;
  xs.forEach((x, k) => {
    while (next < middles.length && middles[next] < x) {
      if (k > 0 && middles[next] > xs[k - 1]) {
        times.push(middles[next]);
        values.push(null);
      }
      next += 1;
    }
    times.push(x);
    values.push(ys[k]);
  });
  return [times, values];
}

/** @typedef {{ from: number, to: number, role: string }} RecordingWindow */

const sixDigits = (value) => Number(value.toPrecision(6));

// The part between two ends, in their order and within the recording.
/** @param {number[]} ends @param {number} duration @returns {[number, number]} */
export function partWithin(ends, duration) {
  const within = ends.map((end) => Math.min(duration, Math.max(0, end)));
  return [sixDigits(Math.min(...within)), sixDigits(Math.max(...within))];
}

// Moves a window within the recording; its length stays.
/** @param {RecordingWindow} window @param {number} shift @param {number} duration @returns {RecordingWindow} */
export function movedWindow(window, shift, duration) {
  const length = window.to - window.from;
  const from = Math.max(0, Math.min(duration - length, window.from + shift));
  return { ...window, from: sixDigits(from), to: sixDigits(from + length) };
}

// The longest part of a recording that no window uses, or null.
/** @param {{ from: number, to: number }[]} windows @param {number} duration @returns {[number, number] | null} */
export function longestUnused(windows, duration) {
  /** @type {[number, number] | null} */
  let longest = null;
  let from = 0;
  const byStart = [...windows].sort((a, b) => a.from - b.from);
  for (const { from: end, to: next } of [...byStart, { from: duration, to: duration }]) {
    if (end > from && (!longest || end - from > longest[1] - longest[0])) {
      longest = [from, end];
    }
    from = Math.max(from, next);
  }
  return longest;
}

// The window of an experiment as a specification has it; undefined stands for the whole recording.
/** @param {{ from: number, to: number }} window @param {number} duration */
export function specifiedWindow({ from, to }, duration) {
  /** @type {{ from_s?: number, to_s?: number }} */
  const window = {};
  if (from > 0) {
    window.from_s = sixDigits(from);
  }
  if (to < duration) {
    window.to_s = sixDigits(to);
  }
  return Object.keys(window).length ? window : undefined;
}

/** @typedef {{ from_s: number, to_s: number, signals?: string[] | null }} ExcludedSpan */

// The spans that are left out of some signals, or of all where none are named, as plots shade them.
/** @param {ExcludedSpan[] | undefined} spans @param {string} kind */
export const shadedSpans = (spans, kind = "excluded") =>
  (spans ?? []).map(({ from_s, to_s, signals = null }) => ({ from: from_s, to: to_s, kind, signals }));

// Answers whether a span is about a signal.
/** @param {string} name @returns {(span: { signals?: string[] | null }) => boolean} */
export const isAbout =
  (name) =>
  ({ signals }) =>
    !signals || signals.includes(name);
