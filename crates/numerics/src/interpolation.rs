//! Interpolation between samples.

/// The straight line through the points `(x0, y0)` and `(x1, y1)`, at `x`. NaN where an end that
/// matters is NaN: at `x0` and `x1` themselves the value is the sample, whatever the other end is.
#[must_use]
pub fn linear([x0, x1]: [f64; 2], [y0, y1]: [f64; 2], x: f64) -> f64 {
    if x == x0 {
        y0
    } else if x == x1 {
        y1
    } else {
        let weight = (x - x0) / (x1 - x0);
        y0 * (1.0 - weight) + y1 * weight
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_value_lies_between_its_neighbours(
            y0 in -1e6..1e6, y1 in -1e6..1e6, weight in 0.0..=1.0,
        ) {
            let y = linear([2.0, 5.0], [y0, y1], 2.0 + 3.0 * weight);
            let margin = 1e-9;
            prop_assert!(y >= f64::min(y0, y1) - margin && y <= f64::max(y0, y1) + margin);
        }

        #[test]
        fn a_straight_line_is_reproduced(slope in -10.0..10.0, x in 0.0..1.0) {
            let y = linear([0.0, 1.0], [1.0, 1.0 + slope], x);
            prop_assert!(f64::abs(y - (1.0 + slope * x)) < 1e-12);
        }
    }

    #[test]
    fn a_missing_neighbour_is_not_bridged() {
        assert_eq!(linear([0.0, 1.0], [3.0, f64::NAN], 0.0), 3.0);
        assert!(linear([0.0, 1.0], [3.0, f64::NAN], 0.5).is_nan());
    }
}
