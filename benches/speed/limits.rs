//! How fast this processor takes square roots and divides: what no kernel with as many of them can
//! fall below.

use super::{RUNS, shortest};
use greybox::simulation::lanes::{Lanes, Real, SingleLanes};
use greybox::simulation::width::{self, Wide};
use serde_json::{Value, json};

/// Rows that are worked on in turns, so that none waits for its own last result.
const ROWS: usize = 4;

/// Operations on each row.
const ROUNDS: usize = 100_000;

/// Square roots in a derivative of the servo, and divisions.
const OF_A_DERIVATIVE: [f64; 2] = [4.0, 4.0];

/// The same operation on every row, again and again.
struct Probe<R, F> {
    rows: [R; ROWS],
    operation: F,
}

impl<R: Real, F: Fn(R) -> R> Wide for Probe<R, F> {
    type Output = [R; ROWS];

    #[inline(always)]
    fn work(mut self) -> [R; ROWS] {
        for _ in 0..ROUNDS {
            for row in &mut self.rows {
                *row = (self.operation)(*row);
            }
        }
        self.rows
    }
}

/// What an operation takes for one number [ns].
fn nanoseconds<R: Real>(operation: impl Fn(R) -> R + Copy) -> f64 {
    let rows = [R::splat(1.37); ROWS];
    let (seconds, _) = shortest(RUNS, || {
        let rows = std::hint::black_box(rows);
        std::hint::black_box(width::at_full_width(Probe { rows, operation }))
    });
    1e9 * seconds / (ROUNDS * ROWS * R::WIDTH) as f64
}

fn of<R: Real>() -> Value {
    let (some, little) = (R::splat(1.0001), R::splat(0.3));
    let times = [
        nanoseconds(
            #[inline(always)]
            |x: R| (x + little).sqrt(),
        ),
        nanoseconds(
            #[inline(always)]
            |x: R| some / x,
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

/// In both precisions, on one core.
pub fn figures() -> Value {
    json!({ "single_precision": of::<SingleLanes>(), "double_precision": of::<Lanes>() })
}
