//! All sources at once, each by itself: one that is away keeps no other back.

use std::collections::BTreeSet;
use std::time::Duration;

use tokio::task::JoinSet;

use super::cursors::Cursors;
use super::delivery::StreamDelivery;
use super::error::CollectError;
use super::pass::{Brought, SeriesPass};
use super::reports::SourceReport;
use super::sources_file::SampleSource;

/// The first wait after a failure; each further one is twice as long.
const SHORTEST_WAIT: Duration = Duration::from_secs(1);
/// The longest wait after a failure.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// When collecting ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Until {
    /// When each series has come to now, or failed.
    CaughtUp,
    /// Never.
    Stopped,
}

/// Collects from all sources, and says how many series failed in their last pass.
pub async fn collect(
    sources: Vec<SampleSource>,
    cursors: &Cursors,
    delivery: &StreamDelivery,
    until: Until,
) -> usize {
    let mut tasks = JoinSet::new();
    for source in sources {
        let followed = FollowedSource {
            report: SourceReport::of(&source),
            source,
            cursors: cursors.clone(),
            delivery: delivery.clone(),
        };
        tasks.spawn(async move { followed.follow(until).await });
    }
    let mut failed = 0;
    while let Some(ended) = tasks.join_next().await {
        failed += ended.unwrap_or_else(|error| std::panic::resume_unwind(error.into_panic()));
    }
    failed
}

/// What a round over all series of a source came to.
#[derive(Clone, Debug, Default)]
struct SourceRound {
    /// The series that failed.
    failures: usize,
    /// Why the source or the server was away: all series of the source wait then.
    away: Option<String>,
    /// The wait that the server asks for.
    asked_wait: Option<Duration>,
}

/// A source whose series are followed.
struct FollowedSource {
    source: SampleSource,
    cursors: Cursors,
    delivery: StreamDelivery,
    report: SourceReport,
}

impl FollowedSource {
    /// Follows all series, tells the server meanwhile how the source is, and says how many series failed in the last
    /// round.
    async fn follow(&self, until: Until) -> usize {
        let name = &self.source.name;
        let failures = tokio::select! {
            failures = self.pass_on(until) => failures,
            never = self.report.tell_on(name, &self.delivery) => match never {},
        };
        self.report.tell(name, &self.delivery).await;
        failures
    }

    /// Passes over all series again and again, and says how many failed in the last round.
    async fn pass_on(&self, until: Until) -> usize {
        let source = &self.source;
        let mut rows: Vec<u32> = vec![source.page_rows; source.series.len()];
        let mut told: Vec<BTreeSet<String>> = vec![BTreeSet::new(); source.series.len()];
        let mut wait = SHORTEST_WAIT;
        loop {
            let mut round = SourceRound::default();
            for (place, series) in source.series.iter().enumerate() {
                let pass = SeriesPass {
                    source,
                    series,
                    cursors: &self.cursors,
                    delivery: &self.delivery,
                    rows: &mut rows[place],
                    refusal: None,
                    brought: Brought::default(),
                    report: &self.report,
                    place,
                };
                let passed = passed(pass, &mut told[place]).await;
                self.report.passed(place, passed.as_ref().err());
                round.count(passed);
            }
            self.report.waits(round.away.clone());
            if until == Until::CaughtUp {
                return round.failures;
            }
            let pause = match round.away {
                Some(_) => wait.max(round.asked_wait.unwrap_or_default()),
                None => source.every,
            };
            wait = match round.away {
                Some(_) => LONGEST_WAIT.min(wait * 2),
                None => SHORTEST_WAIT,
            };
            tokio::time::sleep(pause).await;
        }
    }
}

impl SourceRound {
    fn count(&mut self, passed: Result<(), CollectError>) {
        let Err(error) = passed else {
            return;
        };
        self.failures += 1;
        if !error.is_refusal() {
            self.away = Some(error.to_string());
        }
        if let CollectError::ServerAway { after, .. } = error {
            self.asked_wait = self.asked_wait.max(after);
        }
    }
}

/// Passes over a series, and writes into the log what came of it.
async fn passed(mut pass: SeriesPass<'_>, told: &mut BTreeSet<String>) -> Result<(), CollectError> {
    let passed = pass.run().await;
    tell(&pass, told, passed.as_ref().err());
    passed
}

/// Writes into the log what a pass brought, what of it the server remarks for the first time, and why it ended early.
fn tell(pass: &SeriesPass, told: &mut BTreeSet<String>, error: Option<&CollectError>) {
    let (source, stream) = (&pass.source.name, &pass.series.stream);
    let series = pass.series.label();
    let Brought { rows, stored } = &pass.brought;
    let (added, changed) = (stored.added, stored.changed);
    if added + changed > 0 {
        tracing::info!(
            source,
            series,
            stream,
            rows,
            added,
            changed,
            "samples were brought"
        );
    }
    for (key, remark) in &stored.remarks {
        // A remark that comes with every page is told once.
        if told.insert(key.clone()) {
            tracing::warn!(
                source,
                series,
                stream,
                remark,
                "the server remarks on how it read the samples"
            );
        }
    }
    if let Some(error) = error {
        tracing::warn!(source, series, stream, %error, "the pass ended early; it begins again where it ended");
    }
}
