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

/// The number below which a standard normal number lies with a probability between 0 and 1.
///
/// The rational approximation 26.2.23 of M. Abramowitz, I. A. Stegun, *Handbook of Mathematical
/// Functions*, 1964, whose error is below 4.5e-4, and two steps of Halley's method on `erfc`.
#[must_use]
pub fn normal_quantile(probability: f64) -> f64 {
    const NUMERATOR: [f64; 3] = [2.515_517, 0.802_853, 0.010_328];
    const DENOMINATOR: [f64; 4] = [1.0, 1.432_788, 0.189_269, 0.001_308];
    let tail = probability.min(1.0 - probability);
    let t = (-2.0 * libm::log(tail)).sqrt();
    let sum = |of: &[f64]| of.iter().rev().fold(0.0, |sum, factor| sum * t + factor);
    let mut beyond = t - sum(&NUMERATOR) / sum(&DENOMINATOR);
    for _ in 0..2 {
        let share = 0.5 * libm::erfc(beyond / std::f64::consts::SQRT_2);
        let density = libm::exp(-0.5 * beyond * beyond) / (2.0 * std::f64::consts::PI).sqrt();
        let step = (share - tail) / density;
        beyond += step / (1.0 - 0.5 * beyond * step);
    }
    if probability < 0.5 { -beyond } else { beyond }
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

    /// The values are those of `scipy.stats.norm.ppf` (SciPy 1.17.1).
    #[test]
    fn quantiles_of_the_normal_distribution_agree_with_an_independent_program() {
        for (probability, expected) in [
            (0.5, 0.0),
            (0.975, 1.959_963_984_540_054),
            (0.025, -1.959_963_984_540_054),
            (0.3, -0.524_400_512_708_040_9),
            (1e-6, -4.753_424_308_822_899),
            (1e-12, -7.034_483_825_301_132),
        ] {
            let off = normal_quantile(probability) - expected;
            assert!(off.abs() < 1e-12, "{probability}: {off}");
        }
    }

    #[test]
    fn a_mean_square_is_judged_by_how_many_values_it_has() {
        assert!(is_unit_mean_square(1.3, 200));
        assert!(!is_unit_mean_square(1.3, 20_000));
        assert!(!is_unit_mean_square(0.5, 200));
    }
}
