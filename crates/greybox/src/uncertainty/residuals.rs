//! What the model leaves unexplained: its size against the noise, its memory, and whether it
//! follows an input.
//!
//! Residuals of a right model are white (`whiteness`). A residual that is correlated with what an
//! input was at lags 0 to 25 is an effect of that input that the model has not (L. Ljung, *System
//! Identification*, 1999, ch. 16).
//!
//! The noise level of an output is the declared one, or larger where the residuals are larger. A
//! declared noise is overstated where no more than half of its variance can be white noise: of
//! residuals with a correlation ρ of neighbours the share 1 − ρ of the variance at the most is white,
//! if the rest changes slowly (half the mean square of successive differences; J. von Neumann,
//! "Distribution of the ratio of the mean square successive difference to the variance", Annals of
//! Mathematical Statistics 12, 1941). An overstated noise is not believed: the size of the residuals
//! is the noise level in its place, so that it hides neither a misfit nor a contradicted assumption,
//! and widens no interval. Residuals whose sum of squares is within one declared variance are left
//! alone: nothing in them can move an estimate by more than a standard error of the declared noise.

mod whiteness;

use crate::estimation::loss::Loss;
use crate::estimation::problem::Problem;
use greybox_numerics::statistics;
use greybox_simulation::single::Outputs;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;
use whiteness::{LAGS, NEGLIGIBLE_CORRELATION, NORMAL_99, Whiteness, products};

/// Where no noise level can be relied on, residuals that follow each other by more than this
/// correlation are what the model misses rather than noise.
const MISFIT_CORRELATION: f64 = 0.3;
/// A declared noise is overstated where less than this share of its variance can be white noise.
const OVERSTATED: f64 = 0.5;

/// What the residuals of one output look like over the estimation data.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct ResidualReport {
    /// The noise level that the cost was scaled with, SI.
    pub noise_std: f64,
    /// Where the noise level came from: `given` in the job, or `estimated` from the residuals.
    #[schema(example = "given")]
    pub noise_std_source: String,
    /// Mean squared residual in units of the noise level; near 1 when the model explains the data.
    pub chi_square_per_sample: Option<f64>,
    /// The correlation of neighbouring residuals.
    pub lag_1_autocorrelation: Option<f64>,
    /// Whether the residuals pass for white noise: at most one of 25 lags lies outside ±2.58/√n or
    /// ±0.1, whichever is larger, none lies outside 1.5 times that, and `ljung_box_p` is above 0.001
    /// or no lag lies outside ±0.1; `null` when there are too few residuals.
    pub white: Option<bool>,
    /// How likely white noise would be so correlated over 25 lags, by the test of Ljung and Box;
    /// `null` when there are too few residuals.
    #[serde(default)]
    #[schema(example = 0.42)]
    pub ljung_box_p: Option<f64>,
    /// How many independent residuals the residuals are worth.
    pub effective_samples: Option<f64>,
    /// Residuals beyond `method.huber_threshold`, which counted less than their square; absent
    /// where all counted squared.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub outliers: Option<u64>,
    /// For each input that varies, how the residuals follow it.
    #[serde(default)]
    pub inputs: BTreeMap<String, InputCorrelation>,
    /// Whether the declared noise is much larger than the noise in the residuals.
    #[serde(skip)]
    pub is_noise_overstated: bool,
    /// The share of the residuals that counted squared.
    #[serde(skip)]
    pub inlier_share: f64,
}

/// How residuals follow an input.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct InputCorrelation {
    /// The residuals' largest correlation with what the input was at lags 0 to 25.
    #[schema(example = 0.03)]
    pub correlation: Option<f64>,
    /// The lag of the largest correlation, in samples.
    pub lag: u64,
    /// Whether the correlation is more than chance, at the 1 % level: then the model misses a part
    /// of the input's effect.
    pub significant: bool,
}

/// Looks at the residuals of each output in the part that was estimated from.
#[must_use]
pub fn report(problem: &Problem, trajectories: &[Outputs]) -> Vec<ResidualReport> {
    let of_output = |output: usize| {
        let deviation = expected_deviation(problem, trajectories, output);
        let mut series: Vec<Vec<f64>> = trajectories
            .iter()
            .enumerate()
            .map(|(experiment, trajectory)| series(problem, trajectory, experiment, output))
            .collect();
        if let Some(deviation) = deviation {
            let innovations = series.iter_mut().flatten();
            innovations.for_each(|innovation| *innovation *= deviation);
        }
        let scale = problem.outputs[output].residual_scale;
        let held = Held::new(series, scale, problem.loss);
        let declared = deviation.or(problem.outputs[output].noise_std);
        let mut report = describe(&held, declared, problem.coordinates.len());
        report.inputs = inputs(problem, &held.series);
        report
    };
    (0..problem.outputs.len()).map(of_output).collect()
}

