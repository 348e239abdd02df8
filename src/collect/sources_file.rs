//! The file that says where samples are and which streams they go to.

use std::path::{Path, PathBuf};
use std::time::Duration;

use jiff::{SignedDuration, Timestamp};

use super::connection::SourceConnection;
use super::delivery::StreamDelivery;
use super::document::{SourcesDocument, SourcesFault, SourcesTable};
use super::endpoint::{self, Endpoint};
use super::flux::FluxBucket;
use super::folder::Folder;
use super::influx::Influx;
use super::json_server::JsonServer;
use super::pi::PiWebApi;
use super::postgres::Postgres;
use super::series::SourceSeries;
use super::series_file::{self, SourceKind};

/// How often a source is asked when the file does not say `[s]`.
const EVERY_S: f64 = 60.0;
/// How far behind the cursor a pass begins when the file does not say `[s]`.
const OVERLAP_S: f64 = 60.0;
/// How late samples may come when the file does not say `[s]`.
const LATE_S: f64 = 3.0 * 86_400.0;
/// How long a file must have rested when the sources file does not say `[s]`.
const REST_S: f64 = 10.0;
/// Rows of a page when the file does not say.
const PAGE_ROWS: u32 = 50_000;
/// The entries of a source that every kind has.
const ENTRIES: [&str; 9] = [
    "name",
    "kind",
    "from",
    "every_s",
    "overlap_s",
    "late_s",
    "pause_s",
    "page_rows",
    "series",
];

/// Where samples are.
#[derive(Debug)]
pub struct SampleSource {
    /// How logs and cursors call the source.
    pub name: String,
    /// The kind of the source, as the file names it.
    pub kind: &'static str,
    /// Older samples are not read.
    pub from: Timestamp,
    /// How long the source is left alone between passes.
    pub every: Duration,
    /// How far behind the cursor a pass begins.
    pub overlap: SignedDuration,
    /// How late samples may come: once in as long, a pass begins twice as far behind the cursor.
    pub late: SignedDuration,
    /// How long the source is left alone between pages.
    pub pause: Duration,
    /// Rows of a page at the most.
    pub page_rows: u32,
    /// How the source is reached.
    pub connection: SourceConnection,
    /// What of the source is read.
    pub series: Vec<SourceSeries>,
}

/// What a sources file says.
#[derive(Debug)]
pub struct SourcesFile {
    /// The server to which samples are brought.
    pub server: StreamDelivery,
    /// The file of cursors.
    pub cursors: PathBuf,
    /// The sources, at least one.
    pub sources: Vec<SampleSource>,
}

impl SourcesFile {
    /// Reads the text of a sources file. Paths in it are seen from `folder`.
    ///
    /// # Errors
    /// Everything that is wrong in it, in the order of the lines.
    pub fn read(text: &str, folder: &Path) -> Result<Self, Vec<SourcesFault>> {
        let document = SourcesDocument::new(text);
        let read = read(&document, folder);
        let faults = document.faults();
        match read {
            Some(file) if faults.is_empty() => Ok(file),
            _ => Err(faults),
        }
    }
}

fn read(document: &SourcesDocument, folder: &Path) -> Option<SourcesFile> {
    let mut root = document.root();
    let cursors = root
        .text("cursors")
        .unwrap_or_else(|| "cursors.sqlite".to_owned());
    let server = root.required("server", |root, key| root.table(key, "the server"));
    let server = server.and_then(|mut table| {
        let server = Endpoint::take(&mut table, folder);
        table.end(&endpoint::ENTRIES);
        server
    });
    let tables = root.tables("source", "source");
    if tables.is_empty() {
        root.fault("no source is named: [[source]]");
    }
    root.end(&["cursors", "server", "source"]);
    let mut sources: Vec<SampleSource> = Vec::new();
    for mut table in tables {
        let source = source(&mut table, folder);
        let is_twice =
            |source: &SampleSource| sources.iter().any(|before| before.name == source.name);
        if source.as_ref().is_some_and(is_twice) {
            table.fault("a source before has this name; cursors are kept by names");
        }
        sources.extend(source);
    }
    Some(SourcesFile {
        server: StreamDelivery::to(server?),
        cursors: folder.join(cursors),
        sources,
    })
}

