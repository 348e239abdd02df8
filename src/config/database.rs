//! Which database.

use std::path::PathBuf;

use clap::Args;
use directories::ProjectDirs;

use super::SettingsError;

/// The database file's name in the user's data folder.
const DATABASE_FILE: &str = "greybox.db";

/// Which database, for a command that runs no server.
#[derive(Clone, Debug, Args)]
pub struct DatabaseArguments {
    /// Database file, `sqlite://<path>` [default: greybox.db in the user's data folder]
    #[arg(long, env = "GREYBOX_DATABASE", value_name = "URL")]
    database: Option<String>,
}

impl DatabaseArguments {
    /// The file.
    pub fn path(&self) -> Result<PathBuf, SettingsError> {
        database_path(self.database.as_deref())
    }
}

/// The file that an address names, or that of the user.
pub(super) fn database_path(url: Option<&str>) -> Result<PathBuf, SettingsError> {
    url.map_or_else(default_database, path_of)
}

/// The file that a `sqlite://` address names. A database in memory would lose jobs.
pub(super) fn path_of(url: &str) -> Result<PathBuf, SettingsError> {
    let path = url.strip_prefix("sqlite://").unwrap_or_default();
    let is_file = !path.is_empty() && !path.starts_with(':') && !path.contains('?');
    if is_file && !path.ends_with('/') {
        Ok(PathBuf::from(path))
    } else {
        Err(SettingsError::Database(url.to_owned()))
    }
}

fn default_database() -> Result<PathBuf, SettingsError> {
    ProjectDirs::from("", "", "greybox")
        .map(|folders| folders.data_dir().join(DATABASE_FILE))
        .ok_or(SettingsError::NoDataFolder)
}
