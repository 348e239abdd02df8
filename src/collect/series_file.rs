//! A series of a source, as a sources file says it.

use std::collections::BTreeMap;

use greybox::intake::{self, Options};

use super::document::SourcesTable;
use super::endpoint;
use super::series::{SourceColumn, SourceSeries, TIME_UNITS};
use crate::access::is_stream_name;

/// The kinds of sources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum SourceKind {
    Postgres,
    Ignition,
    Influx,
    PiWebApi,
    Files,
    Json,
}

impl SourceKind {
    const NAMES: [(&str, SourceKind); 6] = [
        ("postgresql", SourceKind::Postgres),
        ("ignition", SourceKind::Ignition),
        ("influxdb", SourceKind::Influx),
        ("pi_web_api", SourceKind::PiWebApi),
        ("files", SourceKind::Files),
        ("json", SourceKind::Json),
    ];

    pub(super) fn named(text: &str) -> Result<Self, String> {
        let entry = Self::NAMES.iter().find(|(name, _)| *name == text);
        entry.map(|(_, kind)| *kind).ok_or_else(|| {
            let names: Vec<&str> = Self::NAMES.iter().map(|(name, _)| *name).collect();
            format!("is one of {}", names.join(", "))
        })
    }

    /// How a sources file names the kind.
    pub(super) fn name(self) -> &'static str {
        let entry = Self::NAMES.iter().find(|(_, kind)| *kind == self);
        entry.map_or("", |(name, _)| name)
    }

    /// The entries of a source of this kind alone.
    pub(super) fn entries(self) -> &'static [&'static str] {
        match self {
            Self::Postgres | Self::Ignition => &["address", "password"],
            Self::Influx => &[
                "url",
                "user",
                "password",
                "token",
                "ca",
                "database",
                "retention",
                "organization",
                "bucket",
            ],
            Self::PiWebApi | Self::Json => &endpoint::ENTRIES,
            Self::Files => &["folder", "rest_s"],
        }
    }

    /// The entries of a series of this kind.
    fn series_entries(self) -> &'static [&'static str] {
        match self {
            Self::Postgres => &[
                "stream",
                "table",
                "time",
                "where",
                "signals",
                "zone",
                "time_unit",
                "quality_scheme",
            ],
            Self::Influx => &[
                "stream",
                "measurement",
                "where",
                "signals",
                "quality_scheme",
            ],
            Self::Files => &["stream", "pattern", "options"],
            Self::Json => &[
                "stream",
                "request",
                "rows",
                "time",
                "time_unit",
                "signals",
                "quality_scheme",
            ],
            Self::Ignition | Self::PiWebApi => {
                &["stream", "tag", "signal", "unit", "interpolation"]
            }
        }
    }

    /// The entry of a signal that says where its values are.
    fn field(self) -> &'static str {
        match self {
            Self::Influx => "field",
            Self::Json => "value",
            _ => "column",
        }
    }
}

/// Takes a series of a source of a kind.
pub(super) fn take(mut table: SourcesTable, kind: SourceKind) -> Option<SourceSeries> {
    let stream = table.required("stream", |table, key| {
        table.parsed(key, |name| match is_stream_name(name) {
            true => Ok(name.to_owned()),
            false => {
                Err("is a name of letters, digits, `.`, `_` and `-`, 100 at the most".to_owned())
            }
        })
    });
    let series = match kind {
        SourceKind::Postgres => of_table(&mut table),
        SourceKind::Influx => of_measurement(&mut table),
        // A history has the codes of Ignition 7 also where a later version writes the history.
        SourceKind::Ignition => of_tag(&mut table, "dataintegrity", "ignition_legacy"),
        SourceKind::PiWebApi => of_tag(&mut table, "Good", "words"),
        SourceKind::Files => of_files(&mut table),
        SourceKind::Json => of_answers(&mut table),
    };
    table.end(kind.series_entries());
    Some(SourceSeries {
        stream: stream?,
        ..series?
    })
}

/// Takes columns of a table.
fn of_table(table: &mut SourcesTable) -> Option<SourceSeries> {
    let name = table.required("table", SourcesTable::text);
    let time = table.required("time", SourcesTable::text);
    let filter = table.texts("where");
    let time_unit = table.parsed("time_unit", time_unit);
    let zone = table.text("zone");
    let (columns, options) = signals(table, SourceKind::Postgres)?;
    Some(SourceSeries {
        table: name?,
        time: time?,
        time_unit,
        zone,
        filter,
        columns,
        options,
        ..SourceSeries::default()
    })
}

/// Takes fields of a measurement.
fn of_measurement(table: &mut SourcesTable) -> Option<SourceSeries> {
    let name = table.required("measurement", SourcesTable::text);
    let filter = table.texts("where");
    let (columns, options) = signals(table, SourceKind::Influx)?;
    Some(SourceSeries {
        table: name?,
        filter,
        columns,
        options,
        ..SourceSeries::default()
    })
}

