//! `greybox estimate`: a job without a server, from a recording and a job document.

use super::error::CommandError;
use super::progress::{self, Progress};
use super::{files, table};
use crate::estimation::{Advance, Estimation, GenerationRow, Observer, RefinementRow};
use crate::estimation::{Problem, StopReason};
use crate::job::assemble::{self, Assembly, Origin};
use crate::job::candidate::{self, Selection};
use crate::job::spec::Context;
use crate::job::{Candidate, CandidateColumn, DatasetId, Fault, JobSpec, Outcome};
use crate::model::{Catalogue, document};
use crate::recording::Recording;
use crate::uncertainty;
use clap::Args;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::collections::HashMap;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What `estimate` is given.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording, CSV or JSON; every experiment of the job is cut from it
    recording: PathBuf,

    /// The job as it is submitted to a server, JSON or YAML; the datasets that it names are not used
    job: PathBuf,

    /// The model in the place of the job's own: a name of the catalogue, or the file of a model
    /// document, JSON or YAML
    #[arg(long)]
    model: Option<String>,

    /// Where to write the result, JSON
    #[arg(long, short)]
    output: Option<PathBuf>,

    /// Where to write a row for each generation, CSV
    #[arg(long)]
    history: Option<PathBuf>,

    /// Where to write a row for each candidate that the search simulated, CSV
    #[arg(long)]
    candidates: Option<PathBuf>,

    /// The recording's time column [default: the first]
    #[arg(long)]
    time: Option<String>,

    /// Threads that compute [default: one for each processor]
    #[arg(long)]
    threads: Option<NonZeroUsize>,
}

/// Estimates, and shows what came of it.
pub fn estimate(arguments: &Arguments) -> Result<(), CommandError> {
    let recording = files::recording(&arguments.recording, arguments.time.as_deref())?;
    let model = arguments.model.as_deref();
    let Prepared { spec, assembly } = Prepared::read(recording, &arguments.job, model)?;
    for finding in &assembly.findings {
        eprintln!("note: {}: {}", finding.pointer, finding.detail);
    }
    share_threads(arguments.threads)?;
    let mut watcher = Watcher::new(arguments.candidates.is_some());
    let outcome = run(
        &spec,
        &assembly.problem,
        origin(&spec, arguments)?,
        &mut watcher,
    )?;
    println!("{}", table::of(&outcome, None));
    if let Some(path) = &arguments.history {
        files::write(Some(path), &history(&watcher.rows))?;
    }
    if let (Some(path), Some(watched)) = (&arguments.candidates, &watcher.candidates) {
        let columns = CandidateColumn::of(&assembly.problem);
        let table = candidate::csv(&columns, &watched.kept);
        files::write(Some(path), table.as_bytes())?;
    }
    if let Some(path) = &arguments.output {
        let text = serde_json::to_vec_pretty(&outcome).expect("a result has only text keys");
        files::write(Some(path), &text)?;
    }
    Ok(())
}

/// A job with its recording, ready to run.
pub(super) struct Prepared {
    /// The completed specification.
    pub spec: JobSpec,
    /// The problem that it poses.
    pub assembly: Assembly,
}

impl Prepared {
    /// Reads the job, with `model` in the place of its own, and puts both together.
    pub fn read(
        recording: Recording,
        job: &Path,
        model: Option<&str>,
    ) -> Result<Self, CommandError> {
        let wrong = |faults: Vec<Fault>| CommandError::faults(job.display(), &faults);
        let mut models = Catalogue::built_in();
        let mut document = files::document(job)?;
        if let (Some(said), Some(job)) = (model, document.as_object_mut()) {
            let model = files::model(said, &mut models)?;
            job.insert("model".to_owned(), json!(model.description().name));
        }
        let spec = read_job(document, &recording, &mut models).map_err(wrong)?;
        let model = models
            .get(&spec.model)
            .expect("a specification names a model that there is");
        let recordings = vec![recording; spec.experiments.len()];
        let assembly = assemble::problem(&spec, model, &recordings).map_err(wrong)?;
        Ok(Prepared { spec, assembly })
    }
}

/// The name under which a specification knows the one recording that there is.
fn the_recording() -> DatasetId {
    let name = format!("{}{:032}", DatasetId::PREFIX, 0);
    name.parse().expect("32 zeros are hexadecimal digits")
}

/// Reads the job as the service does, with the recording in the place of its datasets; a model
/// that it brings along joins the others.
fn read_job(
    mut job: Value,
    recording: &Recording,
    models: &mut Catalogue,
) -> Result<JobSpec, Vec<Fault>> {
    if let Some(job) = job.as_object_mut() {
        let experiments = job.entry("experiments").or_insert_with(|| json!([{}]));
        for experiment in experiments.as_array_mut().into_iter().flatten() {
            if let Some(experiment) = experiment.as_object_mut() {
                experiment.insert("dataset".to_owned(), json!(the_recording()));
            }
        }
    }
    if let Some(document) = job.get("model").filter(|model| model.is_object()) {
        let read = document::referenced(document).map_err(|faults| {
            let faults = faults.into_iter().map(|fault| fault.below("/model"));
            faults.collect::<Vec<_>>()
        })?;
        job["model"] = json!(read.reference());
        models.add(read.model);
    }
    let context = Context {
        models: models.iter().map(|model| model.description()).collect(),
        datasets: &HashMap::from([(the_recording(), recording.summary())]),
        max_duration_s: f64::INFINITY,
    };
    JobSpec::read(&job, &context)
}

