//! The formats that are read, by name and by what they look like.

/// How much of a text is looked at to tell what it is `[bytes]`.
pub(super) const HEAD_BYTES: u64 = 64 * 1024;

/// A head up to the end of its last whole line, where it is cut within a line.
pub(super) fn whole_lines(head: &[u8]) -> &[u8] {
    let end = head.iter().rposition(|byte| *byte == b'\n');
    end.map_or(head, |end| &head[..=end])
}

/// How a source is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// This service's own JSON.
    Json,
    /// A column for each signal, a row for each instant; also Senseye's, Ignition's and AVEVA's wide
    /// exports and `pandas.to_csv`.
    WideCsv,
    /// A row for each sample: time, tag, value, quality. Also SQL exports of AVEVA Historian.
    LongCsv,
    /// A column for each signal with a time or a quality of its own beside it.
    PairedCsv,
    /// Simulink Simulation Data Inspector: rows of units and interpolation, several time columns.
    SimulinkCsv,
    /// InfluxDB's annotated CSV.
    InfluxCsv,
    /// InfluxDB's line protocol.
    InfluxLines,
    /// What a query of InfluxDB 1 answers.
    InfluxJson,
    /// PI Web API: recorded values of a stream or of a set of streams.
    PiWebApi,
    /// OSIsoft Message Format, 1.2 and 2.0.
    Omf,
    /// `ProcessValues` of AVEVA's OData service.
    AvevaOdata,
    /// `getTagData2` of Canary's views.
    Canary,
    /// Data values in the JSON of OPC UA Part 6.
    OpcUaJson,
    /// Datapoints of Cognite Data Fusion.
    Cognite,
    /// `pandas.to_json(orient="records")`, with `lines=True` or without: an object for each row, or for each sample.
    PandasRecords,
    /// Any other document with times beside values.
    JsonSeries,
    /// `pandas.to_json(orient="split")`.
    PandasSplit,
    /// `pandas.to_json(orient="table")`.
    PandasTable,
    /// Apache Parquet.
    Parquet,
    /// Apache Arrow IPC and Feather; recognised, not read.
    Arrow,
    /// A workbook of Excel.
    Excel,
}

const NAMES: [(&str, Format); 24] = [
    ("json", Format::Json),
    ("wide_csv", Format::WideCsv),
    ("senseye", Format::WideCsv),
    ("ignition", Format::WideCsv),
    ("long_csv", Format::LongCsv),
    ("aveva_sql", Format::LongCsv),
    ("paired_csv", Format::PairedCsv),
    ("simulink_csv", Format::SimulinkCsv),
    ("influx_csv", Format::InfluxCsv),
    ("influx_line_protocol", Format::InfluxLines),
    ("influx_json", Format::InfluxJson),
    ("pi_web_api", Format::PiWebApi),
    ("omf", Format::Omf),
    ("aveva_odata", Format::AvevaOdata),
    ("canary", Format::Canary),
    ("opc_ua_json", Format::OpcUaJson),
    ("cognite", Format::Cognite),
    ("pandas_records", Format::PandasRecords),
    ("json_series", Format::JsonSeries),
    ("pandas_split", Format::PandasSplit),
    ("pandas_table", Format::PandasTable),
    ("parquet", Format::Parquet),
    ("arrow", Format::Arrow),
    ("excel", Format::Excel),
];

/// What the media type of a body says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MediaKind {
    /// Comma-separated values of some form.
    Csv,
    /// JSON of some form.
    Json,
    /// Text of some form.
    Text,
    /// Bytes of some form.
    Binary,
}

impl MediaKind {
    /// The kind that a media type stands for, given without parameters and in lower case.
    #[must_use]
    pub fn of_media_type(media_type: &str) -> Option<Self> {
        match media_type {
            "text/csv" | "application/csv" | "text/tab-separated-values" => Some(Self::Csv),
            "application/json" | "application/jsonl" | "application/x-ndjson" => Some(Self::Json),
            named if named.ends_with("+json") => Some(Self::Json),
            "text/plain" => Some(Self::Text),
            "application/octet-stream"
            | "application/gzip"
            | "application/x-gzip"
            | "application/vnd.apache.parquet"
            | "application/vnd.apache.arrow.file"
            | "application/vnd.apache.arrow.stream"
            | "application/vnd.ms-excel"
            | "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet" => {
                Some(Self::Binary)
            }
            _ => None,
        }
    }

    /// The media types that are understood, for messages.
    pub const MEDIA_TYPES: &'static str = "text/csv, application/json, text/plain, \
         application/vnd.apache.parquet, \
         application/vnd.openxmlformats-officedocument.spreadsheetml.sheet and \
         application/octet-stream";
}

