//! Whole texts, as plants and spreadsheets write them.

mod heads;
mod layouts;
mod sentinels;
mod spellings;
mod told_layouts;
mod untidy;

use crate::intake::{self, MediaKind, Options, ReadError};
use crate::{Recording, TimeAxis};
use proptest::prelude::*;
use std::io::{self, Read};

fn read(source: impl Read, options: &Options) -> Result<Recording, ReadError> {
    intake::read(source, MediaKind::Csv, options)
}

fn parse(text: &str) -> Result<Recording, ReadError> {
    read(text.as_bytes(), &Options::default())
}

fn codes(text: &str) -> Vec<String> {
    parse(text)
        .unwrap_err()
        .faults()
        .iter()
        .map(|fault| fault.code.to_string())
        .collect()
}

fn values(recording: &Recording, name: &str) -> Vec<f64> {
    recording.signal(name).unwrap().values.clone()
}

#[test]
fn columns_become_signals_in_si_over_a_uniform_time() {
    let text = "time [s],reference [m],position [mm]\n0,0.03,0\n0.01,0.03,1.5\n0.02,0.03,2\n";
    let recording = parse(text).unwrap();
    assert_eq!(
        recording.time,
        TimeAxis::Uniform {
            sample_time: 0.01,
            samples: 3
        }
    );
    assert_eq!(values(&recording, "position"), [0.0, 0.0015, 0.002]);
    let position = recording.signal("position").unwrap();
    assert_eq!(
        (position.unit.as_str(), position.recorded_unit.as_str()),
        ("m", "mm")
    );
    assert!(recording.notes.is_empty());
}

#[test]
fn empty_and_nan_fields_are_missing_samples() {
    let recording = parse("t,a,b\n0,1,NaN\n1,,nan\n2, ,3\n").unwrap();
    assert_eq!(recording.signal("a").unwrap().missing(), 2);
    assert_eq!(recording.signal("b").unwrap().missing(), 2);
}

#[test]
fn a_spreadsheet_export_with_bom_semicolons_and_crlf_is_read() {
    let recording = parse("\u{feff}time [ms];p [bar]\r\n0;1\r\n10;2\r\n20;3\r\n\r\n\r\n").unwrap();
    assert_eq!(
        recording.time,
        TimeAxis::Uniform {
            sample_time: 0.01,
            samples: 3
        }
    );
    assert_eq!(values(&recording, "p"), [1e5, 2e5, 3e5]);
    assert_eq!(recording.signals[0].name, "p");
}

#[test]
fn empty_rows_and_commas_at_the_line_ends_are_skipped() {
    let recording = parse("time [s],a,b,\n0,1,2,\n,,,\n1,3,4,\n\n2,5,6\n").unwrap();
    assert_eq!(values(&recording, "b"), [2.0, 4.0, 6.0]);
    assert_eq!(recording.notes[0].code, "empty_rows");
}

#[test]
fn another_time_column_can_be_named() {
    let options = Options {
        time: Some("t".to_owned()),
        name: Some("run 3".to_owned()),
        ..Options::default()
    };
    let recording = read("a,t [s],b\n1,0,2\n3,1,4\n".as_bytes(), &options).unwrap();
    let names: Vec<&str> = recording
        .signals
        .iter()
        .map(|signal| signal.name.as_str())
        .collect();
    assert_eq!(names, ["a", "b"]);
    assert_eq!(recording.name.as_deref(), Some("run 3"));
    let error = read("a,b\n1,2\n".as_bytes(), &options).unwrap_err();
    assert_eq!(error.faults()[0].code, "no_time_column");
}

#[test]
fn timestamps_give_the_start_and_the_sample_time() {
    let text = "time,a\n2026-03-02T08:15:00Z,1\n2026-03-02T08:15:00.5Z,2\n2026-03-02T08:15:01Z,3\n";
    let recording = parse(text).unwrap();
    assert_eq!(
        recording.start,
        Some("2026-03-02T08:15:00Z".parse().unwrap())
    );
    assert_eq!(recording.time.sample_time(), 0.5);
}

#[test]
fn a_file_of_dates_only_is_refused_for_want_of_an_offset() {
    assert_eq!(
        codes("date,a\n2026-03-02,1\n2026-03-03,2\n"),
        ["no_offset", "no_offset"]
    );
}

