//! The kinds of sources, each with how it is reached.

use super::error::CollectError;
use super::flux::FluxBucket;
use super::folder::Folder;
use super::influx::Influx;
use super::json_server::JsonServer;
use super::page::{ReadStretch, SeriesPage};
use super::pi::PiWebApi;
use super::postgres::Postgres;
use super::series::SourceSeries;

/// How a source is reached and asked.
#[derive(Debug)]
pub enum SourceConnection {
    /// A PostgreSQL: tables, or the history of an Ignition gateway.
    Postgres(Box<Postgres>),
    /// An InfluxDB that is asked in InfluxQL.
    Influx(Influx),
    /// An InfluxDB that is asked in Flux.
    Flux(FluxBucket),
    /// A server that answers JSON.
    Json(JsonServer),
    /// A folder of files.
    Folder(Folder),
    /// A PI Web API.
    PiWebApi(PiWebApi),
}

impl SourceConnection {
    /// Reads rows of a series.
    ///
    /// # Errors
    /// The source is not reached, or answers something else than samples.
    pub async fn read(
        &self,
        series: &SourceSeries,
        stretch: &ReadStretch,
    ) -> Result<SeriesPage, CollectError> {
        match self {
            Self::Postgres(postgres) => postgres.read(series, stretch).await,
            Self::Influx(influx) => influx.read(series, stretch).await,
            Self::Flux(bucket) => bucket.read(series, stretch).await,
            Self::Json(server) => server.read(series, stretch).await,
            Self::Folder(folder) => folder.read(series, stretch).await,
            Self::PiWebApi(pi) => pi.read(series, stretch).await,
        }
    }
}
