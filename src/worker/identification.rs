//! The method as the worker's runs: from the stored job to [`identification::Run`] and from there
//! to rows and the result.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::run::{Advance, Assignment, Helped, Row, Run, Share, StopReason, unread};
use crate::job::event::PosteriorEvent;
use crate::job::{Candidate, CandidateColumn, Failure, GenerationEvent, ResultOfJob};
use crate::store::SharedPart;
use greybox::estimation::{
    Finding, GenerationRow, Observer, PosteriorRow, Progress, RefinementRow,
};
use greybox::identification::{self, IdentificationError, JobSpec, Part};
use greybox::model::Model;
use greybox::parsing::Fault;
use greybox::recording::Recording;

/// Begins the identification of a model's parameters from recordings, or resumes it where it was
/// saved.
pub(super) fn begin(
    spec: &JobSpec,
    model: &Arc<Model>,
    assignment: Assignment,
) -> Result<Box<dyn Run>, Failure> {
    let Assignment {
        job,
        datasets,
        checkpoint,
        ..
    } = assignment;
    let (digests, recordings): (Vec<String>, Vec<Arc<Recording>>) = datasets.into_iter().unzip();
    let run = match checkpoint {
        None => identification::Run::begin(spec, model, &recordings),
        Some(bytes) => {
            let checkpoint = serde_json::from_slice(&bytes).map_err(|error| unread(&error))?;
            identification::Run::resume(spec, model, &recordings, checkpoint)
        }
    };
    let run = run.map_err(failure)?.named(job.id.to_string(), digests);
    Ok(Box::new(IdentificationRun {
        columns: CandidateColumn::of(run.problem()).into(),
        run,
    }))
}

fn failure(error: IdentificationError) -> Failure {
    match error {
        IdentificationError::Invalid(faults) => {
            let detail = "the experiments cannot be cut out of the recordings".to_owned();
            Failure::cannot_run(detail, faults)
        }
        IdentificationError::NotIdentifiable(findings) => {
            let fault =
                |finding: Finding| Fault::new(finding.pointer, finding.code, finding.detail);
            Failure::not_identifiable(findings.into_iter().map(fault).collect())
        }
        IdentificationError::NoEstimate => Failure::no_estimate(),
        IdentificationError::Checkpoint(error) => unread(&error),
    }
}

struct IdentificationRun {
    run: identification::Run,
    /// What the values of a candidate stand for.
    columns: Arc<[CandidateColumn]>,
}

impl Run for IdentificationRun {
    fn advance(&mut self, stop: &AtomicBool, rows: &mut dyn FnMut(Row)) -> Advance {
        let mut observer = Rows {
            rows,
            columns: &self.columns,
        };
        self.run.advance(stop, &mut observer)
    }

    fn progress(&self) -> Progress {
        self.run.progress()
    }

    fn checkpoint(&self) -> Vec<u8> {
        serde_json::to_vec(&self.run.checkpoint()).expect("a checkpoint has only text keys")
    }

    fn is_shareable(&self) -> bool {
        self.run.is_shareable()
    }

    fn share(&mut self, share: Share, at_most: u32) {
        self.run.share(share, at_most);
    }

    fn take_parts(&mut self, parts: Vec<SharedPart>) {
        let read = parts.into_iter().filter_map(|SharedPart { name, part }| {
            // One that does not read back is done here.
            Some((name, serde_json::from_str(&part).ok()?))
        });
        self.run.take_parts(read);
    }

    fn new_parts(&mut self) -> Vec<SharedPart> {
        shared(self.run.new_parts())
    }

    fn help(&mut self, share: Share, at_most: u32, stop: &AtomicBool) -> Helped {
        let parts = self.run.help(share, at_most, stop);
        let generations = parts.iter().map(|(_, part)| part.generations()).sum();
        let refits = parts.iter().filter(|(_, part)| part.is_refit()).count();
        Helped {
            parts: shared(parts),
            refits,
            generations,
        }
    }

    fn outcome(
        &mut self,
        stopped: Option<StopReason>,
        hurry: &AtomicBool,
    ) -> Result<Option<ResultOfJob>, Failure> {
        let outcome = self.run.outcome(stopped, hurry).map_err(failure)?;
        Ok(outcome.map(|outcome| ResultOfJob::Identification(Box::new(outcome))))
    }
}

fn shared(parts: Vec<(String, Part)>) -> Vec<SharedPart> {
    let written = parts.into_iter().map(|(name, part)| SharedPart {
        name,
        part: serde_json::to_string(&part).expect("a part has only text keys"),
    });
    written.collect()
}

/// Turns what the run reports into rows.
struct Rows<'a> {
    rows: &'a mut dyn FnMut(Row),
    columns: &'a Arc<[CandidateColumn]>,
}

impl Observer for Rows<'_> {
    fn finding(&mut self, finding: &Finding) {
        (self.rows)(Row::Finding(finding.clone()));
    }

    fn generation(&mut self, row: &GenerationRow) {
        (self.rows)(Row::Generation(GenerationEvent::from(row)));
        (self.rows)(Row::Candidates {
            columns: self.columns.clone(),
            candidates: Candidate::of(row),
        });
    }

    fn refinement(&mut self, row: &RefinementRow) {
        (self.rows)(Row::Refinement {
            iteration: row.iteration,
            cost: row.cost,
        });
    }

    fn posterior(&mut self, row: &PosteriorRow) {
        (self.rows)(Row::Posterior(PosteriorEvent::from(row)));
    }
}

#[cfg(test)]
mod tests;