#[test]
fn a_fault_names_line_column_and_text() {
    let error = parse("time [s],position [mm]\n0,1\n1,1..2\n2,stuck\n").unwrap_err();
    assert!(matches!(error, ReadError::Invalid(_)));
    let fault = &error.faults()[0];
    assert_eq!(
        (fault.line, fault.column.as_deref()),
        (Some(3), Some("position"))
    );
    assert_eq!(
        &*fault.detail,
        "line 3, column `position`: `1..2` is not a number"
    );
    let word = "line 4, column `position`: `stuck` is not a number; where it stands for a missing sample, say missing=stuck";
    assert_eq!(&*error.faults()[1].detail, word);
    assert_eq!(error.faults().len(), 2);
}

#[test]
fn with_crlf_lines_are_counted_as_without() {
    let text = "time [s],position [mm]\r\n0,1\r\n1,1..2\r\n\r\n2,x\r\n";
    let error = parse(text).unwrap_err();
    let lines: Vec<_> = error.faults().iter().map(|fault| fault.line).collect();
    assert_eq!(lines, [Some(3), Some(5)]);
}

#[test]
fn infinite_values_are_refused_also_after_the_conversion_of_the_unit() {
    assert_eq!(
        codes("t,a [bar]\n0,inf\n1,1e999\n2,1e308\n"),
        ["not_finite"; 3]
    );
}

#[test]
fn all_faults_of_the_header_are_reported_with_those_of_the_rows() {
    let text = "t,a [parsec],a,,b\n0,1,2,3,x\n1,2,3,4,5\n";
    assert_eq!(
        codes(text),
        [
            "unknown_unit",
            "duplicate_name",
            "empty_name",
            "not_a_number"
        ]
    );
    let error = parse(text).unwrap_err();
    assert!(!error.faults()[0].detail.contains("mbar"), "{error}");
}

#[test]
fn a_decimal_comma_is_read_where_it_can_be_nothing_else_and_it_is_said() {
    let recording = parse("t;a\n0;0,5\n1;0,6\n").unwrap();
    assert_eq!(values(&recording, "a"), [0.5, 0.6]);
    assert_eq!(recording.notes[0].code, "decimal_comma");
    let error = parse("t;a\n0;1,234\n1;0.5\n").unwrap_err();
    assert!(
        error.faults()[0].detail.contains("say decimal=,"),
        "{error}"
    );
}

#[test]
fn a_ragged_row_makes_the_text_malformed() {
    let error = parse("t,a,b\n0,1,2\n1,2\n2,3,4,5\n").unwrap_err();
    assert!(matches!(error, ReadError::Malformed(_)));
    let lines: Vec<_> = error.faults().iter().map(|fault| fault.line).collect();
    assert_eq!(lines, [Some(3), Some(4)]);
}

#[test]
fn text_that_is_no_table_is_malformed() {
    for text in ["", "\n\n", "just a line of words\n", "\u{feff}"] {
        assert!(
            matches!(parse(text), Err(ReadError::Malformed(_))),
            "{text:?}"
        );
    }
    let latin = read(&b"t,\xe9\n0,1\n1,2\n"[..], &Options::default());
    let latin = latin.unwrap_err();
    assert!(latin.faults()[0].detail.contains("encoding="), "{latin}");
}

#[test]
fn a_header_without_rows_has_too_few_samples() {
    assert_eq!(codes("t,a\n"), ["too_few_samples"]);
    assert_eq!(codes("t,a\n0,1\n0,2\n"), ["too_few_samples"]);
}

#[test]
fn the_later_of_two_rows_at_the_same_time_is_dropped_and_counted() {
    let recording = parse("t,a\n0,1\n1,2\n1,9\n2,3\n").unwrap();
    assert_eq!(values(&recording, "a"), [1.0, 2.0, 3.0]);
    assert_eq!(recording.notes[0].code, "duplicate_time");
}

#[test]
fn time_that_runs_backwards_is_refused_at_its_first_line() {
    let error = parse("t,a\n0,1\n2,2\n1,3\n0.5,4\n3,5\n").unwrap_err();
    let faults = error.faults();
    assert_eq!(
        (faults.len(), &*faults[0].code, faults[0].line),
        (1, "time_backwards", Some(4))
    );
}

#[test]
fn equal_faults_are_told_three_times_and_counted() {
    let many: String = (0..100).map(|k| format!("{k},x\n")).collect();
    let error = parse(&format!("t,a\n{many}1000,1\n")).unwrap_err();
    assert_eq!(error.faults().len(), 3);
    let last = &error.faults()[2].detail;
    assert!(
        last.ends_with("; and 97 more like it, the last on line 101"),
        "{last}"
    );
}

