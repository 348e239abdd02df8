//! `greybox health`: asks a server whether it is ready, over TLS where it speaks that.

use super::error::CommandError;
use super::serve::block_on;
use crate::outbound::trust::UnusableCertificates;
use crate::outbound::{self, trust};
use clap::Args;
use hyper::Method;
use hyper::body::Bytes;
use rustls::ClientConfig;
use rustls::pki_types::PrivateKeyDer;
use rustls::pki_types::pem::PemObject;
use serde_json::Value;
use std::fmt::Display;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use url::Url;

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
    if url.host_str().is_none() {
        return Err(no_address(&"it names none"));
    }
    if !["http", "https"].contains(&url.scheme()) {
        return Err(no_address(&"it begins with neither http:// nor https://"));
    }
    let url = url.join("/readyz").map_err(|error| no_address(&error))?;
    let silent = |error| silent(arguments, error);
    let request = outbound::request(Method::GET, &url).body(Bytes::new());
    let request = request.map_err(CommandError::failed)?;
    let tls = Arc::new(tls(arguments)?);
    let answer = outbound::ask(&url, &tls, request, LARGEST_ANSWER).await;
    let answer = answer.map_err(silent)?;
    let document = serde_json::from_slice(answer.body()).unwrap_or_default();
    Ok((answer.status().as_u16(), document))
}

/// Whom the server is believed by, and what the client shows it.
fn tls(arguments: &HealthArguments) -> Result<ClientConfig, CommandError> {
    let roots = trust::of_the_system_and(arguments.ca.as_deref()).map_err(CommandError::failed)?;
    let builder = trust::client(roots);
    let Some(file) = &arguments.client_cert else {
        return Ok(builder.with_no_client_auth());
    };
    let unusable =
        |error: &dyn Display| CommandError::failed(UnusableCertificates::new(file, error));
    let chain = trust::certificates(file).map_err(CommandError::failed)?;
    let key = PrivateKeyDer::from_pem_file(file).map_err(|error| unusable(&error))?;
    let config = builder.with_client_auth_cert(chain, key);
    config.map_err(|error| unusable(&error))
}
