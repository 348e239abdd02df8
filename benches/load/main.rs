//! The service under load: a real server process on loopback, and the figures that a client sees.
//!
//! `cargo bench --bench load` measures every point and prints a table of figures beside their
//! targets; `cargo bench --bench load -- submits streams` measures those alone. The server is the
//! program as it is released, with a database in a temporary folder; both are gone afterwards.
//! `--program=<path>` measures another build of it, `--database=<address>` a scenario on a new
//! PostgreSQL database, and `--nodes=3` has three servers work with that (`submits`, `starts` and
//! `streams`). Load, servers and database share the machine, so the figures are of all.

mod client;
mod figure;
mod jobs;
mod observer;
mod reads;
mod rest;
mod server;
mod small_jobs;
mod starts;
mod streams;
mod submits;
mod upload;

use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use figure::Figure;

/// Longer than any scenario takes on a slow machine.
const PATIENCE: Duration = Duration::from_secs(300);

/// The scenarios by name, in the order in which they run.
const SCENARIOS: [&str; 8] = [
    "submits",
    "starts",
    "reads",
    "small_jobs",
    "rest",
    "streams",
    "upload",
    "parse",
];

/// What a scenario may end with.
type Outcome<T = ()> = Result<T, Box<dyn std::error::Error>>;

fn main() -> ExitCode {
    let asked: Vec<String> = std::env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with("--"))
        .collect();
    if let Some(unknown) = asked
        .iter()
        .find(|name| !SCENARIOS.contains(&name.as_str()))
    {
        eprintln!(
            "there is no scenario `{unknown}`, only {}",
            SCENARIOS.join(", ")
        );
        return ExitCode::FAILURE;
    }
    let given = |flag: &str| {
        std::env::args().find_map(|argument| argument.strip_prefix(flag).map(str::to_owned))
    };
    let nodes = given("--nodes=").and_then(|number| number.parse().ok());
    server::choose(
        given("--program="),
        given("--database="),
        nodes.unwrap_or(1),
    );
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .expect("a runtime");
    let mut failed = false;
    figure::print_head();
    for name in SCENARIOS {
        if !asked.is_empty() && !asked.iter().any(|one| one == name) {
            continue;
        }
        match runtime.block_on(measured(name)) {
            Ok(figures) => figures.iter().for_each(Figure::print),
            Err(error) => {
                eprintln!("{name}: {error}");
                failed = true;
            }
        }
    }
    if failed {
        ExitCode::FAILURE
    } else {
        ExitCode::SUCCESS
    }
}

/// Runs one scenario in a folder of its own. An interruption ends it in order.
async fn measured(name: &str) -> Outcome<Vec<Figure>> {
    let folder = tempfile::tempdir()?;
    tokio::select! {
        figures = run(name, folder.path()) => figures,
        () = tokio::time::sleep(PATIENCE) => Err("it did not end in time".into()),
        interrupted = tokio::signal::ctrl_c() => {
            interrupted?;
            Err("interrupted".into())
        }
    }
}

async fn run(name: &str, folder: &Path) -> Outcome<Vec<Figure>> {
    match name {
        "submits" => submits::measure(folder).await,
        "starts" => starts::measure(folder).await,
        "reads" => reads::measure(folder).await,
        "small_jobs" => small_jobs::measure(folder).await,
        "rest" => rest::measure(folder).await,
        "streams" => streams::measure(folder).await,
        "upload" => upload::measure(folder).await,
        _ => upload::parse(),
    }
}
