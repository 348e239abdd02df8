//! The files of a server's TLS.

use std::path::PathBuf;

use clap::Args;

/// The flags that name the files.
#[derive(Clone, Debug, Default, Args)]
pub struct TlsArguments {
    /// The certificate of the server with those of its authorities, a file in PEM: the server then
    /// speaks TLS. The files are read again when they change
    #[arg(
        long,
        env = "GREYBOX_TLS_CERT",
        value_name = "FILE",
        requires = "tls_key"
    )]
    pub tls_cert: Option<PathBuf>,

    /// The key of the certificate, a file in PEM
    #[arg(
        long,
        env = "GREYBOX_TLS_KEY",
        value_name = "FILE",
        requires = "tls_cert"
    )]
    pub tls_key: Option<PathBuf>,

    /// The authorities of whom every client has to have a certificate, a file in PEM
    #[arg(
        long,
        env = "GREYBOX_TLS_CLIENT_CA",
        value_name = "FILE",
        requires = "tls_cert"
    )]
    pub tls_client_ca: Option<PathBuf>,
}

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

impl TlsArguments {
    /// The files of its TLS, where it speaks that.
    pub fn files(&self) -> Option<TlsFiles> {
        Some(TlsFiles {
            certificate: self.tls_cert.clone()?,
            key: self.tls_key.clone()?,
            client_authority: self.tls_client_ca.clone(),
        })
    }
}
