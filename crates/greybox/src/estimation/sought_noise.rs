//! Disturbances whose numbers are looked for, and the noise models that a problem may have.

use super::problem::Problem;
use super::process_noise::{NoiseNumber, recorded_quantities};
use greybox_simulation::program::{ActsOn, Disturbance, DisturbanceKind, RecordedQuantity};

/// Disturbed states at the most.
const MOST_STATES: usize = 4;

/// A number of a disturbance that is looked for, or given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SoughtNumber {
    /// The number as the filter takes it.
    Stated(NoiseNumber),
    /// An unknown whose range follows from the residuals of the free run and from the record.
    Open,
}

/// A disturbance whose numbers are looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct SoughtDisturbance {
    /// The quantity that the disturbance acts on, and how it moves.
    pub disturbance: Disturbance,
    /// How strong it is `[unit of what it acts on · √s]`.
    pub strength: SoughtNumber,
    /// How long one with memory remembers `[s]`.
    pub time_constant: SoughtNumber,
}

impl SoughtDisturbance {
    /// A disturbance of which nothing is known.
    #[must_use]
    pub fn open(acts_on: ActsOn, kind: DisturbanceKind) -> SoughtDisturbance {
        SoughtDisturbance {
            disturbance: Disturbance { acts_on, kind },
            strength: SoughtNumber::Open,
            time_constant: SoughtNumber::Open,
        }
    }
}

/// The noise models that a problem may have, the simplest first.
#[must_use]
pub fn candidates(problem: &Problem) -> Vec<Vec<SoughtDisturbance>> {
    let mut candidates = vec![Vec::new()];
    let driven = problem.model.driven_states();
    for kind in [DisturbanceKind::White, DisturbanceKind::Memory] {
        let states = driven.iter().take(MOST_STATES);
        let on_rate = |state: &usize| SoughtDisturbance::open(ActsOn::Rate(*state), kind);
        candidates.extend(states.map(|state| vec![on_rate(state)]));
    }
    let recorded = recorded_quantities(problem, &[]);
    candidates.extend(of_controller(problem, &recorded));
    // What acted was recorded as it was: its sensor does not drift.
    let is_measured = |output: &usize| recorded.iter().all(|shown| shown.output != *output);
    let outputs = problem.outputs.iter().map(|output| output.index);
    let outputs = outputs.filter(is_measured);
    candidates.extend(outputs.map(|output| {
        let acts_on = ActsOn::Output(output);
        vec![SoughtDisturbance::open(acts_on, DisturbanceKind::Memory)]
    }));
    candidates
}

/// Disturbances of what a controller within the model computes and no output shows, as far as the filter can
/// carry them.
fn of_controller(problem: &Problem, recorded: &[RecordedQuantity]) -> Vec<Vec<SoughtDisturbance>> {
    let n_quantities = problem.model.description().sampled.len();
    let kinds = [DisturbanceKind::White, DisturbanceKind::Memory];
    let all = kinds.into_iter().flat_map(|kind| {
        (0..n_quantities)
            .filter(|quantity| recorded.iter().all(|shown| shown.quantity != *quantity))
            .take(MOST_STATES)
            .map(move |quantity| SoughtDisturbance::open(ActsOn::Sampled(quantity), kind))
    });
    let is_possible = |sought: &SoughtDisturbance| {
        let mut experiments = problem.experiments.iter();
        experiments.all(|data| {
            let evenly = data.instants.is_none().then_some(data.sample_time);
            let controller = problem.model.controller(evenly, &[sought.disturbance]);
            controller.is_ok_and(|controller| controller.is_some())
        })
    };
    all.filter(is_possible).map(|sought| vec![sought]).collect()
}
