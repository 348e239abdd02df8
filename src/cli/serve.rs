//! `greybox serve`.

use super::error::CommandError;
use super::telemetry::Telemetry;
use crate::app::{self, App, StartError};
use crate::config::Settings;
use std::future::Future;
use std::io::ErrorKind;
use std::net::SocketAddr;

/// Serves until the process is asked to end.
pub fn serve(settings: Settings) -> Result<(), CommandError> {
    app::spare_address_space();
    let telemetry = Telemetry::begin(&settings)?;
    let served = block_on(async {
        let app = start(settings).await?;
        println!("listening on {}", app.url());
        let asked = app.wait_for_signal().await;
        app.shutdown().await;
        asked.map_err(CommandError::failed)
    });
    telemetry.end();
    served
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
