//! Tables with counters before them, heads above and feet below, with blanks or bars between fields.

use super::{codes, parse, read, values};
use crate::Recording;
use crate::intake::Options;

fn told(recording: &Recording) -> Vec<&str> {
    let codes = recording.notes.iter().map(|note| note.code.as_str());
    codes.collect()
}

/// The stored values of a text without a fault.
fn stored(text: &str, name: &str) -> Vec<f64> {
    let recording = parse(text).unwrap_or_else(|error| panic!("{text}: {error:?}"));
    values(&recording, name)
}

#[test]
fn the_time_may_stand_behind_other_columns() {
    let scans = "Scan,Time,101 (V)\n1,2026-03-02 08:15:00Z,3.2\n2,2026-03-02 08:15:01Z,3.3\n3,2026-03-02 08:15:02Z,3.4\n";
    let recording = parse(scans).unwrap();
    assert_eq!(values(&recording, "101"), [3.2, 3.3, 3.4]);
    assert_eq!(recording.signals.len(), 1);
    assert_eq!(told(&recording), ["row_numbers"]);

    let batches = "batch,ts,p [bar]\nb7,2026-03-02T08:15:00Z,1\nb7,2026-03-02T08:15:01Z,2\nb7,2026-03-02T08:15:02Z,3\n";
    let recording = parse(batches).unwrap();
    assert_eq!(values(&recording, "p"), [1e5, 2e5, 3e5]);
    assert_eq!(told(&recording), ["time_column", "text_column"]);
    assert_eq!(recording.start.unwrap().to_string(), "2026-03-02T08:15:00Z");

    let parts = "Header:,Date,Time,PT\nData,2026-03-02,08:15:00.000,3.2\nData,2026-03-02,08:15:00.500,3.3\nData,2026-03-02,08:15:01.000,3.4\n";
    assert_eq!(codes(parts), ["no_offset"; 3]);
    let mut options = Options::default();
    options.set("tz", "Europe/Berlin").unwrap();
    let recording = read(parts.as_bytes(), &options).unwrap();
    assert_eq!(values(&recording, "PT"), [3.2, 3.3, 3.4]);

    // A first column that is called as times are stays the time beside another time.
    let dead = "t,p,dead time [s]\n0,1,5\n1,2,6\n2,3,7\n";
    assert_eq!(stored(dead, "dead time"), [5.0, 6.0, 7.0]);
    let cycles = "cycle,rise time [s]\n0,5\n1,6\n2,7\n";
    let mut options = Options::default();
    options.set("time_unit", "ms").unwrap();
    let recording = read(cycles.as_bytes(), &options).unwrap();
    assert_eq!(values(&recording, "rise time"), [5.0, 6.0, 7.0]);

    // A first column with a unit of time, or called so, is the time whatever else stands there.
    let both = "t [s],stamp,p\n0,2026-03-02T08:15:00Z,1\n1,2026-03-02T08:15:01Z,2\n2,2026-03-02T08:15:02Z,3\n";
    let recording = parse(both).unwrap();
    assert_eq!(values(&recording, "p"), [1.0, 2.0, 3.0]);
    assert_eq!(recording.start, None);
}

#[test]
fn rows_of_a_database_name_their_signals_behind_a_counter() {
    let rows = "id,sensor_id,ts,val\n1,PT,2026-03-02T08:15:00Z,3.2\n2,TT,2026-03-02T08:15:00Z,65\n\
                3,PT,2026-03-02T08:15:01Z,3.3\n4,TT,2026-03-02T08:15:01Z,66\n";
    let recording = parse(rows).unwrap();
    assert_eq!(values(&recording, "PT"), [3.2, 3.3]);
    assert_eq!(values(&recording, "TT"), [65.0, 66.0]);
    assert_eq!(recording.signals.len(), 2);

    let states = "entity_id,state,last_changed\na,65.1,2026-03-02T08:15:00Z\nb,1,2026-03-02T08:15:01Z\n\
                  a,65.2,2026-03-02T08:15:02Z\nb,2,2026-03-02T08:15:03Z\n";
    let recording = parse(states).unwrap();
    let names: Vec<&str> = recording
        .signals
        .iter()
        .map(|signal| signal.name.as_str())
        .collect();
    assert_eq!(names, ["a", "b"]);
}