fn source(table: &mut SourcesTable, folder: &Path) -> Option<SampleSource> {
    let name = table.required("name", SourcesTable::text);
    let kind = table.required("kind", |table, key| table.parsed(key, SourceKind::named));
    let from = table.required("from", SourcesTable::instant);
    let every = table.seconds("every_s", 0.1).unwrap_or(EVERY_S);
    let overlap = table.seconds("overlap_s", 0.0).unwrap_or(OVERLAP_S);
    let late = table.seconds("late_s", 60.0).unwrap_or(LATE_S);
    let pause = table.seconds("pause_s", 0.0).unwrap_or_default();
    let page_rows = table.count("page_rows", 10, 1_000_000).unwrap_or(PAGE_ROWS);
    let kind = kind?;
    let connection = connection(table, folder, kind);
    let tables = table.tables("series", "series");
    if tables.is_empty() {
        table.fault("the source has no series: [[source.series]]");
    }
    let series = tables
        .into_iter()
        .map(|table| series_file::take(table, kind));
    let series: Vec<Option<SourceSeries>> = series.collect();
    table.end(&[&ENTRIES[..], kind.entries()].concat());
    let duration = SignedDuration::from_secs_f64;
    Some(SampleSource {
        name: name?,
        kind: kind.name(),
        from: from?,
        every: Duration::from_secs_f64(every),
        overlap: duration(overlap),
        late: duration(late),
        pause: Duration::from_secs_f64(pause),
        page_rows,
        connection: connection?,
        series: series.into_iter().collect::<Option<_>>()?,
    })
}

/// An InfluxDB: a database that is asked in InfluxQL, or a bucket of an organization that is asked in Flux.
fn influx(table: &mut SourcesTable, server: Option<Endpoint>) -> Option<SourceConnection> {
    let retention = table.text("retention");
    let organization = table.text("organization");
    let Some(bucket) = table.text("bucket") else {
        if organization.is_some() {
            table.fault("`organization` belongs to a `bucket`");
        }
        let database = table.required("database", SourcesTable::text);
        return Some(SourceConnection::Influx(Influx {
            server: server?,
            database: database?,
            retention,
        }));
    };
    if retention.is_some() || table.text("database").is_some() {
        table.fault(
            "a `bucket` is asked in Flux, and a `database` with its `retention` in InfluxQL",
        );
    }
    let Some(organization) = organization else {
        table.fault("a `bucket` belongs to an `organization`");
        return None;
    };
    Some(SourceConnection::Flux(FluxBucket {
        server: server?.with_influx_token(),
        organization,
        bucket,
    }))
}

fn connection(
    table: &mut SourcesTable,
    folder: &Path,
    kind: SourceKind,
) -> Option<SourceConnection> {
    match kind {
        SourceKind::Postgres | SourceKind::Ignition => {
            let postgres = Postgres::take(table, folder, kind == SourceKind::Ignition)?;
            Some(SourceConnection::Postgres(Box::new(postgres)))
        }
        SourceKind::Influx => {
            let server = Endpoint::take(table, folder);
            influx(table, server)
        }
        SourceKind::Files => {
            let rest = table.seconds("rest_s", 0.0).unwrap_or(REST_S);
            let path = table.required("folder", SourcesTable::text)?;
            Some(SourceConnection::Folder(Folder {
                path: folder.join(path),
                rest: SignedDuration::from_secs_f64(rest),
            }))
        }
        SourceKind::Json => {
            let server = Endpoint::take(table, folder)?;
            Some(SourceConnection::Json(JsonServer { server }))
        }
        SourceKind::PiWebApi => Endpoint::take(table, folder)
            .map(|server| SourceConnection::PiWebApi(PiWebApi::at(server))),
    }
}
