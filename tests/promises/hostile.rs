//! Bodies that were made to take much memory, of every format that is read.

use std::io::{Cursor, Read, Write};
use std::sync::Arc;

use parquet::basic::{Compression, Encoding, ZstdLevel};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType};
use parquet::file::properties::{WriterProperties, WriterPropertiesBuilder};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::parser::parse_message_type;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// What is to become of a body.
#[derive(Clone, Copy, Debug)]
pub enum Outcome {
    Stored,
    /// A fault of this code is told.
    Refused(&'static str),
    /// Stored or refused.
    Answered,
}

use Outcome::{Answered, Refused, Stored};

/// A body, and what is expected of it.
pub struct Body {
    pub name: &'static str,
    pub media_type: &'static str,
    pub query: &'static str,
    pub is_gzip: bool,
    pub bytes: Vec<u8>,
    /// The bytes that its reader gets, after any content encoding.
    pub size: u64,
    pub outcome: Outcome,
}

impl Body {
    fn new(name: &'static str, media_type: &'static str, bytes: impl Into<Vec<u8>>) -> Self {
        let bytes = bytes.into();
        Self {
            name,
            media_type,
            query: "",
            is_gzip: false,
            size: bytes.len() as u64,
            bytes,
            outcome: Stored,
        }
    }

    fn refused(self, code: &'static str) -> Self {
        Self {
            outcome: Refused(code),
            ..self
        }
    }

    /// Cuts the end off the body or changes some of its bytes: a damaged body may be stored or refused.
    fn damaged(mut self, random: &mut ChaCha8Rng) -> Self {
        let place = random.random_range(0..self.bytes.len());
        if random.random() {
            self.bytes.truncate(place);
        } else {
            let changed = self.bytes[place..].iter_mut();
            for byte in changed.take(random.random_range(1..9)) {
                *byte = random.random();
            }
        }
        if !self.is_gzip {
            self.size = self.bytes.len() as u64;
        }
        Self {
            outcome: Answered,
            ..self
        }
    }
}

/// About the size of whole bodies whose size is free `[bytes]`.
const SIZE: usize = 24 << 20;

const CSV: &str = "text/csv";
const JSON: &str = "application/json";
const TEXT: &str = "text/plain";
const BINARY: &str = "application/octet-stream";

/// A body of each kind, whole.
pub fn whole_bodies() -> Vec<Body> {
    bodies(SIZE)
}

/// Damaged bodies of all kinds in turn without an end, of sizes up to those of whole bodies.
pub fn damaged_bodies() -> impl Iterator<Item = Body> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let round = move || {
        let bodies = bodies(random.random_range(SIZE / 64..SIZE));
        let damaged = bodies.into_iter().map(|body| body.damaged(&mut random));
        damaged.collect::<Vec<_>>()
    };
    std::iter::repeat_with(round).flatten()
}

/// A body of each kind, of about this size where its size is free `[bytes]`.
fn bodies(size: usize) -> Vec<Body> {
    let all = [
        workbooks(size),
        tables(size),
        tags(size),
        documents(size),
        columns(size),
    ];
    all.into_iter().flatten().collect()
}

/// How many there are of what a whole body has so many of, in a body of this size.
fn share(size: usize, count: usize) -> usize {
    (size * count).div_ceil(SIZE)
}

const RELATIONSHIPS: &str = "http://schemas.openxmlformats.org/officeDocument/2006/relationships";

/// A workbook whose sheet and other part are these, beside so many empty parts.
fn workbook(sheet: &[&str], other: Option<(&str, &[&str])>, parts: usize) -> Vec<u8> {
    let relationships = format!(
        "<Relationships><Relationship Id='r1' Type='{RELATIONSHIPS}/worksheet' \
         Target='worksheets/sheet1.xml'/></Relationships>"
    );
    let book = "<workbook><sheets><sheet name='a' sheetId='1' r:id='r1'/></sheets></workbook>";
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let mut add = |name: &str, pieces: &[&str]| {
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        zip.start_file(name, options).expect("a part");
        for piece in pieces {
            zip.write_all(piece.as_bytes()).expect("memory takes it");
        }
    };
    add("xl/_rels/workbook.xml.rels", &[&relationships]);
    add("xl/workbook.xml", &[book]);
    add("xl/worksheets/sheet1.xml", sheet);
    if let Some((name, pieces)) = other {
        add(name, pieces);
    }
    for part in 0..parts {
        add(&format!("{part}"), &[]);
    }
    zip.finish().expect("a workbook").into_inner()
}

const SHEET: &str = "<worksheet><sheetData><row><c t='inlineStr'><is><t>time</t></is></c>\
                     <c t='inlineStr'><is><t>a</t></is></c></row></sheetData></worksheet>";

