//! What one window hands on to the next: estimates as priors, and where a search begins.
//!
//! All of it is in a parameter's own coordinate `u`: its value, or on a log scale its logarithm.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::record::WatchedEstimate;
use super::spec::MonitorSpec;
use greybox::estimation::Settings;
use greybox::identification::JobSpec;
use greybox::identification::outcome::{Correlation, Outcome, Trust};
use greybox::identification::spec::{
    FreeParameter, JointPriorSpec, ParameterSpec, PriorSpec, SearchRange,
};
use greybox::model::Scale;
use greybox::numerics::normal::Normal;
use greybox::numerics::symmetric;

/// Without a drift, the prior of the next window is so many standard errors wider: the window then
/// has nine tenths of the weight.
const OWN_WEIGHT: f64 = 3.0;
/// A warm search reaches so many standard deviations of the prior to both sides.
const REACH: f64 = 8.0;
/// A warm search reaches so far to both sides at the least, as a share of the whole range.
const LEAST_REACH: f64 = 0.01;
/// A prior that the data contradict by so many standard deviations is not used.
const CONTRADICTED: f64 = 3.0;
/// Half the width of a 95 % range in standard deviations.
const NORMAL_95: f64 = 1.959_964;
/// A window that has less than this share of the weight of what is known says nothing of its own.
const LEAST_NEWS: f64 = 1e-3;

/// What is known of parameters together: a normal distribution of their coordinates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JointEstimate {
    /// The parameters.
    names: Vec<String>,
    /// The distribution of the coordinates of the parameters.
    #[serde(flatten)]
    normal: Normal,
}

impl JointEstimate {
    /// Whether the estimate covers a parameter.
    #[must_use]
    pub fn holds(&self, name: &str) -> bool {
        self.index_of(name).is_some()
    }

    fn index_of(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|other| other == name)
    }

    /// The mean of a parameter's coordinate and its variance.
    #[must_use]
    pub fn of(&self, name: &str) -> Option<(f64, f64)> {
        let index = self.index_of(name)?;
        Some((
            self.normal.mean[index],
            self.normal.covariance[index][index],
        ))
    }
}

/// The errors of which a distribution is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ErrorScope {
    /// The errors of the data, and of what was known before.
    Statistical,
    /// The errors of the data, of what was known before, and of all that was taken as known.
    Total,
}

/// The coordinate of a value.
fn coordinate(scale: Scale, value: f64) -> f64 {
    match scale {
        Scale::Linear => value,
        Scale::Log => libm::log(value),
    }
}

/// The value at a coordinate.
#[must_use]
pub fn value_at(scale: Scale, u: f64) -> f64 {
    match scale {
        Scale::Linear => u,
        Scale::Log => libm::exp(u),
    }
}

/// A deviation of a value as one of the coordinate.
fn deviation_at(scale: Scale, value: f64, deviation: f64) -> f64 {
    match scale {
        Scale::Linear => deviation,
        Scale::Log => deviation / value,
    }
}

/// A deviation of the coordinate as one of the value.
#[must_use]
pub fn deviation_of_value(scale: Scale, value: f64, deviation: f64) -> f64 {
    match scale {
        Scale::Linear => deviation,
        Scale::Log => deviation * value,
    }
}

/// The ranges of the parameters that a job looks for.
#[must_use]
pub fn searched(spec: &JobSpec) -> BTreeMap<String, SearchRange> {
    let parameters = spec.parameters.iter();
    parameters
        .filter_map(|(name, parameter)| match parameter {
            ParameterSpec::Free(free) => Some((name.clone(), free.estimate)),
            ParameterSpec::Fixed(_) => None,
        })
        .collect()
}

