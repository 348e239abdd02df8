//! What the model leaves unexplained: its size against the noise, and its memory.
//!
//! Residuals of a right model are white: their autocorrelation at lags 1 to 25 stays within
//! ±2.58/√n in 99 of 100 cases (L. Ljung, *System Identification*, 1999, ch. 16). With many
//! thousand samples that finds colour too faint to matter, so correlations below
//! `NEGLIGIBLE_CORRELATION` do not count.

use crate::estimation::problem::Problem;
use crate::simulation::single::Outputs;

/// Lags that are looked at.
const LAGS: usize = 25;
/// The 99 % point of the normal distribution, two-sided.
const NORMAL_99: f64 = 2.576;
/// Correlations below this change an interval by less than its own uncertainty.
const NEGLIGIBLE_CORRELATION: f64 = 0.1;

/// What is left unexplained of one output.
#[derive(Clone, Debug)]
pub struct ResidualReport {
    /// The standard deviation that the intervals are made with: the declared noise, or the
    /// residuals' own where that is larger or none is declared `[SI]`.
    pub noise_std: f64,
    /// The mean square of the residuals divided by that of the declared noise.
    pub chi_square_per_sample: Option<f64>,
    /// The correlation of each residual with the next.
    pub lag_1_autocorrelation: Option<f64>,
    /// Whether the residuals have no memory; none where they are too few to tell.
    pub white: Option<bool>,
    /// The number of independent residuals that would tell as much about their mean.
    pub effective_samples: Option<f64>,
}

/// Looks at the residuals of each output in the part that was estimated from.
#[must_use]
pub fn report(problem: &Problem, trajectories: &[Outputs]) -> Vec<ResidualReport> {
    let of_output = |output: usize| {
        let series: Vec<Vec<f64>> = trajectories
            .iter()
            .enumerate()
            .map(|(experiment, trajectory)| series(problem, trajectory, experiment, output))
            .collect();
        describe(
            &series,
            problem.outputs[output].noise_std,
            problem.coordinates.len(),
        )
    };
    (0..problem.outputs.len()).map(of_output).collect()
}

/// measured − simulated of one output in one experiment [SI]; NaN where not measured.
fn series(problem: &Problem, trajectory: &Outputs, experiment: usize, output: usize) -> Vec<f64> {
    let data = &problem.experiments[experiment];
    let simulated = &trajectory[problem.outputs[output].index];
    let used = data.measured[output][..data.estimation_samples]
        .iter()
        .zip(simulated);
    used.map(|(measured, simulated)| measured - simulated)
        .collect()
}

fn describe(series: &[Vec<f64>], declared: Option<f64>, unknowns: usize) -> ResidualReport {
    let (sum, count) = products(series, 0);
    let mean_square = sum / count.max(1) as f64;
    let freedom = count.saturating_sub(unknowns).max(1) as f64;
    let own = (sum / freedom).sqrt().max(f64::MIN_POSITIVE);
    let correlation = |lag: usize| {
        let (sum, pairs) = products(series, lag);
        (pairs > 0 && mean_square > 0.0).then(|| sum / pairs as f64 / mean_square)
    };
    let correlations: Vec<f64> = (1..=LAGS).filter_map(correlation).collect();
    let enough = count > 4 * LAGS && correlations.len() == LAGS;
    let limit = (NORMAL_99 / (count.max(1) as f64).sqrt()).max(NEGLIGIBLE_CORRELATION);
    let outside = correlations.iter().filter(|rho| rho.abs() > limit).count();
    ResidualReport {
        noise_std: declared.map_or(own, |declared| declared.max(own)),
        chi_square_per_sample: declared.map(|declared| mean_square / (declared * declared)),
        lag_1_autocorrelation: correlations.first().copied(),
        // One of 25 lags may lie outside by chance.
        white: enough.then_some(outside <= 1),
        effective_samples: enough.then(|| effective(count, &correlations, limit)),
    }
}

/// The sum of the products of residuals that stand `lag` samples apart, and how many there are.
fn products(series: &[Vec<f64>], lag: usize) -> (f64, usize) {
    let mut total = (0.0, 0);
    for values in series {
        let pairs = values.iter().zip(values.iter().skip(lag));
        for product in pairs
            .map(|(a, b)| a * b)
            .filter(|product| !product.is_nan())
        {
            total.0 += product;
            total.1 += 1;
        }
    }
    total
}

/// n/(1 + 2·Σρ) over the lags up to the first correlation within the limit.
fn effective(count: usize, correlations: &[f64], limit: f64) -> f64 {
    let memory: f64 = correlations
        .iter()
        .take_while(|rho| rho.abs() > limit)
        .sum();
    count as f64 / (1.0 + 2.0 * memory).max(1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::rng::{Purpose, normal, stream};

    fn noise(count: usize, memory: f64) -> Vec<f64> {
        let mut rng = stream(11, 0, Purpose::Noise);
        let mut last = 0.0;
        (0..count)
            .map(|_| {
                last = memory * last + normal(&mut rng);
                last
            })
            .collect()
    }

    #[test]
    fn white_noise_of_the_declared_size_is_called_white_and_sized_right() {
        let report = describe(&[noise(5000, 0.0)], Some(1.0), 4);
        assert_eq!(report.white, Some(true));
        // The variance of 5000 squares: 2/5000, five standard errors.
        assert!((report.chi_square_per_sample.unwrap() - 1.0).abs() < 0.1);
    }

    #[test]
    fn noise_with_a_memory_is_called_coloured_and_counts_for_less() {
        let report = describe(&[noise(5000, 0.8)], None, 4);
        assert_eq!(report.white, Some(false));
        assert!((report.lag_1_autocorrelation.unwrap() - 0.8).abs() < 0.05);
        // (1 − 0.8)/(1 + 0.8) of the samples.
        let expected = 5000.0 / 9.0;
        assert!((report.effective_samples.unwrap() / expected - 1.0).abs() < 0.25);
    }

    #[test]
    fn missing_samples_break_no_pair_but_their_own() {
        let mut values = noise(5000, 0.8);
        values
            .iter_mut()
            .step_by(7)
            .for_each(|value| *value = f64::NAN);
        let report = describe(&[values], None, 4);
        assert!((report.lag_1_autocorrelation.unwrap() - 0.8).abs() < 0.05);
    }
}
