//! The method as a run: assemble the problem, search and refine, analyse, write the result.
//!
//! The analysis is a unit of work like the others, so that a stop reaches it too. It is not part
//! of the checkpoint: a run that is taken up after its estimate stands analyses again, with the
//! same bits.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use super::run::{Advance, Assignment, Method, Row, Run, StopReason};
use crate::estimation::{self, Checkpoint, Estimation, GenerationRow, Problem, RefinementRow};
use crate::job::assemble::{self, Finding, Origin};
use crate::job::{
    Candidate, CandidateColumn, Failure, Fault, GenerationEvent, JobSpec, Phase, Progress,
};
use crate::model::{Catalogue, Model, document};
use crate::recording::Recording;
use crate::store::JobRow;
use crate::uncertainty::identifiability::FlatDirection;
use crate::uncertainty::{self, Conclusion};

/// The identification of a model's parameters from recordings.
#[derive(Debug)]
pub struct Identification {
    catalogue: Catalogue,
}

impl Identification {
    /// The identification of the models of a catalogue.
    pub fn new(catalogue: Catalogue) -> Self {
        Self { catalogue }
    }
}

impl Method for Identification {
    fn begin(&self, assignment: Assignment) -> Result<Box<dyn Run>, Failure> {
        let Assignment {
            job,
            model,
            datasets,
            checkpoint,
        } = assignment;
        let spec = read_spec(&job)?;
        let model = match model {
            Some(document) => read_model(&document)?,
            None => self.catalogue.get(&spec.model).cloned().ok_or_else(|| {
                Failure::cannot_run(format!("there is no model `{}`", spec.model), Vec::new())
            })?,
        };
        let (dataset_digests, recordings): (Vec<String>, Vec<Recording>) =
            datasets.into_iter().unzip();
        let assembly = assemble::problem(&spec, &model, &recordings).map_err(|faults| {
            let detail = "the experiments cannot be cut out of the recordings".to_owned();
            Failure::cannot_run(detail, faults)
        })?;
        let findings = checkpoint
            .is_none()
            .then(|| assemble::preflight(&assembly, &spec.method).findings);
        let problem = assembly.problem;
        let estimation = match checkpoint {
            None => Estimation::start(&problem, &spec.method, spec.seed),
            Some(bytes) => resume(&problem, &spec, &bytes)?,
        };
        let origin = Origin {
            job: job.id.to_string(),
            seed: spec.seed,
            spec_digest: digest(&job.spec),
            dataset_digests,
        };
        Ok(Box::new(IdentificationRun {
            request: spec.request(),
            origin,
            columns: CandidateColumn::of(&problem).into(),
            problem,
            findings,
            refusal: None,
            estimation,
            conclusion: None,
        }))
    }
}

fn read_spec(job: &JobRow) -> Result<JobSpec, Failure> {
    serde_json::from_value(job.spec.clone()).map_err(|error| {
        let detail = format!("the stored specification does not read back: {error}");
        Failure::cannot_run(detail, Vec::new())
    })
}

fn read_model(document: &Value) -> Result<Arc<Model>, Failure> {
    let read = document::referenced(document).map_err(|faults| {
        let detail = "the stored model does not read back".to_owned();
        Failure::cannot_run(detail, faults)
    })?;
    Ok(read.model)
}

fn resume(problem: &Problem, spec: &JobSpec, bytes: &[u8]) -> Result<Estimation, Failure> {
    let unreadable = |why: String| {
        let detail = format!("the stored checkpoint does not read back: {why}");
        Failure::cannot_run(detail, Vec::new())
    };
    let checkpoint: Checkpoint =
        serde_json::from_slice(bytes).map_err(|error| unreadable(error.to_string()))?;
    Estimation::resume(problem, &spec.method, spec.seed, checkpoint)
        .map_err(|error| unreadable(error.to_string()))
}

/// The digest of a completed specification.
fn digest(spec: &Value) -> String {
    let digest = Sha256::digest(spec.to_string());
    let hexadecimal: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("sha256:{hexadecimal}")
}

struct IdentificationRun {
    origin: Origin,
    /// What is asked about the estimate's uncertainty.
    request: uncertainty::Request,
    problem: Problem,
    /// What the values of a candidate stand for.
    columns: Arc<[CandidateColumn]>,
    /// What is known before anything is simulated; taken by the look ahead with which a new run
    /// begins.
    findings: Option<Vec<Finding>>,
    /// Why the run goes no further than its look ahead.
    refusal: Option<Failure>,
    estimation: Estimation,
    /// Of the estimate that stands; nothing while the run goes on.
    conclusion: Option<Conclusion>,
}

/// Nobody raises it.
static NEVER: AtomicBool = AtomicBool::new(false);