fn workbooks(size: usize) -> Vec<Body> {
    let piece = "a".repeat(1 << 20);
    let text = vec![piece.as_str(); share(size, 150)];
    let begin = "<worksheet><sheetData><row><c t='inlineStr'><is><t>";
    let end = "</t></is></c></row></sheetData></worksheet>";
    let cell = [&[begin][..], &text, &[end]].concat();
    let comment = [&["<worksheet><!--"][..], &text, &["--></worksheet>"]].concat();
    let strings = "<si><t></t></si>".repeat(10_000);
    let strings = [
        &["<sst>"][..],
        &vec![strings.as_str(); share(size, 500)],
        &["</sst>"],
    ]
    .concat();
    let font = format!(
        "<styleSheet><fonts><font><name val='{}'/></font></fonts><cellXfs>",
        "a".repeat(30_000)
    );
    let formats = "<xf fontId='0'></xf>".repeat(share(size, 20_000));
    let styles = [font.as_str(), &formats, "</cellXfs></styleSheet>"];
    let claim = ["<sst uniqueCount='40000000000'></sst>"];
    let table = "xl/sharedStrings.xml";
    vec![
        Body::new("a long cell", BINARY, workbook(&cell, None, 0)).refused("too_large"),
        Body::new("a long comment", BINARY, workbook(&comment, None, 0)).refused("too_large"),
        Body::new(
            "many shared strings",
            BINARY,
            workbook(&[SHEET], Some((table, &strings)), 0),
        )
        .refused("too_much_memory"),
        Body::new(
            "room for 40 thousand million shared strings",
            BINARY,
            workbook(&[SHEET], Some((table, &claim)), 0),
        )
        .refused("too_much_memory"),
        Body::new(
            "many styles of a long font",
            BINARY,
            workbook(&[SHEET], Some(("xl/styles.xml", &styles)), 0),
        )
        .refused("too_much_memory"),
        Body::new(
            "a workbook of many parts",
            BINARY,
            workbook(&[SHEET], None, share(size, 200_000)),
        )
        .refused("too_large"),
    ]
}

/// A text of a head, of as many repeated pieces as make this size, and of an end.
fn repeated(size: usize, head: &str, piece: &str, end: &str) -> String {
    [head, &piece.repeat(size / piece.len()), end].concat()
}

fn tables(size: usize) -> Vec<Body> {
    let long_rows: String = (0..size / 16)
        .map(|row| format!("{row},{}\n", row % 7))
        .collect();
    vec![
        Body::new(
            "a header of commas",
            CSV,
            repeated(size, "time,a", ",", "\n"),
        )
        .refused("row_too_long"),
        Body::new(
            "fields of a line end",
            CSV,
            repeated(size, "time,a\n0", ",\"\n\"", "\n"),
        )
        .refused("row_too_long"),
        Body::new(
            "a long field",
            CSV,
            repeated(size, "time,a\n0,\"", "a", "\"\n1,2\n"),
        )
        .refused("row_too_long"),
        Body::new(
            "a table of many rows",
            CSV,
            ["time [s],a\n", &long_rows].concat(),
        ),
        gzipped(
            "a table of many rows, gzip",
            ["time [s],a\n", &long_rows].concat(),
        ),
    ]
}

/// A table that is sent compressed.
fn gzipped(name: &'static str, text: String) -> Body {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    zip.start_file("table", options).expect("a part");
    zip.write_all(text.as_bytes()).expect("memory takes it");
    let mut zip = ZipArchive::new(zip.finish().expect("a zip file")).expect("a zip file");
    let mut part = zip.by_index_raw(0).expect("the part");
    let mut packed = vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 255];
    part.read_to_end(&mut packed).expect("memory can be read");
    packed.extend(part.crc32().to_le_bytes());
    packed.extend((text.len() as u32).to_le_bytes());
    Body {
        size: text.len() as u64,
        is_gzip: true,
        ..Body::new(name, CSV, packed)
    }
}

fn tags(size: usize) -> Vec<Body> {
    let names: String = (0..900).map(|k| format!(",s{k}")).collect();
    let influx = format!(
        "#datatype,dateTime:RFC3339{}\n,_time{names}\n",
        ",double".repeat(900)
    );
    let row = format!(",2026-03-02T08:15:00Z{}\n", ",".repeat(900));
    let line = format!("a {} 1465839830100400200\n", ["b=1"; 1000].join(","));
    let mut sparse = "timestamp,tag,value\n".to_owned();
    for tag in 0..900 {
        sparse += &format!("0,s{tag},1\n{},s{tag},2\n", 1000 + tag);
    }
    let dense: String = (0..share(size, 100_000))
        .map(|k| format!("{k}.5,dense,1\n"))
        .collect();
    let classes = ["0", "192", "64", "216"];
    let changing: String = (0..size / 16)
        .map(|k| format!("{k},a,1,{}\n", classes[k % 4]))
        .collect();
    let backwards: String = (0..size / 12)
        .rev()
        .map(|k| format!("{},a,1\n", k * 7 % 2_000_003))
        .collect();
    let union = Body {
        query: "?grid=none&time_unit=s",
        ..Body::new(
            "sparse tags at all instants",
            CSV,
            [&*sparse, &*dense].concat(),
        )
    };
    vec![
        Body::new(
            "rows of commas of 900 tags",
            CSV,
            repeated(size, &influx, &row, ""),
        )
        .refused("too_many_samples"),
        Body::new("lines of 1000 fields", TEXT, repeated(size, "", &line, ""))
            .refused("too_many_samples"),
        Body {
            query: "?time_unit=s",
            ..Body::new("sparse tags on a grid", CSV, [&*sparse, &*dense].concat())
        }
        .refused("too_much_memory"),
        union.refused("too_much_memory"),
        Body {
            query: "?quality_scheme=opc_da&time_unit=s",
            ..Body::new(
                "a quality that changes with each sample",
                CSV,
                ["timestamp,tag,value,quality\n", &changing].concat(),
            )
        }
        .refused("too_much_memory"),
        Body {
            query: "?time_unit=s",
            ..Body::new(
                "samples out of their order",
                CSV,
                ["timestamp,tag,value\n", &backwards].concat(),
            )
        },
    ]
}