/// The root mean square over all samples of the standard deviation that the innovations of an output are
/// expected to have, SI; none where the free run is compared.
fn expected_deviation(problem: &Problem, trajectories: &[Outputs], output: usize) -> Option<f64> {
    let innovations = problem.innovations.as_deref()?;
    let column = innovations.n_outputs + problem.outputs[output].index;
    let experiments = problem.experiments.iter().zip(trajectories);
    let variances = experiments.flat_map(|(data, outputs)| {
        let used = data.measured[output][..data.estimation_samples].iter();
        let present = used
            .zip(&outputs[column])
            .filter(|(measured, _)| !measured.is_nan());
        present.map(|(_, variance)| *variance)
    });
    statistics::mean(variances).map(f64::sqrt)
}

/// measured − simulated of one output in one experiment [SI], as large as if all samples had the
/// same noise; NaN where not measured. An innovation is divided by its standard deviation.
pub(super) fn series(
    problem: &Problem,
    trajectory: &Outputs,
    experiment: usize,
    output: usize,
) -> Vec<f64> {
    let data = &problem.experiments[experiment];
    let index = problem.outputs[output].index;
    let used = data.measured[output][..data.estimation_samples].iter();
    let used = used.zip(&trajectory[index]).enumerate();
    let Some(innovations) = problem.innovations.as_deref() else {
        let weighted = |(sample, (measured, simulated))| {
            let residual: f64 = measured - simulated;
            residual * data.weight(output, sample)
        };
        return used.map(weighted).collect();
    };
    let variances = &trajectory[innovations.n_outputs + index];
    used.map(|(sample, (measured, expected))| (measured - expected) / variances[sample].sqrt())
        .collect()
}

impl ResidualReport {
    /// Whether residuals follow each other so closely that they are no noise of a sensor.
    #[must_use]
    pub fn is_misfit_by_colour(&self) -> bool {
        let correlation = self.lag_1_autocorrelation.unwrap_or_default();
        self.white == Some(false) && correlation.abs() > MISFIT_CORRELATION
    }
}

/// Residuals, each held within the threshold of the loss.
struct Held {
    series: Vec<Vec<f64>>,
    outliers: usize,
    loss: Loss,
}

impl Held {
    fn new(mut series: Vec<Vec<f64>>, scale: f64, loss: Loss) -> Held {
        let mut outliers = 0;
        for residual in series.iter_mut().flatten() {
            outliers += usize::from(loss.is_outlier(*residual / scale));
            *residual = if loss == Loss::Squared {
                *residual
            } else {
                loss.score(*residual / scale) * scale
            };
        }
        Held {
            series,
            outliers,
            loss,
        }
    }
}

/// The noise level of held residuals is the one that the variance of Huber's estimate asks for,
/// `Σψ²/(n − p)` over the squared share of inliers (P. J. Huber, *Robust Statistics*, 1981, §7.6).
fn describe(held: &Held, declared: Option<f64>, unknowns: usize) -> ResidualReport {
    let series = &held.series;
    let (sum, count) = products(series, 0);
    let mean_square = sum / count.max(1) as f64;
    let freedom = count.saturating_sub(unknowns).max(1) as f64;
    let inlier_share = 1.0 - held.outliers as f64 / count.max(1) as f64;
    let left = (sum / freedom).sqrt() / inlier_share.max(f64::MIN_POSITIVE);
    let left = left.max(f64::MIN_POSITIVE);
    let expected = held.loss.normal_mean_square_score();
    let whiteness = Whiteness::of(series);
    let white = whiteness.is_white();
    let finite = |value: f64| Some(value).filter(|value| value.is_finite());
    let chi_square =
        declared.and_then(|declared| finite(mean_square / (expected * declared * declared)));
    let white_share = match (white, whiteness.lag_1()) {
        (Some(false), Some(rho)) => 1.0 - rho.max(0.0),
        _ => 1.0,
    };
    let is_overstated = |chi_square: f64| {
        white.is_some() && chi_square * white_share < OVERSTATED && chi_square * count as f64 > 1.0
    };
    let is_noise_overstated = chi_square.is_some_and(is_overstated);
    let given = declared.filter(|declared| *declared >= left && !is_noise_overstated);
    ResidualReport {
        noise_std: given.unwrap_or(left),
        noise_std_source: if given.is_some() {
            "given"
        } else {
            "estimated"
        }
        .to_owned(),
        chi_square_per_sample: chi_square,
        lag_1_autocorrelation: whiteness.lag_1().and_then(finite),
        white,
        ljung_box_p: whiteness.ljung_box_p().and_then(finite),
        effective_samples: whiteness.effective_samples().and_then(finite),
        outliers: (held.loss != Loss::Squared).then_some(held.outliers as u64),
        inputs: BTreeMap::new(),
        is_noise_overstated,
        inlier_share,
    }
}

