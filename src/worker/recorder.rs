//! From the rows of a run to the events and the history of its job.
//!
//! Every generation becomes a row of the history. It becomes an event too if the last such event
//! is old enough; the last generation of a search always does. What was reported before a crash is not
//! reported again: a slice that does a generation again comes to the same row.

use std::time::Duration;

use jiff::Timestamp;

use super::candidates::Candidates;
use super::run::Row;
use crate::job::{Event, GenerationEvent};
use crate::store::{CandidatePage, Record, Reported, SharedPart, Slice};
use greybox::estimation::{Finding, Progress};

/// The least time between two `generation` events of a job: five a second.
const GENERATION_EVENT_GAP: Duration = Duration::from_millis(200);

/// Collects what a slice has to write.
#[derive(Debug)]
pub(super) struct Recorder {
    reported: Reported,
    /// The newest generation, while no event tells of it.
    unreported: Option<GenerationEvent>,
    /// Iterations of the refinement and looks at the chains of a posterior so far, in this slice and before
    /// it.
    refinements: u32,
    /// Findings that no event tells of yet.
    findings: Vec<Finding>,
    generations: Vec<GenerationEvent>,
    candidates: Candidates,
    events: Vec<Event>,
    parts: Vec<SharedPart>,
    progress: Option<Progress>,
    /// Time that the job worked before this slice [s].
    worked_before: f64,
}

impl Recorder {
    /// Goes on where the last slice stopped, with the candidates that are known to be stored.
    pub(super) fn new(slice: &Slice, candidates: Candidates) -> Self {
        Self {
            reported: slice.reported,
            unreported: slice.unreported.clone(),
            refinements: slice.checkpoint.as_ref().map_or(0, |c| c.refinements),
            findings: Vec::new(),
            generations: Vec::new(),
            candidates,
            events: Vec::new(),
            parts: Vec::new(),
            progress: None,
            worked_before: Duration::from_millis(slice.running_ms).as_secs_f64(),
        }
    }

    /// Which candidates are stored, for the next slice.
    pub(super) fn into_candidates(self) -> Candidates {
        self.candidates
    }

    /// Iterations of the refinement and looks at the chains of a posterior so far.
    pub(super) fn refinements(&self) -> u32 {
        self.refinements
    }

    /// Takes in candidates that were kept in slices before. All of them come before any row.
    pub(super) fn recall(&mut self, kept: &CandidatePage) {
        self.candidates.recall(kept);
    }

    /// Takes in a row at a time [of the wall clock].
    pub(super) fn take(&mut self, row: Row, now: Timestamp) {
        match row {
            Row::Finding(finding) => self.findings.push(finding),
            Row::Generation(generation) => {
                self.generations.push(generation.clone());
                if generation.generation > self.reported.generation {
                    self.unreported = Some(generation);
                    self.report_if_due(now);
                }
            }
            Row::Candidates {
                columns,
                candidates,
            } => self.candidates.take(columns, candidates),
            Row::Design(design) => {
                let looked_at = u32::try_from(design.assessed).unwrap_or(u32::MAX);
                if looked_at > self.reported.generation {
                    self.report_findings();
                    self.reported.generation = looked_at;
                    self.events.push(Event::Design(design));
                }
            }
            Row::Selection(event) => {
                let looked = u32::try_from(event.looked).unwrap_or(u32::MAX);
                if looked > self.reported.generation {
                    self.report_findings();
                    self.reported.generation = looked;
                    self.events.push(Event::Selection(event));
                }
            }
            Row::Refinement { iteration, cost } => {
                self.follow_search(Event::Refinement { iteration, cost }, now);
            }
            Row::Posterior(look) => self.follow_search(Event::Posterior(look), now),
        }
    }

    /// Takes in an event of what follows a search, unless it was told before.
    fn follow_search(&mut self, event: Event, now: Timestamp) {
        self.report(now);
        self.refinements += 1;
        if self.refinements > self.reported.refinements {
            self.report_findings();
            self.reported.refinements = self.refinements;
            self.events.push(event);
        }
    }

    /// Takes in what other nodes are to know of.
    pub(super) fn take_parts(&mut self, parts: Vec<SharedPart>) {
        self.parts.extend(parts);
    }

    /// Notes how far the run came after `worked` of this slice.
    pub(super) fn note(&mut self, progress: Progress, worked: Duration) {
        let so_far = self.worked_before + worked.as_secs_f64();
        let rest = so_far * (1.0 - progress.fraction) / progress.fraction;
        self.progress = Some(Progress {
            eta_s: Some(rest).filter(|rest| rest.is_finite()),
            ..progress
        });
    }

    /// Tells of the newest generation if the last event is old enough.
    pub(super) fn report_if_due(&mut self, now: Timestamp) {
        let gap = i64::try_from(GENERATION_EVENT_GAP.as_millis()).expect("a gap is short");
        let since = now.as_millisecond() - self.reported.at_ms;
        // A clock that was set back does not silence a job.
        if since >= gap || since < 0 {
            self.report(now);
        }
    }

