//! `greybox record`: one of the demonstration recordings as CSV.

use super::error::CommandError;
use super::files;
use clap::{Args, ValueEnum};
use greybox::demo::{self, Demo};
use std::path::PathBuf;

/// The recordings by their letters.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Letter {
    /// The nominal rig, richly excited
    A,
    /// An imperfect rig, excited as in the paper
    B,
    /// As a, with both chamber pressures
    C,
    /// The rig of b, excited as a
    D,
}

impl From<Letter> for Demo {
    fn from(letter: Letter) -> Demo {
        match letter {
            Letter::A => Demo::A,
            Letter::B => Demo::B,
            Letter::C => Demo::C,
            Letter::D => Demo::D,
        }
    }
}

/// What `record` is given.
#[derive(Debug, Args)]
pub struct Arguments {
    /// Which recording
    recording: Letter,

    /// Seed of the random numbers
    #[arg(long, default_value_t = 1)]
    seed: u64,

    /// The file to write [default: standard output]
    #[arg(long, short)]
    output: Option<PathBuf>,
}

/// Writes the recording.
pub fn record(arguments: &Arguments) -> Result<(), CommandError> {
    let recording = demo::recording(arguments.recording.into(), arguments.seed);
    files::write(arguments.output.as_deref(), &files::csv(&recording))
}
