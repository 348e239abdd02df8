//! The memory and the work that a recipe may take.

use super::fault::PreparationFault;
use super::step::PreparationStep;
use greybox_recording::Recording;

/// The most values of a recording before each step of a recipe and after it: two copies of them are in memory at a
/// time.
pub const MAX_VALUES: usize = 32_000_000;

/// The most operations on values that a recipe may take.
const MAX_WORK: f64 = 4e9;
/// Operations on each value in a step that has no number of them in its fields.
const WORK_OF_A_VALUE: f64 = 20.0;

/// Refuses a recording of so many samples of so many signals that it takes too much memory.
pub(super) fn check_values(samples: f64, signals: usize) -> Result<(), PreparationFault> {
    if samples * signals as f64 <= MAX_VALUES as f64 {
        return Ok(());
    }
    let detail = format!(
        "{samples} samples of {signals} signals are more than {MAX_VALUES} values: cut the recording, or leave \
         signals out, in a step before"
    );
    Err(PreparationFault::of_step("too_large", detail))
}

/// Adds the work of a step to that of the steps before it, and refuses too much.
pub(super) fn add_work(
    work: &mut f64,
    step: &PreparationStep,
    recording: &Recording,
) -> Result<(), PreparationFault> {
    let samples = recording.time.samples() as f64;
    let values = samples * recording.signals.len() as f64;
    *work += match step {
        PreparationStep::Median {
            signals,
            samples: of,
        } => {
            let signals = signals.as_ref().map_or(recording.signals.len(), Vec::len);
            samples * signals as f64 * f64::from(*of)
        }
        // An equation has no more operations than characters.
        PreparationStep::Calculate { equation, .. } => samples * equation.len() as f64,
        _ => values * WORK_OF_A_VALUE,
    };
    if *work <= MAX_WORK {
        return Ok(());
    }
    let detail = "the steps up to this one take too long for a recording of this length: cut it in a step before, or \
                  take the median of fewer samples";
    Err(PreparationFault::of_step(
        "too_much_work",
        detail.to_owned(),
    ))
}
