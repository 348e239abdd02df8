//! Samples that are fetched from historians and appended to streams of a server: what `greybox collect` does beside
//! a historian. The collector alone makes connections; the server never asks a historian for anything.
//!
//! A [`SourcesFile`] names sources and the series of each: a tag, a measurement, columns of a table. Each series has
//! a cursor ([`Cursors`]), the instant up to which the series is in its stream. A pass over a series reads pages of
//! CSV from a little before the cursor, appends each page to the stream, and moves the cursor when the server has
//! answered that the page is on disk. A page that is appended twice changes nothing in a stream, so that a collector
//! which is killed between the two loses nothing and doubles nothing.

mod connection;
mod cursors;
mod delivery;
mod document;
mod endpoint;
mod error;
mod flux;
mod folder;
mod influx;
mod json_server;
mod page;
mod pass;
mod pi;
mod postgres;
mod query;
mod reports;
mod run;
mod secret;
mod series;
mod series_file;
mod sources_file;

pub use connection::SourceConnection;
pub use cursors::Cursors;
pub use delivery::StreamDelivery;
pub use document::SourcesFault;
pub use error::CollectError;
pub use page::{ReadStretch, SeriesPage};
pub use run::{Until, collect};
pub use series::{SourceColumn, SourceSeries};
pub use sources_file::{SampleSource, SourcesFile};
