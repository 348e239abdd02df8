//! `greybox estimate`: a job without a server, from a recording and a job document.

use super::error::CommandError;
use super::progress::{self, Progress};
use super::reading::Reading;
use super::{assignments, files, table};
use crate::job::candidate::{self, Selection};
use crate::job::{Candidate, CandidateColumn, GenerationEvent};
use clap::Args;
use greybox::estimation::{
    Advance, Finding, GenerationRow, Observer, PosteriorRow, RefinementRow, StopReason,
};
use greybox::identification::{Identification, IdentificationError, JobSpec, Outcome, Run};
use greybox::recording::Recording;
use serde_json::{Value, json};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// What `estimate` is given.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording, in any format that the service reads, `-` for standard input; every experiment of the job is cut from it
    recording: PathBuf,

    /// The job as it is submitted to a server, JSON or YAML; the datasets that it names are not used.
    /// Left out, `--model` estimates what the model calls unknown
    #[arg(required_unless_present = "model")]
    job: Option<PathBuf>,

    /// The model in the place of the job's own: a name of the catalogue, or the file of a model
    /// document, JSON or YAML
    #[arg(long)]
    model: Option<String>,

    /// What is known of a parameter, SI: `mass=50..70` to look there, `mass=58` or `mass=58±1%`
    /// where it is known, `mass=?` to look in the model's range
    #[arg(long = "set", value_name = "PARAMETER=…", value_parser = assignments::parameter)]
    parameters: Vec<(String, Value)>,

    /// Which signal of the recording is one of the model's: `position=cyl_pos`
    #[arg(long = "signal", value_name = "MODEL=RECORDED", value_parser = assignments::signal)]
    signals: Vec<(String, Value)>,

    /// Print the result as JSON in the place of the table
    #[arg(long)]
    json: bool,

    /// Where to write the result, JSON
    #[arg(long, short)]
    output: Option<PathBuf>,

    /// Where to write a row for each generation, CSV
    #[arg(long)]
    history: Option<PathBuf>,

    /// Where to write a row for each candidate that the search simulated, CSV
    #[arg(long)]
    candidates: Option<PathBuf>,

    #[command(flatten)]
    reading: Reading,

    /// Threads that compute [default: one for each processor]
    #[arg(long)]
    threads: Option<NonZeroUsize>,
}

/// Estimates, and shows what came of it.
pub fn estimate(arguments: &Arguments) -> Result<(), CommandError> {
    let (recording, digest) = files::recorded(&arguments.recording, &arguments.reading)?;
    let source = arguments.job.as_deref().unwrap_or(Path::new("the job"));
    let identification = asked(arguments, recording)?;
    let (spec, _) = identification
        .specification()
        .map_err(|error| wrong(source, error))?;
    share_threads(arguments.threads)?;
    let digests = vec![digest; spec.experiments.len()];
    let run = identification
        .begin()
        .map_err(|error| wrong(source, error))?
        .named(spec.name.clone().unwrap_or_default(), digests);
    let columns = CandidateColumn::of(run.problem());
    let mut watcher = SearchWatcher::new(&spec, arguments.candidates.is_some());
    let outcome = to_the_end(run, &spec, &mut watcher).map_err(|error| wrong(source, error))?;
    let text = serde_json::to_vec_pretty(&outcome).expect("a result has only text keys");
    if arguments.json {
        files::write(None, &[&text[..], b"\n"].concat())?;
    } else {
        println!("{}", table::of(&outcome, None));
    }
    if let Some(path) = &arguments.history {
        files::write(Some(path), GenerationEvent::csv(&watcher.rows).as_bytes())?;
    }
    if let (Some(path), Some(watched)) = (&arguments.candidates, &watcher.candidates) {
        let table = candidate::csv(&columns, &watched.kept);
        files::write(Some(path), table.as_bytes())?;
    }
    if let Some(path) = &arguments.output {
        files::write(Some(path), &text)?;
    }
    Ok(())
}

/// The job that the arguments ask for: that of the file, if there is one, with what they say beside.
fn asked(arguments: &Arguments, recording: Recording) -> Result<Identification, CommandError> {
    let mut job = match &arguments.job {
        Some(path) => files::document(path)?,
        None => json!({}),
    };
    assignments::into_job(&mut job, &arguments.parameters, &arguments.signals)?;
    of_document(job, recording, arguments.model.as_deref())
}

