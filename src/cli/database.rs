//! `greybox backup`, `restore`, `check` and `database copy`: the database without its server.

use super::error::CommandError;
use super::serve::block_on;
use crate::config::DatabaseArguments;
use crate::encrypted_file::{Identities, Recipients};
use crate::store::backup::{self, Restoring};
use crate::store::{DatabasePlace, database_copy};
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// What `backup` is given.
#[derive(Debug, Args)]
pub struct BackupArguments {
    /// The file to make
    into: PathBuf,
    /// Encrypt it for whoever has the identity of this key, in the format of `age` (`age1…`, as `age-keygen` shows it);
    /// repeat the flag for several
    #[arg(long = "recipient", value_name = "KEY")]
    recipients: Vec<String>,
    /// Encrypt it for the keys of a file, one on each line; repeat the flag for several
    #[arg(long = "recipients-file", value_name = "FILE")]
    recipients_files: Vec<PathBuf>,
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
    /// The file with the identity that opens an encrypted backup, as `age-keygen` writes it
    #[arg(long, value_name = "FILE")]
    identity: Option<PathBuf>,
    #[command(flatten)]
    database: DatabaseArguments,
}

/// What `check` is given.
#[derive(Debug, Args)]
pub struct CheckArguments {
    /// Then seal the rows from before there were seals: what changes from then on is found
    #[arg(long)]
    seal: bool,
    #[command(flatten)]
    database: DatabaseArguments,
}

/// What `database` does.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Copy all of a file into an empty PostgreSQL, or back, while no server works with either
    Copy(CopyArguments),
}

/// What `database copy` is given.
#[derive(Debug, Args)]
pub struct CopyArguments {
    /// What is copied: `sqlite://<path>` or `postgres://<user>@<host>/<database>`
    #[arg(long, value_name = "URL", value_parser = DatabaseArguments::parse)]
    from: DatabasePlace,
    /// Where to: one of the other kind, new or empty
    #[arg(long, value_name = "URL", value_parser = DatabaseArguments::parse)]
    to: DatabasePlace,
}

/// Does what one of the commands says.
pub fn run(command: &Command) -> Result<(), CommandError> {
    let Command::Copy(CopyArguments { from, to }) = command;
    let copied = block_on(async {
        let copied = database_copy::copy(from, to).await;
        copied.map_err(CommandError::failed)
    })?;
    for table in copied.iter().filter(|table| table.rows > 0) {
        println!("{:>12} {}", table.rows, table.name);
    }
    println!("copied to {to} and compared; unfinished jobs go on with the next server");
    Ok(())
}

/// Copies a database that a server may be working with.
pub fn backup(arguments: &BackupArguments) -> Result<(), CommandError> {
    let database = arguments.database.path().map_err(CommandError::input)?;
    let recipients = Recipients::read(&arguments.recipients, &arguments.recipients_files);
    let recipients = recipients.map_err(CommandError::input)?;
    block_on(async {
        let made = backup::backup(&database, &arguments.into, recipients.as_ref()).await;
        made.map_err(CommandError::failed)
    })
}

/// Puts a backup in the place of a database.
pub fn restore(arguments: &RestoreArguments) -> Result<(), CommandError> {
    let database = arguments.database.path().map_err(CommandError::input)?;
    let identities = arguments.identity.as_deref().map(Identities::of_file);
    let how = Restoring {
        replace: arguments.replace,
        identities: identities.transpose().map_err(CommandError::input)?,
    };
    let restored = block_on(async {
        let restored = backup::restore(&arguments.backup, &database, how).await;
        restored.map_err(CommandError::failed)
    })?;
    match restored.revoked {
        None => eprintln!(
            "Tokens that were revoked after the backup was made count again: `greybox token list` shows all."
        ),
        Some(names) if names.is_empty() => {}
        Some(names) => eprintln!(
            "These tokens were revoked after the backup was made and stay revoked: {}",
            names.join(", ")
        ),
    }
    Ok(())
}

/// Says whether a database is sound.
pub fn check(arguments: &CheckArguments) -> Result<(), CommandError> {
    let place = arguments.database.place().map_err(CommandError::input)?;
    let checked = block_on(async {
        let checked = match &place {
            DatabasePlace::File(path) => backup::check(path).await,
            DatabasePlace::Postgres(options) => backup::check_postgres(options).await,
        };
        checked.map_err(CommandError::failed)
    })?;
    if !checked.findings.is_empty() {
        return Err(CommandError::failed(checked.findings.join("\nerror: ")));
    }
    println!("{place} is sound");
    if let Some(head) = &checked.audit_head {
        println!(
            "the audit log ends with entry {}, {}",
            head.entry, head.chain
        );
    }
    if checked.unchained > 0 {
        println!(
            "{} entries of the audit log are from before its entries were a chain and were not checked",
            checked.unchained
        );
    }
    let unsealed = checked.unsealed;
    if arguments.seal {
        let sealed = block_on(async {
            let sealed = match &place {
                DatabasePlace::File(path) => backup::seal(path).await,
                DatabasePlace::Postgres(options) => backup::seal_postgres(options).await,
            };
            sealed.map_err(CommandError::failed)
        })?;
        println!("{sealed} rows were sealed as they are");
    } else if unsealed > 0 {
        println!(
            "{unsealed} rows from before there were seals were not checked; `greybox check --seal` seals them as \
             they are"
        );
    }
    Ok(())
}
