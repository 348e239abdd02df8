//! Recordings that were read lately, decoded, in memory: those that many jobs read, or one job again and
//! again because it goes from node to node, are read once. They never change, so what is kept is right for
//! as long as the recording is there.

use std::sync::Arc;

use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

use greybox::identification::DatasetId;
use greybox::recording::{Recording, TimeAxis};

/// What is kept at the most, in bytes of samples.
const LIMIT: u64 = 64 << 20;

/// Recordings by their identifiers, bounded in bytes. Cheap to clone.
#[derive(Clone)]
pub(super) struct RecordingCache(Arc<Cache<DatasetId, Arc<Recording>, SampleBytes>>);

impl Default for RecordingCache {
    fn default() -> Self {
        Self::with_limit(LIMIT)
    }
}

impl RecordingCache {
    fn with_limit(limit: u64) -> Self {
        // One large recording may fill the only shard.
        let options = OptionsBuilder::new()
            .shards(1)
            .estimated_items_capacity(100)
            .weight_capacity(limit)
            .build()
            .expect("all that an option needs is given");
        let (hasher, lifecycle) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
        Self(Arc::new(Cache::with_options(
            options,
            SampleBytes,
            hasher,
            lifecycle,
        )))
    }

    /// Whether a recording of so many series of samples, its time among them, can be kept.
    pub(super) fn may_keep(samples: usize, series: usize) -> bool {
        (samples * series * size_of::<f64>()) as u64 <= LIMIT
    }

    /// The recording, if it is kept.
    pub(super) fn get(&self, id: DatasetId) -> Option<Arc<Recording>> {
        self.0.get(&id)
    }

    /// Keeps a recording, in the place of others that are asked for less.
    pub(super) fn keep(&self, id: DatasetId, recording: &Arc<Recording>) {
        self.0.insert(id, recording.clone());
    }

    /// Keeps it no more.
    pub(super) fn forget(&self, id: DatasetId) {
        self.0.remove(&id);
    }
}

/// Counts the bytes of samples.
#[derive(Clone)]
struct SampleBytes;

impl Weighter<DatasetId, Arc<Recording>> for SampleBytes {
    fn weight(&self, _id: &DatasetId, recording: &Arc<Recording>) -> u64 {
        let axes = matches!(recording.time, TimeAxis::Instants(_));
        let series = recording.signals.len() + usize::from(axes);
        (recording.time.samples() * series * size_of::<f64>()) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// One of 1000 bytes.
    fn recording() -> Arc<Recording> {
        let samples = vec![1.0; 125];
        Arc::new(Recording::from_samples(0.1, [("level", "m", samples)]))
    }

    #[test]
    fn what_is_kept_is_bounded_in_bytes() {
        let kept = RecordingCache::with_limit(3500);
        let ids: Vec<DatasetId> = (0..10).map(|_| DatasetId::new()).collect();
        for id in &ids {
            kept.keep(*id, &recording());
        }
        let n_kept = ids.iter().filter(|id| kept.get(**id).is_some()).count();
        assert!((1..=3).contains(&n_kept), "{n_kept}");
    }

    #[test]
    fn a_recording_that_was_removed_is_not_kept() {
        let kept = RecordingCache::default();
        let id = DatasetId::new();
        kept.keep(id, &recording());
        assert!(kept.get(id).is_some());
        kept.forget(id);
        assert!(kept.get(id).is_none());
    }

    #[test]
    fn one_that_is_too_large_is_not_kept() {
        let kept = RecordingCache::with_limit(999);
        let id = DatasetId::new();
        kept.keep(id, &recording());
        assert!(kept.get(id).is_none());
    }
}
