//! How well the model explains each output, and criteria for the comparison of models.
//!
//! `fit = 100·(1 − ‖y − ŷ‖/‖y − mean(y)‖)`; with V the mean square of the residuals, n their
//! number and d that of the unknowns, `FPE = V·(1 + d/n)/(1 − d/n)`,
//! `AIC = n·ln V + n·(1 + ln 2π) + 2d`, `AICc = AIC + 2d(d + 1)/(n − d − 1)`,
//! `BIC = n·ln V + n·(1 + ln 2π) + d·ln n` (L. Ljung, *System Identification*, 1999, ch. 16; the
//! definitions of the identification toolboxes). With several outputs n·ln V is a sum.

use crate::estimation::problem::Problem;
use greybox_simulation::single::Outputs;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Which part of the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The part that was estimated from.
    Estimation,
    /// The part that was held back.
    Validation,
}

/// How one simulated output follows the measured one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct OutputFit {
    /// `100·(1 − ‖y − ŷ‖ / ‖y − mean(y)‖)`; `null` where the measured output is constant.
    #[schema(example = 97.3)]
    pub fit_percent: Option<f64>,
    /// Root-mean-square error, SI.
    #[schema(example = 1.1e-5)]
    pub rmse: Option<f64>,
    /// Largest error, SI.
    #[schema(example = 9e-5)]
    pub max_abs_error: Option<f64>,
    /// The number of samples compared; missing samples are not.
    #[schema(example = 9000)]
    pub samples: u64,
    /// Why a number above is `null`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The correlation of the simulated samples with the measured ones; none where one of the two
    /// does not vary.
    #[serde(skip)]
    pub correlation: Option<f64>,
    /// The mean square of the residuals, each as large as if all samples had the same noise
    /// `[SI²]`: likelihoods are made of it.
    #[serde(skip)]
    pub weighted_square: Option<f64>,
}

