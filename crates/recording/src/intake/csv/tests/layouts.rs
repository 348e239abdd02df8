//! Tables in the layouts that loggers, spreadsheets and scripts write.

use crate::intake::{self, MediaKind, Options, ReadError};
use crate::{Recording, TimeAxis};
use proptest::prelude::*;
use std::fmt::Write as _;

fn read(text: &str, options: &[(&str, &str)]) -> Result<Recording, ReadError> {
    let mut read_options = Options::default();
    for (option, value) in options {
        read_options.set(option, value).unwrap();
    }
    intake::read(text.as_bytes(), MediaKind::Csv, &read_options)
}

fn parse(text: &str) -> Recording {
    read(text, &[("tz", "UTC")]).unwrap_or_else(|error| panic!("{text}\n{error}"))
}

fn codes(text: &str) -> Vec<String> {
    let error = read(text, &[]).expect_err(text);
    error
        .faults()
        .iter()
        .map(|fault| fault.code.to_string())
        .collect()
}

/// Whether a warning of that code is told.
fn tells(recording: &Recording, code: &str) -> bool {
    recording.notes.iter().any(|note| note.code == code)
}

/// Checks that a text is 1.0, 1.1 and 1.2 bar as `PT` and 20, 21 and 22 °C as `TT`, every tenth of a second.
fn check(text: &str) -> Recording {
    let recording = parse(text);
    let uniform = TimeAxis::Uniform {
        sample_time: 0.1,
        samples: 3,
    };
    assert_eq!(recording.time, uniform, "{text}");
    for (name, expected) in [
        ("PT", [1.0e5, 1.1e5, 1.2e5]),
        ("TT", [293.15, 294.15, 295.15]),
    ] {
        let signal = recording.signal(name).unwrap_or_else(|| panic!("{text}"));
        let pairs = signal.values.iter().zip(expected);
        assert!(
            pairs
                .clone()
                .all(|(value, expected)| (value - expected).abs() < 1e-6),
            "{text}: {:?}",
            signal.values
        );
        assert_eq!(pairs.count(), 3);
    }
    recording
}

const ROWS: &str = "0,1.0,20\n0.1,1.1,21\n0.2,1.2,22\n";
const TITLES: &str = "Time [s],PT [bar],TT [degC]";

#[test]
fn a_row_of_units_stands_below_the_titles() {
    for units in [
        "s,bar,degC",
        "[s],[bar],[°C]",
        "(s),(bar),(DEG C)",
        "s;bar;degC",
        "Unit:,bar,degC",
    ] {
        let text = format!("Time,PT,TT\n{units}\n{ROWS}");
        let text = match units.contains(';') {
            true => text.replace(',', ";"),
            false => text,
        };
        assert!(tells(&check(&text), "row_of_units"), "{text}");
    }
    let clock =
        "Zeit,PT,TT\nhh:mm:ss,bar,°C\n08:15:00.0,1.0,20\n08:15:00.1,1.1,21\n08:15:00.2,1.2,22\n";
    assert!(tells(&check(clock), "times_without_date"));
    let dimensionless = parse("Time,PT,n\ns,bar,-\n0,1,2\n1,1,3\n");
    assert_eq!(dimensionless.signal("n").unwrap().unit, "1");
    let recording = parse("t,A,V\n0,1,2\n1,1,3\n");
    assert_eq!(recording.signals[0].name, "A", "titles that are units");
    assert_eq!(
        codes("Time,PT,TT\ns,bar,parsec\n0,1,2\n1,1,3\n"),
        ["unknown_unit"]
    );
    assert_eq!(codes("t,PT [bar]\ns,kPa\n0,1\n1,1\n"), ["units_differ"]);
    let long = "timestamp,tag,value,unit\n0,PT,1,bar\n0,TT,20,degC\n1,PT,1,bar\n1,TT,21,degC\n";
    assert_eq!(parse(&long.replace("timestamp", "time")).signals.len(), 2);
}

