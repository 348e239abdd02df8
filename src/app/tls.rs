//! TLS: the certificate and key of the server, read again when their files change, so that a renewed
//! certificate is used without a restart.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use parking_lot::RwLock;
use rustls::client::WebPkiServerVerifier;
use rustls::client::danger::ServerCertVerifier;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName, UnixTime};
use rustls::server::WebPkiClientVerifier;
use rustls::{CertificateError, RootCertStore, ServerConfig};
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;

use crate::config::tls::TlsFiles;

/// How often it is looked whether the files have changed.
const LOOK_INTERVAL: Duration = Duration::from_secs(5);

/// Why the files make no TLS.
#[derive(Debug, thiserror::Error)]
pub enum TlsError {
    /// A file cannot be read.
    #[error("{} cannot be read: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// A file holds something else.
    #[error("{} holds no {what} in PEM", path.display())]
    Pem {
        /// The file.
        path: PathBuf,
        /// The kind of item that the file should hold.
        what: &'static str,
    },
    /// Certificate and key are not for each other, or for nothing.
    #[error("the certificate and its key cannot be used: {0}")]
    Unusable(String),
    /// A new certificate has expired or is not valid yet, and the certificate in use is valid.
    #[error("{} is not valid now, so the certificate before it stays in use", path.display())]
    NotValidNow {
        /// The file.
        path: PathBuf,
    },
}

/// The TLS of a server, as its files say now.
pub(super) struct Tls {
    files: TlsFiles,
    current: RwLock<Loaded>,
}

struct Loaded {
    bytes: Vec<Vec<u8>>,
    config: Arc<ServerConfig>,
    certificate: CertificateDer<'static>,
}

impl Tls {
    /// Reads the files.
    pub(super) fn new(files: TlsFiles) -> Result<Self, TlsError> {
        let loaded = Loaded::of(&files, read(&files)?)?;
        if !is_valid_at(&loaded.certificate, UnixTime::now()) {
            let file = files.certificate.display();
            tracing::warn!(%file, "the certificate has expired or is not valid yet");
        }
        Ok(Self {
            files,
            current: RwLock::new(loaded),
        })
    }

    /// Whether the certificate is valid in so many days.
    pub(super) fn is_valid_in_days(&self, days: u64) -> bool {
        let then = SystemTime::now() + Duration::from_hours(24 * days);
        let since_1970 = then.duration_since(UNIX_EPOCH).unwrap_or_default();
        let then = UnixTime::since_unix_epoch(since_1970);
        is_valid_at(&self.current.read().certificate, then)
    }

    /// What takes the next connection.
    pub(super) fn acceptor(&self) -> TlsAcceptor {
        let current = self.current.read();
        TlsAcceptor::from(Arc::clone(&current.config))
    }

    /// Reads the files again where they have changed; says whether they had. Where they are of no use
    /// what they said before holds on. A certificate that is not valid now does not replace a valid certificate.
    pub(super) fn reload(&self) -> Result<bool, TlsError> {
        let bytes = read(&self.files)?;
        let current = self.current.read();
        if current.bytes == bytes {
            return Ok(false);
        }
        let now = UnixTime::now();
        let was_valid = is_valid_at(&current.certificate, now);
        drop(current);
        let loaded = Loaded::of(&self.files, bytes)?;
        if was_valid && !is_valid_at(&loaded.certificate, now) {
            let path = self.files.certificate.clone();
            return Err(TlsError::NotValidNow { path });
        }
        *self.current.write() = loaded;
        Ok(true)
    }

    /// Looks after the files until the server goes down.
    pub(super) async fn watch(self: Arc<Self>, closing: CancellationToken) {
        let mut told = None;
        loop {
            tokio::select! {
                () = closing.cancelled() => return,
                () = tokio::time::sleep(LOOK_INTERVAL) => {}
            }
            match self.reload() {
                Ok(false) => {}
                Ok(true) => {
                    tracing::info!("the certificate was read again");
                    told = None;
                }
                Err(error) if told.as_ref() == Some(&error.to_string()) => {}
                Err(error) => {
                    tracing::error!(%error, "the certificate was not read again");
                    told = Some(error.to_string());
                }
            }
        }
    }
}

impl Loaded {
    /// What the bytes of the files say.
    fn of(files: &TlsFiles, bytes: Vec<Vec<u8>>) -> Result<Self, TlsError> {
        let config = configure(files, &bytes)?;
        let chain = certificates(&files.certificate, &bytes[0])?;
        let certificate = chain.into_iter().next();
        let certificate = certificate.expect("a chain has a certificate at the least");
        Ok(Self {
            bytes,
            config,
            certificate,
        })
    }
}

