//! Whom this program believes over TLS when it is the client.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::client::WantsClientCert;
use rustls::pki_types::CertificateDer;
use rustls::pki_types::pem::PemObject;
use rustls::{ClientConfig, ConfigBuilder, RootCertStore};

/// A file with certificates that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{} cannot be used: {why}", path.display())]
pub struct UnusableCertificates {
    /// The file.
    path: PathBuf,
    /// Why.
    why: String,
}

impl UnusableCertificates {
    /// The refusal of a file.
    pub fn new(file: &Path, why: impl Display) -> Self {
        Self {
            path: file.to_owned(),
            why: why.to_string(),
        }
    }
}

/// The authorities that the system trusts.
#[must_use]
pub fn of_the_system() -> RootCertStore {
    let mut roots = RootCertStore::empty();
    let loaded = rustls_native_certs::load_native_certs();
    for error in loaded.errors {
        tracing::warn!(%error, "a certificate of the system cannot be used");
    }
    roots.add_parsable_certificates(loaded.certs);
    roots
}

/// The authorities that the system trusts and those of a file in PEM.
///
/// # Errors
/// The file holds no certificates of authorities.
pub fn of_the_system_and(file: Option<&Path>) -> Result<RootCertStore, UnusableCertificates> {
    let mut roots = of_the_system();
    if let Some(file) = file {
        for authority in certificates(file)? {
            let added = roots.add(authority);
            added.map_err(|error| UnusableCertificates::new(file, error))?;
        }
    }
    Ok(roots)
}

/// The certificates of a file in PEM, at least one.
///
/// # Errors
/// The file cannot be read or holds none.
pub fn certificates(file: &Path) -> Result<Vec<CertificateDer<'static>>, UnusableCertificates> {
    let chain = CertificateDer::pem_file_iter(file).and_then(Iterator::collect);
    let chain: Vec<_> = chain.map_err(|error| UnusableCertificates::new(file, error))?;
    match chain.is_empty() {
        true => Err(UnusableCertificates::new(
            file,
            "it holds no certificate in PEM",
        )),
        false => Ok(chain),
    }
}

/// A client that trusts the authorities; whether the client has a certificate is still open.
#[must_use]
pub fn client(roots: RootCertStore) -> ConfigBuilder<ClientConfig, WantsClientCert> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    ClientConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .expect("the provider speaks the versions of TLS that are safe")
        .with_root_certificates(roots)
}