#[test]
fn lines_before_the_titles_are_left_out_and_it_is_told() {
    for before in [
        "Test rig 4\n",
        "Test rig 4\n\nExported;2026-03-02\n\n",
        "\"Rig 4, run 3\"\nSampling,100,ms\nOperator,Smith\n",
        "Rig 4,,\nDate,2026-03-02,\n,,\n",
        "# made by hand, on rig 4, twice\n#\n",
        "sep=,\n",
    ] {
        let recording = check(&format!("{before}{TITLES}\n{ROWS}"));
        assert!(tells(&recording, "lines_left_out"), "{before}");
        assert!(!tells(&recording, "row_of_units"), "{before}");
        check(&format!("{before}Time,PT,TT\ns,bar,degC\n{ROWS}"));
    }
    let before = "LabVIEW Measurement\nDate,2026/03/02\nTime,08:15:00.1\nSamples,3,3\nX0,0.0,0.0\nDelta_X,0.1,0.1\n***End***\n";
    check(&format!("{before}{TITLES}\n{ROWS}"));
    let commented = check(&format!("# rig 4\n# {TITLES}\n{ROWS}"));
    assert_eq!(commented.signals[0].name, "PT");
    check(&format!("{TITLES}\n# by hand, on rig 4, twice\n#\n{ROWS}"));
    let semicolons = format!("Rig 4, run 3, hot\nStart: 08:15\n{TITLES}\n{ROWS}");
    let semicolons = semicolons
        .replace(',', ";")
        .replace("4; run 3;", "4, run 3,");
    check(&semicolons.replace('.', ","));
    let error = read(&format!("Rig 4\n\n{TITLES}\n{ROWS}0.3,x,1\n"), &[]).unwrap_err();
    assert_eq!(error.faults()[0].line, Some(7), "{error}");
    let two = format!("pressure time,left,right\n{TITLES}\n{ROWS}");
    assert_eq!(codes(&two), ["titles_unclear"]);
}

#[test]
fn a_date_and_a_time_in_two_columns_are_one_time() {
    let rows = |separator: &str, clocks: [&str; 3], fraction: &str| -> String {
        let rows = clocks.iter().enumerate().map(|(k, clock)| {
            let row = [
                "2.3.2026",
                clock,
                &format!("1{fraction}{k}"),
                &format!("2{k}"),
            ]
            .join(separator);
            row + "\n"
        });
        rows.collect()
    };
    let clocks = ["08:15:00.0", "08:15:00.1", "08:15:00.2"];
    let text = format!("Date,Time,PT [bar],TT [degC]\n{}", rows(",", clocks, "."));
    let recording = check(&text);
    assert!(tells(&recording, "joined_time"));
    let start = recording.start.map(|start| start.to_string());
    assert_eq!(start.as_deref(), Some("2026-03-02T08:15:00Z"));
    let clocks = clocks.map(|clock| clock.replace('.', ","));
    let rows = rows(";", clocks.each_ref().map(|clock| &**clock), ",");
    check(&format!("Datum;Uhrzeit;PT [bar];TT [degC]\n{rows}"));
    check(&format!("Datum;Uhrzeit;PT;TT\n;hh:mm:ss;bar;°C\n{rows}"));
    let text = "Time,ms,PT [bar],TT [degC]\n2026-03-02 08:15:00,900,1.0,20\n2026-03-02 08:15:01,0,1.1,21\n\
                2026-03-02 08:15:01,100,1.2,22\n";
    check(text);
    let three = text
        .replace("Time,", "Date,Time,")
        .replace("02 08", "02,08");
    check(&three);
    let late = format!("{three}2026-03-02,08:15:01,1200,1.3,23\n");
    assert!(read(&late, &[("tz", "UTC")]).is_err());
    let swapped = text.replace("Time,", "Time,Date,");
    check(
        &swapped
            .replace("2026-03-02 08:15:00", "08:15:00,2026-03-02")
            .replace("2026-03-02 08:15:01", "08:15:01,2026-03-02"),
    );
}

#[test]
fn letters_and_offsets_behind_a_time_are_its_zone() {
    for (stamp, utc) in [
        ("2026-07-02 08:15:00 CEST", "06:15:00"),
        ("2026-07-02 08:15:00 UTC", "08:15:00"),
        ("02.07.2026 08:15:00 MESZ", "06:15:00"),
        ("02.07.2026 08:15:00 +0530", "02:45:00"),
        ("02.07.2026 08:15:00Z", "08:15:00"),
        ("2026-07-02 08:15:00 EEST", "05:15:00"),
    ] {
        let text = format!(
            "t,a\n{stamp},1\n{},2\n",
            stamp.replace(":00 ", ":01 ").replace(":00Z", ":01Z")
        );
        let recording = read(&text, &[]).unwrap_or_else(|error| panic!("{stamp}: {error}"));
        let start = recording.start.unwrap().to_string();
        assert_eq!(start, format!("2026-07-02T{utc}Z"), "{stamp}");
    }
    let text = "t,a\n2026-07-02 08:15:00 BST,1\n2026-07-02 08:15:01 BST,2\n";
    let error = read(text, &[]).unwrap_err();
    assert_eq!(&*error.faults()[0].code, "ambiguous_zone");
    assert!(error.faults()[0].detail.contains("`tz`"), "{error}");
    let london = read(text, &[("tz", "Europe/London")]).unwrap();
    assert_eq!(london.start.unwrap().to_string(), "2026-07-02T07:15:00Z");
    assert!(read(text, &[("tz", "Europe/Berlin")]).is_err());
}