/// Whether the time is within the validity of a certificate. A verifier looks at that before it looks for an
/// authority, so that no authority is needed; what else a verifier says is left to the clients.
fn is_valid_at(certificate: &CertificateDer<'static>, time: UnixTime) -> bool {
    let mut roots = RootCertStore::empty();
    if roots.add(certificate.clone()).is_err() {
        return true;
    }
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let verifier = WebPkiServerVerifier::builder_with_provider(Arc::new(roots), provider).build();
    let (Ok(verifier), Ok(name)) = (verifier, ServerName::try_from("localhost")) else {
        return true;
    };
    let verified = verifier.verify_server_cert(certificate, &[], &name, &[], time);
    !matches!(
        verified,
        Err(rustls::Error::InvalidCertificate(
            CertificateError::Expired
                | CertificateError::ExpiredContext { .. }
                | CertificateError::NotValidYet
                | CertificateError::NotValidYetContext { .. }
        ))
    )
}

/// The bytes of all files: certificate, key, authority of clients.
fn read(files: &TlsFiles) -> Result<Vec<Vec<u8>>, TlsError> {
    let all = [
        Some(&files.certificate),
        Some(&files.key),
        files.client_authority.as_ref(),
    ];
    let read = |path: &PathBuf| {
        std::fs::read(path).map_err(|source| TlsError::File {
            path: path.clone(),
            source,
        })
    };
    all.into_iter().flatten().map(read).collect()
}

fn configure(files: &TlsFiles, bytes: &[Vec<u8>]) -> Result<Arc<ServerConfig>, TlsError> {
    let chain = certificates(&files.certificate, &bytes[0])?;
    let key = PrivateKeyDer::from_pem_slice(&bytes[1]).map_err(|_| TlsError::Pem {
        path: files.key.clone(),
        what: "private key",
    })?;
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let builder = ServerConfig::builder_with_provider(Arc::clone(&provider))
        .with_safe_default_protocol_versions()
        .map_err(unusable)?;
    let builder = match &files.client_authority {
        None => builder.with_no_client_auth(),
        Some(path) => {
            let mut roots = RootCertStore::empty();
            for certificate in certificates(path, &bytes[2])? {
                roots.add(certificate).map_err(unusable)?;
            }
            let verifier = WebPkiClientVerifier::builder_with_provider(Arc::new(roots), provider);
            builder.with_client_cert_verifier(verifier.build().map_err(unusable)?)
        }
    };
    let mut config = builder.with_single_cert(chain, key).map_err(unusable)?;
    config.alpn_protocols = vec![b"http/1.1".to_vec()];
    Ok(Arc::new(config))
}

fn certificates(path: &Path, bytes: &[u8]) -> Result<Vec<CertificateDer<'static>>, TlsError> {
    let chain: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(bytes).collect();
    let chain = chain.ok().filter(|chain| !chain.is_empty());
    chain.ok_or_else(|| TlsError::Pem {
        path: path.to_owned(),
        what: "certificate",
    })
}

fn unusable(error: impl std::fmt::Display) -> TlsError {
    TlsError::Unusable(error.to_string())
}

