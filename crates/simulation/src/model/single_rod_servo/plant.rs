//! The servo as a plant that is simulated block by block.
//!
//! Candidates of which none has a switchable effect, and whose valve lags in second order, are
//! simulated by equations from which the rest is left out when they are compiled. What is not
//! there adds nothing, so the bits are the same; the processor is spared the questions.

use super::dynamics::SingleRodServo;
use crate::native::{Dynamics, Native};
use crate::{
    Accuracy, BlockSimulator, CandidateBlock, DrivingInputs, Plant, SimulatedCandidate, block,
};

/// The servo.
#[derive(Clone, Copy, Debug)]
pub(super) struct Servo {
    with_effects: Native<SingleRodServo<true>>,
    without: Native<SingleRodServo<false>>,
}

impl Servo {
    /// With the outputs of its description.
    pub fn new(n_outputs: usize) -> Servo {
        Servo {
            with_effects: Native {
                dynamics: SingleRodServo,
                n_outputs,
            },
            without: Native {
                dynamics: SingleRodServo,
                n_outputs,
            },
        }
    }
}

impl Plant for Servo {
    fn n_outputs(&self) -> usize {
        self.with_effects.n_outputs
    }

    fn work_rate(&self, parameters: &[f64]) -> f64 {
        self.with_effects.work_rate(parameters)
    }

    fn block_sizes(&self, accuracy: Accuracy) -> &'static [usize] {
        block::sizes(accuracy)
    }

    fn simulator<'a>(
        &'a self,
        excitation: DrivingInputs<'a>,
        candidates: CandidateBlock<'_>,
    ) -> Box<dyn BlockSimulator + 'a> {
        let has_effects = |candidate: &SimulatedCandidate<'_>| {
            let constants = self.with_effects.dynamics.constants(candidate.parameters);
            constants.has_effects()
        };
        if candidates.members.iter().any(has_effects) {
            block::simulator(&self.with_effects, excitation, candidates)
        } else {
            block::simulator(&self.without, excitation, candidates)
        }
    }
}
