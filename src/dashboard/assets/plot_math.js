// Numbers of plots. Pure.

// The index of a sorted column that is nearest to a value.
export function nearest(xs, value) {
  let low = 0;
  let high = xs.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    xs[middle] < value ? (low = middle) : (high = middle);
  }
  return high < 0 || Math.abs(xs[low] - value) <= Math.abs(xs[high] - value) ? low : high;
}
