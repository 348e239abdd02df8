//! The servo as a plant that is simulated block by block.
//!
//! Candidates of which none has a switchable effect, and whose valve lags in second order, are
//! simulated by equations from which the rest is left out when they are compiled. What is not
//! there adds nothing, so the bits are the same; the processor is spared the questions.

use super::SingleRodServo;
use crate::simulation::batch::Plant;
use crate::simulation::dynamics::Dynamics;
use crate::simulation::{Accuracy, BlockSimulator, Candidate, Excitation, block};

const WITH_EFFECTS: SingleRodServo<true> = SingleRodServo;
const WITHOUT: SingleRodServo<false> = SingleRodServo;

/// The servo, with the outputs of its description.
#[derive(Clone, Copy, Debug)]
pub(super) struct Servo {
    pub n_outputs: usize,
}

impl Plant for Servo {
    fn n_outputs(&self) -> usize {
        self.n_outputs
    }

    fn resolved_rate(&self, parameters: &[f64]) -> f64 {
        WITH_EFFECTS.resolved_rate(&WITH_EFFECTS.constants(parameters))
    }

    fn block_sizes(&self, accuracy: Accuracy) -> &'static [usize] {
        block::sizes(accuracy)
    }

    fn simulator<'a>(
        &'a self,
        excitation: Excitation<'a>,
        candidates: &[Candidate<'_>],
    ) -> Box<dyn BlockSimulator + 'a> {
        let has_effects = |candidate: &Candidate<'_>| {
            let constants = WITH_EFFECTS.constants(candidate.parameters);
            constants.has_effects()
        };
        if candidates.iter().any(has_effects) {
            block::simulator(&WITH_EFFECTS, excitation, candidates)
        } else {
            block::simulator(&WITHOUT, excitation, candidates)
        }
    }
}
