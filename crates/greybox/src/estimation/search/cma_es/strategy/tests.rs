//! The strategy on functions whose minimum is known.

use super::*;
use crate::estimation::objective::Evaluation;
use crate::estimation::search::cma_es::best_first;
use greybox_numerics::rng::{Purpose, stream};
use greybox_simulation::SimulationFailure;
use std::sync::Arc;

/// The lowest value of a function after so many evaluations of it, and the strategy then.
fn lowest(
    function: impl Fn(&[f64]) -> f64,
    (unknowns, candidates, evaluations): (usize, usize, usize),
    seed: u64,
) -> (f64, Strategy) {
    let mut first = stream(seed, 0, Purpose::Population);
    let mean = (0..unknowns).map(|_| rng::unit(&mut first)).collect();
    let mut strategy = Strategy::about(mean);
    let mut lowest = f64::INFINITY;
    for generation in 0..evaluations / candidates {
        let mut rng = stream(seed, generation as u64, Purpose::Mutation);
        let drawn = strategy.draw(candidates, &mut rng);
        let costs: Vec<f64> = drawn.iter().map(|own| function(own)).collect();
        let mut best_first: Vec<usize> = (0..candidates).collect();
        best_first.sort_by(|&a, &b| costs[a].total_cmp(&costs[b]));
        lowest = lowest.min(costs[best_first[0]]);
        strategy.learn(&best_first);
    }
    (lowest, strategy)
}

/// An ellipsoid about a point of the box, the longest of its axes so many times as long as the
/// shortest, and aslant: the axes of the box are turned by a reflection.
fn aslant(centre: f64, longest: f64) -> impl Fn(&[f64]) -> f64 {
    move |positions| {
        let n = positions.len() as f64;
        let offset: Vec<f64> = positions.iter().map(|part| part - centre).collect();
        let normal: Vec<f64> = (0..positions.len()).map(|k| 1.0 + k as f64).collect();
        let along: f64 = offset.iter().zip(&normal).map(|(a, b)| a * b).sum();
        let squared: f64 = normal.iter().map(|part| part * part).sum();
        let turned = offset.iter().zip(&normal);
        let turned = turned.map(|(part, normal)| part - 2.0 * along / squared * normal);
        let stiffness = |k: usize| libm::pow(longest, 2.0 * k as f64 / (n - 1.0));
        turned
            .enumerate()
            .map(|(k, part)| stiffness(k) * part * part)
            .sum()
    }
}

#[test]
fn a_narrow_valley_aslant_is_followed_to_its_bottom() {
    for seed in 1..=10 {
        let (lowest, _) = lowest(aslant(0.4, 1e3), (5, 10, 3000), seed);
        assert!(lowest < 1e-10, "seed {seed}: {lowest}");
    }
}

#[test]
fn the_covariance_learns_the_shape_of_the_valley() {
    for seed in 1..=10 {
        let (_, strategy) = lowest(aslant(0.4, 1e3), (5, 10, 1300), seed);
        let axes = strategy.axes().into_iter().map(|axis| axis.value);
        let (shortest, longest) = axes.fold((f64::INFINITY, 0.0_f64), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        let ratio = longest / shortest;
        assert!((300.0..3000.0).contains(&ratio), "seed {seed}: {ratio}");
    }
}

#[test]
fn one_unknown_alone_is_found() {
    for seed in 1..=10 {
        let square = |positions: &[f64]| (positions[0] - 0.123_456).powi(2);
        let (lowest, _) = lowest(square, (1, 6, 600), seed);
        assert!(lowest < 1e-14, "seed {seed}: {lowest}");
    }
}

#[test]
fn the_fewest_candidates_that_are_allowed_are_enough() {
    // The settings allow no smaller population.
    let fewest = 4;
    for seed in 1..=40 {
        let (lowest, _) = lowest(aslant(0.4, 10.0), (2, fewest, 2000), seed);
        assert!(lowest < 1e-10, "seed {seed}: {lowest}");
    }
}

#[test]
fn a_minimum_on_the_bounds_and_in_a_corner_is_found_and_nothing_leaves_the_box() {
    for seed in 1..=10 {
        for centre in [0.0, 1.0, -0.3] {
            let function = |positions: &[f64]| {
                assert!(positions.iter().all(|part| (0.0..=1.0).contains(part)));
                positions.iter().map(|part| (part - centre).powi(2)).sum()
            };
            let (lowest, _) = lowest(function, (3, 10, 4000), seed);
            let least = 3.0 * (centre.clamp(0.0, 1.0) - centre).powi(2);
            assert!(lowest - least < 1e-9, "seed {seed}: {lowest}");
        }
    }
}

#[test]
fn where_all_costs_are_the_same_it_stays_sound() {
    let (_, strategy) = lowest(|_| 1.0, (3, 8, 8000), 1);
    let text = serde_json::to_string(&strategy).unwrap();
    assert!(!text.contains("null"), "{text}");
    let deviations = strategy
        .axes()
        .into_iter()
        .map(|axis| axis.value * strategy.step);
    assert!(
        deviations
            .into_iter()
            .all(|length| (1e-9..=1.0).contains(&length))
    );
}

#[test]
fn a_strategy_written_down_draws_the_same_bits() {
    let (_, mut strategy) = lowest(aslant(0.6, 1e3), (4, 8, 1000), 3);
    let text = serde_json::to_string(&strategy).unwrap();
    let mut read: Strategy = serde_json::from_str(&text).unwrap();
    assert_eq!(read, strategy);
    let draw = |from: &mut Strategy| from.draw(8, &mut stream(3, 9, Purpose::Mutation));
    assert_eq!(draw(&mut read), draw(&mut strategy));
}

fn evaluation(cost: f64) -> Arc<Evaluation> {
    Arc::new(Evaluation {
        cost,
        block_errors: Vec::new(),
        failure: (!cost.is_finite()).then_some(SimulationFailure::Diverged),
    })
}

#[test]
fn a_candidate_that_failed_counts_as_not_drawn() {
    let mut rng = stream(4, 0, Purpose::Population);
    let mut begun = Strategy::about(vec![0.3, 0.5, 0.7]);
    begun.draw(8, &mut rng);
    // After a generation of these of the eight, without the candidates drawn then.
    let after = |judged: &[(usize, f64)]| {
        let mut strategy = begun.clone();
        let drawn = judged.iter().map(|(place, _)| begun.drawn[*place].clone());
        strategy.drawn = drawn.collect();
        let evaluations: Vec<_> = judged.iter().map(|(_, cost)| evaluation(*cost)).collect();
        let mut rng = stream(4, 1, Purpose::Mutation);
        strategy.learn(&best_first(&evaluations));
        let drawn = strategy.draw(evaluations.len(), &mut rng);
        assert_eq!(drawn.len(), judged.len());
        strategy.drawn.clear();
        strategy
    };
    let mut untaught = begun.clone();
    untaught.drawn.clear();
    let failed = f64::INFINITY;
    let sound = after(&[(0, 5.0), (3, 2.0), (6, 9.0)]);
    assert_ne!(sound, untaught);
    let among = [(0, 5.0), (1, failed), (3, 2.0), (4, failed), (6, 9.0)];
    assert_eq!(after(&among), sound);
    // Which of them was drawn first makes no difference.
    assert_eq!(after(&[(6, 9.0), (3, 2.0), (0, 5.0)]), sound);
    // None is better than another where one alone, or none, came to a cost.
    assert_eq!(after(&[(0, 5.0), (1, failed), (2, failed)]), untaught);
    assert_eq!(after(&[(1, failed), (2, failed)]), untaught);
}
