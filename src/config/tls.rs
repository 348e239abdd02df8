//! The files of a server's TLS.

use std::path::PathBuf;

use super::Settings;

/// The files of a server's TLS, each in PEM.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TlsFiles {
    /// The certificate of the server, with the certificates of its authorities.
    pub certificate: PathBuf,
    /// The key of the certificate.
    pub key: PathBuf,
    /// The authorities that sign the certificates of clients, where clients need a certificate.
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