/// Takes answers by the request for them and their shape.
fn of_answers(table: &mut SourcesTable) -> Option<SourceSeries> {
    let request = table.required("request", |table, key| {
        table.parsed(key, |request| match request.contains("{from") {
            true => Ok(request.to_owned()),
            false => Err(
                "says where the request begins, by `{from}`, `{from_ms}` or their kind".to_owned(),
            ),
        })
    });
    let rows = table.parsed("rows", pointer).unwrap_or_default();
    let time = table.required("time", |table, key| table.parsed(key, pointer));
    let time_unit = table.parsed("time_unit", time_unit);
    let (columns, options) = signals(table, SourceKind::Json)?;
    Some(SourceSeries {
        table: request?,
        time: time?,
        time_unit,
        rows,
        columns,
        options,
        ..SourceSeries::default()
    })
}

/// Takes a tag, whose quality the source says in a column by the codes of a scheme.
fn of_tag(table: &mut SourcesTable, quality: &str, scheme: &str) -> Option<SourceSeries> {
    let tag = table.required("tag", SourcesTable::text);
    let signal = table.required("signal", SourcesTable::text);
    let unit = table.text("unit");
    let interpolation = table.parsed("interpolation", held);
    let scheme = ("quality_scheme", scheme.to_owned());
    let interpolation = interpolation.map(|held| ("interpolation", held));
    Some(SourceSeries {
        table: tag?,
        columns: vec![SourceColumn {
            field: String::new(),
            signal: signal?,
            unit,
            quality: Some(quality.to_owned()),
        }],
        options: interpolation.into_iter().chain([scheme]).collect(),
        ..SourceSeries::default()
    })
}

/// Takes files by a pattern of their names, and the options by which the server reads them.
fn of_files(table: &mut SourcesTable) -> Option<SourceSeries> {
    let pattern = table.required("pattern", SourcesTable::text);
    Some(SourceSeries {
        options: reading(table),
        table: pattern?,
        ..SourceSeries::default()
    })
}

/// The columns of a series, and the options by which the server reads its pages.
type Signals = (Vec<SourceColumn>, BTreeMap<&'static str, String>);

/// Takes the signals of a series by their names.
fn signals(table: &mut SourcesTable, kind: SourceKind) -> Option<Signals> {
    let mut options = BTreeMap::new();
    let scheme = table.parsed("quality_scheme", quality_scheme);
    options.extend(scheme.map(|scheme| ("quality_scheme", scheme)));
    let mut tables = table.required("signals", |table, key| table.table(key, "`signals`"))?;
    let mut columns = Vec::new();
    let mut interpolation = Vec::new();
    for signal in tables.names() {
        let name = format!("the signal `{signal}`");
        let Some(mut entry) = tables.table(&signal, &name) else {
            continue;
        };
        let field = entry.text(kind.field()).unwrap_or_else(|| signal.clone());
        let unit = entry.text("unit");
        let quality = entry.text("quality");
        let held = entry.parsed("interpolation", held);
        interpolation.extend(held.map(|held| format!("{signal}:{held}")));
        entry.end(&[kind.field(), "unit", "quality", "interpolation"]);
        columns.push(SourceColumn {
            field,
            signal,
            unit,
            quality,
        });
    }
    if columns.is_empty() {
        tables.fault("no signal is named");
    }
    if !interpolation.is_empty() {
        options.insert("interpolation", interpolation.join(","));
    }
    Some((columns, options))
}

/// Takes the options by which the server reads files.
fn reading(table: &mut SourcesTable) -> BTreeMap<&'static str, String> {
    let names = || Options::NAMES.into_iter().chain(["time", "layout"]);
    let Some(mut options) = table.table("options", "`options`") else {
        return BTreeMap::new();
    };
    let given = names().filter_map(|name| {
        let understood = |text: &str| match name {
            "layout" => Ok(()),
            _ => Options::default().set(name, text),
        };
        let text = options.parsed(name, |text| understood(text).map(|()| text.to_owned()))?;
        Some((name, text))
    });
    let given = given.collect();
    options.end(&names().collect::<Vec<_>>());
    given
}

/// A place in a document, as a JSON pointer (RFC 6901) names it.
fn pointer(text: &str) -> Result<String, String> {
    match text.is_empty() || text.starts_with('/') {
        true => Ok(text.to_owned()),
        false => Err("is a JSON pointer, such as \"/data/samples\"".to_owned()),
    }
}

fn time_unit(text: &str) -> Result<String, String> {
    match TIME_UNITS.iter().any(|(unit, _)| *unit == text) {
        true => Ok(text.to_owned()),
        false => Err("is `s`, `ms`, `us` or `ns`".to_owned()),
    }
}

fn held(text: &str) -> Result<String, String> {
    match text {
        "hold" | "linear" => Ok(text.to_owned()),
        _ => Err("is `hold` or `linear`".to_owned()),
    }
}

fn quality_scheme(text: &str) -> Result<String, String> {
    let names: Vec<&str> = intake::quality_schemes().collect();
    match names.contains(&text) {
        true => Ok(text.to_owned()),
        false => Err(format!("is one of {}", names.join(", "))),
    }
}
