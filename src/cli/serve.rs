//! `greybox serve` and `greybox health`.

use super::client::Client;
use super::error::CommandError;
use crate::app::{App, StartError};
use crate::config::Settings;
use clap::Args;
use std::future::Future;
use std::io::{ErrorKind, IsTerminal};
use std::net::SocketAddr;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

/// What `health` is given.
#[derive(Debug, Args)]
pub struct HealthArguments {
    /// The server
    #[arg(default_value = "http://127.0.0.1:8080")]
    url: String,
}

/// Serves until the process is asked to end.
pub fn serve(settings: Settings) -> Result<(), CommandError> {
    log(&settings.log)?;
    block_on(async {
        let app = start(settings).await?;
        println!("listening on {}", app.url());
        let asked = app.wait_for_signal().await;
        app.shutdown().await;
        asked.map_err(CommandError::failed)
    })
}

/// Succeeds when the server says that it is ready.
pub fn health(arguments: HealthArguments) -> Result<(), CommandError> {
    block_on(async {
        let answer = Client::new(&arguments.url)?.get("/readyz").await?;
        println!("{}", answer["status"].as_str().unwrap_or("answered"));
        Ok(())
    })
}

/// A server at work.
pub async fn start(settings: Settings) -> Result<App, CommandError> {
    App::start(settings).await.map_err(|error| match &error {
        StartError::Listen { address, source } if source.kind() == ErrorKind::AddrInUse => {
            let next = SocketAddr::new(address.ip(), address.port().wrapping_add(1));
            CommandError::failed(format!(
                "{error}; another program listens there: choose another with `--listen {next}`"
            ))
        }
        _ => CommandError::failed(error),
    })
}

/// Runs what waits for the network.
pub fn block_on<T>(work: impl Future<Output = Result<T, CommandError>>) -> Result<T, CommandError> {
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .build()
        .map_err(CommandError::failed)?;
    let done = runtime.block_on(work);
    // What still computes has no one to compute for.
    runtime.shutdown_background();
    done
}

/// Logs to standard error, as text for people and as JSON for programs.
pub fn log(filter: &str) -> Result<(), CommandError> {
    let targets: Targets = filter
        .parse()
        .map_err(|error| CommandError::input(format!("--log {filter}: {error}")))?;
    let log = tracing_subscriber::registry().with(targets);
    // A log on a disk that is full is lost; to say so there too would end the thread that logs.
    let lines = fmt::layer()
        .log_internal_errors(false)
        .with_writer(std::io::stderr);
    if std::io::stderr().is_terminal() {
        log.with(lines).init();
    } else {
        log.with(lines.json()).init();
    }
    Ok(())
}
