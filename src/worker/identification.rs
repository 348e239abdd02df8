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
use crate::dataset::Recording;
use crate::estimation::{self, Checkpoint, Estimation, GenerationRow, Problem, RefinementRow};
use crate::job::assemble::{self, Origin};
use crate::job::{Failure, GenerationEvent, JobSpec, Phase, Progress};
use crate::model::{Catalogue, Model, document};
use crate::store::JobRow;
use crate::uncertainty::{self, Analysis};

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
        let problem = assemble::problem(&spec, &model, &recordings)
            .map_err(|faults| {
                let detail = "the experiments cannot be cut out of the recordings".to_owned();
                Failure::cannot_run(detail, faults)
            })?
            .problem;
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
            request: uncertainty::Request {
                settings: spec.uncertainty,
                seed: spec.seed,
            },
            origin,
            problem,
            estimation,
            analysis: None,
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
    estimation: Estimation,
    /// Of the estimate that stands; nothing while the run goes on.
    analysis: Option<(estimation::Report, Analysis)>,
}

/// Nobody raises it.
static NEVER: AtomicBool = AtomicBool::new(false);

impl Run for IdentificationRun {
    fn advance(&mut self, stop: &AtomicBool, rows: &mut dyn FnMut(Row)) -> Advance {
        if self.estimation.phase() == estimation::Phase::Analyse {
            return self.analyse(stop);
        }
        let mut observer = Rows(rows);
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
        let finished = self.analysis.take().filter(|_| stopped.is_none());
        let (report, analysis) = match finished {
            Some(finished) => finished,
            None => {
                let stopped = stopped.map(estimation::StopReason::from);
                let Some(report) = self.estimation.report(&self.problem, stopped) else {
                    return Ok(None);
                };
                // A run that was stopped is not kept waiting for the more thorough intervals.
                let request = match stopped {
                    Some(_) => &uncertainty::Request::default(),
                    None => &self.request,
                };
                let analysis = uncertainty::analyse(&self.problem, &report, request, &NEVER)
                    .expect("an analysis that nobody stops comes to its end");
                (report, analysis)
            }
        };
        let outcome = assemble::outcome(&self.origin, &self.problem, &report, &analysis);
        Ok(Some(
            serde_json::to_value(outcome).expect("a result has only text keys"),
        ))
    }
}