fn origin(spec: &JobSpec, arguments: &Arguments) -> Result<Origin, CommandError> {
    let recording = std::fs::read(&arguments.recording).map_err(CommandError::failed)?;
    let spec_text = serde_json::to_vec(spec).expect("a specification has only text keys");
    Ok(Origin {
        job: spec.name.clone().unwrap_or_default(),
        seed: spec.seed,
        spec_digest: digest(&spec_text),
        dataset_digests: vec![digest(&recording); spec.experiments.len()],
    })
}

fn digest(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    let digits: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    format!("sha256:{digits}")
}

fn share_threads(threads: Option<NonZeroUsize>) -> Result<(), CommandError> {
    let Some(threads) = threads else {
        return Ok(());
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build_global()
        .map_err(CommandError::failed)
}

/// Runs to the end, the job's time limit or ctrl-c; then the best so far is analysed.
fn run(
    spec: &JobSpec,
    problem: &Problem,
    origin: Origin,
    watcher: &mut Watcher,
) -> Result<Outcome, CommandError> {
    let stop = raised_by_ctrl_c()?;
    let limit = Duration::try_from_secs_f64(spec.limits.max_duration_s).unwrap_or(Duration::MAX);
    let started = Instant::now();
    let mut line = Progress::new();
    let mut estimation = Estimation::start(problem, &spec.method, spec.seed);
    watcher.generations = u64::from(spec.method.generations);
    let stopped = loop {
        match estimation.advance(problem, &stop, watcher) {
            Advance::Finished => break None,
            Advance::Interrupted => break Some(StopReason::Cancelled),
            Advance::Working if started.elapsed() > limit => break Some(StopReason::TimeLimit),
            Advance::Working => {
                line.update(estimation.progress().fraction, watcher.message.clone());
            }
        }
    };
    line.finish();
    let report = estimation.report(problem, stopped);
    let report = report.ok_or_else(|| CommandError::failed("no candidate could be simulated"))?;
    // Whoever stops a run is not kept waiting for the more thorough answers.
    let request = match stopped {
        Some(_) => uncertainty::Request::default(),
        None => spec.request(),
    };
    let never = AtomicBool::new(false);
    let conclusion = uncertainty::conclude(problem, &report, &request, &never);
    let conclusion = conclusion.expect("an analysis that nobody stops comes to its end");
    Ok(assemble::outcome(&origin, &conclusion))
}

/// A flag that goes up when the user presses ctrl-c; a second time ends the process.
fn raised_by_ctrl_c() -> Result<Arc<AtomicBool>, CommandError> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(CommandError::failed)?;
    // The thread waits for as long as the process lives and ends with it.
    std::thread::spawn(move || {
        runtime.block_on(async {
            if tokio::signal::ctrl_c().await.is_ok() {
                raised.store(true, Ordering::Relaxed);
            }
            if tokio::signal::ctrl_c().await.is_ok() {
                std::process::exit(130);
            }
        });
    });
    Ok(flag)
}

/// Remembers the rows of the search, and what to show of the last one.
struct Watcher {
    generations: u64,
    rows: Vec<GenerationRow>,
    candidates: Option<WatchedCandidates>,
    message: String,
}

/// The candidates of the search, each once.
struct WatchedCandidates {
    selection: Selection,
    kept: Vec<Candidate>,
}

impl Watcher {
    fn new(with_candidates: bool) -> Self {
        Watcher {
            generations: 0,
            rows: Vec::new(),
            candidates: with_candidates.then(|| WatchedCandidates {
                selection: Selection::new(u64::MAX),
                kept: Vec::new(),
            }),
            message: String::new(),
        }
    }
}

impl Observer for Watcher {
    fn generation(&mut self, row: &GenerationRow) {
        let best = row.best.iter().map(|(name, value)| (name.as_str(), *value));
        let numbers = [Some(row.best_cost), Some(row.best_credit)];
        let counts = [u64::from(row.generation), self.generations];
        self.message = progress::generation(counts, numbers, best);
        if let Some(candidates) = &mut self.candidates {
            let simulated = candidates.selection.admit(Candidate::of(row));
            candidates.kept.extend(simulated);
        }
        self.rows.push(GenerationRow {
            simulated: Vec::new(),
            ..row.clone()
        });
    }

    fn refinement(&mut self, row: &RefinementRow) {
        self.message = progress::refinement(u64::from(row.iteration), row.cost);
    }
}

/// A row for each generation; the best candidate's unknowns stand in the last columns.
fn history(rows: &[GenerationRow]) -> Vec<u8> {
    let mut text = "generation,evaluations,best_cost,generation_best_cost,mean_cost,best_credit,\
                    entropy,credit_updates"
        .to_owned();
    let names = rows.first().map(|row| &row.best).into_iter().flatten();
    text.extend(names.map(|(name, _)| format!(",{name}")));
    text.push('\n');
    for row in rows {
        let mean = row.mean_cost.map(|mean| mean.to_string());
        text += &format!(
            "{},{},{},{},{},{},{},{}",
            row.generation,
            row.evaluations,
            row.best_cost,
            row.generation_best_cost,
            mean.unwrap_or_default(),
            row.best_credit,
            row.entropy,
            row.credit_updates
        );
        text.extend(row.best.iter().map(|(_, value)| format!(",{value}")));
        text.push('\n');
    }
    text.into_bytes()
}