    /// Tells of the newest generation.
    pub(super) fn report(&mut self, now: Timestamp) {
        if let Some(generation) = self.unreported.take() {
            self.report_findings();
            self.reported.generation = generation.generation;
            self.reported.at_ms = now.as_millisecond();
            self.events.push(Event::Generation(generation));
        }
    }

    /// Tells of the findings in front of the first row that is reported, and so never twice.
    fn report_findings(&mut self) {
        let findings = std::mem::take(&mut self.findings);
        if (self.reported.generation, self.reported.refinements) == (0, 0) {
            self.events.extend(findings.into_iter().map(Event::Finding));
        }
    }

    /// Whether there is anything to write.
    pub(super) fn is_empty(&self) -> bool {
        self.generations.is_empty() && self.events.is_empty() && self.progress.is_none()
    }

    /// What has come together since the last call.
    pub(super) fn record(&mut self) -> Record {
        Record {
            generations: std::mem::take(&mut self.generations),
            candidates: self.candidates.news(),
            events: std::mem::take(&mut self.events),
            reported: self.reported,
            progress: self.progress.take(),
            parts: std::mem::take(&mut self.parts),
            ..Record::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use indexmap::IndexMap;
    use jiff::ToSpan;
    use proptest::prelude::*;

    use super::*;

    fn recorder() -> Recorder {
        Recorder {
            reported: Reported::default(),
            unreported: None,
            refinements: 0,
            findings: Vec::new(),
            generations: Vec::new(),
            candidates: Candidates::new(0),
            events: Vec::new(),
            parts: Vec::new(),
            progress: None,
            worked_before: 10.0,
        }
    }

    fn row(generation: u32) -> Row {
        Row::Generation(GenerationEvent {
            generation,
            evaluations: 0,
            best_cost: None,
            generation_best_cost: None,
            mean_cost: None,
            best_credit: None,
            entropy: None,
            credit_updates: 0,
            best: IndexMap::new(),
        })
    }

    fn at(ms: i64) -> Timestamp {
        Timestamp::UNIX_EPOCH + 1_000_000_i64.seconds() + ms.milliseconds()
    }

    fn reported(events: &[Event]) -> Vec<u32> {
        let number = |event: &Event| match event {
            Event::Generation(generation) => Some(generation.generation),
            _ => None,
        };
        events.iter().filter_map(number).collect()
    }

    #[test]
    fn the_last_generation_before_the_refinement_is_always_told() {
        let mut recorder = recorder();
        for generation in 1..=5 {
            recorder.take(row(generation), at(i64::from(generation)));
        }
        let refinement = Row::Refinement {
            iteration: 1,
            cost: 0.5,
        };
        recorder.take(refinement, at(6));
        let record = recorder.record();
        assert_eq!(reported(&record.events), [1, 5]);
        assert_eq!(record.events[2].name(), "refinement");
        assert_eq!(record.generations.len(), 5);
        assert_eq!(
            (record.reported.generation, record.reported.refinements),
            (5, 1)
        );
    }

    #[test]
    fn what_was_told_before_a_crash_is_not_told_again() {
        let mut recorder = recorder();
        recorder.reported = Reported {
            generation: 2,
            refinements: 1,
            at_ms: 0,
        };
        for generation in 1..=3 {
            recorder.take(row(generation), at(1000 * i64::from(generation)));
        }
        for iteration in 1..=2 {
            recorder.take(
                Row::Refinement {
                    iteration,
                    cost: 1.0,
                },
                at(9000),
            );
        }
        let record = recorder.record();
        assert_eq!(reported(&record.events), [3]);
        assert_eq!(record.events.len(), 2);
        assert_eq!(record.generations.len(), 3);
    }

    #[test]
    fn the_time_left_follows_from_the_time_worked_in_all_slices() {
        let mut recorder = recorder();
        let progress = Progress {
            phase: greybox::estimation::Phase::Search,
            generation: 1,
            generations: 4,
            evaluations: 30,
            best_cost: None,
            best_credit: None,
            fraction: 0.25,
            eta_s: None,
        };
        recorder.note(progress, Duration::from_secs(2));
        let noted = recorder.record().progress.expect("progress");
        assert_eq!(noted.eta_s, Some(36.0));
    }

    proptest! {
        #[test]
        fn no_second_has_more_than_five_generation_events(
            gaps in proptest::collection::vec(0_i64..400, 1..200)
        ) {
            let mut recorder = recorder();
            let mut now = 0;
            let mut times = Vec::new();
            for (generation, gap) in (1..).zip(&gaps) {
                now += gap;
                recorder.take(row(generation), at(now));
                times.extend(recorder.record().events.iter().map(|_| now));
            }
            for (k, first) in times.iter().enumerate() {
                let within = times[k..].iter().filter(|t| **t < first + 1000).count();
                prop_assert!(within <= 5);
            }
            recorder.report(at(now));
            let last = reported(&recorder.record().events);
            let newest = u32::try_from(gaps.len()).expect("few");
            prop_assert!(last == [newest] || recorder.reported.generation == newest);
        }
    }
}