#[test]
fn heads_of_loggers_and_oscilloscopes_are_read() {
    let toa5 = "\"TOA5\",\"CR1000\",\"CR1000\",\"1234\",\"Std.27\",\"prog.CR1\",\"7\",\"Table1\"\n\
                \"TIMESTAMP\",\"RECORD\",\"P\",\"T_Avg(1)\"\n\"TS\",\"RN\",\"mbar\",\"Deg C\"\n\"\",\"\",\"Smp\",\"Avg\"\n\
                \"2026-03-02 08:15:00Z\",0,950,20\n\"2026-03-02 08:15:01Z\",1,951,21\n\"2026-03-02 08:15:02Z\",2,952,22\n";
    assert_eq!(stored(toa5, "P"), [95_000.0, 95_100.0, 95_200.0]);
    assert_eq!(stored(toa5, "T_Avg(1)"), [293.15, 294.15, 295.15]);

    let scope = "x-axis,1,2\nsecond,Volt,Volt\n0.0,1.5,2.5\n0.001,1.6,2.6\n0.002,1.7,2.7\n";
    assert_eq!(stored(scope, "1"), [1.5, 1.6, 1.7]);
    assert_eq!(stored(scope, "2"), [2.5, 2.6, 2.7]);

    let labview = "X_Value\tPT [bar]\tComment\n0.0\t3.2\n0.1\t3.3\n0.2\t3.4\n";
    assert!(!codes(&labview.replace("Comment", "TT")).is_empty());
    let recording = parse(labview).unwrap();
    assert_eq!(values(&recording, "PT"), [3.2e5, 3.3e5, 3.4e5]);
    assert_eq!(told(&recording), ["left_out_columns", "time_unit_assumed"]);
}

#[test]
fn rows_below_the_data_are_left_out_and_told() {
    let rows = "t [s],p\n0,1\n1,2\n2,3\n";
    for foot in [
        "Average,2\n",
        "3 rows,\n",
        "EOF\n",
        "\nMin,1\nMax,3\n",
        "Exported by A, hall 2, on Monday\n",
        "3\n",
    ] {
        let recording = parse(&[rows, foot].concat()).unwrap();
        assert_eq!(values(&recording, "p"), [1.0, 2.0, 3.0], "{foot}");
        assert!(told(&recording).contains(&"lines_left_out"), "{foot}");
    }
    let closed = [rows, "\0\0\0\0\0\0\n"].concat();
    assert_eq!(stored(&closed, "p"), [1.0, 2.0, 3.0]);
    // A row among the data, and a number at a time that cannot be read, are faults as before.
    for (among, code) in [
        ("Average,2\n3,4\n", "not_a_time"),
        ("3\n4,5\n", "ragged_row"),
        ("3x,4\n", "not_a_time"),
    ] {
        assert_eq!(codes(&[rows, among].concat()), [code], "{among}");
    }
    let many: String = (0..21).map(|_| "word,1\n").collect();
    assert!(!codes(&[rows, &many].concat()).is_empty());
}

#[test]
fn fields_may_stand_between_blanks_or_bars() {
    let saved = "# t[s] p[bar]\n0.000e+00 1.5e+00\n1.000e+00 1.6e+00\n2.000e+00 1.7e+00\n";
    assert_eq!(stored(saved, "p"), [1.5e5, 1.6e5, 1.7e5]);
    let aligned = "  t[s]      p\n   0.0   1.50\n   1.0  10.50\n   2.0 100.50\n";
    assert_eq!(stored(aligned, "p"), [1.5, 10.5, 100.5]);
    let numbered = "\"time\" \"p\"\n\"1\" 0 1.5\n\"2\" 1 1.6\n\"3\" 2 1.7\n";
    assert_eq!(stored(numbered, "p"), [1.5, 1.6, 1.7]);
    let bars = "         ts          |  p  \n---------------------+-----\n 2026-03-02 08:15:00Z | 1.5\n\
                 2026-03-02 08:15:01Z | 1.6\n 2026-03-02 08:15:02Z | 1.7\n(3 rows)\n";
    assert_eq!(stored(bars, "p"), [1.5, 1.6, 1.7]);
    // One column of words with blanks is no table.
    assert_eq!(codes("a b c\nd e\nf\n"), ["no_signals"]);
}

#[test]
fn a_quality_behind_each_signal_rates_the_signal_before() {
    let twice = "time [s],A,Status,B,Status\n0,1,Good,5,Good\n1,2,Bad [Comm Failure],6,Good\n2,3,Good,7,\"Bad, Not Connected\"\n";
    let recording = parse(twice).unwrap();
    assert_eq!(recording.signals.len(), 2);
    assert_eq!(recording.signal("A").unwrap().missing(), 1);
    assert_eq!(recording.signal("B").unwrap().missing(), 1);
    assert_eq!(values(&recording, "A")[2], 3.0);
}

#[test]
fn points_that_may_stand_between_thousands_are_told() {
    let rows = "t [s];n [rpm]\n0;1.452\n1;1.467\n2;1.470\n";
    assert_eq!(told(&parse(rows).unwrap()), ["decimal_point"]);
    let clear = rows.replace("1.470", "1.47");
    assert!(told(&parse(&clear).unwrap()).is_empty());
    assert!(told(&parse(&rows.replace(';', ",")).unwrap()).is_empty());
}

#[test]
fn numbers_that_no_plant_has_are_missing() {
    let text = "t [s],U [V]\n0,1.5\n1,9.9E+37\n2,1.6\n3,-1e30\n";
    let recording = parse(text).unwrap();
    assert_eq!(recording.signal("U").unwrap().missing(), 2);
    assert_eq!(told(&recording), ["words_for_missing"]);
}

