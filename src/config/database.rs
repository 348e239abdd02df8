//! Which database.

use std::path::{Path, PathBuf};

use clap::Args;
use directories::ProjectDirs;

use super::SettingsError;
use crate::store::{AddressError, DatabasePlace};

/// The database file's name in the user's data folder.
const DATABASE_FILE: &str = "greybox.db";

/// Which database.
#[derive(Clone, Debug, Default, Args)]
pub struct DatabaseArguments {
    /// Database: `sqlite://<path>` or `postgres://<user>@<host>/<database>` [default: the file
    /// greybox.db in the user's data folder]
    #[arg(long, env = "GREYBOX_DATABASE", value_name = "URL")]
    database: Option<String>,

    /// A file that holds the address of the database, so that a password is neither in the list of processes nor in
    /// the environment
    #[arg(long, env = "GREYBOX_DATABASE_FILE", value_name = "FILE")]
    database_file: Option<PathBuf>,
}

impl DatabaseArguments {
    /// Where the database of an address is.
    pub fn parse(url: &str) -> Result<DatabasePlace, SettingsError> {
        database_place(Some(url))
    }

    /// The database of an address.
    pub fn of(url: impl Into<String>) -> Self {
        Self {
            database: Some(url.into()),
            database_file: None,
        }
    }

    /// The place of the database. An empty address counts as none.
    pub fn place(&self) -> Result<DatabasePlace, SettingsError> {
        let address = self.database.as_deref().filter(|url| !url.is_empty());
        match (&self.database_file, address) {
            (None, address) => database_place(address),
            (Some(file), None) => place_in(file),
            (Some(_), Some(_)) => Err(SettingsError::TwoDatabases),
        }
    }

    /// The file that it is; an error where it is none.
    pub fn path(&self) -> Result<PathBuf, SettingsError> {
        match self.place()? {
            DatabasePlace::File(path) => Ok(path),
            other @ DatabasePlace::Postgres(_) => Err(SettingsError::NotAFile(other.to_string())),
        }
    }
}

/// Where the database is whose address a file holds.
fn place_in(file: &Path) -> Result<DatabasePlace, SettingsError> {
    let refused = |why: String| SettingsError::DatabaseFile {
        path: file.to_owned(),
        why,
    };
    let text = std::fs::read_to_string(file).map_err(|error| refused(error.to_string()))?;
    database_place(Some(text.trim())).map_err(|error| refused(error.to_string()))
}

/// What an address names, or the file of the user.
fn database_place(url: Option<&str>) -> Result<DatabasePlace, SettingsError> {
    match url {
        None => default_database().map(DatabasePlace::File),
        Some(url) if url.starts_with("postgres://") || url.starts_with("postgresql://") => {
            DatabasePlace::of_postgres(url).map_err(|error| match error {
                AddressError::NotAnAddress => SettingsError::Database,
                error => SettingsError::Address(error),
            })
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