/// The job of a file on a recording, with `model` in the place of its own.
pub(super) fn identification(
    recording: Recording,
    job: &Path,
    model: Option<&str>,
) -> Result<Identification, CommandError> {
    of_document(files::document(job)?, recording, model)
}

fn of_document(
    job: Value,
    recording: Recording,
    model: Option<&str>,
) -> Result<Identification, CommandError> {
    let identification = Identification::of_job(job, recording);
    match model {
        Some(name) => Ok(identification.model(&files::model(name)?)),
        None => Ok(identification),
    }
}

/// What keeps a job of a file from its result.
pub(super) fn wrong(job: &Path, error: IdentificationError) -> CommandError {
    match error {
        IdentificationError::Invalid(faults) => CommandError::faults(job.display(), &faults),
        IdentificationError::NotIdentifiable(findings) => {
            let line = |finding: &Finding| {
                let (
                    job,
                    Finding {
                        pointer, detail, ..
                    },
                ) = (job.display(), finding);
                format!("{job}: {pointer}: {detail}")
            };
            CommandError::inputs(findings.iter().map(line))
        }
        error => CommandError::failed(error),
    }
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

/// Runs to the end, the job's time limit or ctrl-c; then the outcome is the best so far.
fn to_the_end(
    mut run: Run,
    spec: &JobSpec,
    watcher: &mut SearchWatcher,
) -> Result<Outcome, IdentificationError> {
    let stop = raised_by_ctrl_c();
    let limit = Duration::try_from_secs_f64(spec.limits.max_duration_s).unwrap_or(Duration::MAX);
    let started = Instant::now();
    let mut line = Progress::new();
    let stopped = loop {
        match run.advance(&stop, watcher) {
            Advance::Finished => break None,
            Advance::Interrupted => break Some(StopReason::Cancelled),
            Advance::Working if started.elapsed() > limit => break Some(StopReason::TimeLimit),
            Advance::Working => line.update(run.progress().fraction, watcher.message.clone()),
        }
    };
    line.finish();
    let unhurried = AtomicBool::new(false);
    run.outcome(stopped, &unhurried)?
        .ok_or(IdentificationError::NoEstimate)
}

/// A flag that goes up when the user presses ctrl-c; a second time ends the process.
fn raised_by_ctrl_c() -> Arc<AtomicBool> {
    let flag = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&flag);
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .expect("the system lends a handle for signals");
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
    flag
}

/// Remembers the rows of the search, and what to show of the last one.
struct SearchWatcher {
    generations: u64,
    rows: Vec<GenerationEvent>,
    candidates: Option<WatchedCandidates>,
    message: String,
}

/// The candidates of the search, each once.
struct WatchedCandidates {
    selection: Selection,
    kept: Vec<Candidate>,
}

impl SearchWatcher {
    fn new(spec: &JobSpec, with_candidates: bool) -> Self {
        SearchWatcher {
            generations: u64::from(spec.method.generations),
            rows: Vec::new(),
            candidates: with_candidates.then(|| WatchedCandidates {
                selection: Selection::new(u64::MAX),
                kept: Vec::new(),
            }),
            message: String::new(),
        }
    }
}

impl Observer for SearchWatcher {
    fn finding(&mut self, finding: &Finding) {
        eprintln!("note: {}: {}", finding.pointer, finding.detail);
    }

    fn generation(&mut self, row: &GenerationRow) {
        let best = row.best.iter().map(|(name, value)| (name.as_str(), *value));
        let numbers = [Some(row.best_cost), Some(row.best_credit)];
        let counts = [u64::from(row.generation), self.generations];
        self.message = progress::generation(counts, numbers, best);
        if let Some(candidates) = &mut self.candidates {
            let simulated = candidates.selection.admit(Candidate::of(row));
            candidates.kept.extend(simulated);
        }
        self.rows.push(GenerationEvent::from(row));
    }

    fn refinement(&mut self, row: &RefinementRow) {
        self.message = progress::refinement(u64::from(row.iteration), row.cost);
    }

    fn posterior(&mut self, row: &PosteriorRow) {
        let counts = [row.generation, row.generations].map(u64::from);
        let r_hat = row.convergence.map(|convergence| convergence.r_hat);
        self.message = progress::posterior(counts, r_hat);
    }
}
