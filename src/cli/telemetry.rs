//! What the program says of its work: lines of log, and spans for a collector of OpenTelemetry.

use std::io::IsTerminal;

use opentelemetry::trace::TracerProvider as _;
use opentelemetry::{KeyValue, global};
use opentelemetry_otlp::{Protocol, SpanExporter, WithExportConfig as _, WithHttpConfig as _};
use opentelemetry_sdk::Resource;
use opentelemetry_sdk::propagation::TraceContextPropagator;
use opentelemetry_sdk::trace::SdkTracerProvider;
use tracing::level_filters::LevelFilter;
use tracing_appender::non_blocking::{NonBlockingBuilder, WorkerGuard};
use tracing_subscriber::filter::{FilterExt as _, Targets, filter_fn};
use tracing_subscriber::fmt;
use tracing_subscriber::layer::{Layer as _, SubscriberExt as _};
use tracing_subscriber::util::SubscriberInitExt as _;

use super::collector::Collector;
use super::error::CommandError;
use crate::config::Settings;
use crate::span;

/// Lines of log that wait to be taken, at the most.
const WAITING_LINES: usize = 10_000;

/// The ways of log and spans out of the program.
pub struct Telemetry {
    /// Writes what is waiting when it goes out of scope.
    _log: WorkerGuard,
    traces: Option<SdkTracerProvider>,
}

impl Telemetry {
    /// Begins to log to standard error, as text for people and as JSON for programs; and to send spans
    /// where the settings name a collector.
    pub fn begin(settings: &Settings) -> Result<Self, CommandError> {
        let otlp = &settings.otlp;
        let traces = otlp
            .otlp_endpoint
            .as_deref()
            .map(|endpoint| exporter(Collector::at(endpoint, otlp.otlp_ca.as_deref())?))
            .transpose()?;
        Self::of(&settings.log, traces)
    }

    /// Begins to log, without spans.
    pub fn of_lines(filter: &str) -> Result<Self, CommandError> {
        Self::of(filter, None)
    }

    fn of(filter: &str, traces: Option<SdkTracerProvider>) -> Result<Self, CommandError> {
        let targets: Targets = filter
            .parse()
            .map_err(|error| CommandError::input(format!("--log {filter}: {error}")))?;
        let spans = traces.as_ref().map(|traces| {
            let spans_alone = Targets::new().with_target(span::TARGET, LevelFilter::INFO);
            let spans = tracing_opentelemetry::layer().with_tracer(traces.tracer("greybox"));
            spans.with_filter(spans_alone)
        });
        let events = targets.and(filter_fn(|what| what.is_event()));
        // Whoever reads the log may stop reading, and its disk may be slow or full: nothing waits for
        // them, and what they do not take is lost.
        let (writer, log) = NonBlockingBuilder::default()
            .lossy(true)
            .buffered_lines_limit(WAITING_LINES)
            .thread_name("log")
            .finish(std::io::stderr());
        let lines = fmt::layer().log_internal_errors(false).with_writer(writer);
        let registry = tracing_subscriber::registry().with(spans);
        if std::io::stderr().is_terminal() {
            registry.with(lines.with_filter(events)).init();
        } else {
            registry.with(lines.json().with_filter(events)).init();
        }
        Ok(Self { _log: log, traces })
    }

    /// Sends what has not been sent yet.
    pub fn end(self) {
        if let Some(traces) = &self.traces
            && let Err(error) = traces.shutdown()
        {
            tracing::warn!(%error, "the last spans were not sent");
        }
    }
}

/// Sends spans in batches, beside the work; what a collector does not take is lost.
fn exporter(collector: Collector) -> Result<SdkTracerProvider, CommandError> {
    let exporter = SpanExporter::builder()
        .with_http()
        .with_protocol(Protocol::HttpBinary)
        .with_endpoint(collector.spans())
        .with_http_client(collector)
        .build()
        .map_err(CommandError::input)?;
    global::set_text_map_propagator(TraceContextPropagator::new());
    let version = KeyValue::new("service.version", env!("CARGO_PKG_VERSION"));
    let resource = Resource::builder()
        .with_service_name("greybox")
        .with_attribute(version)
        .build();
    Ok(SdkTracerProvider::builder()
        .with_batch_exporter(exporter)
        .with_resource(resource)
        .build())
}
