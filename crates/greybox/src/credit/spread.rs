//! The error spread σ of the paper's Eq. 10, which it calls "dynamically adjusted".
//!
//! The rule used by default is ours, derived from the recursion: after T updates with gain ν the
//! log credits of two candidates differ by about ν·T·Δē/σ, Δē the difference of their mean
//! errors, so
//!
//! `σ = ν·T·std_k(ē_k) / (q·√(2 ln K))`, `q = √(1 − h*)/h*`
//!
//! keeps the entropy at the stop near the share h* of its maximum, however far the population has
//! converged. A σ tied to the mean error itself decays into random search as the population
//! converges, because the differences vanish against it.

use greybox_numerics::statistics;

/// How σ follows from the candidates' mean errors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// The rule above; holds the share h* of the largest entropy that it aims at.
    Concentration(f64),
    /// The mean of the candidates' errors.
    MeanError,
    /// The lowest of the candidates' errors.
    BestError,
}

/// Errors beyond this many interquartile ranges above the upper quartile count as that much, so
/// that one hopeless candidate does not stretch σ for all others.
const WINSOR_RANGES: f64 = 1.5;

/// σ for a generation. `mean_errors` holds NaN or infinity for candidates that failed, which are
/// left out; `growth` is ν·T. Infinite (no candidate is preferred) where all errors are equal.
#[must_use]
pub fn error_spread(rule: Rule, mean_errors: &[f64], growth: f64) -> f64 {
    let sound: Vec<f64> = mean_errors
        .iter()
        .copied()
        .filter(|error| error.is_finite())
        .collect();
    let spread = match rule {
        Rule::MeanError => statistics::mean(sound).unwrap_or(0.0),
        Rule::BestError => statistics::range(&sound).map_or(0.0, |(lowest, _)| lowest),
        Rule::Concentration(target) => {
            let deviation = statistics::standard_deviation(&winsorised(&sound)).unwrap_or(0.0);
            let q = (1.0 - target).sqrt() / target;
            let candidates = (mean_errors.len().max(2)) as f64;
            growth * deviation / (q * (2.0 * libm::log(candidates)).sqrt())
        }
    };
    if spread > 0.0 { spread } else { f64::INFINITY }
}

fn winsorised(errors: &[f64]) -> Vec<f64> {
    let quartile = |share| statistics::quantile(errors, share);
    let (Some(lower), Some(upper)) = (quartile(0.25), quartile(0.75)) else {
        return Vec::new();
    };
    let limit = upper + WINSOR_RANGES * (upper - lower);
    errors.iter().map(|error| error.min(limit)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spread_follows_the_differences_of_the_errors_not_their_level() {
        let errors = [1.0, 2.0, 3.0, 4.0];
        let lifted = errors.map(|error| error + 100.0);
        let rule = Rule::Concentration(0.5);
        let (a, b) = (
            error_spread(rule, &errors, 10.0),
            error_spread(rule, &lifted, 10.0),
        );
        assert!((a - b).abs() < 1e-9 * a);
    }

    #[test]
    fn failed_candidates_and_one_hopeless_one_do_not_stretch_it() {
        let rule = Rule::Concentration(0.5);
        let plain = error_spread(rule, &[1.0, 1.1, 1.2, 1.3, 1.4, 1.5], 10.0);
        let hopeless = error_spread(
            rule,
            &[1.0, 1.1, 1.2, 1.3, 1.4, 1e9, f64::INFINITY, f64::NAN],
            10.0,
        );
        assert!(hopeless < 4.0 * plain);
    }

    #[test]
    fn equal_errors_prefer_nobody() {
        assert_eq!(
            error_spread(Rule::Concentration(0.5), &[2.0; 5], 10.0),
            f64::INFINITY
        );
    }
}
