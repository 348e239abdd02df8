//! Tables whose layout options say.

use super::{read, values};
use crate::intake::{self, ColumnRole, Layout, MediaKind, Options};
use std::fmt::Write as _;

fn with(pairs: &[(&str, &str)]) -> Options {
    let mut options = Options::default();
    for (option, text) in pairs {
        options.set(option, text).unwrap();
    }
    options
}

fn faults(text: &str, options: &[(&str, &str)]) -> Vec<(String, Option<String>)> {
    let error = read(text.as_bytes(), &with(options)).unwrap_err();
    let faults = error.faults().iter();
    faults
        .map(|fault| {
            (
                fault.code.to_string(),
                fault.parameter.clone().map(String::from),
            )
        })
        .collect()
}

#[test]
fn titles_that_are_in_doubt_are_asked_for_and_said_by_their_line() {
    let text = "Tag 1;Tag 2;Tag 3\nZeit;Druck;Ventil\n0;1;2\n1;1.5;3\n2;2.5;4\n";
    let asked = ("titles_unclear".to_owned(), Some("header_row".to_owned()));
    assert_eq!(faults(text, &[]), [asked]);
    let recording = read(text.as_bytes(), &with(&[("header_row", "2")])).unwrap();
    assert_eq!(values(&recording, "Druck"), [1.0, 1.5, 2.5]);
    assert_eq!(recording.source.options["header_row"], "2");
    let recording = read(text.as_bytes(), &with(&[("header_row", "1")]));
    // The unit of a time that is called `Tag 1` is then asked for.
    assert!(recording.is_err());
    let beyond = ("unknown_line".to_owned(), Some("header_row".to_owned()));
    assert_eq!(faults(text, &[("header_row", "99")]), [beyond]);
}

#[test]
fn columns_without_titles_are_called_by_their_numbers_where_options_say_so() {
    let text = "0,1,2\n1,1.5,3\n2,2.5,4\n";
    let asked = ("no_header".to_owned(), Some("header_row".to_owned()));
    assert_eq!(faults(text, &[]), [asked]);
    let options = [
        ("header_row", "none"),
        ("time_unit", "s"),
        ("units", "column_2:bar"),
        ("rename", "column_3:valve"),
    ];
    for above in ["", "# logger 7\n", "Report of hall 2\n\n"] {
        let recording = read([above, text].concat().as_bytes(), &with(&options)).unwrap();
        assert_eq!(values(&recording, "column_2"), [1e5, 1.5e5, 2.5e5]);
        assert_eq!(values(&recording, "valve"), [2.0, 3.0, 4.0]);
        let mut codes = recording.notes.iter().map(|note| &note.code);
        assert!(codes.any(|code| code == "no_titles"));
    }
    let units = ["ms,bar,1\n", text].concat();
    let recording = read(units.as_bytes(), &with(&[("header_row", "none")])).unwrap();
    assert_eq!(values(&recording, "column_2"), [1e5, 1.5e5, 2.5e5]);
    assert_eq!(recording.time.duration(), 0.002);
    let rows = (0..6).map(|k| format!("{k},A,{k}.5\n{k},B,1\n"));
    let options = [
        ("header_row", "none"),
        ("time_unit", "s"),
        ("tag", "column_2"),
        ("value", "column_3"),
    ];
    let recording = read(rows.collect::<String>().as_bytes(), &with(&options)).unwrap();
    assert_eq!(values(&recording, "A"), [0.5, 1.5, 2.5, 3.5, 4.5, 5.5]);
}

