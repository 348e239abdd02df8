//! `greybox compare`: the same job by several methods and seeds, so that anyone can see which of
//! them finds what the others miss.

use super::error::CommandError;
use super::estimate::Prepared;
use super::files;
use crate::estimation::settings::MethodName;
use crate::estimation::{
    Advance, Estimation, GenerationRow, Observer, Problem, RefinementRow, Report, Settings,
};
use clap::Args;
use comfy_table::{Table, presets};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// A run has found the minimum when its cost is at most so many times the lowest of all runs.
const SAME_COST: f64 = 1.01;

/// What `compare` is given.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording, CSV or JSON
    recording: PathBuf,

    /// The job, JSON or YAML; its own method's settings hold for all of them
    job: PathBuf,

    /// The model in the place of the job's own: a name of the catalogue, or the file of a model
    /// document, JSON or YAML
    #[arg(long)]
    model: Option<String>,

    /// The methods
    #[arg(
        long,
        value_delimiter = ',',
        default_value = "icra_genetic,differential_evolution,multistart_lm"
    )]
    methods: Vec<String>,

    /// Runs of each method, seeded 1, 2, …
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,

    /// Where to write every run, JSON
    #[arg(long, short)]
    output: Option<PathBuf>,

    /// The recording's time column [default: the first]
    #[arg(long)]
    time: Option<String>,
}

/// One run of one method.
struct Trial {
    method: String,
    seed: u64,
    report: Report,
    seconds: f64,
}

/// Runs all of them, one after the other, and shows a table.
pub fn compare(arguments: &Arguments) -> Result<(), CommandError> {
    let methods = methods(&arguments.methods)?;
    let recording = files::recording(&arguments.recording, arguments.time.as_deref())?;
    let prepared = Prepared::read(recording, &arguments.job, arguments.model.as_deref())?;
    let problem = &prepared.assembly.problem;
    let mut trials = Vec::new();
    for (name, method) in &methods {
        for seed in 1..=arguments.seeds {
            eprint!("\r{name}, seed {seed} of {}    ", arguments.seeds);
            let settings = Settings {
                name: *method,
                ..prepared.spec.method.clone()
            };
            let started = Instant::now();
            trials.extend(run(problem, &settings, seed).map(|report| Trial {
                method: name.clone(),
                seed,
                report,
                seconds: started.elapsed().as_secs_f64(),
            }));
        }
    }
    eprintln!();
    let lowest = trials.iter().filter_map(|trial| trial.report.cost);
    let lowest = lowest.fold(f64::INFINITY, f64::min);
    println!("{}", table(&methods, &trials, arguments.seeds, lowest));
    println!("\nfound: a cost within 1 % of the lowest of all runs, {lowest:.6}");
    if let Some(path) = &arguments.output {
        let rows: Vec<Value> = trials.iter().map(|trial| shown(problem, trial)).collect();
        let text = serde_json::to_vec_pretty(&rows).expect("rows have only text keys");
        files::write(Some(path), &text)?;
    }
    Ok(())
}

fn methods(names: &[String]) -> Result<Vec<(String, MethodName)>, CommandError> {
    let method = |name: &String| {
        let method = serde_json::from_value(json!(name));
        method
            .map(|method| (name.clone(), method))
            .map_err(|error| CommandError::input(format!("--methods: {error}")))
    };
    names.iter().map(method).collect()
}

struct Unwatched;

impl Observer for Unwatched {
    fn generation(&mut self, _row: &GenerationRow) {}
    fn refinement(&mut self, _row: &RefinementRow) {}
}

/// Nothing where no candidate could be simulated.
fn run(problem: &Problem, settings: &Settings, seed: u64) -> Option<Report> {
    let never = AtomicBool::new(false);
    let mut run = Estimation::start(problem, settings, seed);
    while run.advance(problem, &never, &mut Unwatched) != Advance::Finished {}
    run.report(problem, None)
}

fn table(methods: &[(String, MethodName)], trials: &[Trial], seeds: u64, lowest: f64) -> String {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header(["method", "found", "evaluations", "seconds", "cost / lowest"]);
    for (name, _) in methods {
        let own = || trials.iter().filter(|trial| trial.method == *name);
        let ratio = |trial: &Trial| {
            trial
                .report
                .cost
                .map_or(f64::INFINITY, |cost| cost / lowest)
        };
        let found = own().filter(|trial| ratio(trial) <= SAME_COST).count();
        table.add_row([
            name.clone(),
            format!("{found} of {seeds}"),
            spread(
                own()
                    .map(|trial| trial.report.counters.evaluations as f64)
                    .collect(),
                0,
            ),
            spread(own().map(|trial| trial.seconds).collect(), 2),
            spread(own().map(ratio).collect(), 4),
        ]);
    }
    table.trim_fmt()
}

/// The median, and the least and the largest.
fn spread(mut values: Vec<f64>, decimals: usize) -> String {
    values.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (values.first(), values.last()) else {
        return "-".to_owned();
    };
    let middle = values[values.len() / 2];
    format!("{middle:.decimals$} ({first:.decimals$} to {last:.decimals$})")
}

fn shown(problem: &Problem, trial: &Trial) -> Value {
    let values: serde_json::Map<String, Value> = problem
        .named_values(&trial.report.positions)
        .into_iter()
        .map(|(name, value)| (name, json!(value)))
        .collect();
    json!({
        "method": trial.method,
        "seed": trial.seed,
        "cost": trial.report.cost,
        "evaluations": trial.report.counters.evaluations,
        "distinct_evaluations": trial.report.counters.distinct_evaluations,
        "seconds": trial.seconds,
        "estimates": values,
    })
}