#[test]
fn a_column_that_says_whether_a_sample_is_good_rates_it() {
    for (title, good, bad) in [
        ("IsValid", "1", "0"),
        ("Valid", "Yes", "No"),
        ("Quality", "Good", "Comm Fail"),
    ] {
        let text = format!(
            "Timestamp,Tag,Value,{title}\n2026-03-02T08:15:00Z,PT,3.2,{good}\n2026-03-02T08:15:01Z,PT,3.3,{bad}\n\
             2026-03-02T08:15:02Z,PT,3.4,{good}\n"
        );
        let recording = parse(&text).unwrap();
        assert_eq!(recording.signal("PT").unwrap().missing(), 1, "{title}");
    }
}

#[test]
fn tags_may_be_numbers_and_rows_may_be_counted_twice() {
    let tags = "Date,Time,Millitm,TagIndex,Value,Status,Marker\n2026-03-02,08:15:00,000,0,3.2,,\n2026-03-02,08:15:00,000,1,65,,\n\
                2026-03-02,08:15:00,500,0,3.3,,\n2026-03-02,08:15:00,500,1,66,,\n";
    let mut options = Options::default();
    options.set("tz", "+01:00").unwrap();
    let recording = read(tags.as_bytes(), &options).unwrap();
    assert_eq!(values(&recording, "0"), [3.2, 3.3]);
    assert_eq!(values(&recording, "1"), [65.0, 66.0]);

    let twice = ",Unnamed: 0,time [s],p\n0,0,0,1\n1,1,1,2\n2,2,2,3\n";
    let recording = parse(twice).unwrap();
    assert_eq!(values(&recording, "p"), [1.0, 2.0, 3.0]);
    assert_eq!(recording.signals.len(), 1);
}

#[test]
fn columns_between_blanks_without_titles_are_asked_for() {
    assert_eq!(codes("0.0 1.5\n1.0 1.6\n2.0 1.7\n"), ["no_header"]);
    let mut options = Options::default();
    options.set("header_row", "none").unwrap();
    options.set("time_unit", "s").unwrap();
    let recording = read("0.0 1.5\n1.0 1.6\n2.0 1.7\n".as_bytes(), &options).unwrap();
    assert_eq!(values(&recording, "column_2"), [1.5, 1.6, 1.7]);
}

#[test]
fn a_time_may_stand_in_six_columns() {
    let text = "No.,Year,Month,Day,Hour,Min,Sec,P\n1,26,3,2,17,15,0,1.5\n2,26,3,2,17,15,0.5,1.6\n3,26,3,2,17,15,1,1.7\n";
    let mut options = Options::default();
    options.set("tz", "Asia/Tokyo").unwrap();
    let recording = read(text.as_bytes(), &options).unwrap();
    assert_eq!(values(&recording, "P"), [1.5, 1.6, 1.7]);
    assert_eq!(recording.signals.len(), 1);
    let start = recording.start.unwrap().to_string();
    assert_eq!(start, "2026-03-02T08:15:00Z");
    let instants: Vec<f64> = (0..3).map(|k| recording.time.instant(k)).collect();
    assert_eq!(instants, [0.0, 0.5, 1.0]);
}

#[test]
fn rows_of_states_are_no_samples_and_units_may_stand_far_above() {
    let states = "VarName;TimeString;VarValue;Validity\nPT;2026-03-02 08:15:00Z;3,2;1\nPT;2026-03-02 08:15:01Z;3,3;1\n\
                  PT;2026-03-02 08:15:02Z;3,4;1\n$RT_OFF$;2026-03-02 08:15:03Z;0;2\n";
    let recording = parse(states).unwrap();
    assert_eq!(values(&recording, "PT"), [3.2, 3.3, 3.4]);
    assert_eq!(recording.signals.len(), 1);
    assert!(told(&recording).contains(&"lines_left_out"));

    let scope = "Model,MSO44\nVertical Units,V,mV\nRecord Length,3\n\nTIME,CH1,CH2\n0.0,1.5,20\n0.1,1.6,21\n0.2,1.7,22\n";
    assert_eq!(stored(scope, "CH2"), [0.02, 0.021, 0.022]);

    let seconds = "ALIAS,DATA_TYPE,TIMESTAMP_SECONDS,TIMESTAMP_NANO_OFFSET,QUALITY,VALUE\n/p/PT,DOUBLE,1772439300,0,GOOD,3.2\n\
                   /p/PT,DOUBLE,1772439301,0,BAD,3.3\n/p/PT,DOUBLE,1772439302,0,GOOD,3.4\n";
    let recording = parse(seconds).unwrap();
    assert_eq!(recording.signal("/p/PT").unwrap().missing(), 1);
    assert_eq!(recording.start.unwrap().to_string(), "2026-03-02T08:15:00Z");
}