/// The cost and the information criteria.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[non_exhaustive]
pub struct Criteria {
    /// The cost at the estimate.
    pub cost: Option<f64>,
    /// Akaike's information criterion.
    pub aic: Option<f64>,
    /// Akaike's criterion, corrected for few samples.
    pub aicc: Option<f64>,
    /// The Bayesian information criterion.
    pub bic: Option<f64>,
    /// Akaike's final prediction error.
    pub fpe: Option<f64>,
    /// The natural logarithm of the likelihood, where disturbances move the plant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub log_likelihood: Option<f64>,
    /// Why a number above is `null`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

impl Criteria {
    /// The criteria where no likelihood can be compared.
    #[must_use]
    pub fn missing() -> Criteria {
        let reason = "too few samples, a simulation that fails or fits exactly, or Huber's loss";
        Criteria {
            cost: None,
            aic: None,
            aicc: None,
            bic: None,
            fpe: None,
            log_likelihood: None,
            reason: Some(reason.to_owned()),
        }
    }
}

/// The fit of each output in a part of the data.
#[must_use]
pub fn of(problem: &Problem, trajectories: &[Outputs], part: Part) -> Vec<OutputFit> {
    let of_output = |output: usize| {
        let mut pairs = Vec::new();
        let mut weighted = 0.0;
        for (data, trajectory) in problem.experiments.iter().zip(trajectories) {
            let range = match part {
                Part::Estimation => 0..data.estimation_samples,
                Part::Validation => data.scored_from..data.samples,
            };
            let simulated = &trajectory[problem.outputs[output].index];
            let measured = &data.measured[output];
            let both = range.map(|sample| (sample, (measured[sample], simulated[sample])));
            let present = both.filter(|(_, (measured, _))| !measured.is_nan());
            for (sample, (measured, simulated)) in present {
                weighted += ((measured - simulated) * data.weight(output, sample)).powi(2);
                pairs.push((measured, simulated));
            }
        }
        OutputFit {
            weighted_square: (!pairs.is_empty()).then(|| weighted / pairs.len() as f64),
            ..describe(&pairs)
        }
    };
    (0..problem.outputs.len()).map(of_output).collect()
}

fn describe(pairs: &[(f64, f64)]) -> OutputFit {
    let samples = pairs.len();
    if samples == 0 {
        return OutputFit {
            fit_percent: None,
            rmse: None,
            max_abs_error: None,
            samples: 0,
            reason: Some("no samples are held in this part".to_owned()),
            correlation: None,
            weighted_square: None,
        };
    }
    let mean = pairs.iter().map(|(measured, _)| measured).sum::<f64>() / samples as f64;
    let square = |value: f64| value * value;
    let error: f64 = pairs
        .iter()
        .map(|(y, simulated)| square(y - simulated))
        .sum();
    let spread: f64 = pairs.iter().map(|(y, _)| square(y - mean)).sum();
    let largest = pairs
        .iter()
        .map(|(y, simulated)| (y - simulated).abs())
        .fold(0.0, f64::max);
    let centre = pairs.iter().map(|(_, simulated)| simulated).sum::<f64>() / samples as f64;
    let (mut products, mut power) = (0.0, 0.0);
    for (y, simulated) in pairs {
        products += (y - mean) * (simulated - centre);
        power += square(simulated - centre);
    }
    let finite = |value: f64| Some(value).filter(|value| value.is_finite());
    OutputFit {
        fit_percent: finite(100.0 * (1.0 - (error / spread).sqrt())).filter(|_| spread > 0.0),
        rmse: finite((error / samples as f64).sqrt()),
        max_abs_error: finite(largest),
        samples: samples as u64,
        reason: (spread <= 0.0).then(|| "the measured signal does not vary".to_owned()),
        correlation: finite(products / (spread * power).sqrt()),
        weighted_square: Some(error / samples as f64),
    }
}

/// The criteria from the fits of the data that were estimated from, without the cost; missing where
/// the unknowns are as many as the samples, or a residual is exactly zero throughout.
#[must_use]
pub fn criteria(fits: &[OutputFit], unknowns: usize) -> Criteria {
    let n: f64 = fits.iter().map(|fit| fit.samples as f64).sum();
    let d = unknowns as f64;
    if n <= d + 1.0 {
        return Criteria::missing();
    }
    let mut log_likelihood_part = 0.0;
    let mut product = 1.0;
    for fit in fits.iter().filter(|fit| fit.samples > 0) {
        let Some(variance) = fit.weighted_square else {
            return Criteria::missing();
        };
        log_likelihood_part += fit.samples as f64 * libm::log(variance);
        product *= variance;
    }
    let constant = n * (1.0 + libm::log(2.0 * std::f64::consts::PI));
    let aic = log_likelihood_part + constant + 2.0 * d;
    if !aic.is_finite() {
        return Criteria::missing();
    }
    Criteria {
        cost: None,
        aic: Some(aic),
        aicc: Some(aic + 2.0 * d * (d + 1.0) / (n - d - 1.0)),
        bic: Some(log_likelihood_part + constant + d * libm::log(n)),
        fpe: Some(product * (1.0 + d / n) / (1.0 - d / n)).filter(|fpe| fpe.is_finite()),
        log_likelihood: None,
        reason: None,
    }
}

/// The criteria of a likelihood, without the cost.
#[must_use]
pub fn likelihood_criteria(log_likelihood: f64, samples: usize, unknowns: usize) -> Criteria {
    let (n, d) = (samples as f64, unknowns as f64);
    let aic = 2.0 * d - 2.0 * log_likelihood;
    Criteria {
        cost: None,
        aic: Some(aic),
        aicc: (n > d + 1.0).then(|| aic + 2.0 * d * (d + 1.0) / (n - d - 1.0)),
        bic: Some(d * libm::log(n) - 2.0 * log_likelihood),
        fpe: None,
        log_likelihood: Some(log_likelihood),
        reason: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mean_as_a_model_fits_zero_per_cent_and_the_truth_a_hundred() {
        let measured = [1.0, 2.0, 3.0, 6.0];
        let against = |simulated: [f64; 4]| {
            describe(&measured.into_iter().zip(simulated).collect::<Vec<_>>())
        };
        assert_eq!(against([3.0; 4]).fit_percent, Some(0.0));
        assert_eq!(against(measured).fit_percent, Some(100.0));
        let off = against([1.0, 2.0, 3.0, 4.0]);
        assert_eq!((off.rmse, off.max_abs_error), (Some(1.0), Some(2.0)));
        let mirrored = against([-1.0, -2.0, -3.0, -6.0]).correlation.unwrap();
        assert!((mirrored + 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_constant_signal_has_no_fit_per_cent() {
        assert_eq!(describe(&[(2.0, 2.5), (2.0, 1.5)]).fit_percent, None);
    }

    #[test]
    fn the_criteria_agree_with_numbers_worked_by_hand() {
        // n = 100, d = 2, V = 0.25.
        let fit = OutputFit {
            fit_percent: None,
            rmse: Some(0.5),
            max_abs_error: None,
            samples: 100,
            reason: None,
            correlation: None,
            weighted_square: Some(0.25),
        };
        let criteria = criteria(&[fit], 2);
        // 100·ln 0.25 = −138.629436, 100·(1 + ln 2π) = 283.787707.
        assert!((criteria.aic.unwrap() - 149.158_271).abs() < 1e-5);
        assert!((criteria.aicc.unwrap() - 149.281_982).abs() < 1e-5);
        // 2·ln 100 = 9.210340.
        assert!((criteria.bic.unwrap() - 154.368_611).abs() < 1e-5);
        assert!((criteria.fpe.unwrap() - 0.25 * 1.02 / 0.98).abs() < 1e-12);
    }
}
