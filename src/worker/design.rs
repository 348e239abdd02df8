//! The design of an experiment as a job: from the stored task to [`Designing`], a few experiments a
//! unit, and from there to events and the result.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::run::{Advance, Assignment, Past, Row, Run, StopReason, unread};
use crate::job::event::DesignEvent;
use crate::job::{Failure, ResultOfJob};
use greybox::estimation::{Phase, Progress};
use greybox::identification::assemble::{Assessments, COST_OF_JOB, Designing, PastResult};
use greybox::identification::design::Design;
use greybox::identification::spec::design::{DesignRequest, DesignSpec, PastJob};
use greybox::model::Model;
use greybox::parsing::Fault;
use greybox::recording::Recording;

/// Experiments that are looked at in one unit of work.
const EXPERIMENTS_A_UNIT: usize = 4;

/// Begins a design, or goes on where it was saved.
pub(super) fn begin(
    design: &DesignRequest,
    model: Arc<Model>,
    assignment: Assignment,
) -> Result<Box<dyn Run>, Failure> {
    let past = assignment.past;
    let before = past
        .as_ref()
        .map(|past| PastJob::new(&past.spec, &past.outcome));
    let spec = design.read(&[model.description()], before.as_ref());
    let spec = spec.map_err(cannot)?;
    let saved = match assignment.checkpoint {
        Some(bytes) => serde_json::from_slice(&bytes).map_err(|error| unread(&error))?,
        None => Saved::default(),
    };
    Ok(Box::new(DesignRun {
        beginning: Some(Beginning {
            spec,
            model,
            past,
            recordings: assignment
                .datasets
                .into_iter()
                .map(|(_, recording)| recording)
                .collect(),
        }),
        designing: None,
        saved,
        best: None,
        failure: None,
    }))
}

fn cannot(faults: Vec<Fault>) -> Failure {
    Failure::cannot_run("the design cannot be made".to_owned(), faults)
}

/// What a design is begun from.
struct Beginning {
    spec: DesignSpec,
    model: Arc<Model>,
    past: Option<Past>,
    recordings: Vec<Arc<Recording>>,
}

/// What is kept between slices.
#[derive(Default, Serialize, Deserialize)]
struct Saved {
    #[serde(rename = "looked")]
    assessments: Assessments,
    /// The `log10_determinant` of the best experiment that an event reported.
    #[serde(rename = "told")]
    reported: Option<f64>,
}

struct DesignRun {
    /// Until the design has begun, which may take as long as its job's recordings are long.
    beginning: Option<Beginning>,
    designing: Option<Designing>,
    saved: Saved,
    /// The best so far.
    best: Option<Design>,
    failure: Option<Failure>,
}

impl DesignRun {
    /// Looks at a few experiments more. Answers nothing when `stop` was raised before there was any.
    fn go_on(&mut self, stop: &AtomicBool) -> Result<Option<Design>, Failure> {
        if let Some(beginning) = &self.beginning {
            let past = beginning.past.as_ref().map(|past| PastResult {
                spec: &past.spec,
                outcome: &past.outcome,
                recordings: &beginning.recordings,
            });
            let (spec, model) = (beginning.spec.clone(), &beginning.model);
            let begun = Designing::begin(spec, model, past, COST_OF_JOB, stop).map_err(cannot)?;
            if begun.is_some() {
                self.designing = begun;
                self.beginning = None;
            }
        }
        let Some(designing) = &self.designing else {
            return Ok(None);
        };
        let assessments = &mut self.saved.assessments;
        let design = designing.go_on(assessments, EXPERIMENTS_A_UNIT, stop);
        design.map_err(cannot)
    }

    /// The event of the best so far, where it is better than what was told before.
    fn news(&mut self) -> Option<Row> {
        let event = DesignEvent::of(self.best.as_ref()?)?;
        let reached = event.best.log10_determinant;
        if self
            .saved
            .reported
            .is_some_and(|reported| reached <= reported)
        {
            return None;
        }
        self.saved.reported = Some(reached);
        Some(Row::Design(event))
    }
}

impl Run for DesignRun {
    fn advance(&mut self, stop: &AtomicBool, rows: &mut dyn FnMut(Row)) -> Advance {
        match self.go_on(stop) {
            Ok(None) => return Advance::Interrupted,
            Ok(best) => self.best = best,
            Err(failure) => {
                self.failure = Some(failure);
                return Advance::Finished;
            }
        }
        if let Some(row) = self.news() {
            rows(row);
        }
        let is_finished = self.best.as_ref().is_some_and(|best| best.finished);
        match is_finished {
            true => Advance::Finished,
            false if stop.load(Ordering::Relaxed) => Advance::Interrupted,
            false => Advance::Working,
        }
    }

    fn progress(&self) -> Progress {
        let assessed = self.saved.assessments.len();
        let most = self
            .designing
            .as_ref()
            .map_or(1, Designing::most_assessments);
        Progress {
            phase: Phase::Search,
            generation: 0,
            generations: 0,
            evaluations: assessed as u64,
            best_cost: None,
            best_credit: None,
            fraction: (assessed as f64 / most.max(1) as f64).min(1.0),
            eta_s: None,
        }
    }

    fn checkpoint(&self) -> Vec<u8> {
        serde_json::to_vec(&self.saved).expect("a checkpoint has only text keys")
    }

    fn outcome(
        &mut self,
        _stopped: Option<StopReason>,
        _hurry: &AtomicBool,
    ) -> Result<Option<ResultOfJob>, Failure> {
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        let best = self.best.clone();
        Ok(best.map(|best| ResultOfJob::Design(Box::new(best))))
    }
}

#[cfg(test)]
mod tests;
