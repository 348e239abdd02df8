//! The layouts of files that are no text, as people see them before they upload.

use greybox_recording::intake::{self, ColumnRole, Layout, MediaKind, Options, ReadError};
use std::path::Path;

fn shown(file: &str, options: &[(&str, &str)]) -> Result<Layout, ReadError> {
    let payloads = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/payloads");
    let mut reading = Options::default();
    for (option, text) in options {
        reading.set(option, text).unwrap();
    }
    let file = std::fs::File::open(payloads.join(file)).unwrap();
    intake::layout(file, MediaKind::Binary, &reading)
}

fn columns(layout: &Layout) -> Vec<(&str, &str, ColumnRole)> {
    let columns = layout.columns.iter();
    columns
        .map(|column| (column.name.as_str(), column.unit.as_str(), column.role))
        .collect()
}

#[test]
fn a_workbook_shows_its_rows_and_its_sheets() {
    let layout = shown("excel/typical.xlsx", &[]).unwrap();
    assert_eq!((layout.file, layout.format), (Some("excel"), "wide_csv"));
    assert_eq!(layout.sheet.as_deref(), Some("Messung 1"));
    assert_eq!(layout.sheets, ["Messung 1", "Info"]);
    let rows = (layout.header_row, layout.unit_row, layout.first_row);
    assert_eq!(rows, (Some(3), None, Some(4)));
    let expected = [
        ("Zeit", "s", ColumnRole::Time),
        ("Ventil", "V", ColumnRole::Signal),
        ("Druck, Kolben", "bar", ColumnRole::Signal),
        ("Bemerkung", "", ColumnRole::Signal),
    ];
    assert_eq!(columns(&layout), expected);
    assert_eq!(layout.rows[1].fields[..3], ["0.0", "0.0", "1.5"]);
    let warnings = layout.warnings.iter();
    assert!(
        warnings
            .clone()
            .any(|warning| warning.code == "other_sheets")
    );
}

#[test]
fn rows_of_a_workbook_are_said_to_be_otherwise() {
    let options = [("sheet", "samples"), ("quality", "none"), ("tz", "UTC")];
    let layout = shown("excel/nasty.xlsx", &options).unwrap();
    assert_eq!(layout.format, "long_csv");
    let roles: Vec<ColumnRole> = layout.columns.iter().map(|column| column.role).collect();
    let expected = [
        ColumnRole::Time,
        ColumnRole::Tag,
        ColumnRole::Value,
        ColumnRole::LeftOut,
    ];
    assert_eq!(roles, expected);
    let cover = shown("excel/nasty.xlsx", &[]).unwrap();
    assert_eq!(cover.sheet.as_deref(), Some("cover"));
    assert!(!cover.faults.is_empty());
    let missing = shown("excel/nasty.xlsx", &[("sheet", "sums")]).unwrap_err();
    assert_eq!(missing.faults()[0].parameter.as_deref(), Some("sheet"));
}

#[test]
fn a_parquet_file_shows_its_columns_with_the_units_of_its_schema() {
    let layout = shown("parquet/nasty_arrow_schema.parquet", &[]).unwrap();
    assert_eq!((layout.file, layout.format), (Some("parquet"), "wide_csv"));
    let expected = [
        ("elapsed", "s", ColumnRole::Time),
        ("PT101", "bar", ColumnRole::Signal),
        ("speed", "1/min", ColumnRole::Signal),
        ("lag", "s", ColumnRole::Signal),
    ];
    assert_eq!(columns(&layout), expected);
    assert_eq!(layout.rows[1].fields, ["0", "1.0", "60.0", "0.001"]);
    assert_eq!(layout.faults, []);
}

#[test]
fn lines_are_left_out_of_any_table_and_shown() {
    let text = "t [s],p [bar]\n0,1\n1,broken line\nt [s],p [bar]\n2,2\n3,3\nsum,5,1,1\n4,4\n";
    let options = |lines: &str| {
        let mut options = Options::default();
        options.set("skip", lines).unwrap();
        options
    };
    let recording = |lines| intake::read(text.as_bytes(), MediaKind::Csv, &options(lines));
    let refused = recording("3").unwrap_err();
    assert_eq!(refused.faults()[0].code, "ragged_row");
    let read = recording("3,7-7").unwrap();
    assert_eq!(read.signals[0].values, [1e5, 2e5, 3e5, 4e5]);
    let cut = recording("3,7-").unwrap();
    assert_eq!(cut.signals[0].values, [1e5, 2e5, 3e5]);
    let layout = intake::layout(text.as_bytes(), MediaKind::Csv, &options("3,7-")).unwrap();
    assert_eq!(layout.rows[2].fields, ["1", "broken line"]);
    assert_eq!(layout.faults, []);
    let workbook = shown("excel/typical.xlsx", &[("skip", "4")]).unwrap();
    assert_eq!(workbook.first_row, Some(5));
}