/// What an estimate says of the parameters that were looked for, with the correlations of their errors;
/// without them where these are not known.
#[must_use]
pub fn estimated(
    estimates: &[WatchedEstimate],
    correlation: Option<&Correlation>,
    ranges: &BTreeMap<String, SearchRange>,
    errors: ErrorScope,
) -> JointEstimate {
    let each = estimates.iter().filter_map(|parameter| {
        let range = ranges.get(&parameter.name)?;
        let total = parameter
            .total_standard_error
            .filter(|_| errors == ErrorScope::Total);
        let deviation = total.or(parameter.standard_error)?;
        let deviation = deviation_at(range.scale, parameter.estimate, deviation);
        let mean = coordinate(range.scale, parameter.estimate);
        (mean.is_finite() && deviation > 0.0).then(|| (parameter.name.clone(), mean, deviation))
    });
    let each: Vec<(String, f64, f64)> = each.collect();
    let places = each.iter().map(|(name, ..)| {
        let mut names = correlation?.names.iter();
        names.position(|other| other == name)
    });
    let places: Vec<Option<usize>> = places.collect();
    let between = |a: usize, b: usize| {
        let (row, column) = (places[a]?, places[b]?);
        correlation?.matrix[row][column]
    };
    let covariance = |with_correlations: bool| -> Vec<Vec<f64>> {
        let entry = |a: usize, b: usize| match a == b {
            true => each[a].2 * each[a].2,
            false if with_correlations => between(a, b).unwrap_or(0.0) * each[a].2 * each[b].2,
            false => 0.0,
        };
        let row = |a| (0..each.len()).map(|b| entry(a, b)).collect();
        (0..each.len()).map(row).collect()
    };
    // Rounding may have made of a nearly flat direction none at all.
    let joint = Some(covariance(true)).filter(|matrix| symmetric::whitening(matrix).is_some());
    JointEstimate {
        normal: Normal {
            mean: each.iter().map(|(_, mean, _)| *mean).collect(),
            covariance: joint.unwrap_or_else(|| covariance(false)),
        },
        names: each.into_iter().map(|(name, ..)| name).collect(),
    }
}

/// The prior of a window that begins so long after the one before `[s]`.
#[must_use]
pub fn prior(
    spec: &MonitorSpec,
    estimate: &JointEstimate,
    ranges: &BTreeMap<String, SearchRange>,
    after_s: f64,
) -> JointEstimate {
    let growth = |index: usize| {
        let name = &estimate.names[index];
        let (drift, range) = (spec.drift.get(name)?, ranges.get(name)?);
        let value = value_at(range.scale, estimate.normal.mean[index]);
        Some(deviation_at(range.scale, value, drift.std).powi(2) * (after_s / drift.per_s))
    };
    let growth: Vec<Option<f64>> = (0..estimate.names.len()).map(growth).collect();
    let mut prior = estimate.clone();
    for (a, row) in prior.normal.covariance.iter_mut().enumerate() {
        for (b, entry) in row.iter_mut().enumerate() {
            match (growth[a], growth[b]) {
                (Some(growth), Some(_)) if a == b => *entry += growth,
                (None, None) => *entry *= 1.0 + OWN_WEIGHT * OWN_WEIGHT,
                _ => {}
            }
        }
    }
    prior
}

/// The job that begins at its prior: a search of no generations refines the middle of ranges that
/// lie around it.
#[must_use]
pub fn begin_warm(
    cold: &JobSpec,
    ranges: &BTreeMap<String, SearchRange>,
    prior: &JointEstimate,
) -> JobSpec {
    let mut warm = cold.clone();
    for name in &prior.names {
        if let (Some(range), Some((middle, variance))) = (ranges.get(name), prior.of(name)) {
            let free = ParameterSpec::Free(FreeParameter {
                estimate: narrowed(range, middle, variance),
                prior: None,
            });
            warm.parameters.insert(name.clone(), free);
        }
    }
    let scale_of = |name: &String| ranges.get(name).map(|range| range.scale);
    match &prior.names[..] {
        [name] => {
            if let (Some(scale), Some((middle, variance))) = (scale_of(name), prior.of(name))
                && let Some(ParameterSpec::Free(free)) = warm.parameters.get_mut(name)
            {
                let half = NORMAL_95 * variance.sqrt();
                let range_95 = [middle - half, middle + half].map(|u| value_at(scale, u));
                free.prior = Some(PriorSpec::Range { range_95, scale });
            }
        }
        names => {
            let scales: Vec<Scale> = names.iter().filter_map(scale_of).collect();
            warm.priors = vec![of_values(prior, &scales)];
        }
    }
    warm.method = Settings {
        generations: 0,
        further_searches: 0,
        refine_candidates: 1,
        huber_threshold: cold.method.huber_threshold,
        ..Settings::default()
    };
    warm
}

/// The part of a range that lies around the middle of a prior with a variance.
fn narrowed(range: &SearchRange, middle: f64, variance: f64) -> SearchRange {
    let scale = range.scale;
    let (low, high) = (
        coordinate(scale, range.lower),
        coordinate(scale, range.upper),
    );
    let reach = (REACH * variance.sqrt()).max(LEAST_REACH * (high - low));
    // The middle is the prior's where the whole range has room for it.
    let reach = reach.min(f64::max(high - middle, middle - low));
    let lower = f64::max(middle - reach, low);
    let upper = f64::min(middle + reach, high);
    SearchRange {
        lower: value_at(scale, lower).max(range.lower),
        upper: value_at(scale, upper).min(range.upper),
        scale,
        start: None,
    }
}

