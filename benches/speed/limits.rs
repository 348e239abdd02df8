//! How fast this processor takes square roots and divides: what no kernel with as many of them can
//! fall below.

use super::{RUNS, shortest};
use greybox::numerics::lanes::{Lanes, Real};
use greybox::numerics::width::{self, Wide};
use serde_json::{Value, json};

/// Rows, which all stay in the nearest cache; none waits for another.
const ROWS: usize = 64;

/// Operations on each row.
const ROUNDS: usize = 10_000;

/// Square roots in a derivative of the servo, and divisions.
const OF_A_DERIVATIVE: [f64; 2] = [4.0, 4.0];

/// The same operation on every row, again and again.
struct Probe<'a, R, F> {
    rows: &'a mut [R],
    operation: F,
}

impl<R: Real, F: Fn(R) -> R> Wide for Probe<'_, R, F> {
    type Output = ();

    #[inline(always)]
    fn work(self) {
        for _ in 0..ROUNDS {
            for row in self.rows.iter_mut() {
                *row = (self.operation)(*row);
            }
        }
    }
}

/// What an operation takes for one number [ns].
fn nanoseconds<R: Real>(operation: impl Fn(R) -> R + Copy) -> f64 {
    let mut rows = [R::splat(1.37); ROWS];
    let (seconds, ()) = shortest(RUNS, || {
        let rows = std::hint::black_box(&mut rows[..]);
        width::at_full_width(Probe { rows, operation });
    });
    1e9 * seconds / (ROUNDS * ROWS * R::WIDTH) as f64
}

/// In double precision, on one core.
pub fn figures() -> Value {
    let (some, little) = (Lanes::splat(1.0001), Lanes::splat(0.3));
    let times = [
        nanoseconds(
            #[inline(always)]
            |x: Lanes| (x + little).sqrt(),
        ),
        nanoseconds(
            #[inline(always)]
            |x: Lanes| some / x,
        ),
    ];
    let pairs = times.iter().zip(OF_A_DERIVATIVE);
    json!({
        "square_root_nanoseconds": times[0],
        "division_nanoseconds": times[1],
        "roots_and_divisions_of_a_derivative_nanoseconds":
            pairs.map(|(time, count)| time * count).sum::<f64>(),
    })
}
