//! `greybox completions` and `greybox man`.

use super::error::CommandError;
use super::files;
use clap::{Args, Command};
use clap_complete::Shell;
use std::path::PathBuf;

/// What `completions` is given.
#[derive(Debug, Args)]
pub struct CompletionArguments {
    /// The shell
    shell: Shell,
}

/// What `man` is given.
#[derive(Debug, Args)]
pub struct ManArguments {
    /// A folder for a page for each command [default: the first page, to standard output]
    #[arg(long, short)]
    output: Option<PathBuf>,
}

/// Prints what makes a shell complete the commands and their flags.
pub fn completions(
    arguments: &CompletionArguments,
    mut command: Command,
) -> Result<(), CommandError> {
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "greybox", &mut script);
    files::write(None, &script)
}

/// Writes the pages of the manual.
pub fn man(arguments: &ManArguments, command: Command) -> Result<(), CommandError> {
    match &arguments.output {
        Some(folder) => {
            std::fs::create_dir_all(folder).map_err(CommandError::failed)?;
            clap_mangen::generate_to(command, folder).map_err(CommandError::failed)
        }
        None => {
            let mut page = Vec::new();
            let written = clap_mangen::Man::new(command).render(&mut page);
            written.map_err(CommandError::failed)?;
            files::write(None, &page)
        }
    }
}