/// How many independent squares the squares of normal series are worth: n/(1 + 2·Σρ²) over the lags at
/// which neighbours hang together.
pub(super) fn independent_squares(series: &[Vec<f64>], lags: usize) -> f64 {
    let (power, count) = products(series, 0);
    let mean_square = power / count.max(1) as f64;
    let correlation = |lag: usize| {
        let (sum, pairs) = products(series, lag);
        sum / pairs.max(1) as f64 / mean_square
    };
    let lags = (1..=lags).map(correlation);
    let remembered = lags.take_while(|rho| *rho > NEGLIGIBLE_CORRELATION);
    count as f64 / (1.0 + 2.0 * remembered.map(|rho| rho * rho).sum::<f64>())
}

/// How residuals follow the inputs, over the experiments that have the input.
fn inputs(problem: &Problem, series: &[Vec<f64>]) -> BTreeMap<String, InputCorrelation> {
    let sets = &problem.model.description().input_sets;
    let mut correlations = BTreeMap::new();
    for (set, names) in sets.iter().enumerate() {
        let of_set = |place: usize| {
            let experiments = problem.experiments.iter().zip(series);
            let experiments = experiments.filter(move |(data, _)| data.input_set == set);
            experiments
                .map(move |(data, residuals)| (&data.inputs[place][..], &residuals[..]))
                .collect::<Vec<_>>()
        };
        for (place, name) in names.iter().enumerate() {
            let correlation = follow(&of_set(place));
            correlations.extend(correlation.map(|correlation| (name.to_string(), correlation)));
        }
    }
    correlations
}

/// How residuals follow an input: pairs of its samples and theirs, an experiment each.
fn follow(pairs: &[(&[f64], &[f64])]) -> Option<InputCorrelation> {
    let about_mean: Vec<Vec<f64>> = pairs.iter().map(|(input, _)| centred(input)).collect();
    let series: Vec<Vec<f64>> = pairs.iter().map(|(_, series)| series.to_vec()).collect();
    let (input_power, samples) = products(&about_mean, 0);
    let (power, count) = products(&series, 0);
    if count <= 4 * LAGS || input_power <= 0.0 || power <= 0.0 {
        return None;
    }
    let scale = ((input_power / samples as f64) * (power / count as f64)).sqrt();
    let at_lag = |lag: usize| {
        let terms = about_mean.iter().zip(&series).flat_map(|(input, series)| {
            let pairs = series.iter().skip(lag).zip(input);
            pairs.map(|(residual, input)| residual * input)
        });
        let present = terms.filter(|term| !term.is_nan());
        let (sum, n) = present.fold((0.0, 0), |(sum, n), term| (sum + term, n + 1));
        sum / f64::from(n).max(1.0) / scale
    };
    let correlations: Vec<f64> = (0..=LAGS).map(at_lag).collect();
    let limit = chance(&about_mean, &series).max(NEGLIGIBLE_CORRELATION);
    let outside = correlations.iter().filter(|rho| rho.abs() > limit).count();
    let (lag, correlation) = correlations
        .into_iter()
        .enumerate()
        .max_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()))?;
    Some(InputCorrelation {
        correlation: Some(correlation).filter(|rho| rho.is_finite()),
        lag: lag as u64,
        significant: outside > 1,
    })
}

/// What chance makes of the correlation of two independent series, 99 times of 100: their
/// memories make up for samples (L. Ljung, *System Identification*, 1999, ch. 16).
fn chance(input: &[Vec<f64>], series: &[Vec<f64>]) -> f64 {
    let (input_power, samples) = products(input, 0);
    let (power, count) = products(series, 0);
    let memory = (1..=LAGS).map(|lag| {
        let ((a, pairs_a), (b, pairs_b)) = (products(input, lag), products(series, lag));
        let rho = a / pairs_a.max(1) as f64 / (input_power / samples as f64);
        rho * b / pairs_b.max(1) as f64 / (power / count as f64)
    });
    let spread = 1.0 + 2.0 * memory.sum::<f64>();
    NORMAL_99 * (spread.max(1.0) / count as f64).sqrt()
}

