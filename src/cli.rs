//! The command line. A command reads its files, calls the service or the method, and shows what
//! came of it; what went wrong is said in one sentence a fault.
//!
//! Exit codes: 0 done, 1 something failed on the way, 2 what was given is wrong.

mod assignments;
mod client;
mod collect;
mod collector;
mod compare;
mod database;
mod demo;
mod doctor;
mod error;
mod estimate;
mod event_stream;
mod files;
mod health;
mod manual;
mod progress;
mod reading;
mod record;
mod serve;
mod simulate;
mod table;
mod telemetry;
mod token;

use crate::config::Settings;
use clap::{CommandFactory, Parser, Subcommand};
use error::CommandError;
use std::process::ExitCode;

/// Finds the physical parameters of a plant from recorded data.
#[derive(Debug, Parser)]
#[command(name = "greybox", version, about)]
struct CommandLine {
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Serve the HTTP API and the dashboard
    Serve(Settings),
    /// Start a server, estimate from a recording with known parameters, compare
    Demo(demo::Arguments),
    /// Estimate from a recording without a server
    Estimate(estimate::Arguments),
    /// Run a job by several methods and seeds, and compare what they find
    Compare(compare::Arguments),
    /// Simulate a model under the inputs of a recording
    Simulate(simulate::Arguments),
    /// Make one of the demonstration recordings, as CSV
    Record(record::Arguments),
    /// Fetch samples from historians, as a file says, and append them to streams of a server
    Collect(collect::CollectArguments),
    /// Copy a database into a file, while a server works with it
    Backup(database::BackupArguments),
    /// Put a backup in the place of a database that no server works with
    Restore(database::RestoreArguments),
    /// Move between a file and a PostgreSQL
    #[command(subcommand)]
    Database(database::Command),
    /// Say whether a database or a backup is sound
    Check(database::CheckArguments),
    /// Make, list and revoke the tokens that programs ask a server with
    #[command(subcommand)]
    Token(token::Command),
    /// Print the description of the HTTP API, OpenAPI 3.1
    Openapi,
    /// Say what a server would meet that is started with the same settings: limits, disk, database, certificates
    Doctor(Box<doctor::DoctorArguments>),
    /// Ask a server whether it is ready
    Health(health::HealthArguments),
    /// Print what makes a shell complete the commands
    Completions(manual::CompletionArguments),
    /// Write the pages of the manual
    Man(manual::ManArguments),
}

/// Runs the command that the process was started with.
#[must_use]
pub fn main() -> ExitCode {
    match run(CommandLine::parse().command) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            error.exit_code()
        }
    }
}

fn run(command: Command) -> Result<(), CommandError> {
    match command {
        Command::Serve(settings) => serve::serve(settings),
        Command::Demo(arguments) => demo::demo(arguments),
        Command::Estimate(arguments) => estimate::estimate(&arguments),
        Command::Compare(arguments) => compare::compare(&arguments),
        Command::Simulate(arguments) => simulate::simulate(&arguments),
        Command::Record(arguments) => record::record(&arguments),
        Command::Collect(arguments) => collect::collect(&arguments),
        Command::Backup(arguments) => database::backup(&arguments),
        Command::Restore(arguments) => database::restore(&arguments),
        Command::Database(command) => database::run(&command),
        Command::Check(arguments) => database::check(&arguments),
        Command::Token(command) => token::run(&command),
        Command::Openapi => files::write(None, &openapi()),
        Command::Doctor(arguments) => doctor::doctor(&arguments),
        Command::Health(arguments) => health::health(arguments),
        Command::Completions(arguments) => manual::completions(&arguments, CommandLine::command()),
        Command::Man(arguments) => manual::man(&arguments, CommandLine::command()),
    }
}

/// The description as it is committed: indented, with a newline at its end.
fn openapi() -> Vec<u8> {
    let description = crate::api::openapi();
    let mut text =
        serde_json::to_vec_pretty(&description).expect("a description has only text keys");
    text.push(b'\n');
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_commands_and_their_flags_do_not_contradict_each_other() {
        CommandLine::command().debug_assert();
    }
}