#[test]
fn milliseconds_may_stand_behind_a_colon() {
    let mut text = "t,PT [bar],TT [degC]\n".to_owned();
    for k in 0..3 {
        writeln!(text, "02.03.2026 08:15:00:{k}00,1.{k},2{k}").unwrap();
    }
    check(&text);
    assert!(
        read(&text.replace("00,1", ",1"), &[("tz", "UTC")]).is_err(),
        "one digit"
    );
}

#[test]
fn the_indices_of_pandas_are_understood() {
    let numbered =
        check(",time [s],PT [bar],TT [degC]\n0,0.0,1.0,20\n1,0.1,1.1,21\n2,0.2,1.2,22\n");
    assert!(tells(&numbered, "row_numbers"));
    check(
        "No.,Date,Time,PT [bar],TT [degC]\n1,2.3.2026,8:15:00.0,1.0,20\n2,2.3.2026,8:15:00.1,1.1,21\n3,2.3.2026,8:15:00.2,1.2,22\n",
    );
    check("Unnamed: 0,time,PT [bar],TT [degC]\n0,0.0,1.0,20\n1,0.1,1.1,21\n2,0.2,1.2,22\n");
    let text = ",PT [bar],TT [degC]\n0 days 00:00:00,1.0,20\n0 days 00:00:00.100000,1.1,21\n\
                0 days 00:00:00.200000,1.2,22\n";
    check(text);
    check(&text.replace("0 days 00:00:00", "1 days 10:00:00"));
    check(&text.replace("0 days 00", "-1 days +00"));
    assert_eq!(codes(",a\n0,1\n1,2\n2,3\n"), ["time_unit_needed"; 3]);
}

#[test]
fn the_titles_of_joined_files_are_left_out() {
    let mut rows = ROWS.split_inclusive('\n');
    let first = rows.next().unwrap();
    let text = format!(
        "Rig 4\n{TITLES}\n{first}Rig 4\n{TITLES}\n{}",
        rows.collect::<String>()
    );
    assert!(tells(&check(&text), "repeated_titles"));
}

#[test]
fn rows_that_share_a_second_are_spread_over_it_and_it_is_told() {
    let text = |counts: &[usize]| {
        let mut text = "time,PT [bar],TT [degC]\n".to_owned();
        for (second, count) in counts.iter().enumerate() {
            for k in 0..*count {
                writeln!(text, "2026-03-02 08:15:{second:02},{second}.{k},{k}").unwrap();
            }
        }
        text
    };
    let recording = parse(&text(&[10, 10, 10]));
    assert!(tells(&recording, "spread_rows"), "{:?}", recording.notes);
    assert_eq!(
        (recording.time.samples(), recording.time.sample_time()),
        (30, 0.1)
    );
    let begun = parse(&text(&[3, 10, 10, 10, 4]));
    assert_eq!((begun.time.samples(), begun.time.sample_time()), (37, 0.1));
    assert_eq!(begun.start.unwrap().to_string(), "2026-03-02T08:15:00.7Z");
    let lost = parse(&text(&[10, 10, 9, 10, 10, 11, 10, 10]));
    assert_eq!(lost.time.samples(), 80);
    assert_eq!(lost.time.instant(79), 7.9);
    let tagged = text(&[10, 10, 10])
        .replace(",", ",PT,")
        .replace(",PT,PT [bar],PT,TT [degC]", ",tag,value");
    let cut = |line: &str| {
        line.rsplit_once(",PT,")
            .map_or(line, |(line, _)| line)
            .to_owned()
            + "\n"
    };
    let tagged = parse(&tagged.lines().map(cut).collect::<String>());
    assert!(tells(&tagged, "spread_rows") && tagged.source.format == "long_csv");
    assert_eq!(
        (tagged.time.samples(), tagged.time.sample_time()),
        (30, 0.1)
    );
    let finer = text(&[10, 10, 10, 10, 10]).replace("08:15:04,4.0,0", "08:15:03.5,4.0,0");
    assert_eq!(
        read(&finer, &[("tz", "UTC")]).unwrap_err().faults()[0].code,
        "repeated_time"
    );
    let stuck = read(&text(&[10, 10, 10, 25, 10, 10, 10]), &[("tz", "UTC")]).unwrap_err();
    assert_eq!(
        (&*stuck.faults()[0].code, stuck.faults()[0].line),
        ("repeated_time", Some(52))
    );
    let uneven = read(&text(&[10, 3, 7, 1, 30, 2, 5]), &[("tz", "UTC")]).unwrap_err();
    assert_eq!(uneven.faults()[0].code, "repeated_time");
    let again: String = ROWS
        .split_inclusive('\n')
        .flat_map(|row| [row, row])
        .collect();
    assert!(tells(
        &check(&format!("{TITLES}\n{again}")),
        "duplicate_time"
    ));
}