#[cfg(test)]
mod tests {
    use rcgen::{CertificateParams, CertifiedIssuer, KeyPair};
    use rustls::ClientConfig;
    use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};
    use tokio_rustls::TlsConnector;

    use super::*;

    struct Authority(CertifiedIssuer<'static, KeyPair>);

    impl Authority {
        fn new() -> Self {
            let mut params = CertificateParams::new(Vec::new()).expect("parameters");
            params.is_ca = rcgen::IsCa::Ca(rcgen::BasicConstraints::Unconstrained);
            let key = KeyPair::generate().expect("a key");
            Self(CertifiedIssuer::self_signed(params, key).expect("an authority"))
        }

        /// A certificate for a name and its key, in PEM.
        fn issue(&self, name: &str) -> (String, String) {
            let params = CertificateParams::new(vec![name.to_owned()]);
            self.sign(params.expect("parameters"))
        }

        /// A certificate for a name that is valid in these years, and its key, in PEM.
        fn issue_for(&self, name: &str, years: [i32; 2]) -> (String, String) {
            let params = CertificateParams::new(vec![name.to_owned()]);
            let mut params = params.expect("parameters");
            params.not_before = rcgen::date_time_ymd(years[0], 1, 1);
            params.not_after = rcgen::date_time_ymd(years[1], 1, 1);
            self.sign(params)
        }

        fn sign(&self, params: CertificateParams) -> (String, String) {
            let key = KeyPair::generate().expect("a key");
            let certificate = params.signed_by(&key, &self.0).expect("a certificate");
            (certificate.pem(), key.serialize_pem())
        }

        fn roots(&self) -> RootCertStore {
            let mut roots = RootCertStore::empty();
            roots.add(self.0.der().clone()).expect("a certificate");
            roots
        }
    }

    fn put(folder: &Path, (certificate, key): &(String, String)) {
        std::fs::write(folder.join("cert.pem"), certificate).expect("a file");
        std::fs::write(folder.join("key.pem"), key).expect("a file");
    }

    fn files(folder: &Path) -> TlsFiles {
        TlsFiles {
            certificate: folder.join("cert.pem"),
            key: folder.join("key.pem"),
            client_authority: None,
        }
    }

    /// Whether a client that trusts the authority takes the server for the one of this name, and is
    /// taken for one itself.
    async fn speaks(
        tls: &Tls,
        authority: &Authority,
        name: &'static str,
        client: Option<(String, String)>,
    ) -> bool {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .expect("versions")
            .with_root_certificates(authority.roots());
        let config = match client {
            None => config.with_no_client_auth(),
            Some((certificate, key)) => {
                let chain =
                    vec![CertificateDer::from_pem_slice(certificate.as_bytes()).expect("one")];
                let key = PrivateKeyDer::from_pem_slice(key.as_bytes()).expect("a key");
                config.with_client_auth_cert(chain, key).expect("a pair")
            }
        };
        let (near, far) = tokio::io::duplex(1 << 16);
        let connector = TlsConnector::from(Arc::new(config));
        let asks = async move {
            let name = ServerName::try_from(name).expect("a name");
            let mut stream = connector.connect(name, near).await?;
            stream.write_all(b"x").await?;
            stream.read_u8().await
        };
        let acceptor = tls.acceptor();
        let answers = async move {
            let mut stream: tokio_rustls::server::TlsStream<DuplexStream> =
                acceptor.accept(far).await?;
            let byte = stream.read_u8().await?;
            stream.write_u8(byte).await?;
            stream.shutdown().await
        };
        let (asked, answered) = tokio::join!(asks, answers);
        asked.is_ok() && answered.is_ok()
    }

    #[tokio::test]
    async fn a_renewed_certificate_is_used_and_a_broken_one_is_not() {
        let folder = tempfile::tempdir().expect("a folder");
        let authority = Authority::new();
        put(folder.path(), &authority.issue("old.example"));
        let tls = Tls::new(files(folder.path())).expect("sound files");
        assert!(speaks(&tls, &authority, "old.example", None).await);
        assert!(!tls.reload().expect("the same files"));
        put(folder.path(), &authority.issue("new.example"));
        assert!(tls.reload().expect("sound files"));
        assert!(speaks(&tls, &authority, "new.example", None).await);
        assert!(!speaks(&tls, &authority, "old.example", None).await);
        // The key of another certificate, as it is while files are replaced one by one.
        let (certificate, _) = authority.issue("third.example");
        std::fs::write(folder.path().join("cert.pem"), certificate).expect("a file");
        assert!(matches!(tls.reload(), Err(TlsError::Unusable(_))));
        assert!(speaks(&tls, &authority, "new.example", None).await);
    }

    #[tokio::test]
    async fn a_certificate_that_is_not_valid_now_replaces_no_valid_one() {
        let folder = tempfile::tempdir().expect("a folder");
        let authority = Authority::new();
        put(folder.path(), &authority.issue("valid.example"));
        let tls = Tls::new(files(folder.path())).expect("sound files");
        for years in [[2000, 2001], [3000, 3001]] {
            let certificate = authority.issue_for("other.example", years);
            put(folder.path(), &certificate);
            let refused = tls.reload().expect_err("the time is not now");
            assert!(matches!(refused, TlsError::NotValidNow { .. }), "{refused}");
            assert!(speaks(&tls, &authority, "valid.example", None).await);
        }
        // A server that has nothing better begins with what there is, and takes what comes.
        let tls = Tls::new(files(folder.path())).expect("files that can be read");
        put(
            folder.path(),
            &authority.issue_for("old.example", [2000, 2001]),
        );
        assert!(tls.reload().expect("neither is valid"));
        put(folder.path(), &authority.issue("valid.example"));
        assert!(tls.reload().expect("a valid certificate"));
        assert!(speaks(&tls, &authority, "valid.example", None).await);
    }

    #[tokio::test]
    async fn only_clients_of_the_authority_are_taken_where_one_is_given() {
        let folder = tempfile::tempdir().expect("a folder");
        let (authority, stranger) = (Authority::new(), Authority::new());
        put(folder.path(), &authority.issue("a.example"));
        let path = folder.path().join("clients.pem");
        std::fs::write(&path, authority.0.pem()).expect("a file");
        let files = TlsFiles {
            client_authority: Some(path),
            ..files(folder.path())
        };
        let tls = Tls::new(files).expect("sound files");
        let trusted = authority.issue("client");
        assert!(speaks(&tls, &authority, "a.example", Some(trusted)).await);
        let other = stranger.issue("client");
        assert!(!speaks(&tls, &authority, "a.example", Some(other)).await);
        assert!(!speaks(&tls, &authority, "a.example", None).await);
    }

    #[test]
    fn files_that_hold_something_else_are_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let text = |files| Tls::new(files).err().expect("a refusal").to_string();
        let missing = text(files(folder.path()));
        assert!(missing.contains("cert.pem cannot be read"), "{missing}");
        put(folder.path(), &("x".to_owned(), "y".to_owned()));
        let empty = text(files(folder.path()));
        assert!(empty.contains("cert.pem holds no certificate"), "{empty}");
    }
}