fn documents(size: usize) -> Vec<Body> {
    let key = "k".repeat(size);
    vec![
        Body::new("lists in lists", JSON, "[".repeat(size)).refused("not_json"),
        Body::new(
            "a list beside the rows",
            JSON,
            repeated(
                size,
                "{\"columns\":[\"t\",\"a\"],\"index\":[1",
                ",1",
                "],\"data\":[[1,2],[3,4]]}",
            ),
        )
        .refused("too_much_memory"),
        Body::new(
            "texts beside the rows",
            JSON,
            repeated(
                size,
                "{\"columns\":[\"t\",\"a\"],\"index\":[1",
                ",\"\"",
                "],\"data\":[[1,2]]}",
            ),
        )
        .refused("too_much_memory"),
        Body::new(
            "fields of one object",
            JSON,
            repeated(size, "[{\"t\":0", ",\"\":1", "}]"),
        )
        .refused("too_much_memory"),
        Body::new("a long key", JSON, format!("[{{\"t\":0,\"{key}\":1}}]"))
            .refused("name_too_long"),
        Body::new(
            "a long name",
            JSON,
            format!("{{\"sample_time_s\":1,\"signals\":{{\"{key}\":{{\"values\":[1,2]}}}}}}"),
        )
        .refused("name_too_long"),
        Body::new(
            "a long value",
            JSON,
            format!("[{{\"t\":0,\"a\":1}},{{\"t\":1,\"a\":\"{key}\"}}]"),
        )
        .refused("not_a_number"),
        Body::new(
            "a signal of short values",
            JSON,
            repeated(
                size,
                "{\"sample_time_s\":1,\"signals\":{\"a\":{\"values\":[1",
                ",1",
                "]}}}",
            ),
        ),
        Body::new(
            "instants at one time",
            JSON,
            [
                &*repeated(size, "{\"time\":{\"values\":[0", ",1", "]},"),
                &*repeated(size, "\"signals\":{\"a\":{\"values\":[1", ",1", "]}}}"),
            ]
            .concat(),
        ),
    ]
}

/// Files of Parquet.
fn columns(size: usize) -> Vec<Body> {
    let words = |value: usize, rows: usize| {
        let value = ByteArray::from("a".repeat(value).into_bytes());
        vec![value; rows]
    };
    let zstd =
        || WriterProperties::builder().set_compression(Compression::ZSTD(ZstdLevel::default()));
    let whole = |builder: WriterPropertiesBuilder| builder.set_data_page_size_limit(usize::MAX);
    let plain = whole(zstd()).set_dictionary_enabled(false);
    let delta = whole(zstd())
        .set_dictionary_enabled(false)
        .set_column_encoding("a".into(), Encoding::DELTA_BYTE_ARRAY);
    vec![
        Body::new(
            "a dictionary of one long word",
            BINARY,
            parquet_file(&words(1 << 19, share(size, 10_000)), zstd()),
        )
        .refused("no_signals"),
        Body::new(
            "long words that begin alike",
            BINARY,
            parquet_file(&words(1 << 17, share(size, 4000)), delta),
        )
        .refused("no_signals"),
        Body::new(
            "a page of many empty words",
            BINARY,
            parquet_file(&words(0, share(size, 5_000_000)), plain),
        ),
    ]
}

/// A file with a column of numbers and one of words.
fn parquet_file(words: &[ByteArray], properties: WriterPropertiesBuilder) -> Vec<u8> {
    let schema = "message m { required double time; required binary a (UTF8); }";
    let schema = Arc::new(parse_message_type(schema).expect("a schema"));
    let properties = Arc::new(properties.build());
    let mut file = SerializedFileWriter::new(Vec::new(), schema, properties).expect("a file");
    let mut group = file.next_row_group().expect("a row group");
    let times: Vec<f64> = (0..words.len()).map(|k| k as f64).collect();
    let mut column = group.next_column().expect("a column").expect("the first");
    column
        .typed::<DoubleType>()
        .write_batch(&times, None, None)
        .expect("numbers");
    column.close().expect("a whole column");
    let mut column = group.next_column().expect("a column").expect("the second");
    column
        .typed::<ByteArrayType>()
        .write_batch(words, None, None)
        .expect("words");
    column.close().expect("a whole column");
    group.close().expect("a whole row group");
    file.into_inner().expect("a whole file")
}
