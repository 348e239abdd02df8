//! `greybox token`: who may ask a server, by its database.

use super::error::CommandError;
use super::serve::block_on;
use crate::access::{Project, Scope, Secret, StreamNames};
use crate::config::DatabaseArguments;
use crate::store::TokenRow;
use crate::store::tokens::{self, NewToken};
use clap::{Args, Subcommand};
use comfy_table::{Table, presets};
use jiff::{SignedDuration, Timestamp};

/// The characters of a token's name at the most.
const MAX_NAME_CHARS: usize = 60;

/// What is done with tokens.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Make a token and show its secret, once
    Create(CreateArguments),
    /// List the tokens, those that count no more too
    List(DatabaseArguments),
    /// End a token; a running server refuses it within a second
    Revoke(RevokeArguments),
}

/// What `token create` is given.
#[derive(Debug, Args)]
pub struct CreateArguments {
    /// The name of the token, in the list and in the audit log
    #[arg(long, value_parser = name)]
    name: String,
    /// The scope of the token: append (to the streams that `--streams` names), read, submit (read and change) or admin
    /// (all, with deliveries and audit log)
    #[arg(long)]
    scope: Scope,
    /// The streams that a token with the scope append appends to: `rig-4,rig-5`
    #[arg(long)]
    streams: Option<StreamNames>,
    /// The project that it is for
    #[arg(long, default_value_t = Project::default())]
    project: Project,
    /// Time after which the token ends by itself: `90d`, `12h` or `never`
    #[arg(long, default_value = "365d", value_parser = expiry)]
    expires: Expiry,
    #[command(flatten)]
    database: DatabaseArguments,
}

/// What `token revoke` is given.
#[derive(Debug, Args)]
pub struct RevokeArguments {
    /// The token's name
    name: String,
    #[command(flatten)]
    database: DatabaseArguments,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Expiry {
    Never,
    After(SignedDuration),
}

fn name(text: &str) -> Result<String, String> {
    let is_plain = text.chars().all(|c| c.is_ascii_graphic());
    if is_plain && (1..=MAX_NAME_CHARS).contains(&text.len()) {
        Ok(text.to_owned())
    } else {
        Err(format!(
            "a name has 1 to {MAX_NAME_CHARS} visible characters and no space"
        ))
    }
}

fn expiry(text: &str) -> Result<Expiry, String> {
    if text == "never" {
        return Ok(Expiry::Never);
    }
    let hours = match text.char_indices().next_back() {
        Some((at, 'h')) => text[..at].parse::<i64>().ok(),
        Some((at, 'd')) => text[..at]
            .parse::<i64>()
            .ok()
            .and_then(|days| days.checked_mul(24)),
        _ => None,
    };
    match hours {
        Some(hours) if (1..=24 * 36_500).contains(&hours) => {
            Ok(Expiry::After(SignedDuration::from_hours(hours)))
        }
        _ => Err("give a number of days or hours, `90d` or `12h`, or `never`".to_owned()),
    }
}

/// Does it.
pub fn run(command: &Command) -> Result<(), CommandError> {
    match command {
        Command::Create(arguments) => create(arguments),
        Command::List(database) => list(database),
        Command::Revoke(arguments) => revoke(arguments),
    }
}

fn create(arguments: &CreateArguments) -> Result<(), CommandError> {
    if arguments.streams.is_some() != (arguments.scope == Scope::Append) {
        let sentence = "the scope append needs `--streams`, and no other scope takes it";
        return Err(CommandError::input(sentence.to_owned()));
    }
    let database = arguments.database.place().map_err(CommandError::input)?;
    let secret = Secret::new().map_err(CommandError::failed)?;
    let expires_at = match arguments.expires {
        Expiry::Never => None,
        Expiry::After(time) => Some(Timestamp::now() + time),
    };
    let new = NewToken {
        name: arguments.name.clone(),
        digest: secret.digest(),
        scope: arguments.scope,
        streams: arguments.streams.clone(),
        project: arguments.project.clone(),
        expires_at,
    };
    let made = block_on(async {
        let made = tokens::create(&database, new).await;
        made.map_err(CommandError::failed)
    })?;
    if !made {
        let name = &arguments.name;
        let sentence =
            format!("there is a token `{name}` already; revoke it, or take another name");
        return Err(CommandError::input(sentence));
    }
    println!("{}", secret.expose());
    eprintln!("This is shown once. Programs send it as `Authorization: Bearer gbx_…`.");
    if arguments.scope == Scope::Append {
        eprintln!("Agents send it as token or as password.");
    }
    Ok(())
}

fn list(database: &DatabaseArguments) -> Result<(), CommandError> {
    let database = database.place().map_err(CommandError::input)?;
    let rows = block_on(async {
        let rows = tokens::list(&database).await;
        rows.map_err(CommandError::failed)
    })?;
    let mut table = Table::new();
    table.load_style(presets::ASCII_MARKDOWN);
    table.set_header([
        "name",
        "scope",
        "streams",
        "project",
        "made",
        "ends",
        "last used",
        "state",
    ]);
    let now = Timestamp::now();
    for row in &rows {
        let at = |at: Option<Timestamp>| at.map_or_else(|| "never".to_owned(), minute);
        table.add_row([
            row.name.clone(),
            row.scope.to_string(),
            row.streams
                .as_ref()
                .map_or_else(|| "all".to_owned(), ToString::to_string),
            row.project.to_string(),
            minute(row.created_at),
            at(row.expires_at),
            at(row.last_used_at),
            state(row, now).to_owned(),
        ]);
    }
    println!("{table}");
    Ok(())
}

fn minute(at: Timestamp) -> String {
    at.strftime("%Y-%m-%dT%H:%MZ").to_string()
}

fn state(row: &TokenRow, now: Timestamp) -> &'static str {
    if row.revoked_at.is_some() {
        "revoked"
    } else if row.is_valid_at(now) {
        "valid"
    } else {
        "expired"
    }
}

fn revoke(arguments: &RevokeArguments) -> Result<(), CommandError> {
    let database = arguments.database.place().map_err(CommandError::input)?;
    let revoked = block_on(async {
        let revoked = tokens::revoke(&database, &arguments.name).await;
        revoked.map_err(CommandError::failed)
    })?;
    if revoked {
        return Ok(());
    }
    let name = &arguments.name;
    Err(CommandError::input(format!(
        "there is no token `{name}` that is not revoked"
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_expiry_is_a_number_of_days_or_hours() {
        let after = |hours| Ok(Expiry::After(SignedDuration::from_hours(hours)));
        assert_eq!(expiry("90d"), after(90 * 24));
        assert_eq!(expiry("12h"), after(12));
        assert_eq!(expiry("never"), Ok(Expiry::Never));
        for text in [
            "",
            "d",
            "0d",
            "-1d",
            "90",
            "1w",
            "99999999d",
            "9223372036854775807d",
        ] {
            assert!(expiry(text).is_err(), "{text}");
        }
    }
}