/// A prior as jobs take it: means and covariance of the values. Where each has a log scale, it is
/// one of logarithms; where only some have, their values are taken to be normal, as near as their
/// spread is small.
fn of_values(prior: &JointEstimate, scales: &[Scale]) -> JointPriorSpec {
    let (mean, covariance) = (&prior.normal.mean, &prior.normal.covariance);
    let all_log = scales.iter().all(|scale| *scale == Scale::Log);
    let value = |a: usize| match scales[a] {
        Scale::Log if all_log => libm::exp(mean[a] + 0.5 * covariance[a][a]),
        scale => value_at(scale, mean[a]),
    };
    let entry = |a: usize, b: usize| {
        let slope = |index: usize| deviation_of_value(scales[index], value(index), 1.0);
        let of_coordinates = covariance[a][b];
        slope(a)
            * slope(b)
            * if all_log {
                libm::expm1(of_coordinates)
            } else {
                of_coordinates
            }
    };
    let places = 0..scales.len();
    let row = |a| places.clone().map(|b| entry(a, b)).collect();
    JointPriorSpec {
        parameters: prior.names.clone(),
        mean: places.clone().map(value).collect(),
        covariance: places.clone().map(row).collect(),
        scale: if all_log { Scale::Log } else { Scale::Linear },
    }
}

/// Whether what a warm search came to is better looked for again without what was known before.
#[must_use]
pub fn is_in_doubt(outcome: &Outcome) -> bool {
    outcome.verdict.trust == Trust::Low
        || outcome.parameters.iter().any(|parameter| {
            let shift = parameter.estimate.prior_shift.unwrap_or(0.0);
            parameter.estimate.at_bound || shift.abs() > CONTRADICTED
        })
}

/// What a window itself says of its parameters, without its prior. Nothing where it says
/// next to nothing.
#[derive(Clone, Debug)]
pub struct WindowEstimate<'p> {
    estimate: Option<JointEstimate>,
    prior: Option<&'p JointEstimate>,
}

impl<'p> WindowEstimate<'p> {
    /// From what the window and its prior say together.
    #[must_use]
    pub fn new(together: JointEstimate, prior: Option<&'p JointEstimate>) -> Self {
        let estimate = match prior {
            None => Some(together),
            Some(prior) if prior.names == together.names => {
                let normal = together.normal.without(&prior.normal);
                normal.map(|normal| JointEstimate { normal, ..together })
            }
            Some(_) => None,
        };
        Self { estimate, prior }
    }