#[test]
fn a_row_of_units_is_where_options_say_or_nowhere() {
    let above = "s,bar,1\nt,p,u\n0,1,0\n1,2,0\n2,3,1\n";
    let recording = read(above.as_bytes(), &with(&[("unit_row", "1")])).unwrap();
    assert_eq!(values(&recording, "p"), [1e5, 2e5, 3e5]);
    // Columns that are called as units are.
    let named = "time,A,V\nx,y,z\n0,1,2\n1,2,2\n2,3,2\n";
    assert_eq!(faults(named, &[])[0].0, "time_unit_needed");
    let options = with(&[
        ("header_row", "2"),
        ("unit_row", "none"),
        ("time_unit", "s"),
    ]);
    let recording = read(named.as_bytes(), &options).unwrap();
    assert_eq!(recording.signal("y").unwrap().unit, "");
    assert_eq!(values(&recording, "z"), [2.0; 3]);
}

#[test]
fn rows_of_one_time_that_differ_by_a_word_are_signals_of_what_the_word_names() {
    let mut text = "time [s],machine,p [bar],T\n".to_owned();
    for k in 0..6 {
        writeln!(text, "{k},A,{k}.5,20\n{k},B,{k},21").unwrap();
    }
    assert_eq!(
        faults(&text, &[]),
        [("layout_unclear".to_owned(), Some("tag".to_owned()))]
    );
    let recording = read(text.as_bytes(), &with(&[("tag", "machine")])).unwrap();
    let names: Vec<&str> = recording.signals.iter().map(|s| s.name.as_str()).collect();
    assert_eq!(names, ["A.p", "A.T", "B.p", "B.T"]);
    assert_eq!(
        values(&recording, "A.p"),
        [0.5e5, 1.5e5, 2.5e5, 3.5e5, 4.5e5, 5.5e5]
    );
    assert_eq!(values(&recording, "B.T"), [21.0; 6]);
    let options = with(&[("tag", "machine"), ("value", "p"), ("units", "A:bar,B:bar")]);
    let recording = read(text.as_bytes(), &options).unwrap();
    assert_eq!(values(&recording, "B")[2], 2e5);
}

