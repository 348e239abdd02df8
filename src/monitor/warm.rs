//! What one window hands on to the next: estimates as priors, and where a search begins.
//!
//! All of it is in a parameter's own coordinate `u`: its value, or on a log scale its logarithm.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::record::WatchedEstimate;
use super::spec::MonitorSpec;
use crate::job::JobSpec;
use crate::job::outcome::{Outcome, Trust};
use crate::job::spec::{ParameterSpec, SearchRange};
use crate::model::Scale;

/// Without a drift, the prior of the next window is so many standard errors wider: the window then
/// has nine tenths of the weight.
const OWN_WEIGHT: f64 = 3.0;
/// A warm search looks so many standard deviations of the prior to both sides …
const REACH: f64 = 8.0;
/// … and at this share of the whole range at the least.
const LEAST_REACH: f64 = 0.01;
/// A prior that the data contradict by so many standard deviations is not used.
const CONTRADICTED: f64 = 3.0;
/// Half the width of a 95 % range in standard deviations.
const NORMAL_95: f64 = 1.959_964;
/// A window that tells less than this share of what is known says nothing of its own.
const LEAST_NEWS: f64 = 1e-3;

/// What a window found out about a parameter, as the next one sees it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// The estimate.
    pub value: f64,
    /// One standard deviation of its error, with all that was taken as known.
    pub deviation: f64,
}

/// A normal prior in the parameter's coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WarmPrior {
    middle: f64,
    deviation: f64,
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

/// What a result hands on.
#[must_use]
pub fn known(
    estimates: &[WatchedEstimate],
    ranges: &BTreeMap<String, SearchRange>,
) -> BTreeMap<String, Known> {
    let known = estimates.iter().filter_map(|own| {
        let range = ranges.get(&own.name)?;
        let deviation = own.total_standard_error.or(own.standard_error)?;
        let deviation = deviation_at(range.scale, own.estimate, deviation);
        let known = Known {
            value: coordinate(range.scale, own.estimate),
            deviation,
        };
        (known.value.is_finite() && deviation > 0.0).then(|| (own.name.clone(), known))
    });
    known.collect()
}

/// The priors of a window that begins so long after the one before `[s]`.
#[must_use]
pub fn priors(
    spec: &MonitorSpec,
    known: &BTreeMap<String, Known>,
    ranges: &BTreeMap<String, SearchRange>,
    after_s: f64,
) -> BTreeMap<String, WarmPrior> {
    let prior = |(name, known): (&String, &Known)| {
        let scale = ranges.get(name)?.scale;
        let growth = match spec.drift.get(name) {
            Some(drift) => {
                let value = value_at(scale, known.value);
                deviation_at(scale, value, drift.std) * (after_s / drift.per_s).sqrt()
            }
            None => OWN_WEIGHT * known.deviation,
        };
        let prior = WarmPrior {
            middle: known.value,
            deviation: known.deviation.hypot(growth),
        };
        Some((name.clone(), prior))
    };
    known.iter().filter_map(prior).collect()
}

