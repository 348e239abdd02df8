//! One source, written in every format, is one recording.

use greybox_recording::Recording;
use greybox_recording::intake::{self, MediaKind, Options};
use jiff::{SignedDuration, Timestamp};
use parquet::data_type::{DoubleType, Int64Type};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use proptest::prelude::*;
use serde_json::{Value, json};
use std::io::{Cursor, Write};
use std::sync::Arc;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Two signals at common instants, in milliseconds from the start.
#[derive(Debug)]
struct Source {
    instants: Vec<i64>,
    a: Vec<f64>,
    b: Vec<f64>,
}

const START: &str = "2026-03-02T08:15:00Z";

impl Source {
    fn stamps(&self) -> Vec<Timestamp> {
        let start: Timestamp = START.parse().unwrap();
        let stamp = |ms: &i64| start.checked_add(SignedDuration::from_millis(*ms)).unwrap();
        self.instants.iter().map(stamp).collect()
    }

    fn samples(&self) -> impl Iterator<Item = (Timestamp, f64, f64)> {
        let values = self.a.iter().zip(&self.b);
        let stamps = self.stamps().into_iter();
        stamps.zip(values).map(|(stamp, (a, b))| (stamp, *a, *b))
    }

    fn wide(&self) -> String {
        let rows = self.samples().map(|(t, a, b)| format!("{t},{a:?},{b:?}\n"));
        std::iter::once("time,a,b\n".to_owned())
            .chain(rows)
            .collect()
    }

    fn long(&self) -> String {
        let rows = self
            .samples()
            .map(|(t, a, b)| format!("{t},a,{a:?}\n{t},b,{b:?}\n"));
        let header = "timestamp,tag,value\n".to_owned();
        std::iter::once(header).chain(rows).collect()
    }

    fn lines(&self) -> String {
        let line = |(t, a, b): (Timestamp, f64, f64)| {
            format!("rig a={a:?},b={b:?} {}\n", t.as_nanosecond())
        };
        self.samples().map(line).collect()
    }

    /// A list of records for each of the signals.
    fn records(&self, record: impl Fn(Timestamp, f64) -> Value) -> [Vec<Value>; 2] {
        let of_a = self.samples().map(|(t, a, _)| record(t, a)).collect();
        let of_b = self.samples().map(|(t, _, b)| record(t, b)).collect();
        [of_a, of_b]
    }

    fn historians(&self) -> Vec<(&'static str, Value)> {
        let [a, b] = self.records(|t, v| json!({"Timestamp": t, "Value": v, "Good": true}));
        let pi = json!({"Items": [{"Name": "a", "Items": a}, {"Name": "b", "Items": b}]});
        let [a, b] = self.records(|t, v| json!({"timestamp": t, "value": v}));
        let omf = json!([{"containerid": "a", "values": a}, {"containerid": "b", "values": b}]);
        let [a, b] = self.records(|t, v| json!({"t": t, "v": v, "q": 192}));
        let canary = json!({"statusCode": "Good", "data": {"a": a, "b": b}});
        let [a, b] = self.records(|t, v| json!({"Value": v, "SourceTimestamp": t}));
        let opc_ua = json!({"a": a, "b": b});
        let [a, b] = self.records(|t, v| json!({"timestamp": t.as_millisecond(), "value": v}));
        let cognite = json!({"items": [{"externalId": "a", "datapoints": a},
                                       {"externalId": "b", "datapoints": b}]});
        let frame: Vec<Value> = self
            .samples()
            .map(|(t, a, b)| json!({"timestamp": t.as_millisecond(), "a": a, "b": b}))
            .collect();
        vec![
            ("pi_web_api", pi),
            ("omf", omf),
            ("canary", canary),
            ("opc_ua_json", opc_ua),
            ("cognite", cognite),
            ("pandas_records", json!(frame)),
        ]
    }
}

/// Apache Parquet with a column for each signal.
fn parquet(source: &Source) -> Vec<u8> {
    let schema = parse_message_type(
        "message recording {
            required double a;
            required int64 time (TIMESTAMP(MILLIS, true));
            optional double b;
        }",
    );
    let mut bytes = Vec::new();
    let properties = Arc::default();
    let mut file =
        SerializedFileWriter::new(&mut bytes, Arc::new(schema.unwrap()), properties).unwrap();
    let mut group = file.next_row_group().unwrap();
    let times: Vec<i64> = source.stamps().iter().map(|t| t.as_millisecond()).collect();
    let mut column = group.next_column().unwrap().unwrap();
    let written = column
        .typed::<DoubleType>()
        .write_batch(&source.a, None, None);
    assert_eq!(written.unwrap(), source.a.len());
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    column
        .typed::<Int64Type>()
        .write_batch(&times, None, None)
        .unwrap();
    column.close().unwrap();
    let mut column = group.next_column().unwrap().unwrap();
    let levels = vec![1; source.b.len()];
    let b = column.typed::<DoubleType>();
    b.write_batch(&source.b, Some(&levels), None).unwrap();
    column.close().unwrap();
    group.close().unwrap();
    file.close().unwrap();
    bytes
}

