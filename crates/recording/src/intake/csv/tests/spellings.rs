//! Numbers and times as people spell them, in whole tables.

use super::{read, values};
use crate::Recording;
use crate::intake::{Options, ReadError};

fn with(text: &str, options: &[(&str, &str)]) -> Result<Recording, ReadError> {
    let mut all = Options::default();
    for (option, value) in options {
        all.set(option, value).unwrap();
    }
    read(text.as_bytes(), &all)
}

/// A table of one signal with these cells, a second apart.
fn table(cells: &[&str]) -> String {
    let rows = cells.iter().enumerate();
    let rows: String = rows.map(|(k, cell)| format!("{k};{cell}\n")).collect();
    format!("t [s];p\n{rows}")
}

fn p(cells: &[&str]) -> Result<Vec<f64>, String> {
    let fault = |error: ReadError| error.faults()[0].code.to_string();
    with(&table(cells), &[])
        .map(|recording| values(&recording, "p"))
        .map_err(fault)
}

#[test]
fn thousands_in_one_column_are_numbers() {
    assert_eq!(p(&["1 452,5", "896,7"]), Ok(vec![1452.5, 896.7]));
    assert_eq!(
        p(&["1\u{202f}452,500", "896,701"]),
        Ok(vec![1452.5, 896.701])
    );
    assert_eq!(p(&["1'452.0", "896.5"]), Ok(vec![1452.0, 896.5]));
    assert_eq!(p(&["+ 61.5", "- 60"]), Ok(vec![61.5, -60.0]));
    assert_eq!(p(&["896,701", "897,702"]), Err("not_a_number".to_owned()));
}

#[test]
fn negative_numbers_without_a_minus_before_them_are_told() {
    for cells in [["(1.5)", "2"], ["1.5-", "2"], ["1.5−", "2"]] {
        let recording = with(&table(&cells), &[]).unwrap();
        assert_eq!(values(&recording, "p"), [-1.5, 2.0]);
        assert!(
            recording
                .notes
                .iter()
                .any(|note| note.code == "negative_numbers")
        );
    }
    for cells in [["(1.5)", "-2"], ["-2", "1.5-"], ["(1.5)", "2-"]] {
        assert_eq!(p(&cells), Err("signs_differ".to_owned()), "{cells:?}");
    }
    assert_eq!(p(&["(1.5)", "-2", "x"]), Err("signs_differ".to_owned()));
    assert_eq!(p(&["(-1.5)", "2"]), Err("not_a_number".to_owned()));
    let text = "t [s];p;comment\n0;1;ok\n1;2;(1)\n2;3;see 1\n";
    let recording = with(text, &[]).unwrap();
    assert_eq!(recording.signals.len(), 1, "a remark is no number");
}

#[test]
fn a_column_without_numbers_is_told_by_a_cell_of_it() {
    let error = with(&table(&["1 45", "2 45"]), &[]).unwrap_err();
    let fault = &error.faults()[0];
    assert_eq!(
        (&*fault.code, fault.line, fault.column.as_deref()),
        ("no_signals", Some(2), Some("p"))
    );
    assert!(fault.detail.contains("`1 45` is not a number"), "{error}");
    let long = "time,tag,value\n2026-03-02T08:15:00Z,PT,ok\n2026-03-02T08:15:01Z,PT,off\n";
    let error = with(long, &[]).unwrap_err();
    assert!(
        error.faults()[0].detail.contains("`ok` is not a number"),
        "{error}"
    );
    let points = with(&table(&["1.452.000", "1.467.150"]), &[]).unwrap_err();
    assert!(points.faults()[0].detail.contains("decimal=,"), "{points}");
}

#[test]
fn words_for_units_stand_in_the_title_of_a_time() {
    for (title, step) in [
        ("t [second(s)]", 1.0),
        ("Time (seconds)", 1.0),
        ("Zeit [Sek]", 1.0),
        ("elapsed_hours", 3600.0),
        ("Time(usec)", 1e-6),
    ] {
        let recording = with(&format!("{title},p\n0,1\n1,2\n"), &[]).unwrap();
        assert_eq!(recording.time.sample_time(), step, "{title}");
        assert!(recording.notes.is_empty(), "{title}");
    }
}

#[test]
fn a_time_may_have_a_decimal_comma_and_an_exponent() {
    let text = "t [s];x [mm]\n-1,0e-03;1,5\n0,0e+00;2,5\n1,0e-03;3,5\n";
    let recording = with(text, &[]).unwrap();
    assert_eq!(recording.time.sample_time(), 0.001);
    assert_eq!(values(&recording, "x"), [0.0015, 0.0025, 0.0035]);
}

#[test]
fn dates_with_points_in_their_times_are_asked_about_as_others_are() {
    let text = |date: &str| format!("time;p\n{date} 10.15.00;1\n{date} 10.15.01;2\n");
    let codes = |date: &str| {
        with(&text(date), &[("tz", "Europe/Rome")])
            .map_err(|error| error.faults()[0].code.to_string())
    };
    assert_eq!(codes("02/03/2026").unwrap_err(), "ambiguous_date");
    let recording = codes("23/04/2026").unwrap();
    assert_eq!(
        recording.start,
        Some("2026-04-23T08:15:00Z".parse().unwrap())
    );
    assert_eq!(recording.time.sample_time(), 1.0);
    // Two dates in a row are no date with its time.
    let spans = "start;end;p\n02.03.26;02.03.26;1\n03.03.26;03.03.26;2\n";
    let recording = with(spans, &[("tz", "UTC")]).unwrap();
    assert_eq!(
        recording.start,
        Some("2026-03-02T00:00:00Z".parse().unwrap())
    );
}

#[test]
fn tags_that_look_like_durations_or_days_are_titles() {
    for titles in ["PT1H,PT2S", "1001-101,1001-102", "1-2,3-4"] {
        let recording = with(&format!("t [s],{titles}\n0,1,2\n1,2,3\n"), &[]).unwrap();
        let names: Vec<&str> = recording
            .signals
            .iter()
            .map(|signal| signal.name.as_str())
            .collect();
        assert_eq!(names.join(","), titles);
    }
}
