//! What the server is told of a source: how far each series has come, and why it stands.

use std::convert::Infallible;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use jiff::Timestamp;

use super::delivery::StreamDelivery;
use super::error::CollectError;
use super::sources_file::SampleSource;
use crate::store::{SeriesState, SourceState};

/// When the server is first told how a source is: the first pass may be over by then.
const FIRST: Duration = Duration::from_secs(5);
/// How often the server is told after that.
const EVERY: Duration = Duration::from_secs(30);
/// The characters of a sentence that is told, at the most.
const MOST_CHARACTERS: usize = 1000;

/// The state of a source while its series are followed.
pub(super) struct SourceReport {
    state: Mutex<SourceState>,
}

impl SourceReport {
    /// A source of which nothing was read yet.
    pub(super) fn of(source: &SampleSource) -> Self {
        let series = source.series.iter().map(|series| SeriesState {
            series: shortened(&series.label()),
            stream: series.stream.clone(),
            reached: None,
            fault: None,
        });
        let state = SourceState {
            kind: source.kind.to_owned(),
            every_s: source.every.as_secs_f64(),
            away: None,
            series: series.collect(),
        };
        Self {
            state: Mutex::new(state),
        }
    }

    fn state(&self) -> MutexGuard<'_, SourceState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes how far a series has come.
    pub(super) fn reached(&self, place: usize, instant: Timestamp) {
        if let Some(series) = self.state().series.get_mut(place) {
            series.reached = Some(instant);
        }
    }

    /// Notes how the last pass over a series ended.
    pub(super) fn passed(&self, place: usize, error: Option<&CollectError>) {
        if let Some(series) = self.state().series.get_mut(place) {
            series.fault = error.map(|error| shortened(&error.to_string()));
        }
    }

    /// Notes why all series of the source wait, or that they do not.
    pub(super) fn waits(&self, away: Option<String>) {
        self.state().away = away.map(|why| shortened(&why));
    }

    /// Tells the server once how the source is.
    pub(super) async fn tell(&self, source: &str, delivery: &StreamDelivery) {
        let state = self.state().clone();
        // The samples come also where the server does not take what is said of them.
        if let Err(error) = delivery.say(source, &state).await {
            tracing::debug!(source, %error, "the server was not told how the source is");
        }
    }

    /// Tells the server again and again how the source is.
    pub(super) async fn tell_on(&self, source: &str, delivery: &StreamDelivery) -> Infallible {
        let mut pause = FIRST;
        loop {
            tokio::time::sleep(pause).await;
            self.tell(source, delivery).await;
            pause = EVERY;
        }
    }
}

fn shortened(text: &str) -> String {
    text.chars().take(MOST_CHARACTERS).collect()
}
