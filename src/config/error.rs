//! What is wrong with settings.

use std::path::PathBuf;

use crate::delivery::InvalidDestination;
use crate::identity::InvalidProvider;
use crate::outbound::trust::UnusableCertificates;
use crate::store::{AddressError, InvalidSecretKeys};

/// A setting that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// The address of the database is not one. It may hold a password, so it is not repeated.
    #[error(
        "the database is not given as sqlite://<path to a file> or postgres://<user>@<host>/<database>"
    )]
    Database,
    /// The address of a PostgreSQL asks for what cannot be.
    #[error("the address of the database: {0}")]
    Address(AddressError),
    /// The database is given by its address and by a file that holds an address.
    #[error(
        "the database is given twice: by its address (--database, GREYBOX_DATABASE) and by a file that holds an \
         address (--database-file, GREYBOX_DATABASE_FILE); leave one of them away"
    )]
    TwoDatabases,
    /// The file that holds the address of the database is of no use.
    #[error("the file {} with the address of the database: {why}", path.display())]
    DatabaseFile {
        /// The file.
        path: PathBuf,
        /// Why.
        why: String,
    },
    /// Only a file can be meant.
    #[error("{0} is not a file; PostgreSQL has its own tools for this: pg_dump, pg_restore")]
    NotAFile(String),
    /// The file with the keys for secrets is of no use.
    #[error(transparent)]
    SecretKeys(#[from] InvalidSecretKeys),
    /// How often a node says that it lives cannot be.
    #[error("a server may say every 0.02 s to 60 s that it lives, not every {0} s")]
    NodeBeat(f64),
    /// There is no place for the default database.
    #[error("the user has no data folder; say where the database is with --database")]
    NoDataFolder,
    /// The hours of work in a day are not a time.
    #[error("{0} hours of work in a day are not a time")]
    WorkHours(f64),
    /// A destination is none.
    #[error(transparent)]
    Destination(InvalidDestination),
    /// A network is not given as an address or a range of them.
    #[error("`{0}` is neither an address nor a network of the form 10.0.0.0/8")]
    Network(String),
    /// The length of a slice is not a time.
    #[error("a slice of {0} s is not between 0 and 3600 s")]
    Slice(f64),
    /// The identity provider or the address of the page cannot be.
    #[error(transparent)]
    Provider(#[from] InvalidProvider),
    /// The authorities of the identity provider cannot be used.
    #[error(transparent)]
    Authorities(#[from] UnusableCertificates),
    /// The file with the secret of this server at the identity provider is of no use.
    #[error("the file {} with the secret for the identity provider: {why}", path.display())]
    ClientSecret {
        /// The file.
        path: PathBuf,
        /// Why.
        why: String,
    },
}
