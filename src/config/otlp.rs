//! The collector of OpenTelemetry that is told of requests and slices.

use std::path::PathBuf;

use clap::Args;

/// Where spans are sent.
#[derive(Clone, Debug, Default, Args)]
pub struct OtlpArguments {
    /// A collector of OpenTelemetry that takes OTLP over HTTP, e.g. `http://127.0.0.1:4318` or
    /// `https://collector.plant.example:4318`
    #[arg(long, env = "GREYBOX_OTLP_ENDPOINT", value_name = "URL")]
    pub otlp_endpoint: Option<String>,

    /// Authorities that are trusted for the collector beside the system's, a file in PEM
    #[arg(
        long,
        env = "GREYBOX_OTLP_CA",
        value_name = "FILE",
        requires = "otlp_endpoint"
    )]
    pub otlp_ca: Option<PathBuf>,
}
