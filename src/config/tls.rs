//! The files of a server's TLS.

use std::path::PathBuf;

use super::Settings;

/// The files of a server's TLS, each in PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// Its certificate, with those of its authorities.
    pub certificate: PathBuf,
    /// The key of that.
    pub key: PathBuf,
    /// The authorities of whom every client has to have a certificate, where it has to.
    pub client_authority: Option<PathBuf>,
}

impl Settings {
    /// The files of its TLS, where it speaks that.
    pub fn tls(&self) -> Option<TlsFiles> {
        Some(TlsFiles {
            certificate: self.tls_cert.clone()?,
            key: self.tls_key.clone()?,
            client_authority: self.tls_client_ca.clone(),
        })
    }
}