    /// The estimate of a parameter and its variance, in its coordinate.
    #[must_use]
    pub fn of(&self, name: &str) -> Option<(f64, f64)> {
        let (value, variance) = self.estimate.as_ref()?.of(name)?;
        let before = self.prior.and_then(|prior| prior.of(name));
        let says_something =
            before.is_none_or(|(_, variance_before)| LEAST_NEWS * variance < variance_before);
        (value.is_finite() && variance > 0.0 && says_something).then_some((value, variance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    /// A job with a parameter that is known.
    fn cold() -> JobSpec {
        serde_json::from_value(json!({
            "model": "m", "experiments": [], "seed": 1, "parameters": {"c": {"value": 1}},
            "method": {"huber_threshold": 2.0}
        }))
        .expect("a job")
    }

    fn range(scale: Scale) -> SearchRange {
        SearchRange {
            lower: 1.0,
            upper: 100.0,
            scale,
            start: None,
        }
    }

    fn estimate(name: &str, estimate: f64, standard_error: f64) -> WatchedEstimate {
        WatchedEstimate {
            name: name.to_owned(),
            unit: String::new(),
            estimate,
            standard_error: Some(standard_error),
            confidence_interval: None,
            total_standard_error: None,
            total_interval: None,
            trust: None,
        }
    }

    fn ranges(scale: Scale) -> BTreeMap<String, SearchRange> {
        ["a", "b"]
            .map(|name| (name.to_owned(), range(scale)))
            .into()
    }

    fn correlated(names: &[&str], between: f64) -> Correlation {
        serde_json::from_value(json!({
            "names": names, "matrix": [[1, between], [between, 1]]
        }))
        .expect("a correlation")
    }

    fn monitor(drift: &Value) -> MonitorSpec {
        MonitorSpec::read(&json!({
            "stream": "s", "window": {"length_s": 1}, "job": {}, "drift": drift
        }))
        .expect("a specification")
    }

    fn two(scale: Scale, between: f64) -> JointEstimate {
        let estimates = [estimate("a", 10.0, 0.4), estimate("b", 20.0, 0.6)];
        let correlation = correlated(&["b", "a"], between);
        estimated(
            &estimates,
            Some(&correlation),
            &ranges(scale),
            ErrorScope::Total,
        )
    }

    #[test]
    fn what_a_window_says_alone_is_what_it_said_before_its_prior_was_added() {
        let (z, r, m, middle) = (10.0, 4.0, 9.0, 7.0);
        let p = 1.0 / (1.0 / r + 1.0 / m);
        let x = p * (z / r + middle / m);
        let of = |mean, deviation| {
            let estimates = [estimate("a", mean, deviation)];
            estimated(
                &estimates,
                None,
                &ranges(Scale::Linear),
                ErrorScope::Statistical,
            )
        };
        let prior = of(middle, f64::sqrt(m));
        let alone = WindowEstimate::new(of(x, p.sqrt()), Some(&prior));
        let (value, variance) = alone.of("a").expect("news");
        assert!((value - z).abs() < 1e-9 && (variance - r).abs() < 1e-9);
        let nothing_new = WindowEstimate::new(prior.clone(), Some(&prior));
        assert_eq!(nothing_new.of("a"), None);
        assert_eq!(
            WindowEstimate::new(of(x, 1.0), None).of("a"),
            Some((x, 1.0))
        );
    }

    #[test]
    fn parameters_whose_errors_hang_together_keep_that_in_the_prior() {
        let known = two(Scale::Linear, 0.9);
        // A drift of `a` of 0.3 in a second, for four seconds; `b` is to speak for itself.
        let spec = monitor(&json!({"a": {"std": 0.3, "per_s": 1}}));
        let prior = prior(&spec, &known, &ranges(Scale::Linear), 4.0);
        let covariance = &prior.normal.covariance;
        let expected = [[0.16 + 0.36, 0.216], [0.216, 3.6]];
        for (row, expected) in covariance.iter().zip(expected) {
            assert!(
                row.iter()
                    .zip(expected)
                    .all(|(own, e)| (own - e).abs() < 1e-12)
            );
        }
        let warm = begin_warm(&cold(), &ranges(Scale::Linear), &prior);
        let [joint] = &warm.priors[..] else {
            panic!("{:?}", warm.priors);
        };
        assert_eq!(joint.parameters, ["a", "b"]);
        assert_eq!(joint.mean, [10.0, 20.0]);
        assert_eq!(joint.covariance, *covariance);
        assert_eq!(warm.method.generations, 0);
        assert_eq!(warm.method.huber_threshold, Some(2.0));
        // A matrix that rounding has made singular leaves each by itself.
        let singular = two(Scale::Linear, 1.0);
        assert_eq!(singular.normal.covariance[0][1], 0.0);
    }

    #[test]
    fn a_prior_of_logarithms_is_that_of_the_values_which_jobs_take() {
        let known = two(Scale::Log, 0.9);
        let of_logarithms = &known.normal.covariance;
        let warm = begin_warm(&cold(), &ranges(Scale::Log), &known);
        let joint = &warm.priors[0];
        assert_eq!(joint.scale, Scale::Log);
        let a = joint.mean[0];
        // The covariance of the logarithms is log(1 + C/(m·m)).
        let of_values = joint.covariance[0].iter().zip(&joint.mean);
        for ((covariance, mean), expected) in of_values.zip(&of_logarithms[0]) {
            let relative = covariance / (a * mean);
            assert!((libm::log1p(relative) / expected - 1.0).abs() < 1e-12);
        }
        let middle = libm::log(a) - 0.5 * of_logarithms[0][0];
        assert!((middle - libm::log(10.0)).abs() < 1e-12);
    }

    #[test]
    fn a_warm_search_has_the_estimate_before_in_its_middle_and_stays_in_the_range() {
        for scale in [Scale::Linear, Scale::Log] {
            let ranges = BTreeMap::from([("a".to_owned(), range(scale))]);
            let narrow = [estimate("a", 10.0, 0.1)];
            let known = estimated(&narrow, None, &ranges, ErrorScope::Total);
            let prior = prior(&monitor(&json!({})), &known, &ranges, 1.0);
            let warm = begin_warm(&cold(), &ranges, &prior);
            let Some(ParameterSpec::Free(free)) = warm.parameters.get("a") else {
                panic!("{:?}", warm.parameters);
            };
            assert!(free.prior.is_some() && warm.parameters.contains_key("c"));
            let ends = [free.estimate.lower, free.estimate.upper];
            assert!(ends[0] >= 1.0 && ends[1] <= 100.0, "{ends:?}");
            let [low, high] = ends.map(|end| coordinate(scale, end));
            let middle = value_at(scale, 0.5 * (low + high));
            assert!((middle - 10.0).abs() < 1e-6, "{scale:?}: {middle}");
        }
    }
}