#[test]
fn the_newest_row_may_come_first() {
    let rows: String = ROWS.split_inclusive('\n').rev().collect();
    assert!(tells(&check(&format!("{TITLES}\n{rows}")), "newest_first"));
    let stamped = rows
        .replace("0.", "2026-03-02T08:15:00.")
        .replace("0,1.0", "2026-03-02T08:15:00,1.0");
    let stamped = check(&format!("{TITLES}\n{stamped}").replace("Time [s]", "Time"));
    assert_eq!(stamped.start.unwrap().to_string(), "2026-03-02T08:15:00Z");
    let error = read(&format!("{TITLES}\n{rows}0.3,1,2\n"), &[]).unwrap_err();
    assert_eq!(
        (&*error.faults()[0].code, error.faults()[0].line),
        ("time_backwards", Some(3))
    );
}

#[test]
fn numbers_in_quotes_may_have_decimal_commas_or_thousands() {
    let text = format!("{TITLES}\n{ROWS}");
    let commas = text
        .replace("1.0", "\"1,0\"")
        .replace("1.1", "\"1,1\"")
        .replace("1.2", "\"1,2\"")
        .replace("0.1", "\"0,1\"")
        .replace("0.2", "\"0,2\"");
    assert!(tells(&check(&commas), "decimal_comma"));
    let mixed = commas.replace("\"0,1\"", "0.1").replace("\"0,2\"", "0.2");
    let error = read(&mixed, &[]).unwrap_err();
    assert!(error.faults()[0].detail.contains("decimal="), "{error}");
    let error = read(&mixed, &[("decimal", ",")]).unwrap_err();
    assert_eq!(
        error.faults()[0].code,
        "not_a_time",
        "no time is ten times itself"
    );
    let thousands = "t,p\n0,\"1,052.3\"\n1,\"12,345,678.0\"\n2,998.5\n";
    let values = &parse(thousands).signals[0].values;
    assert_eq!(values, &[1052.3, 12_345_678.0, 998.5]);
    let unclear = "t,p\n0,\"1,052\"\n1,998\n2,997\n";
    let error = read(unclear, &[]).unwrap_err();
    assert!(error.faults()[0].detail.contains("decimal="), "{error}");
    let with_decimal = read(unclear, &[("decimal", ".")]).unwrap();
    assert_eq!(with_decimal.signals[0].values, [1052.0, 998.0, 997.0]);
    let groups = read("t,p\n0,\"1,05,2.3\"\n1,1\n2,3\n", &[]);
    assert!(groups.is_err());
}

#[test]
fn units_may_stand_in_the_cells() {
    let text = "Time [s],PT,TT\n0,1.0 bar,20°C\n0.1,1.1 bar,21 degC\n0.2,1.2 Bar,22 °C\n";
    assert!(tells(&check(text), "unit_from_cells"));
    check(&text.replace("PT", "PT [bar]"));
    check(&text.replace(',', ";").replace('.', ","));
    for wrong in ["1.1 psi", "1.1"] {
        let error = read(&text.replace("1.1 bar", wrong), &[]).unwrap_err();
        let fault = &error.faults()[0];
        assert_eq!(
            (&*fault.code, fault.line),
            ("units_differ", Some(3)),
            "{wrong}"
        );
    }
    let words = parse("t,a,state\n0,1,2 of 3\n1,2,3 of 3\n");
    assert!(tells(&words, "text_column"));
}

#[test]
fn units_of_many_trades_are_known() {
    for unit in [
        "%RH", "ppm", "pH", "cP", "cSt", "U/min", "cfm", "Sm3/h", "inWC", "daN", "kp", "hp",
        "W/m²K", "counts", "Volts", "AMPS", "DEG C",
    ] {
        let recording = parse(&format!("t,a [{unit}]\n0,1\n1,2\n"));
        assert_eq!(recording.signals[0].recorded_unit, unit);
    }
}

