//! What the fuzz targets share: a model that is read soundly must also run; nothing may panic, hang
//! or grow.

use greybox::model::document::{self, Read};
use greybox::numerics::lanes::{LANES, Lanes};
use greybox::simulation::{Accuracy, SimulatedCandidate, CandidateBlock, DrivingInputs};
use serde_json::Value;
use std::sync::atomic::AtomicBool;

/// Samples that a model runs for.
const SAMPLES: usize = 3;

/// Reads a model document; one that is sound is simulated for a moment.
pub fn read_and_run(document: &Value) {
    let Ok(Read { model, .. }) = document::read(document) else {
        return;
    };
    let description = model.description();
    let inputs = vec![vec![0.0, 1.0, -1e3]; description.inputs.len()];
    let parameters = description.defaults();
    let initial_state = vec![None; description.states.len()];
    let excitation = DrivingInputs {
        sample_time: 1e-3,
        instants: None,
        samples: SAMPLES,
        input_set: 0,
        inputs: &inputs,
        accuracy: Accuracy::Screening,
    };
    let candidate = SimulatedCandidate {
        parameters: &parameters,
        initial_state: &initial_state,
    };
    let candidates = CandidateBlock {
        members: &[candidate],
        in_step: false,
    };
    let mut block = model.plant().simulator(excitation, candidates);
    let mut outputs = vec![Lanes([0.0; LANES]); SAMPLES * description.outputs.len()];
    let never = AtomicBool::new(false);
    let ended = block.advance(SAMPLES, &mut outputs, &never);
    assert!(ended.is_some(), "nobody stops it");
    for (lane, failure) in block.failures().iter().enumerate() {
        let finite = outputs.iter().all(|row| row.0[lane].is_finite());
        assert!(
            finite || failure.is_some(),
            "a lane without numbers is a failure"
        );
    }
}