#[test]
fn a_column_of_text_is_kept_aside_and_reported() {
    let recording = parse("t [s],a,state\n0,1,RUN\n1,2,RUN\n2,3,STOP\n").unwrap();
    assert_eq!(recording.signals.len(), 1);
    assert_eq!(recording.notes[0].code, "text_column");
    assert_eq!(recording.notes[0].signal.as_deref(), Some("state"));
    assert_eq!(codes("t,state\n0,RUN\n1,RUN\n"), ["no_signals"]);
}

#[test]
fn a_table_without_names_is_refused() {
    assert_eq!(codes("0,1,2\n1,2,3\n2,3,4\n"), ["no_header"]);
    assert_eq!(
        codes("2026-03-02T08:15:00Z,1\n2026-03-02T08:15:01Z,2\n"),
        ["no_header"]
    );
}

#[test]
fn a_source_that_breaks_off_is_not_a_fault_of_the_text() {
    struct Broken;
    impl Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Err(io::Error::new(io::ErrorKind::ConnectionReset, "gone"))
        }
    }
    let source = "t,a\n0,1\n".as_bytes().chain(Broken);
    assert!(matches!(
        read(source, &Options::default()),
        Err(ReadError::Io(_))
    ));
}

proptest! {
    #[test]
    fn no_text_makes_the_reader_panic(text in "[ -~\\n;,\\t\"]{0,200}") {
        let _ = parse(&text);
        let _ = parse(&format!("t,a\n{text}"));
    }

    #[test]
    fn no_bytes_make_the_reader_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = read(bytes.as_slice(), &Options::default());
    }
}

/// A pressure at 1 Hz beside a tag of its own instants.
fn beside_a_pressure(tag: &str, samples: &[(u32, f64)]) -> String {
    let mut text = "time [s],tag,value\n".to_owned();
    for k in 0..60_u32 {
        text += &format!("{k},PT,{}\n", 1.0 + 0.01 * f64::from(k * k % 17));
        for (_, value) in samples.iter().filter(|(instant, _)| *instant == k) {
            text += &format!("{k},{tag},{value}\n");
        }
    }
    text
}

#[test]
fn a_command_that_is_recorded_when_it_changes_is_no_ramp() {
    let text = beside_a_pressure("CMD", &[(0, 20.0), (10, 80.0), (37, 20.0)]);
    let recording = parse(&text).unwrap();
    let commands = values(&recording, "CMD");
    assert_eq!(
        (commands[5], commands[10], commands[36]),
        (20.0, 80.0, 80.0)
    );
    assert_eq!(commands[59], 20.0, "it stands after the last change");
    let told = recording.notes.iter().find(|note| note.code == "held");
    assert_eq!(told.and_then(|note| note.signal.as_deref()), Some("CMD"));
    let mut options = Options::default();
    options.set("interpolation", "CMD:linear").unwrap();
    let moving = read(text.as_bytes(), &options).unwrap();
    assert_eq!(values(&moving, "CMD")[5], 50.0);
}

#[test]
fn a_measurement_moves_between_its_samples_and_uneven_instants_are_told() {
    let even: Vec<(u32, f64)> = (0..12).map(|k| (5 * k, f64::from(k * k))).collect();
    let uneven: Vec<(u32, f64)> = (0..10)
        .map(|k| (k * (k + 3) / 2, f64::from(k * k)))
        .collect();
    for (samples, code) in [(even, None), (uneven, Some("may_be_held"))] {
        let recording = parse(&beside_a_pressure("TT", &samples)).unwrap();
        let between = f64::midpoint(samples[3].1, samples[4].1);
        let middle = u32::midpoint(samples[3].0, samples[4].0);
        let temperature = values(&recording, "TT")[middle as usize];
        assert!(
            (temperature - between).abs() < 3.0,
            "{temperature} {between}"
        );
        assert_ne!(temperature, samples[3].1);
        let mut told = recording.notes.iter().map(|note| &*note.code);
        assert_eq!(told.find(|told| told.contains("held")), code);
    }
}