/// Has a job begin at its priors: a search of no generations refines the middle of ranges that lie
/// around them.
pub fn begin_warm(
    document: &mut Value,
    ranges: &BTreeMap<String, SearchRange>,
    priors: &BTreeMap<String, WarmPrior>,
) {
    for (name, prior) in priors {
        let Some(range) = ranges.get(name) else {
            continue;
        };
        let scale = range.scale;
        let (low, high) = (
            coordinate(scale, range.lower),
            coordinate(scale, range.upper),
        );
        let reach = (REACH * prior.deviation).max(LEAST_REACH * (high - low));
        // The middle is the prior's where the whole range has room for it.
        let reach = reach.min(f64::max(high - prior.middle, prior.middle - low));
        let lower = f64::max(prior.middle - reach, low);
        let upper = f64::min(prior.middle + reach, high);
        let ends = |half: f64| {
            let ends = [prior.middle - half, prior.middle + half];
            ends.map(|u| value_at(scale, u))
        };
        document["parameters"][name] = json!({
            "estimate": {
                "lower": value_at(scale, lower).max(range.lower),
                "upper": value_at(scale, upper).min(range.upper),
                "scale": scale,
            },
            "prior": {"range_95": ends(NORMAL_95 * prior.deviation), "scale": scale},
        });
    }
    let huber = document.pointer("/method/huber_threshold").cloned();
    document["method"] = json!({"generations": 0, "further_searches": 0, "refine_candidates": 1});
    if let Some(huber) = huber {
        document["method"]["huber_threshold"] = huber;
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

/// What a window itself says of a parameter, without its prior: the estimate and its variance, in the
/// parameter's coordinate. Nothing where it says next to nothing.
///
/// A prior `N(m, M)` and what the window says, `N(z, R)`, make the estimate `N(x, P)` with
/// `1/P = 1/M + 1/R` and `x/P = m/M + z/R`.
#[must_use]
pub fn alone(
    own: &WatchedEstimate,
    range: &SearchRange,
    prior: Option<&WarmPrior>,
) -> Option<(f64, f64)> {
    let x = coordinate(range.scale, own.estimate);
    let p = deviation_at(range.scale, own.estimate, own.standard_error?).powi(2);
    let (z, r) = match prior {
        None => (x, p),
        Some(prior) => {
            let m = prior.deviation.powi(2);
            let news = 1.0 - p / m;
            if news < LEAST_NEWS {
                return None;
            }
            (prior.middle + (x - prior.middle) / news, p / news)
        }
    };
    (z.is_finite() && r.is_finite() && r > 0.0).then_some((z, r))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(scale: Scale) -> SearchRange {
        SearchRange {
            lower: 1.0,
            upper: 100.0,
            scale,
        }
    }

    fn estimate(estimate: f64, standard_error: f64) -> WatchedEstimate {
        WatchedEstimate {
            name: "a".to_owned(),
            unit: String::new(),
            estimate,
            standard_error: Some(standard_error),
            confidence_interval: None,
            total_standard_error: None,
            total_interval: None,
        }
    }

    #[test]
    fn what_a_window_says_alone_is_what_it_said_before_its_prior_was_added() {
        let (z, r, m, middle) = (10.0, 4.0, 9.0, 7.0);
        let p = 1.0 / (1.0 / r + 1.0 / m);
        let x = p * (z / r + middle / m);
        let prior = WarmPrior {
            middle,
            deviation: f64::sqrt(m),
        };
        let own = estimate(x, p.sqrt());
        let (value, variance) = alone(&own, &range(Scale::Linear), Some(&prior)).expect("news");
        assert!((value - z).abs() < 1e-9 && (variance - r).abs() < 1e-9);
    }

    #[test]
    fn a_window_that_adds_nothing_to_its_prior_says_nothing() {
        let prior = WarmPrior {
            middle: 10.0,
            deviation: 1.0,
        };
        let own = estimate(10.0, 1.0);
        assert_eq!(alone(&own, &range(Scale::Linear), Some(&prior)), None);
    }

    #[test]
    fn a_warm_search_has_the_estimate_before_in_its_middle_and_stays_in_the_range() {
        for scale in [Scale::Linear, Scale::Log] {
            let ranges = BTreeMap::from([("a".to_owned(), range(scale))]);
            let known = known(&[estimate(10.0, 0.1)], &ranges);
            let spec = MonitorSpec::read(&json!({
                "stream": "s", "window": {"length_s": 1}, "job": {}
            }))
            .expect("a specification");
            let priors = priors(&spec, &known, &ranges, 1.0);
            let mut document = json!({"parameters": {"b": {"value": 1}}});
            begin_warm(&mut document, &ranges, &priors);
            let own = &document["parameters"]["a"]["estimate"];
            let ends = ["lower", "upper"].map(|end| own[end].as_f64().expect("a number"));
            assert!(ends[0] >= 1.0 && ends[1] <= 100.0, "{ends:?}");
            let [low, high] = ends.map(|end| coordinate(scale, end));
            let middle = value_at(scale, 0.5 * (low + high));
            assert!((middle - 10.0).abs() < 1e-6, "{scale:?}: {middle}");
        }
    }
}
