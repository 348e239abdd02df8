//! How large an error of a value is.

use crate::estimation::problem::Coordinate;
use greybox_simulation::model::Scale;

/// A total standard error beyond this share of the value makes the trust low.
pub(super) const LOW_SHARE: f64 = 0.5;
/// Where a linear search range holds 0, an error is measured by this share of its largest magnitude
/// at the least: an offset that is not there is known to no share of its value.
const SHARE_OF_RANGE: f64 = 0.25;

/// An error of a value as a share of what it is measured by.
pub(super) fn share_of_magnitude(coordinate: &Coordinate, value: f64, error: f64) -> f64 {
    error / magnitude(coordinate, value).max(f64::MIN_POSITIVE)
}

/// Whether an error alone makes a value one that cannot be trusted.
pub fn is_too_wide(coordinate: &Coordinate, value: f64, error: f64) -> bool {
    let share = share_of_magnitude(coordinate, value, error);
    share.is_nan() || share > LOW_SHARE
}

/// What the error of a value is measured by: its magnitude, or a share of the search range where the
/// range says that the value may be 0.
pub(super) fn magnitude(coordinate: &Coordinate, value: f64) -> f64 {
    let Coordinate {
        lower,
        upper,
        scale,
        ..
    } = *coordinate;
    let of_range = SHARE_OF_RANGE * lower.abs().max(upper.abs());
    match scale == Scale::Linear && lower <= 0.0 && upper >= 0.0 {
        true => value.abs().max(of_range),
        false => value.abs(),
    }
}
