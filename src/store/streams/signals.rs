//! Which signals a stream has: those that came with its batches.

use std::collections::HashMap;

use super::stream::BatchOutcome;
use greybox::recording::{MAX_SIGNALS, RowSignal};

/// The signals of a stream with those of a batch, and the place of each of the batch's among them.
pub(super) fn places(
    stored: &[RowSignal],
    new: &[RowSignal],
) -> Result<(Vec<RowSignal>, Vec<usize>), BatchOutcome> {
    let mut signals = stored.to_vec();
    let names = stored.iter().enumerate();
    let mut by_name: HashMap<String, usize> = names
        .map(|(place, signal)| (signal.name.clone(), place))
        .collect();
    let mut places = Vec::with_capacity(new.len());
    for signal in new {
        let place = *by_name.entry(signal.name.clone()).or_insert(signals.len());
        match signals.get_mut(place) {
            None => signals.push(signal.clone()),
            Some(stored) if stored.unit != signal.unit => {
                let units = (stored.unit.clone(), signal.unit.clone());
                return Err(BatchOutcome::UnitsDiffer(
                    signal.name.clone(),
                    units.0,
                    units.1,
                ));
            }
            Some(stored) => stored.interpolation = stored.interpolation.or(signal.interpolation),
        }
        places.push(place);
    }
    if signals.len() > MAX_SIGNALS {
        return Err(BatchOutcome::TooManySignals);
    }
    Ok((signals, places))
}