/// Fields of which layouts are made.
const FIELDS: [&str; 24] = [
    "",
    "Time",
    "Date",
    "PT",
    "ms",
    "s",
    "bar",
    "Unit",
    "#",
    "# a",
    "0",
    "1",
    "1.5",
    "\"1,5\"",
    "5 bar",
    "2026-03-02",
    "02.03.2026 08:15:00",
    "08:15:00",
    "0 days 00:00:01",
    "1 452.5",
    "(1.5)",
    "20260302081500",
    "PT0.5S",
    "PT [bar]",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]
    #[test]
    fn no_layout_makes_the_reader_panic(
        rows in prop::collection::vec(prop::collection::vec(prop::sample::select(&FIELDS[..]), 0..5), 0..12),
    ) {
        let text: String = rows.iter().map(|row| row.join(",") + "\n").collect();
        for options in [&[][..], &[("tz", "UTC"), ("time_unit", "s")]] {
            let times = read(&text, options).map(|recording| recording.time);
            let instants = times.iter().flat_map(|time| (0..time.samples()).map(|k| time.instant(k)));
            let instants: Vec<f64> = instants.collect();
            prop_assert!(instants.windows(2).all(|pair| pair[0] < pair[1]), "{text}");
            prop_assert!(instants.first().is_none_or(|first| *first == 0.0), "{text}");
        }
    }
}

/// Whether the second of two samples is missing because a column rates it as bad.
fn is_rated(text: &str) -> bool {
    let recording = parse(text);
    let is_bad = |values: &[f64]| !values[0].is_nan() && values[1].is_nan();
    recording.signals.len() == 1 && is_bad(&recording.signals[0].values)
}

#[test]
fn columns_that_rate_values_are_known_by_their_titles_or_are_told() {
    for title in [
        "DataQuality",
        "StatusCode",
        "IsGood",
        "Qualität",
        "Validity",
    ] {
        let long = format!(
            "Timestamp,Tag,Value,{title}\n2026-03-02T08:15:00Z,PT,3.2,Good\n2026-03-02T08:15:01Z,PT,3.3,Bad\n"
        );
        assert!(is_rated(&long), "{title}");
    }
    for title in ["PT_Q", "PT.isGood", "PT (Quality)", "Quality(PT)"] {
        let beside = format!(
            "Timestamp,PT,{title}\n2026-03-02T08:15:00Z,3.2,Good\n2026-03-02T08:15:01Z,3.3,Bad\n"
        );
        assert!(is_rated(&beside), "{title}");
    }
    let flow = parse(
        "Timestamp,pump,pump_Q\n2026-03-02T08:15:00Z,3.2,17.5\n2026-03-02T08:15:01Z,3.3,18.5\n",
    );
    assert_eq!(flow.signals.len(), 2, "the numbers of a flow are no codes");
    let text =
        "Timestamp,Tag,Value,Grade\n2026-03-02T08:15:00Z,PT,3.2,A\n2026-03-02T08:15:01Z,PT,3.3,B\n";
    let recording = parse(text);
    let told = recording
        .notes
        .iter()
        .find(|note| note.code == "left_out_columns");
    assert!(told.expect("a warning").detail.contains("quality=Grade"));
}

#[test]
fn numbers_of_a_time_without_a_unit_are_told_to_be_seconds() {
    assert!(tells(
        &parse("time,p\n0,1\n10000,2\n20000,3\n"),
        "time_unit_assumed"
    ));
    assert!(!tells(
        &parse("time [s],p\n0,1\n1,2\n2,3\n"),
        "time_unit_assumed"
    ));
}

#[test]
fn values_with_commas_are_told_apart_from_words_where_the_tag_was_said() {
    let text = "Zeit;Anlage;p;T\n2026-03-13T08:00:00Z;Nord;1,5;20,5\n2026-03-13T08:00:00Z;Sued;2,5;21,5\n\
                2026-03-13T08:00:01Z;Nord;1,6;20,6\n2026-03-13T08:00:01Z;Sued;2,6;21,6\n";
    let recording = read(text, &[("tag", "Anlage")]).unwrap();
    let names: Vec<&str> = recording
        .signals
        .iter()
        .map(|signal| signal.name.as_str())
        .collect();
    assert_eq!(names, ["Nord.p", "Nord.T", "Sued.p", "Sued.T"]);
}