#[test]
fn a_row_for_each_sample_is_told_by_what_stands_in_it_whatever_its_titles() {
    for titles in [
        "time [s],metric,avg",
        "time [s],Messstelle,Wert",
        "time [s],where,how much",
    ] {
        let rows = (0..8).flat_map(|k| ["PT", "TT"].map(|tag| format!("{k},{tag},{k}.5\n")));
        let text = format!("{titles}\n{}", rows.collect::<String>());
        let recording = parse(&text).unwrap();
        let names: Vec<&str> = recording
            .signals
            .iter()
            .map(|signal| &*signal.name)
            .collect();
        assert_eq!(names, ["PT", "TT"], "{titles}");
        assert_eq!(values(&recording, "TT")[7], 7.5, "{titles}");
        assert!(recording.notes.is_empty(), "{:?}", recording.notes);
    }
    let rows = (0..8).flat_map(|k| ["A", "B"].map(|unit| format!("{k},{unit},{k}.5,3\n")));
    let text = format!("time [s],machine,p,T\n{}", rows.collect::<String>());
    assert_eq!(codes(&text), ["layout_unclear"]);
}

#[test]
fn thousands_of_a_german_file_are_no_fractions() {
    let recording = parse("t;p;T\n0;998;20,5\n1;1.052;20,6\n2;1.101;20,7\n").unwrap();
    assert_eq!(values(&recording, "p"), [998.0, 1052.0, 1101.0]);
    assert_eq!(values(&recording, "T"), [20.5, 20.6, 20.7]);
    let unclear = "t;p\n0;998\n1;1.052\n2;1.101\n";
    assert_eq!(codes(unclear), ["decimal_unclear"]);
    let mut options = Options::default();
    options.set("decimal", ".").unwrap();
    let said = read(unclear.as_bytes(), &options).unwrap();
    assert_eq!(values(&said, "p"), [998.0, 1.052, 1.101]);
}

#[test]
fn a_signal_keeps_the_times_and_the_quality_that_stand_beside_it() {
    let mut text = "PT Time [s],PT [bar],TT Time [s],TT [degC]\n".to_owned();
    for k in 0..20_u32 {
        let (k, late) = (f64::from(k), f64::from(k) + 0.5);
        text += &format!("{k},{},{late},{}\n", 1.0 + 0.1 * k, 20.0 + late);
    }
    let recording = parse(&text).unwrap();
    assert_eq!(recording.source.format, "paired_csv");
    let temperature = values(&recording, "TT");
    assert!(
        (temperature[7] - (273.15 + 27.0)).abs() < 1e-9,
        "{temperature:?}"
    );
    let pressure = values(&recording, "PT");
    assert!((pressure[7] - 1.7e5).abs() < 1e-6, "{pressure:?}");

    let text =
        "time [s],PT [bar],PT.Quality,TT [degC]\n0,1,192,20\n1,0,0,21\n2,3,64,22\n3,4,192,23\n";
    assert_eq!(codes(text), ["quality_scheme_needed"; 2], "0 and 64");
    let mut options = Options::default();
    options.set("quality_scheme", "opc_da").unwrap();
    let recording = read(text.as_bytes(), &options).unwrap();
    let names: Vec<&str> = recording
        .signals
        .iter()
        .map(|signal| &*signal.name)
        .collect();
    assert_eq!(names, ["PT", "TT"]);
    let rated = recording.signal("PT").unwrap();
    assert_eq!(rated.classes.len(), 2, "{:?}", rated.classes);
    // A cycle time is a signal, and so is a status of nothing.
    let plain =
        parse("time [s],cycle_time [s],p,valve_status\n0,3,1,0\n1,2,1,1\n2,4,1,0\n").unwrap();
    assert_eq!(plain.signals.len(), 3);
}

#[test]
fn a_gap_that_is_filled_because_the_source_says_so_is_told() {
    let samples: Vec<(u32, f64)> = (0..12).chain(40..52).map(|k| (k, f64::from(k))).collect();
    let text = beside_a_pressure("FT", &samples);
    let mut options = Options::default();
    options.set("interpolation", "FT:linear").unwrap();
    let recording = read(text.as_bytes(), &options).unwrap();
    let told = recording
        .notes
        .iter()
        .find(|note| note.code == "bridged_gap");
    assert!(
        told.is_some_and(|told| told.detail.contains("29 s")),
        "{told:?}"
    );
    assert_eq!(values(&recording, "FT")[20], 20.0);
    let unsaid = parse(&text).unwrap();
    assert!(values(&unsaid, "FT")[20].is_nan());
    assert!(unsaid.notes.iter().all(|note| note.code != "may_be_held"));
}