#[test]
fn columns_of_a_list_of_samples_are_called_what_options_say() {
    let mut text = "geschrieben,Ort,Wert 1,Gte\n".to_owned();
    for k in 0..6 {
        let time = format!("2026-01-01T00:00:0{k}Z");
        writeln!(text, "{time},A,{k},192\n{time},B,9,0").unwrap();
    }
    let options = with(&[
        ("tag", "Ort"),
        ("value", "Wert 1"),
        ("quality", "Gte"),
        ("quality_scheme", "opc_da"),
    ]);
    let recording = read(text.as_bytes(), &options).unwrap();
    assert_eq!(
        values(&recording, "A"),
        [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
        "{:?}",
        recording.signals
    );
    assert_eq!(recording.signal("B").unwrap().missing(), 6);
    let without_quality = with(&[("tag", "Ort"), ("value", "Wert 1"), ("quality", "none")]);
    let whole = read(text.replace("Gte", "Quality").as_bytes(), &without_quality).unwrap();
    assert_eq!(whole.signal("B").unwrap().missing(), 0);
    for (option, title) in [("tag", "Orte"), ("value", "Wert"), ("quality", "Güte")] {
        let columns = [("tag", "Ort"), ("value", "Wert 1"), ("quality", "Gte")];
        let columns =
            columns.map(|(name, column)| (name, if name == option { title } else { column }));
        let unknown = ("unknown_column".to_owned(), Some(option.to_owned()));
        assert_eq!(faults(&text, &columns), [unknown]);
    }
    let columns = [("tag", "geschrieben"), ("value", "Wert 1")];
    let both = ("columns_missing".to_owned(), Some("time".to_owned()));
    assert_eq!(faults(&text, &columns), [both]);
}

#[test]
fn options_about_a_table_are_refused_where_there_is_none() {
    let text = "time [s],p\n0,1\n1,2\n2,3\n";
    let useless = ("invalid_parameter".to_owned(), Some("quality".to_owned()));
    assert_eq!(faults(text, &[("quality", "p")]), [useless]);
    for (option, text) in [
        ("header_row", "0"),
        ("unit_row", "last"),
        ("header_row", "two"),
    ] {
        assert!(Options::default().set(option, text).is_err(), "{option}");
    }
}

fn shown(text: &str, options: &[(&str, &str)]) -> Layout {
    intake::layout(text.as_bytes(), MediaKind::Csv, &with(options)).unwrap()
}

fn roles(layout: &Layout) -> Vec<ColumnRole> {
    layout.columns.iter().map(|column| column.role).collect()
}

#[test]
fn the_first_rows_are_shown_with_what_they_are_taken_for() {
    use ColumnRole::{LeftOut, Signal, Time};
    let mut text = "# logger 7\n# hall 2\nNr,Date,Time,p,T [degC]\n,,,bar,\n".to_owned();
    for k in 0..60 {
        writeln!(text, "{k},2026-01-02,10:00:{k:02},{k},20").unwrap();
    }
    let layout = shown(&text, &[("tz", "UTC"), ("ignore", "T")]);
    assert_eq!((layout.format, layout.delimiter), ("wide_csv", Some(',')));
    let rows = (layout.header_row, layout.unit_row, layout.first_row);
    assert_eq!(rows, (Some(3), Some(4), Some(5)));
    assert_eq!(roles(&layout), [LeftOut, Time, Time, Signal, LeftOut]);
    let units: Vec<&str> = layout
        .columns
        .iter()
        .map(|column| column.unit.as_str())
        .collect();
    assert_eq!(units, ["", "", "", "bar", "degC"]);
    assert_eq!(layout.rows.len(), 30);
    let first = &layout.rows[0];
    assert_eq!(
        (first.line, &first.fields[..]),
        (1, &["# logger 7".to_owned()][..])
    );
    let codes: Vec<&str> = layout
        .warnings
        .iter()
        .map(|warning| warning.code.as_str())
        .collect();
    assert!(
        codes.contains(&"row_of_units") && layout.faults.is_empty(),
        "{codes:?}"
    );
}

#[test]
fn a_layout_that_is_asked_for_is_shown_as_options_say() {
    use ColumnRole::{Tag, Time, Value};
    let rows = (0..8).flat_map(|k| ["A", "B"].map(|unit| format!("{k},{unit},{k}.5,3\n")));
    let text = format!("time [s],machine,p,T\n{}", rows.collect::<String>());
    let unclear = shown(&text, &[]);
    assert_eq!(
        (unclear.format, &*unclear.faults[0].code),
        ("wide_csv", "layout_unclear")
    );
    assert_eq!(unclear.faults[0].parameter.as_deref(), Some("tag"));
    let told = shown(&text, &[("tag", "machine")]);
    assert_eq!((told.format, &told.faults[..]), ("long_csv", &[][..]));
    assert_eq!(roles(&told), [Time, Tag, Value, Value]);
    let untitled = shown(
        "0,1\n1,2\n2,4\n",
        &[("header_row", "none"), ("time_unit", "s")],
    );
    assert_eq!((untitled.header_row, untitled.first_row), (None, Some(1)));
    assert_eq!(untitled.columns[1].title, "column_2");
    assert_eq!(untitled.faults, []);
}

#[test]
fn a_long_text_is_judged_by_its_whole_lines_and_a_text_without_a_table_by_its_format() {
    let mut text = "time [s];p\r\n".to_owned();
    for k in 0..20_000 {
        write!(text, "{k};{k},5\r\n").unwrap();
    }
    let layout = shown(&text, &[]);
    assert_eq!((layout.delimiter, &layout.faults[..]), (Some(';'), &[][..]));
    let json = intake::layout(&b"{\"signals\": []}"[..], MediaKind::Json, &with(&[])).unwrap();
    assert_eq!((json.format, json.columns.len()), ("json", 0));
    let workbook = intake::layout(&b"PK\x03\x04"[..], MediaKind::Binary, &with(&[]));
    assert!(workbook.is_err());
}
