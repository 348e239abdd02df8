//! Means, spreads and quantiles of samples with holes.

/// A number that is neither infinite nor NaN; none else.
#[must_use]
pub fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// The mean of the numbers that are there; none where there are none.
#[must_use]
pub fn mean(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (sum, count) = values
        .into_iter()
        .filter(|value| !value.is_nan())
        .fold((0.0, 0u64), |(sum, count), value| (sum + value, count + 1));
    (count > 0).then(|| sum / count as f64)
}

/// The standard deviation about the mean of the numbers that are there (divided by their count).
#[must_use]
pub fn standard_deviation(values: &[f64]) -> Option<f64> {
    let centre = mean(values.iter().copied())?;
    let squares = values
        .iter()
        .map(|value| (value - centre) * (value - centre));
    mean(squares).map(f64::sqrt)
}

/// The `share` quantile (0 to 1) by linear interpolation between order statistics.
#[must_use]
pub fn quantile(values: &[f64], share: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values
        .iter()
        .copied()
        .filter(|value| !value.is_nan())
        .collect();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let position = share.clamp(0.0, 1.0) * last as f64;
    let below = position.floor() as usize;
    let above = (below + 1).min(last);
    Some(sorted[below] + (position - below as f64) * (sorted[above] - sorted[below]))
}

/// The largest and the smallest of the numbers that are there.
#[must_use]
pub fn range(values: &[f64]) -> Option<(f64, f64)> {
    let mut present = values.iter().copied().filter(|value| !value.is_nan());
    let first = present.next()?;
    Some(present.fold((first, first), |(low, high), value| {
        (low.min(value), high.max(value))
    }))
}

/// Whether a mean square of so many values is what independent normal values of unit variance
/// have, within three standard deviations of it.
#[must_use]
pub fn is_unit_mean_square(mean_square: f64, count: usize) -> bool {
    let deviation = (2.0 / count as f64).sqrt();
    (mean_square - 1.0).abs() <= 3.0 * deviation
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_numbers_are_left_out() {
        let values = [1.0, f64::NAN, 3.0];
        assert_eq!(mean(values), Some(2.0));
        assert_eq!(standard_deviation(&values), Some(1.0));
        assert_eq!(quantile(&values, 0.25), Some(1.5));
        assert_eq!(range(&values), Some((1.0, 3.0)));
        assert_eq!(mean([f64::NAN]), None);
        assert_eq!(range(&[]), None);
    }

    #[test]
    fn a_mean_square_is_judged_by_how_many_values_it_has() {
        assert!(is_unit_mean_square(1.3, 200));
        assert!(!is_unit_mean_square(1.3, 20_000));
        assert!(!is_unit_mean_square(0.5, 200));
    }
}