impl Run for IdentificationRun {
    fn advance(&mut self, stop: &AtomicBool, rows: &mut dyn FnMut(Row)) -> Advance {
        if let Some(findings) = &self.findings {
            let Some(flat) = assemble::flat_directions(&self.problem, stop) else {
                return Advance::Interrupted;
            };
            let reported = |flat: &FlatDirection| assemble::unseen(&self.problem, flat);
            let refuses =
                |flat: &&FlatDirection| self.request.settings.flat_directions.refuses(flat);
            let grounds: Vec<Finding> = flat.iter().filter(refuses).map(reported).collect();
            let findings = findings
                .iter()
                .cloned()
                .chain(flat.iter().map(reported))
                .collect();
            self.findings = None;
            if !grounds.is_empty() {
                self.refusal = Some(refusal(&grounds));
                return Advance::Finished;
            }
            rows(Row::Findings(findings));
        }
        if self.estimation.phase() == estimation::Phase::Analyse {
            return self.analyse(stop);
        }
        let mut observer = Rows {
            tell: rows,
            columns: &self.columns,
        };
        match self.estimation.advance(&self.problem, stop, &mut observer) {
            estimation::Advance::Interrupted => Advance::Interrupted,
            estimation::Advance::Working | estimation::Advance::Finished => Advance::Working,
        }
    }

    fn progress(&self) -> Progress {
        let progress = self.estimation.progress();
        Progress {
            phase: match progress.phase {
                estimation::Phase::Search => Phase::Search,
                estimation::Phase::Refine => Phase::Refine,
                estimation::Phase::Analyse => Phase::Analyse,
            },
            generation: progress.generation,
            generations: progress.generations,
            evaluations: progress.evaluations,
            best_cost: progress.best_cost,
            best_credit: progress.best_credit,
            fraction: progress.fraction,
            eta_s: None,
        }
    }

    fn checkpoint(&self) -> Vec<u8> {
        serde_json::to_vec(&self.estimation.checkpoint()).expect("a checkpoint has only text keys")
    }

    fn outcome(&mut self, stopped: Option<StopReason>) -> Result<Option<Value>, Failure> {
        if let Some(refusal) = self.refusal.take() {
            return Err(refusal);
        }
        let finished = self.conclusion.take().filter(|_| stopped.is_none());
        let conclusion = match finished {
            Some(finished) => finished,
            None => {
                let stopped = stopped.map(estimation::StopReason::from);
                let Some(report) = self.estimation.report(&self.problem, stopped) else {
                    return Ok(None);
                };
                // A run that was stopped is not kept waiting for the more thorough answers.
                let request = match stopped {
                    Some(_) => &uncertainty::Request::default(),
                    None => &self.request,
                };
                uncertainty::conclude(&self.problem, &report, request, &NEVER)
                    .expect("an analysis that nobody stops comes to its end")
            }
        };
        let outcome = assemble::outcome(&self.origin, &conclusion);
        Ok(Some(
            serde_json::to_value(outcome).expect("a result has only text keys"),
        ))
    }
}

fn refusal(grounds: &[Finding]) -> Failure {
    let fault =
        |finding: &Finding| Fault::new(&finding.pointer, finding.code.clone(), &finding.detail);
    Failure::not_identifiable(grounds.iter().map(fault).collect())
}

impl IdentificationRun {
    fn analyse(&mut self, stop: &AtomicBool) -> Advance {
        let Some(report) = self.estimation.report(&self.problem, None) else {
            return Advance::Finished;
        };
        match uncertainty::conclude(&self.problem, &report, &self.request, stop) {
            Some(conclusion) => {
                self.conclusion = Some(conclusion);
                Advance::Finished
            }
            None => Advance::Interrupted,
        }
    }
}

impl From<StopReason> for estimation::StopReason {
    fn from(reason: StopReason) -> Self {
        match reason {
            StopReason::TimeLimit => Self::TimeLimit,
            StopReason::Cancelled => Self::Cancelled,
            StopReason::Paused => Self::Paused,
        }
    }
}

/// Passes on what the run tells.
struct Rows<'a> {
    tell: &'a mut dyn FnMut(Row),
    columns: &'a Arc<[CandidateColumn]>,
}

impl estimation::Observer for Rows<'_> {
    fn generation(&mut self, row: &GenerationRow) {
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        let best = row.best.iter().map(|(name, value)| {
            let value = serde_json::Number::from_f64(*value);
            (name.clone(), value.map_or(Value::Null, Value::Number))
        });
        (self.tell)(Row::Generation(GenerationEvent {
            generation: row.generation,
            evaluations: row.evaluations,
            best_cost: finite(row.best_cost),
            generation_best_cost: finite(row.generation_best_cost),
            mean_cost: row.mean_cost.and_then(finite),
            best_credit: finite(row.best_credit),
            entropy: finite(row.entropy),
            credit_updates: row.credit_updates,
            best: best.collect::<Map<String, Value>>(),
        }));
        (self.tell)(Row::Candidates {
            columns: self.columns.clone(),
            candidates: Candidate::of(row),
        });
    }

    fn refinement(&mut self, row: &RefinementRow) {
        (self.tell)(Row::Refinement {
            iteration: row.iteration,
            cost: row.cost,
        });
    }
}

#[cfg(test)]
mod tests;
