//! `greybox health`: asks a server whether it is ready, over TLS where it speaks that.

use super::error::CommandError;
use super::serve::block_on;
use crate::delivery::trust;
use clap::Args;
use http_body_util::{BodyExt, Empty, Limited};
use hyper::Request;
use hyper::body::Bytes;
use hyper::client::conn::http1;
use hyper::header::HOST;
use hyper_util::rt::TokioIo;
use reqwest::Url;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use serde_json::Value;
use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;

/// How long the server may take.
const PATIENCE: Duration = Duration::from_secs(10);
/// The bytes of its answer at the most.
const LARGEST_ANSWER: usize = 1 << 20;

/// What `health` is given.
#[derive(Debug, Args)]
pub struct HealthArguments {
    /// The server
    #[arg(default_value = "http://127.0.0.1:8080")]
    url: String,
    /// Authorities that are trusted beside the system's, a file in PEM
    #[arg(long, value_name = "FILE")]
    ca: Option<PathBuf>,
    /// A certificate with its key, a file in PEM, for a server that asks clients for one
    #[arg(long, value_name = "FILE")]
    client_cert: Option<PathBuf>,
}

/// Succeeds when the server says that it is ready.
pub fn health(arguments: HealthArguments) -> Result<(), CommandError> {
    block_on(async {
        let asking = tokio::time::timeout(PATIENCE, ask(&arguments));
        let answered = asking.await.unwrap_or_else(|_| {
            let seconds = PATIENCE.as_secs();
            Err(silent(&arguments, format!("nothing came in {seconds} s")))
        });
        let (status, answer) = answered?;
        if status != 200 {
            let detail = answer["detail"].as_str();
            let detail = detail.map_or(String::new(), |detail| format!(": {detail}"));
            let url = &arguments.url;
            return Err(CommandError::failed(format!(
                "{url} answered {status}{detail}"
            )));
        }
        println!("{}", answer["status"].as_str().unwrap_or("answered"));
        Ok(())
    })
}

fn silent(arguments: &HealthArguments, why: impl Display) -> CommandError {
    CommandError::failed(format!("{} does not answer: {why}", arguments.url))
}

/// The status of `/readyz`, and what it says.
async fn ask(arguments: &HealthArguments) -> Result<(u16, Value), CommandError> {
    let no_address = |why: &dyn Display| {
        CommandError::input(format!(
            "`{}` is no address of a server: {why}",
            arguments.url
        ))
    };
    let url = Url::parse(&arguments.url).map_err(|error| no_address(&error))?;
    let host = url.host_str().ok_or_else(|| no_address(&"it names none"))?;
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    let port = url.port_or_known_default().unwrap_or(80);
    let stream = TcpStream::connect((bare, port)).await;
    let stream = stream.map_err(|error| silent(arguments, error))?;
    match url.scheme() {
        "http" => answer(stream, arguments, &url).await,
        "https" => {
            let name = ServerName::try_from(bare.to_owned()).map_err(|error| no_address(&error))?;
            let agreed = connector(arguments)?.connect(name, stream).await;
            let stream = agreed.map_err(|error| silent(arguments, error))?;
            answer(stream, arguments, &url).await
        }
        _ => Err(no_address(&"it begins with neither http:// nor https://")),
    }
}

async fn answer<S>(
    stream: S,
    arguments: &HealthArguments,
    url: &Url,
) -> Result<(u16, Value), CommandError>
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let silent = |error: hyper::Error| silent(arguments, error);
    let (mut sender, connection) = http1::handshake(TokioIo::new(stream))
        .await
        .map_err(silent)?;
    tokio::spawn(connection);
    let request = Request::get("/readyz").header(HOST, url.authority());
    let request = request.body(Empty::<Bytes>::new());
    let request = request.map_err(CommandError::failed)?;
    let answer = sender.send_request(request).await.map_err(silent)?;
    let status = answer.status().as_u16();
    let body = Limited::new(answer.into_body(), LARGEST_ANSWER)
        .collect()
        .await;
    let body = body.map_err(|error| CommandError::failed(error.to_string()))?;
    Ok((
        status,
        serde_json::from_slice(&body.to_bytes()).unwrap_or_default(),
    ))
}

fn connector(arguments: &HealthArguments) -> Result<TlsConnector, CommandError> {
    let mut roots = trust::of_the_system();
    if let Some(file) = &arguments.ca {
        for authority in certificates(file)? {
            roots
                .add(authority)
                .map_err(|error| unusable(file, &error))?;
        }
    }
    let builder = trust::client(roots);
    let config = match &arguments.client_cert {
        None => builder.with_no_client_auth(),
        Some(file) => {
            let chain = certificates(file)?;
            let key = PrivateKeyDer::from_pem_file(file);
            let key = key.map_err(|error| unusable(file, &error))?;
            let config = builder.with_client_auth_cert(chain, key);
            config.map_err(|error| unusable(file, &error))?
        }
    };
    Ok(TlsConnector::from(Arc::new(config)))
}

fn certificates(file: &Path) -> Result<Vec<CertificateDer<'static>>, CommandError> {
    let chain = CertificateDer::pem_file_iter(file).and_then(Iterator::collect);
    let chain: Vec<_> = chain.map_err(|error| unusable(file, &error))?;
    match chain.is_empty() {
        true => Err(unusable(file, &"it holds no certificate in PEM")),
        false => Ok(chain),
    }
}

fn unusable(file: &Path, why: &dyn Display) -> CommandError {
    CommandError::failed(format!("{} cannot be used: {why}", file.display()))
}
