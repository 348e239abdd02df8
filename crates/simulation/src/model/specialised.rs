//! Plants made for the parameters that a job fixes, kept while the job is at work.

use crate::Plant;
use std::sync::{Arc, Mutex, PoisonError};

/// How many are kept.
const KEPT: usize = 4;

/// A plant, and the bits of the parameters that it was made for.
type SpecialisedPlant = (Vec<Option<u64>>, Arc<dyn Plant>);

/// The plants made last, the newest at the end.
#[derive(Default)]
pub(super) struct Specialised(Mutex<Vec<SpecialisedPlant>>);

impl Specialised {
    /// The plant for candidates that have these parameters in common.
    pub(super) fn get(&self, plant: &Arc<dyn Plant>, fixed: &[Option<f64>]) -> Arc<dyn Plant> {
        let bits: Vec<Option<u64>> = fixed.iter().map(|value| value.map(f64::to_bits)).collect();
        // Nothing in here can be left half done.
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, made)) = kept.iter().find(|(fixed_bits, _)| *fixed_bits == bits) {
            return Arc::clone(made);
        }
        let made = plant.specialised(fixed);
        let made = made.unwrap_or_else(|| Arc::clone(plant));
        if kept.len() == KEPT {
            kept.remove(0);
        }
        kept.push((bits, Arc::clone(&made)));
        made
    }
}