impl Format {
    /// The format of that name.
    ///
    /// # Errors
    /// A sentence with all names.
    pub fn named(text: &str) -> Result<Self, String> {
        let entry = NAMES.iter().find(|(name, _)| *name == text);
        entry.map(|(_, format)| *format).ok_or_else(|| {
            let names = NAMES.map(|(name, _)| name);
            format!("`{text}` is not one of {}", names.join(", "))
        })
    }

    /// The names of the formats that are read.
    pub fn names() -> impl Iterator<Item = &'static str> {
        let is_read = |(_, format): &(&str, Format)| format.instead().is_none();
        NAMES.into_iter().filter(is_read).map(|(name, _)| name)
    }

    /// The name of the format.
    #[must_use]
    pub fn name(self) -> &'static str {
        let entry = NAMES.iter().find(|(_, format)| *format == self);
        entry.map_or("", |(name, _)| name)
    }

    /// What is read from its bytes rather than from text.
    pub(super) fn of_magic(head: &[u8]) -> Option<Self> {
        const MAGIC: [(&[u8], Format); 4] = [
            (b"PAR1", Format::Parquet),
            (b"ARROW1", Format::Arrow),
            (b"PK\x03\x04", Format::Excel),
            (b"\xD0\xCF\x11\xE0", Format::Excel),
        ];
        let entry = MAGIC.iter().find(|(magic, _)| head.starts_with(magic));
        entry.map(|(_, format)| *format)
    }

    /// What to send instead of a format that is known and not read.
    pub(super) fn instead(self) -> Option<&'static str> {
        match self {
            Self::Arrow => Some(
                "this is Apache Arrow (Feather): recognised, and not read here; send Parquet or CSV",
            ),
            Self::Excel if !cfg!(feature = "excel") => Some(
                "this is a workbook of Excel, and this program was built without `excel`; send CSV",
            ),
            Self::Parquet if !cfg!(feature = "parquet") => Some(
                "this is Apache Parquet, and this program was built without `parquet`; send CSV",
            ),
            _ => None,
        }
    }

    /// Options that would do nothing for this format.
    pub(super) fn without(self) -> Vec<&'static str> {
        let columns = ["tag", "value", "quality"];
        let table: &[&str] = match self {
            Self::LongCsv => &[],
            Self::PandasRecords | Self::JsonSeries => &["header_row", "unit_row"],
            Self::Cognite => &["header_row", "unit_row", "tag", "quality"],
            Self::WideCsv | Self::PairedCsv => &columns,
            _ => &["header_row", "unit_row", "tag", "value", "quality"],
        };
        // An object on each line is a line of text; other documents have none to leave out.
        let is_document = self == Self::Json || self.is_json();
        let has_lines = matches!(self, Self::PandasRecords | Self::JsonSeries);
        let lines: &[&str] = match is_document && !has_lines {
            true => &["skip"],
            false => &[],
        };
        [self.without_of_all(), table, lines].concat()
    }

    /// Options that would do nothing for this format, but for those about the layout of a table.
    fn without_of_all(self) -> &'static [&'static str] {
        match self {
            Self::Json => &[
                "time",
                "tz",
                "time_unit",
                "decimal",
                "missing",
                "ignore",
                "units",
                "rename",
                "quality_scheme",
                "interpolation",
                "grid",
            ],
            Self::WideCsv => &["quality_scheme", "grid"],
            Self::SimulinkCsv | Self::InfluxCsv | Self::PiWebApi => &["time", "quality_scheme"],
            Self::PandasRecords | Self::JsonSeries | Self::LongCsv => &[],
            Self::PandasSplit | Self::PandasTable | Self::InfluxJson => &["quality_scheme"],
            _ => &["time"],
        }
    }

    /// Whether the text is rows of fields.
    pub(super) fn is_table(self) -> bool {
        matches!(
            self,
            Self::WideCsv | Self::LongCsv | Self::PairedCsv | Self::SimulinkCsv | Self::InfluxCsv
        )
    }

    /// Whether samples are held in memory until the end of the text; a limit is set to them.
    pub(super) fn is_json(self) -> bool {
        matches!(
            self,
            Self::InfluxJson
                | Self::PiWebApi
                | Self::Omf
                | Self::AvevaOdata
                | Self::Canary
                | Self::OpcUaJson
                | Self::Cognite
                | Self::PandasRecords
                | Self::JsonSeries
                | Self::PandasSplit
                | Self::PandasTable
        )
    }
}
