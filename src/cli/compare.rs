//! `greybox compare`: the same job by several methods and seeds, so that anyone can see which of
//! them finds what the others miss.

use super::error::CommandError;
use super::reading::Reading;
use super::{estimate, files};
use crate::job::comparison::{self, Comparison, Spread, Trial};
use clap::Args;
use comfy_table::{Table, presets};
use greybox::estimation::settings::MethodName;
use greybox::estimation::{Estimation, Problem, Report, Settings};
use serde_json::json;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// What `compare` is given.
#[derive(Debug, Args)]
pub struct Arguments {
    /// The recording, in any format that the service reads
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
        default_value = "icra_genetic,differential_evolution,cma_es,multistart_lm"
    )]
    methods: Vec<String>,

    /// Runs of each method, seeded 1, 2, …
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    seeds: u64,

    /// Where to write every run, JSON
    #[arg(long, short)]
    output: Option<PathBuf>,

    #[command(flatten)]
    reading: Reading,
}

/// Runs all of them, one after the other, and shows a table.
pub fn compare(arguments: &Arguments) -> Result<(), CommandError> {
    let methods = methods(&arguments.methods)?;
    let recording = files::recording(&arguments.recording, &arguments.reading)?;
    let job = &arguments.job;
    let identification = estimate::identification(recording, job, arguments.model.as_deref())?;
    let assembly = identification.assembly();
    let (assembly, spec) = assembly.map_err(|error| estimate::wrong(job, error))?;
    let (problem, of_the_job) = (&assembly.problem, &spec.method);
    let settings = methods
        .iter()
        .map(|(name, method)| settings(of_the_job, name, *method));
    let settings = settings.collect::<Result<Vec<Settings>, CommandError>>()?;
    let never = AtomicBool::new(false);
    let mut trials = Vec::new();
    for ((name, _), settings) in methods.iter().zip(&settings) {
        for seed in 1..=arguments.seeds {
            eprint!("\r{name}, seed {seed} of {}    ", arguments.seeds);
            let started = Instant::now();
            let mut run = Estimation::start(problem, settings, seed);
            let report = run.run(problem, &never, &mut ());
            let seconds = started.elapsed().as_secs_f64();
            trials.extend(report.map(|report| trial(problem, (name, seed), &report, seconds)));
        }
    }
    eprintln!();
    let names: Vec<String> = methods.into_iter().map(|(name, _)| name).collect();
    let comparison = comparison::compare(&names, &trials);
    println!("{}", table(&comparison, arguments.seeds));
    if let Some(lowest) = comparison.lowest_cost {
        println!("\nfound: a cost within 1 % of the lowest of all runs, {lowest:.6}");
    }
    if let Some(path) = &arguments.output {
        let text = serde_json::to_vec_pretty(&trials).expect("rows have only text keys");
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

/// The job's settings for another method.
fn settings(
    of_the_job: &Settings,
    name: &str,
    method: MethodName,
) -> Result<Settings, CommandError> {
    let settings = Settings {
        name: method,
        ..of_the_job.clone()
    };
    match settings.contradiction() {
        Some(detail) => Err(CommandError::input(format!("--methods: {name}: {detail}"))),
        None => Ok(settings),
    }
}

fn trial(problem: &Problem, (name, seed): (&str, u64), report: &Report, seconds: f64) -> Trial {
    Trial {
        method: name.to_owned(),
        seed,
        cost: report.cost,
        evaluations: report.counters.evaluations,
        seconds,
        estimates: problem
            .named_values(&report.positions)
            .into_iter()
            .collect(),
    }
}

fn table(comparison: &Comparison, seeds: u64) -> String {
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header([
        "method",
        "found",
        "evaluations",
        "seconds",
        "cost / lowest",
        "estimates apart [%]",
    ]);
    for row in &comparison.methods {
        table.add_row([
            row.method.clone(),
            format!("{} of {seeds}", row.found),
            spread(row.evaluations, 0),
            spread(row.seconds, 2),
            spread(row.cost_ratio, 4),
            spread(row.deviation_percent, 3),
        ]);
    }
    table.trim_fmt()
}

/// The median, and the least and the largest.
fn spread(values: Option<Spread>, decimals: usize) -> String {
    let Some(Spread {
        median,
        least,
        largest,
    }) = values
    else {
        return "-".to_owned();
    };
    format!("{median:.decimals$} ({least:.decimals$} to {largest:.decimals$})")
}
