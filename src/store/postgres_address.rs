//! The address of a PostgreSQL, `postgres://<user>@<host>/<database>?sslmode=…`, and what it says of TLS.

use std::fs::File;
use std::path::PathBuf;

use sqlx::postgres::{PgConnectOptions, PgSslMode};
use url::Url;

/// The names of parameters that name an authority of certificates.
const AUTHORITY: [&str; 3] = ["sslrootcert", "ssl-root-cert", "ssl-ca"];
/// The names of parameters that name the certificate and the key of a client.
const CLIENT: [&str; 4] = ["sslcert", "ssl-cert", "sslkey", "ssl-key"];

/// An address that is not taken.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// The text is no address. It may hold a password, so it is not repeated.
    #[error("it is no address of the form postgres://<user>@<host>/<database>")]
    NotAnAddress,
    /// The address asks for a check of the server's certificate that leaves out the name of the server.
    #[error(
        "sslmode=verify-full alone looks at the certificate of a PostgreSQL, with sslrootcert=<file> where an \
         authority of one's own signed it; sslmode=verify-ca would take any server that an authority of the system \
         vouches for"
    )]
    Unverified,
    /// A file that the address names cannot be read.
    #[error("the {parameter} {} cannot be read: {why}", path.display())]
    File {
        /// The parameter that names the file.
        parameter: String,
        /// The file.
        path: PathBuf,
        /// Why.
        why: String,
    },
}

/// How a PostgreSQL is reached.
///
/// # Errors
/// The text is no address, names files that cannot be read, or asks for half a check of the server.
pub fn parse(address: &str) -> Result<PgConnectOptions, AddressError> {
    let url: Url = address.parse().map_err(|_| AddressError::NotAnAddress)?;
    let options: PgConnectOptions = address.parse().map_err(|_| AddressError::NotAnAddress)?;
    let mode = options.get_ssl_mode();
    let is_verified = matches!(mode, PgSslMode::VerifyFull);
    let mut is_half_verified = matches!(mode, PgSslMode::VerifyCa);
    for (parameter, value) in url.query_pairs() {
        let is_authority = AUTHORITY.contains(&&*parameter);
        is_half_verified |= is_authority && !is_verified;
        let is_file = is_authority || CLIENT.contains(&&*parameter);
        if is_file && !value.starts_with("-----BEGIN") {
            File::open(&*value).map_err(|error| AddressError::File {
                parameter: parameter.into_owned(),
                path: PathBuf::from(&*value),
                why: error.to_string(),
            })?;
        }
    }
    if is_half_verified {
        return Err(AddressError::Unverified);
    }
    Ok(options)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(address: &str) -> AddressError {
        parse(address).expect_err("it is not taken")
    }

    #[test]
    fn a_server_is_verified_as_a_whole_or_not_at_all() {
        let folder = tempfile::tempdir().expect("a folder");
        let authority = folder.path().join("ca.pem");
        std::fs::write(&authority, "").expect("a file");
        let authority = authority.display();
        let base = "postgres://greybox@db.plant.example/greybox?sslmode=";
        for mode in ["disable", "prefer", "require", "verify-full"] {
            assert!(parse(&format!("{base}{mode}")).is_ok(), "{mode}");
        }
        assert!(parse(&format!("{base}verify-full&sslrootcert={authority}")).is_ok());
        for half in ["verify-ca", &format!("require&sslrootcert={authority}")] {
            assert_eq!(refused(&format!("{base}{half}")), AddressError::Unverified);
        }
    }

    #[test]
    fn files_that_are_not_there_and_texts_that_are_no_address_are_named() {
        let refusal = refused("postgres://h/d?sslmode=verify-full&sslrootcert=/nowhere/ca.pem");
        let text = refusal.to_string();
        assert!(
            text.contains("the sslrootcert /nowhere/ca.pem cannot be read"),
            "{text}"
        );
        for text in [
            "postgres://localhost:port/greybox",
            "postgres://h/d?sslmode=perhaps",
        ] {
            assert_eq!(refused(text), AddressError::NotAnAddress, "{text}");
        }
    }
}
