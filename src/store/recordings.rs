//! Recordings that were read lately, decoded, in memory: those that many jobs read, or one job again and
//! again because it goes from node to node, are read once. They never change, so what is kept is right for
//! as long as the recording is there.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use greybox::identification::DatasetId;
use greybox::recording::{Recording, TimeAxis};

/// What is kept at the most, in bytes of samples.
const LIMIT: usize = 64 << 20;

/// Recordings by their identifiers, bounded in bytes. Cheap to clone.
#[derive(Clone)]
pub(super) struct RecordingCache(Arc<Mutex<Kept>>);

struct Kept {
    /// The one that was asked for last stands last.
    recordings: VecDeque<(DatasetId, Arc<Recording>)>,
    limit: usize,
}

impl Default for RecordingCache {
    fn default() -> Self {
        Self::with_limit(LIMIT)
    }
}

impl RecordingCache {
    fn with_limit(limit: usize) -> Self {
        Self(Arc::new(Mutex::new(Kept {
            recordings: VecDeque::new(),
            limit,
        })))
    }

    /// The recording, if it is kept.
    pub(super) fn get(&self, id: DatasetId) -> Option<Arc<Recording>> {
        self.with(|kept| {
            let place = kept.recordings.iter().position(|(own, _)| *own == id)?;
            let entry = kept.recordings.remove(place)?;
            let recording = entry.1.clone();
            kept.recordings.push_back(entry);
            Some(recording)
        })
    }

    /// Keeps a recording, in the place of those that were not asked for for the longest.
    pub(super) fn keep(&self, id: DatasetId, recording: &Arc<Recording>) {
        self.with(|kept| {
            kept.recordings.retain(|(own, _)| *own != id);
            kept.recordings.push_back((id, recording.clone()));
            let bytes = |kept: &Kept| -> usize {
                let all = kept.recordings.iter();
                all.map(|(_, recording)| bytes_of(recording)).sum()
            };
            while bytes(kept) > kept.limit {
                kept.recordings.pop_front();
            }
        });
    }

    /// Keeps it no more.
    pub(super) fn forget(&self, id: DatasetId) {
        self.with(|kept| kept.recordings.retain(|(own, _)| *own != id));
    }

    fn with<T>(&self, act: impl FnOnce(&mut Kept) -> T) -> T {
        act(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// The bytes of its samples.
fn bytes_of(recording: &Recording) -> usize {
    let axes = matches!(recording.time, TimeAxis::Instants(_));
    let series = recording.signals.len() + usize::from(axes);
    recording.time.samples() * series * size_of::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of 1000 bytes and a little.
    fn recording() -> Arc<Recording> {
        let samples = vec![1.0; 125];
        Arc::new(Recording::from_samples(0.1, [("level", "m", samples)]))
    }

    #[test]
    fn those_that_were_not_asked_for_for_the_longest_go_when_there_is_no_room() {
        let kept = RecordingCache::with_limit(3000);
        let ids: Vec<DatasetId> = (0..4).map(|_| DatasetId::new()).collect();
        for id in &ids[..3] {
            kept.keep(*id, &recording());
        }
        assert!(kept.get(ids[0]).is_some());
        kept.keep(ids[3], &recording());
        let found: Vec<bool> = ids.iter().map(|id| kept.get(*id).is_some()).collect();
        assert_eq!(found, [true, false, true, true]);
        kept.forget(ids[0]);
        assert!(kept.get(ids[0]).is_none());
    }

    #[test]
    fn one_that_is_too_large_is_not_kept() {
        let kept = RecordingCache::with_limit(999);
        let id = DatasetId::new();
        kept.keep(id, &recording());
        assert!(kept.get(id).is_none());
    }
}