fn centred(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|value| value - mean).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::rng::{Purpose, normal, stream};

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

    fn squared(values: Vec<f64>) -> Held {
        Held::new(vec![values], 1.0, Loss::Squared)
    }

    #[test]
    fn wild_residuals_do_not_move_the_noise_level_where_the_loss_holds_them() {
        let mut values = noise(5000, 0.0);
        let clean = describe(
            &Held::new(vec![values.clone()], 1.0, Loss::Huber(1.5)),
            Some(1.0),
            4,
        );
        assert!((clean.chi_square_per_sample.unwrap() - 1.0).abs() < 0.1);
        // What the estimate loses where nothing is wild: 3.7 % of its efficiency at 1.5.
        assert!((clean.noise_std.powi(2) - 1.037).abs() < 0.05);
        values
            .iter_mut()
            .step_by(100)
            .for_each(|value| *value = 80.0);
        let wild = describe(
            &Held::new(vec![values.clone()], 1.0, Loss::Huber(1.5)),
            Some(1.0),
            4,
        );
        let beyond = values.iter().filter(|value| value.abs() > 1.5).count();
        assert_eq!(wild.outliers, Some(beyond as u64));
        assert!((0.98..1.1).contains(&wild.noise_std), "{}", wild.noise_std);
        assert!(describe(&squared(values), Some(1.0), 4).noise_std > 7.0);
    }

    #[test]
    fn white_noise_of_the_declared_size_is_called_white_and_sized_right() {
        let report = describe(&squared(noise(5000, 0.0)), Some(1.0), 4);
        assert_eq!(report.white, Some(true));
        // The variance of 5000 squares: 2/5000, five standard errors.
        assert!((report.chi_square_per_sample.unwrap() - 1.0).abs() < 0.1);
    }

    #[test]
    fn a_declared_noise_twice_as_large_as_the_residuals_gives_way_to_them() {
        let level = |declared: f64| {
            let report = describe(&squared(noise(5000, 0.0)), Some(declared), 4);
            (report.noise_std, report.noise_std_source)
        };
        assert_eq!(level(1.3), (1.3, "given".to_owned()));
        let (overstated, source) = level(2.0);
        assert!((0.95..1.05).contains(&overstated), "{overstated}");
        assert_eq!(source, "estimated");
        // Residuals of the declared size that follow each other leave little that is noise.
        let coloured = describe(&squared(noise(5000, 0.8)), Some(5.0_f64.sqrt()), 4);
        assert!(coloured.is_noise_overstated);
        let exact = noise(5000, 0.0).iter().map(|value| value * 1e-3).collect();
        let exact = describe(&squared(exact), Some(1.0), 4);
        assert_eq!((exact.is_noise_overstated, exact.noise_std), (false, 1.0));
        // Of a hundred residuals nobody knows whether they are white.
        let few = describe(&squared(noise(100, 0.0)), Some(2.0), 4);
        assert_eq!((few.white, few.noise_std), (None, 2.0));
    }

    #[test]
    fn noise_with_a_memory_is_called_coloured_and_counts_for_less() {
        let report = describe(&squared(noise(5000, 0.8)), None, 4);
        assert_eq!(report.white, Some(false));
        assert!((report.lag_1_autocorrelation.unwrap() - 0.8).abs() < 0.05);
        // (1 − 0.8)/(1 + 0.8) of the samples.
        let expected = 5000.0 / 9.0;
        assert!((report.effective_samples.unwrap() / expected - 1.0).abs() < 0.25);
    }

    #[test]
    fn residuals_that_follow_an_input_late_are_told_with_the_lag() {
        let input = noise(5000, 0.5);
        let noise_alone = noise(5100, 0.0);
        let late = |share: f64| -> Vec<f64> {
            let lagged = std::iter::repeat_n(0.0, 7).chain(input.iter().copied());
            let pairs = lagged.zip(&noise_alone[100..]);
            pairs.map(|(input, noise)| share * input + noise).collect()
        };
        let follows = follow(&[(&input, &late(1.0))]).unwrap();
        assert!(follows.significant);
        assert_eq!(follows.lag, 7);
        let free = follow(&[(&input, &late(0.0))]).unwrap();
        assert!(!free.significant, "{:?}", free.correlation);
        assert!(follow(&[(&[1.0; 5000], &late(0.0))]).is_none());
    }

    #[test]
    fn missing_samples_break_no_pair_but_their_own() {
        let mut values = noise(5000, 0.8);
        values
            .iter_mut()
            .step_by(7)
            .for_each(|value| *value = f64::NAN);
        let report = describe(&squared(values), None, 4);
        assert!((report.lag_1_autocorrelation.unwrap() - 0.8).abs() < 0.05);
    }
}