impl IdentificationRun {
    fn analyse(&mut self, stop: &AtomicBool) -> Advance {
        let Some(report) = self.estimation.report(&self.problem, None) else {
            return Advance::Finished;
        };
        match uncertainty::analyse(&self.problem, &report, &self.request, stop) {
            Some(analysis) => {
                self.analysis = Some((report, analysis));
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
struct Rows<'a>(&'a mut dyn FnMut(Row));

impl estimation::Observer for Rows<'_> {
    fn generation(&mut self, row: &GenerationRow) {
        let finite = |value: f64| Some(value).filter(|value| value.is_finite());
        let best = row.best.iter().map(|(name, value)| {
            let value = serde_json::Number::from_f64(*value);
            (name.clone(), value.map_or(Value::Null, Value::Number))
        });
        (self.0)(Row::Generation(GenerationEvent {
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
    }

    fn refinement(&mut self, row: &RefinementRow) {
        (self.0)(Row::Refinement {
            iteration: row.iteration,
            cost: row.cost,
        });
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;
    use std::sync::atomic::Ordering;

    use serde_json::json;

    use super::*;
    use crate::dataset::{Signal, TimeAxis};
    use crate::job::spec::Context;
    use crate::job::{DatasetId, JobId, Status};

    /// A carriage of 2 kg with 3 N·s/m of viscous friction under a square wave, integrated at a
    /// tenth of the sample time.
    fn recording() -> Recording {
        let (sample_time, samples) = (0.02, 200);
        let (mut position, mut velocity) = (0.0, 0.0);
        let (mut positions, mut forces) = (Vec::new(), Vec::new());
        for k in 0..samples {
            let force = if (k / 17) % 2 == 0 { 20.0 } else { -20.0 };
            forces.push(force);
            positions.push(position);
            for _ in 0..10 {
                velocity += sample_time / 10.0 * (force - 3.0 * velocity) / 2.0;
                position += sample_time / 10.0 * velocity;
            }
        }
        let time = TimeAxis::Uniform {
            sample_time,
            samples,
        };
        let signals = vec![
            Signal::new("force", "N", forces),
            Signal::new("position", "m", positions),
        ];
        Recording::new(time, signals)
    }

    fn job() -> JobRow {
        let dataset = DatasetId::new();
        let document = json!({
            "model": "positioning_drive",
            "experiments": [{"dataset": dataset}],
            "parameters": {
                "mass": {"estimate": {"lower": 0.5, "upper": 10}},
                "viscous_friction": {"estimate": {"lower": 0.1, "upper": 20}},
                "coulomb_friction": {"value": 0},
                "offset": {"value": 0}
            },
            "outputs": {"position": {"noise_std": 1e-3}},
            "method": {"population": 10, "generations": 6},
            "seed": 7
        });
        let catalogue = Catalogue::built_in();
        let datasets = HashMap::from([(dataset, recording().summary())]);
        let context = Context {
            models: catalogue.iter().map(|model| model.description()).collect(),
            datasets: &datasets,
            max_duration_s: 60.0,
        };
        let spec = JobSpec::read(&document, &context).expect("a sound specification");
        JobRow {
            id: JobId::new(),
            name: None,
            labels: Default::default(),
            model: spec.model.clone(),
            spec: serde_json::to_value(spec).expect("JSON"),
            status: Status::Running,
            stop_request: None,
            progress: None,
            attempt: 1,
            error: None,
            created_at: jiff::Timestamp::UNIX_EPOCH,
            started_at: None,
            finished_at: None,
            last_event: 1,
            revision: 1,
        }
    }

    fn begin(job: &JobRow, checkpoint: Option<Vec<u8>>) -> Box<dyn Run> {
        let assignment = Assignment {
            model: None,
            job: job.clone(),
            datasets: vec![("sha256:1".to_owned(), recording())],
            checkpoint,
        };
        let method = Identification::new(Catalogue::built_in());
        method.begin(assignment).expect("a run")
    }

    fn work(run: &mut dyn Run) -> Vec<Row> {
        let mut rows = Vec::new();
        while run.advance(&NEVER, &mut |row| rows.push(row)) == Advance::Working {}
        rows
    }

    fn outcome(run: &mut dyn Run, stopped: Option<StopReason>) -> Value {
        let outcome = run.outcome(stopped).expect("no failure");
        outcome.expect("an estimate")
    }

    #[test]
    fn a_run_finds_the_parameters_and_tells_how_it_went() {
        let mut run = begin(&job(), None);
        let rows = work(&mut *run);
        let generations = rows.iter().filter(|row| matches!(row, Row::Generation(_)));
        assert_eq!(generations.count(), 6);
        assert_eq!(run.progress().phase, Phase::Analyse);
        let outcome = outcome(&mut *run, None);
        let mass = outcome["parameters"][0]["estimate"]
            .as_f64()
            .expect("a mass");
        // The recording was integrated with an error of about 1 %.
        assert!((mass / 2.0 - 1.0).abs() < 0.03, "{mass}");
        assert_eq!(outcome["engine"]["dataset_digests"], json!(["sha256:1"]));
    }

    #[test]
    fn a_run_taken_up_after_every_unit_comes_to_the_same_result() {
        let job = job();
        let mut unbroken = begin(&job, None);
        work(&mut *unbroken);
        let expected = outcome(&mut *unbroken, None);
        let mut run = begin(&job, None);
        while run.advance(&NEVER, &mut |_| ()) == Advance::Working {
            run = begin(&job, Some(run.checkpoint()));
        }
        let broken = outcome(&mut *run, None);
        assert_eq!(broken["parameters"], expected["parameters"]);
        assert_eq!(broken["verdict"], expected["verdict"]);
    }

    #[test]
    fn several_searches_and_other_methods_are_taken_up_with_the_same_bits_too() {
        for method in ["icra_genetic", "differential_evolution", "multistart_lm"] {
            let mut job = job();
            job.spec["method"]["name"] = json!(method);
            job.spec["method"]["restarts"] = json!(2);
            let mut unbroken = begin(&job, None);
            let rows = work(&mut *unbroken);
            let generations = rows.iter().filter(|row| matches!(row, Row::Generation(_)));
            let n_searches = if method == "multistart_lm" { 0 } else { 2 };
            assert_eq!(generations.count(), 6 * n_searches);
            let expected = outcome(&mut *unbroken, None);
            let mass = expected["parameters"][0]["estimate"].as_f64();
            let mass = mass.expect("a mass");
            assert!((mass / 2.0 - 1.0).abs() < 0.03, "{method}: {mass}");
            let searches = expected["searches"].as_array().expect("a list");
            assert_eq!(searches.len(), n_searches);
            let mut run = begin(&job, None);
            while run.advance(&NEVER, &mut |_| ()) == Advance::Working {
                run = begin(&job, Some(run.checkpoint()));
            }
            let broken = outcome(&mut *run, None);
            assert_eq!(broken["parameters"], expected["parameters"]);
            assert_eq!(broken["searches"], expected["searches"]);
        }
    }

    #[test]
    fn a_stopped_run_has_the_best_so_far_and_can_go_on() {
        let job = job();
        let mut run = begin(&job, None);
        assert_eq!(run.outcome(Some(StopReason::Cancelled)), Ok(None));
        run.advance(&NEVER, &mut |_| ());
        let paused = outcome(&mut *run, Some(StopReason::Paused));
        assert_eq!(paused["stop_reason"], "paused");
        work(&mut *run);
        let mut unbroken = begin(&job, None);
        work(&mut *unbroken);
        let (resumed, unbroken) = (outcome(&mut *run, None), outcome(&mut *unbroken, None));
        assert_eq!(resumed["parameters"], unbroken["parameters"]);
    }

    #[test]
    fn a_raised_flag_interrupts_the_analysis_too() {
        let mut run = begin(&job(), None);
        let stop = AtomicBool::new(false);
        while run.progress().phase != Phase::Analyse {
            assert_eq!(run.advance(&stop, &mut |_| ()), Advance::Working);
        }
        stop.store(true, Ordering::Relaxed);
        assert_eq!(run.advance(&stop, &mut |_| ()), Advance::Interrupted);
        stop.store(false, Ordering::Relaxed);
        assert_eq!(run.advance(&stop, &mut |_| ()), Advance::Finished);
    }

    #[test]
    fn a_job_that_does_not_read_back_says_why() {
        let method = Identification::new(Catalogue::built_in());
        let assignment = |job: JobRow, checkpoint| Assignment {
            model: None,
            job,
            datasets: vec![("sha256:1".to_owned(), recording())],
            checkpoint,
        };
        let mut unknown = job();
        unknown.spec["model"] = json!("perpetuum_mobile");
        let failure = method.begin(assignment(unknown, None)).err();
        let detail = failure.expect("no such model").detail;
        assert_eq!(detail, "there is no model `perpetuum_mobile`");
        let failure = method.begin(assignment(job(), Some(b"{}".to_vec()))).err();
        let detail = failure.expect("no checkpoint").detail;
        assert!(
            detail.starts_with("the stored checkpoint does not read back"),
            "{detail}"
        );
    }
}
