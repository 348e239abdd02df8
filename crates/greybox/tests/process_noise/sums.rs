//! What the likelihood of two experiments is.

use super::coverage::{Disturbed, model, record};
use greybox::estimation::Problem;
use greybox::estimation::process_noise::{NoiseModel, NoiseNumber, ProcessNoise, filtered};
use greybox::estimation::sensitivity::{Neighbourhood, Sides};
use greybox::simulation::Accuracy;
use greybox::simulation::program::{ActsOn, Disturbance, DisturbanceKind};
use greybox::{Identification, Recording};
use std::sync::atomic::AtomicBool;

/// The logarithm of the likelihood of recordings under a force with memory on the rig.
fn log_likelihood(recordings: &[Recording]) -> f64 {
    let (first, further) = recordings.split_first().unwrap();
    let mut identification = Identification::new(&model(), first.clone()).hold_back(0.0);
    for recording in further {
        identification = identification.experiment(recording.clone());
    }
    let problem = identification.problem().unwrap();
    let noise = NoiseModel {
        disturbances: vec![ProcessNoise {
            name: "v".to_owned(),
            disturbance: Disturbance {
                acts_on: ActsOn::Rate(1),
                kind: DisturbanceKind::Memory,
            },
            strength: NoiseNumber::Given(0.2),
            time_constant: Some(NoiseNumber::Given(0.5)),
        }],
        sensors: vec![NoiseNumber::Given(1e-4)],
        steps: 2,
    };
    likelihood_of(&filtered(&problem, &noise).unwrap())
}

fn likelihood_of(problem: &Problem) -> f64 {
    let never = AtomicBool::new(false);
    let positions = vec![0.51, 0.49, 0.5];
    let middle = (&positions[..], Sides::One);
    let others = std::slice::from_ref(&positions);
    let around =
        Neighbourhood::along_axes(problem, middle, others, (Accuracy::Full, &never)).unwrap();
    around.log_likelihood(0).unwrap()
}

#[test]
fn two_experiments_have_the_sum_of_their_likelihoods() {
    let recordings = [record(Disturbed::Memory, 1), record(Disturbed::White, 2)];
    let apart: f64 = recordings
        .iter()
        .map(|recording| log_likelihood(std::slice::from_ref(recording)))
        .sum();
    let together = log_likelihood(&recordings);
    assert!((together - apart).abs() < 1e-6, "{together} beside {apart}");
}