/// The parts of a workbook that do not depend on what is in its sheet.
const WORKBOOK: [(&str, &str); 4] = [
    (
        "[Content_Types].xml",
        r#"<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">
        <Default Extension="rels" ContentType="application/vnd.openxmlformats-package.relationships+xml"/>
        <Default Extension="xml" ContentType="application/xml"/></Types>"#,
    ),
    (
        "_rels/.rels",
        r#"<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
        <Relationship Id="r1" Target="xl/workbook.xml"
        Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/officeDocument"/>
        </Relationships>"#,
    ),
    (
        "xl/workbook.xml",
        r#"<workbook xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"
        xmlns:r="http://schemas.openxmlformats.org/officeDocument/2006/relationships">
        <sheets><sheet name="Data" sheetId="1" r:id="r1"/></sheets></workbook>"#,
    ),
    (
        "xl/_rels/workbook.xml.rels",
        r#"<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">
        <Relationship Id="r1" Target="worksheets/sheet1.xml"
        Type="http://schemas.openxmlformats.org/officeDocument/2006/relationships/worksheet"/>
        </Relationships>"#,
    ),
];

/// A workbook of Excel with a column for each signal.
fn workbook(source: &Source) -> Vec<u8> {
    let text = |text: &str| format!(r#"<c t="inlineStr"><is><t>{text}</t></is></c>"#);
    let header: String = ["time", "a", "b"].map(text).concat();
    let rows = source.samples().map(|(t, a, b)| {
        let time = text(&t.to_string());
        format!("<row>{time}<c><v>{a:?}</v></c><c><v>{b:?}</v></c></row>")
    });
    let rows: String = rows.collect();
    workbook_of(&format!("<row>{header}</row>{rows}"))
}

/// A workbook of Excel with these rows.
fn workbook_of(rows: &str) -> Vec<u8> {
    let sheet = format!(
        r#"<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main">
        <sheetData>{rows}</sheetData></worksheet>"#
    );
    let mut file = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, part) in WORKBOOK
        .into_iter()
        .chain([("xl/worksheets/sheet1.xml", &*sheet)])
    {
        let options = SimpleFileOptions::default();
        file.start_file(name, options).unwrap();
        file.write_all(part.as_bytes()).unwrap();
    }
    file.finish().unwrap().into_inner()
}

#[test]
fn a_sheet_may_have_lines_above_its_titles_and_end_its_rows_early() {
    let row = |row: &[&str]| {
        let cells = row.iter().map(|cell| match cell.parse::<f64>() {
            Ok(number) => format!("<c><v>{number}</v></c>"),
            Err(_) => format!(r#"<c t="inlineStr"><is><t>{cell}</t></is></c>"#),
        });
        format!("<row>{}</row>", cells.collect::<String>())
    };
    let titles = row(&["Rig 4"]) + &row(&["Time", "a", "b"]) + &row(&["s", "bar", "degC"]);
    let rows = row(&["0", "1", "20"]) + &row(&["1", "2"]) + &row(&["2", "3", "22"]);
    let bytes = workbook_of(&(titles + &rows));
    let recording = intake::read(&bytes[..], MediaKind::Binary, &Options::default()).unwrap();
    assert_eq!(recording.signal("a").unwrap().values, [1e5, 2e5, 3e5]);
    assert!(recording.signal("b").unwrap().values[1].is_nan());
}

#[test]
fn dates_and_times_of_a_sheet_are_one_time() {
    let text = "Date,Time,a\n2026-03-02T00:00:00.000,29700,1\n2026-03-02T00:00:00.000,29700.25,2\n\
                2026-03-02T00:00:00.000,29700.5,3\n";
    let mut options = Options::default();
    options.set("tz", "UTC").unwrap();
    let recording = intake::read(text.as_bytes(), MediaKind::Csv, &options).unwrap();
    assert_eq!(
        recording.start,
        Some("2026-03-02T08:15:00Z".parse().unwrap())
    );
    assert_eq!(recording.time.sample_time(), 0.25);
}

fn read(text: &str, kind: MediaKind) -> Recording {
    intake::read(text.as_bytes(), kind, &Options::default())
        .unwrap_or_else(|error| panic!("{error}:\n{text}"))
}

fn source() -> impl Strategy<Value = Source> {
    let sample = (1_i64..5000, -1e6..1e6, -1e-3..1e-3);
    prop::collection::vec(sample, 2..40).prop_map(|samples| {
        let mut instant = 0;
        let mut source = Source {
            instants: Vec::new(),
            a: Vec::new(),
            b: Vec::new(),
        };
        for (interval, a, b) in samples {
            source.instants.push(instant);
            source.a.push(a);
            source.b.push(b);
            instant += interval;
        }
        source
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn a_source_is_the_same_recording_in_every_format(source in source()) {
        let wide = read(&source.wide(), MediaKind::Csv);
        prop_assert_eq!(wide.start, Some(START.parse().unwrap()));
        let mut others = vec![
            ("long_csv", read(&source.long(), MediaKind::Csv)),
            ("influx_line_protocol", read(&source.lines(), MediaKind::Text)),
        ];
        for (format, bytes) in [("parquet", parquet(&source)), ("excel", workbook(&source))] {
            let read = intake::read(&bytes[..], MediaKind::Binary, &Options::default());
            others.push((format, read.unwrap_or_else(|error| panic!("{format}: {error}"))));
        }
        for (format, document) in source.historians() {
            others.push((format, read(&document.to_string(), MediaKind::Json)));
        }
        for (format, other) in others {
            prop_assert_eq!(&other.source.format, format);
            prop_assert_eq!(other.start, wide.start, "{}", format);
            prop_assert_eq!(&other.time, &wide.time, "{}", format);
            for (own, wide) in other.signals.iter().zip(&wide.signals) {
                prop_assert_eq!(&own.name, &wide.name);
                prop_assert_eq!(&own.values, &wide.values, "{}", format);
            }
        }
    }
}
