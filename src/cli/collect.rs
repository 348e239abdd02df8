//! `greybox collect`: brings samples from historians into streams of a server.

use super::error::CommandError;
use super::serve::block_on;
use super::telemetry::Telemetry;
use crate::collect::{self, Cursors, ReadStretch, SeriesPage, SourcesFile, Until};
use clap::Args;
use jiff::Timestamp;
use std::path::{Path, PathBuf};

/// Rows that a check shows of each series.
const SHOWN_ROWS: u32 = 10;

/// What `collect` is given.
#[derive(Debug, Args)]
pub struct CollectArguments {
    /// The file that says where samples are and which streams they go to, in TOML
    #[arg(value_name = "FILE")]
    sources: PathBuf,
    /// Ask each source for ten rows and the server for its answer, show them, and bring nothing
    #[arg(long)]
    check: bool,
    /// Bring what there is up to now, and end
    #[arg(long, conflicts_with = "check")]
    once: bool,
    /// The filter of the log, e.g. `info` or `greybox=debug`
    #[arg(long, default_value = "info", env = "GREYBOX_LOG")]
    log: String,
}

/// Brings samples until the process is ended; or once, or shows what would be brought.
pub fn collect(arguments: &CollectArguments) -> Result<(), CommandError> {
    let file = read(&arguments.sources)?;
    if arguments.check {
        return block_on(check(file));
    }
    let telemetry = Telemetry::of_lines(&arguments.log)?;
    let until = match arguments.once {
        true => Until::CaughtUp,
        false => Until::Stopped,
    };
    let collected = block_on(async {
        let cursors = Cursors::open(&file.cursors).await;
        let cursors = cursors.map_err(|error| {
            let shown = file.cursors.display();
            CommandError::failed(format!(
                "{shown}, the file of cursors, cannot be used: {error}"
            ))
        })?;
        match collect::collect(file.sources, &cursors, &file.server, until).await {
            0 => Ok(()),
            failed => Err(CommandError::failed(format!(
                "{failed} series were not brought up to now"
            ))),
        }
    });
    telemetry.end();
    collected
}

fn read(path: &Path) -> Result<SourcesFile, CommandError> {
    let shown = path.display();
    let text = std::fs::read_to_string(path);
    let text = text.map_err(|error| CommandError::input(format!("{shown}: {error}")))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let faults = |faults: Vec<_>| {
        CommandError::inputs(faults.iter().map(|fault| format!("{shown}: {fault}")))
    };
    SourcesFile::read(&text, folder).map_err(faults)
}

/// Shows the first rows of each series as the server would get them, and asks the server whether it knows the token.
async fn check(file: SourcesFile) -> Result<(), CommandError> {
    let mut failures = Vec::new();
    for source in file.sources {
        for series in source.series {
            let place = format!("{}: {} -> {}", source.name, series.label(), series.stream);
            let stretch = ReadStretch {
                between: source.from..Timestamp::now(),
                rows: SHOWN_ROWS,
            };
            let page = source.connection.read(&series, &stretch).await;
            let shown = page.map(|page| shown(&page, source.from));
            let answered = file.server.check(&series.stream).await;
            for error in [shown.as_ref().err(), answered.as_ref().err()] {
                failures.extend(error.map(|error| format!("{place}: {error}")));
            }
            println!("{place}\n{}", shown.unwrap_or_default());
        }
    }
    match failures.is_empty() {
        true => Ok(()),
        false => Err(CommandError::failed(failures.join("\nerror: "))),
    }
}

/// The first lines of a page.
fn shown(page: &SeriesPage, from: Timestamp) -> String {
    if page.newest.is_none() {
        return format!("  no samples since {from}");
    }
    if let Some(file) = &page.file {
        let bytes = page.body.len();
        return format!("  {file}, {bytes} bytes, and those after it");
    }
    let csv = String::from_utf8_lossy(&page.body);
    let lines = csv.lines().take(SHOWN_ROWS as usize + 1);
    let lines: Vec<String> = lines.map(|line| format!("  {line}")).collect();
    lines.join("\n")
}
