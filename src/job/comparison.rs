//! Several methods and seeds on the same problem: which of them finds what the others miss.
//!
//! A run has found the minimum when its cost is within 1 % of the lowest of all runs. That says
//! nothing about a minimum that none of them found.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use utoipa::ToSchema;

/// A run has found the minimum when its cost is at most so many times the lowest of all runs.
const SAME_COST: f64 = 1.01;

/// One run of one method.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// The method.
    pub method: String,
    /// The seed.
    pub seed: u64,
    /// The cost that it reached.
    pub cost: Option<f64>,
    /// Candidates judged.
    pub evaluations: u64,
    /// How long it took `[s]`.
    pub seconds: f64,
    /// Estimate of each parameter, SI.
    pub estimates: BTreeMap<String, f64>,
}

/// How the methods fared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Comparison {
    /// The lowest cost of all runs; `null` before the first has ended.
    pub lowest_cost: Option<f64>,
    /// The methods, in the order in which they were asked for.
    pub methods: Vec<MethodRow>,
}

/// How one method fared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MethodRow {
    /// The method.
    #[schema(example = "icra_genetic")]
    pub method: String,
    /// Runs that have ended.
    pub runs: u64,
    /// Runs that came within 1 % of the lowest cost.
    pub found: u64,
    /// Candidates judged in a run.
    pub evaluations: Option<Spread>,
    /// How long a run took `[s]`, from its first slice to its end.
    pub seconds: Option<Spread>,
    /// The cost of a run divided by the lowest cost.
    pub cost_ratio: Option<Spread>,
    /// Among the runs that found the minimum, how far the estimate that differs most lies from that
    /// of the lowest run `[%]`.
    pub deviation_percent: Option<Spread>,
}

/// Many values in short.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Spread {
    /// The middle value; of an even number of values, the mean of the two in the middle.
    pub median: f64,
    /// The smallest value.
    pub least: f64,
    /// The largest value.
    pub largest: f64,
}

impl Spread {
    fn of(values: impl Iterator<Item = f64>) -> Option<Spread> {
        let mut values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
        values.sort_by(f64::total_cmp);
        let above = *values.get(values.len() / 2)?;
        let below = values[(values.len() - 1) / 2];
        Some(Spread {
            median: f64::midpoint(below, above),
            least: *values.first()?,
            largest: *values.last()?,
        })
    }
}

/// Sets the runs of these methods side by side.
#[must_use]
pub fn compare(methods: &[String], trials: &[Trial]) -> Comparison {
    let costs = trials
        .iter()
        .filter_map(|trial| Some((trial, trial.cost?)))
        .filter(|(_, cost)| cost.is_finite());
    let best = costs.min_by(|a, b| a.1.total_cmp(&b.1));
    let row = |method: &String| {
        let of_method = || trials.iter().filter(|trial| trial.method == *method);
        let ratio = |trial: &Trial| Some(trial.cost? / best?.1);
        let is_found = |trial: &Trial| ratio(trial).is_some_and(|ratio| ratio <= SAME_COST);
        let near_best = || of_method().filter(|trial| is_found(trial));
        MethodRow {
            method: method.clone(),
            runs: of_method().count() as u64,
            found: near_best().count() as u64,
            evaluations: Spread::of(of_method().map(|trial| trial.evaluations as f64)),
            seconds: Spread::of(of_method().map(|trial| trial.seconds)),
            cost_ratio: Spread::of(of_method().filter_map(ratio)),
            deviation_percent: Spread::of(
                near_best().filter_map(|trial| Some(deviation(trial, best?.0))),
            ),
        }
    };
    Comparison {
        lowest_cost: best.map(|(_, cost)| cost),
        methods: methods.iter().map(row).collect(),
    }
}

/// The largest difference of an estimate, in per cent of that of the other run.
fn deviation(trial: &Trial, best: &Trial) -> f64 {
    let pairs = trial.estimates.iter();
    let pairs = pairs.filter_map(|(name, estimate)| Some((estimate, best.estimates.get(name)?)));
    pairs
        .filter(|(_, of_best)| **of_best != 0.0)
        .map(|(estimate, of_best)| 100.0 * (estimate / of_best - 1.0).abs())
        .fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trial(method: &str, cost: Option<f64>, mass: f64) -> Trial {
        Trial {
            method: method.to_owned(),
            seed: 1,
            cost,
            evaluations: 100,
            seconds: 2.0,
            estimates: BTreeMap::from([("mass".to_owned(), mass)]),
        }
    }

    #[test]
    fn the_median_of_an_even_number_of_values_is_the_mean_of_the_two_in_the_middle() {
        let median =
            |values: &[f64]| Spread::of(values.iter().copied()).map(|spread| spread.median);
        assert_eq!(median(&[4.0, 1.0]), Some(2.5));
        assert_eq!(median(&[8.0, 1.0, 2.0, 4.0]), Some(3.0));
        assert_eq!(median(&[8.0, f64::NAN, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[f64::NAN]), None);
    }

    #[test]
    fn a_run_that_ends_above_the_lowest_cost_has_not_found_it() {
        let trials = [
            trial("a", Some(2.0), 50.0),
            trial("a", Some(2.01), 51.0),
            trial("a", Some(3.0), 80.0),
            trial("b", None, 0.0),
        ];
        let methods = ["a", "b", "c"].map(str::to_owned);
        let comparison = compare(&methods, &trials);
        assert_eq!(comparison.lowest_cost, Some(2.0));
        let [a, b, c] = &comparison.methods[..] else {
            panic!("{comparison:?}");
        };
        assert_eq!((a.runs, a.found), (3, 2));
        let deviation = a.deviation_percent.expect("two found it");
        assert!((deviation.largest - 2.0).abs() < 1e-9 && deviation.least == 0.0);
        assert_eq!(a.cost_ratio.expect("three costs").largest, 1.5);
        assert_eq!((b.runs, b.found, b.cost_ratio), (1, 0, None));
        assert_eq!((c.runs, c.evaluations), (0, None));
    }
}
