//! Which database.

use std::path::PathBuf;

use clap::Args;
use directories::ProjectDirs;

use super::SettingsError;
use crate::store::DatabasePlace;

/// The database file's name in the user's data folder.
const DATABASE_FILE: &str = "greybox.db";

/// Which database, for a command that runs no server.
#[derive(Clone, Debug, Args)]
pub struct DatabaseArguments {
    /// Database: `sqlite://<path>` or `postgres://<user>@<host>/<database>` [default: the file
    /// greybox.db in the user's data folder]
    #[arg(long, env = "GREYBOX_DATABASE", value_name = "URL")]
    database: Option<String>,
}

impl DatabaseArguments {
    /// Where the database of an address is.
    pub fn parse(url: &str) -> Result<DatabasePlace, SettingsError> {
        database_place(Some(url))
    }

    /// Where it is.
    pub fn place(&self) -> Result<DatabasePlace, SettingsError> {
        database_place(self.database.as_deref())
    }

    /// The file that it is; an error where it is none.
    pub fn path(&self) -> Result<PathBuf, SettingsError> {
        match self.place()? {
            DatabasePlace::File(path) => Ok(path),
            other @ DatabasePlace::Postgres(_) => Err(SettingsError::NotAFile(other.to_string())),
        }
    }
}

/// What an address names, or the file of the user.
pub(super) fn database_place(url: Option<&str>) -> Result<DatabasePlace, SettingsError> {
    match url {
        None => default_database().map(DatabasePlace::File),
        Some(url) if url.starts_with("postgres://") || url.starts_with("postgresql://") => {
            let options = url.parse().map_err(|_| SettingsError::Database)?;
            Ok(DatabasePlace::Postgres(Box::new(options)))
        }
        Some(url) => path_of(url).map(DatabasePlace::File),
    }
}

/// The file that a `sqlite://` address names. A database in memory would lose jobs.
fn path_of(url: &str) -> Result<PathBuf, SettingsError> {
    let path = url.strip_prefix("sqlite://").unwrap_or_default();
    let is_file = !path.is_empty() && !path.starts_with(':') && !path.contains('?');
    if is_file && !path.ends_with('/') {
        Ok(PathBuf::from(path))
    } else {
        Err(SettingsError::Database)
    }
}

fn default_database() -> Result<PathBuf, SettingsError> {
    ProjectDirs::from("", "", "greybox")
        .map(|folders| folders.data_dir().join(DATABASE_FILE))
        .ok_or(SettingsError::NoDataFolder)
}
