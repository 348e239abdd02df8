//! `greybox backup`, `restore` and `check`: the database as a file, without its server.

use super::error::CommandError;
use super::serve::block_on;
use crate::config::DatabaseArguments;
use crate::store::backup;
use clap::Args;
use std::path::PathBuf;

/// What `backup` is given.
#[derive(Debug, Args)]
pub struct BackupArguments {
    /// The file to make
    into: PathBuf,
    #[command(flatten)]
    database: DatabaseArguments,
}

/// What `restore` is given.
#[derive(Debug, Args)]
pub struct RestoreArguments {
    /// The backup
    backup: PathBuf,
    /// Replace the database that is there
    #[arg(long)]
    replace: bool,
    #[command(flatten)]
    database: DatabaseArguments,
}

/// Copies a database that a server may be working with.
pub fn backup(arguments: &BackupArguments) -> Result<(), CommandError> {
    let database = arguments.database.path().map_err(CommandError::input)?;
    block_on(async {
        let made = backup::backup(&database, &arguments.into).await;
        made.map_err(CommandError::failed)
    })
}

/// Puts a backup in the place of a database.
pub fn restore(arguments: &RestoreArguments) -> Result<(), CommandError> {
    let database = arguments.database.path().map_err(CommandError::input)?;
    block_on(async {
        let restored = backup::restore(&arguments.backup, &database, arguments.replace).await;
        restored.map_err(CommandError::failed)
    })
}

/// Says whether a database is sound.
pub fn check(arguments: &DatabaseArguments) -> Result<(), CommandError> {
    let database = arguments.path().map_err(CommandError::input)?;
    let findings = block_on(async {
        let findings = backup::check(&database).await;
        findings.map_err(CommandError::failed)
    })?;
    if findings.is_empty() {
        println!("{} is sound", database.display());
        return Ok(());
    }
    Err(CommandError::failed(findings.join("\nerror: ")))
}
