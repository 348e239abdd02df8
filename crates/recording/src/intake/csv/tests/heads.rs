//! Heads of instruments, sections of tags and times that go on past midnight.

use super::{codes, parse, read, values};
use crate::Recording;
use crate::intake::Options;

fn with(pairs: &[(&str, &str)]) -> Options {
    let mut options = Options::default();
    for (option, text) in pairs {
        options.set(option, text).unwrap();
    }
    options
}

fn told(recording: &Recording, code: &str) -> bool {
    recording.notes.iter().any(|note| note.code == code)
}

fn start(recording: &Recording) -> String {
    recording
        .start
        .map(|start| start.to_string())
        .unwrap_or_default()
}

fn instants(recording: &Recording) -> Vec<f64> {
    (0..recording.time.samples())
        .map(|k| recording.time.instant(k))
        .collect()
}

const LABVIEW: &str = "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\n\
    Date\t2026/03/02\nTime\t08:15:00.0000000\n***End_of_Header***\t\n\nChannels\t2\t\nSamples\t3\t3\n\
    Date\t2026/03/02\t2026/03/02\nTime\t08:15:01.5\t08:15:01.5\nY_Unit_Label\tbar\tdegC\nX_Dimension\tTime\tTime\n\
    X0\t0.0\t0.0\nDelta_X\t0.01\t0.01\n***End_of_Header***\t\t\nX_Value\tPT\tTT\tComment\n\
    0.010000\t3.2\t65.0\n0.020000\t3.3\t65.1\n0.030000\t3.4\t65.25\n";

#[test]
fn the_head_of_a_labview_measurement_says_when_it_began() {
    let utc = with(&[("tz", "UTC")]);
    let recording = read(LABVIEW.as_bytes(), &utc).unwrap();
    assert_eq!(start(&recording), "2026-03-02T08:15:01.51Z");
    assert_eq!(values(&recording, "PT"), [3.2e5, 3.3e5, 3.4e5]);
    assert_eq!(values(&recording, "TT")[0], 338.15);
    assert_eq!(recording.zone.as_deref(), Some("UTC"));
    assert!(told(&recording, "instrument_head"));
    assert_eq!(codes(LABVIEW), ["no_offset"; 3]);
    // A comment in a row is a column, which is kept aside.
    let comment = LABVIEW.replace("65.0", "65.0\tvalve opened");
    let comment = comment
        .replace("65.1", "65.1\t")
        .replace("65.25", "65.25\t");
    assert_eq!(
        values(&read(comment.as_bytes(), &utc).unwrap(), "TT")[0],
        338.15
    );
    // Channels that began at different times have no one beginning.
    let apart = LABVIEW.replace("08:15:01.5\t08:15:01.5", "08:15:01.5\t08:15:02.5");
    let recording = read(apart.as_bytes(), &utc).unwrap();
    assert_eq!(recording.start, None);
    let commas = LABVIEW.replace('.', ",");
    assert_eq!(
        start(&read(commas.as_bytes(), &utc).unwrap()),
        "2026-03-02T08:15:01.51Z"
    );
}

const TWINCAT: &str = "Name\tScope Project\nFile\tC:\\Scope\\run.svdx\nStarttime of export\t134169129000000000\tMonday\n\
    Endtime of export\t134169129000380000\tMonday\n\nName\tMAIN.fPressure\tName\tMAIN.fSpeed\n\
    SymbolComment\t\tSymbolComment\t\nData-Type\tREAL64\tData-Type\tREAL64\nSampleTime[ms]\t2\tSampleTime[ms]\t2\n\
    VariableSize\t8\tVariableSize\t8\nUnit\tbar\tUnit\tHz\n\n0\t3.2\t0\t50.5\n2\t3.3\t2\t51.5\n4\t3.4\t4\t52.5\n";

#[test]
fn a_twincat_scope_has_a_block_of_facts_for_each_signal() {
    let recording = parse(TWINCAT).unwrap();
    assert_eq!(start(&recording), "2026-03-02T08:15:00Z");
    assert_eq!(values(&recording, "MAIN.fPressure")[..2], [3.2e5, 3.3e5]);
    assert_eq!(recording.signals.len(), 2);
    assert_eq!(recording.signal("MAIN.fSpeed").unwrap().unit, "Hz");
    assert_eq!(instants(&recording), [0.0, 0.002, 0.004]);
    let commas = TWINCAT
        .replace('.', ",")
        .replace("MAIN,", "MAIN.")
        .replace('\t', ";");
    assert_eq!(start(&parse(&commas).unwrap()), "2026-03-02T08:15:00Z");
    // Times whose steps are not those of the head are in no unit that it tells.
    let unlike = TWINCAT.replace("SampleTime[ms]\t2", "SampleTime[ms]\t5");
    assert!(parse(&unlike).is_err());
}

#[test]
fn oscilloscopes_count_samples_or_have_facts_beside_them() {
    let tds = "Record Length,3,,-0.001,4.8,\nSource,CH1,,0.0,6.7,\nVertical Units,V,,0.001,8.2,\nHorizontal Units,s,,0.002,8.7,\n";
    let recording = parse(tds).unwrap();
    assert_eq!(values(&recording, "CH1"), [4.8, 6.7, 8.2, 8.7]);
    assert_eq!(
        (recording.signals.len(), recording.time.sample_time()),
        (1, 0.001)
    );
    assert_eq!(recording.signals[0].unit, "V");

    let infiniium = "Type,raw\nPoints,3\nXInc,1E-04\nXOrg,-1E-03\nYUnits,Volt,Ampere\nXUnits,second\nTime,1,2\n\
                     -1E-03,+4.8,+17.4\n-9E-04,+6.7,+17.9\n-8E-04,+8.2,+18.2\n";
    let recording = parse(infiniium).unwrap();
    assert_eq!(values(&recording, "2"), [17.4, 17.9, 18.2]);
    assert_eq!(recording.signal("2").unwrap().unit, "A");

    let sequence = "X,CH1,CH2,Start,Increment\nSequence,Volt,Volt,-1.0e-03,1.0e-04\n0,4.8,17.4,,\n1,6.7,17.9,,\n2,8.2,18.2,,\n";
    let recording = parse(sequence).unwrap();
    assert_eq!(values(&recording, "CH1"), [4.8, 6.7, 8.2]);
    assert_eq!(
        (recording.signals.len(), recording.time.sample_time()),
        (2, 1e-4)
    );
    let milliseconds = read(sequence.as_bytes(), &with(&[("time_unit", "ms")])).unwrap();
    assert_eq!(milliseconds.time.sample_time(), 1e-3);

    let increment =
        "CH1V,CH2A,t0 =-1.0e-03,tInc = 1.0e-04\n4.8,17.4,,\n6.7,17.9,,\n4.8,17.4,,\n8.2,18.2,,\n\n";
    let recording = parse(increment).unwrap();
    assert_eq!(values(&recording, "CH1V"), [4.8, 6.7, 4.8, 8.2]);
    assert_eq!(recording.signal("CH2A").unwrap().unit, "A");
    assert_eq!(
        (recording.time.samples(), recording.time.sample_time()),
        (4, 1e-4)
    );
    assert!(parse(&increment.replace("1.0e-04", "0")).is_err());

    // A table whose first title looks so is read as before.
    let plain = parse("X,CH1,CH2\n0,1,2\n1,2,3\n").unwrap_err();
    assert_eq!(plain.faults()[0].code, "time_unit_needed");
    assert_eq!(
        values(&parse("Time [s],Name\n0,1\n1,2\n").unwrap(), "Name"),
        [1.0, 2.0]
    );
}

#[test]
fn recorders_of_yokogawa_name_channels_and_times_apart() {
    let gx20 = "Device,GX20\nSerial No.,S5\n\nChannel,,,CH0001,CH0002\nTag,,,Feed,Outlet\nUnit,,,V,°C\nDate,Time,msec,,\n\
                2026/03/02,17:15:00,0,3.2,65.0\n2026/03/02,17:15:00,500,3.4,65.5\n2026/03/02,17:15:01,0,3.6,66.0\n";
    assert_eq!(codes(gx20)[0], "no_offset");
    let recording = read(gx20.as_bytes(), &with(&[("tz", "Asia/Tokyo")])).unwrap();
    assert_eq!(start(&recording), "2026-03-02T08:15:00Z");
    assert_eq!(recording.time.sample_time(), 0.5);
    assert_eq!(values(&recording, "CH0001"), [3.2, 3.4, 3.6]);
    assert_eq!(values(&recording, "CH0002")[0], 338.15);

    let dl850 = "\"Model Name\",\"DL850E\"\n\"BlockNumber\",1\n\"TraceName\",\"CH1\",\"CH2\"\n\"BlockSize\",3,3\n\
                 \"VUnit\",\"V\",\"A\"\n\"SampleRate\",1.0E+03,1.0E+03\n\"HResolution\",1.0E-03,1.0E-03\n\"HOffset\",0.0E+00,0.0E+00\n\
                 \"HUnit\",\"s\",\"s\"\n\"Date\",\"2026/03/02\",\"2026/03/02\"\n\"Time\",\"17:15:00.00\",\"17:15:00.00\"\n\"\"\n\
                 ,4.8,17.4\n,6.7,17.9\n,8.2,18.2\n";
    let tokyo = with(&[("tz", "Asia/Tokyo")]);
    let recording = read(dl850.as_bytes(), &tokyo).unwrap();
    assert_eq!(start(&recording), "2026-03-02T08:15:00Z");
    assert_eq!(instants(&recording), [0.0, 1e-3, 2e-3]);
    assert_eq!(values(&recording, "CH2"), [17.4, 17.9, 18.2]);
    let later = dl850.replace("\"HOffset\",0.0E+00", "\"HOffset\",5.0E-01");
    assert!(read(later.as_bytes(), &tokyo).is_err());
}

#[test]
fn a_matrix_of_octave_has_numbered_columns() {
    let saved = "# Created by Octave 8.4.0, Mon Mar 02 08:15:00 2026 UTC <lab@rig>\n# name: data\n# type: matrix\n\
                 # rows: 3\n# columns: 2\n 0 3.2\n 0.1 3.4\n 0.2 3.6\n\n\n";
    assert_eq!(codes(saved)[0], "time_unit_needed");
    let recording = read(saved.as_bytes(), &with(&[("time_unit", "s")])).unwrap();
    assert_eq!(values(&recording, "column_2"), [3.2, 3.4, 3.6]);
    let two = format!("{saved}# name: more\n# type: matrix\n# rows: 1\n# columns: 2\n 0 1\n");
    assert!(read(two.as_bytes(), &with(&[("time_unit", "s")])).is_err());
}

#[test]
fn a_section_of_tags_has_the_units_of_the_samples() {
    let text = "[Tags]\nTagname,Description,EngineeringUnits\nA.PV,Feed pressure,bar\nB.PV,Level,\nC.PV,Spare,mm\n\n[Data]\n\
                Tagname,TimeStamp,Value,DataQuality\nA.PV,2026-03-02T08:15:00Z,3.2,Good\nA.PV,2026-03-02T08:15:10Z,3.4,Good\n\
                B.PV,2026-03-02T08:15:00Z,65,Good\nB.PV,2026-03-02T08:15:10Z,66,Good\n";
    let recording = parse(text).unwrap();
    assert_eq!(values(&recording, "A.PV"), [3.2e5, 3.4e5]);
    assert_eq!(values(&recording, "B.PV"), [65.0, 66.0]);
    assert_eq!(codes(&text.replace(",bar", ",parsec")), ["unknown_unit"]);
}

#[test]
fn columns_between_blanks_end_where_dashes_end() {
    let text = "DateTime                    TagName Value    OPCQuality\n\
                --------------------------- ------- -------- ----------\n\
                2026-03-02 08:15:00.0000000 A.PT       3.200        192\n\
                2026-03-02 08:15:00.0000000 A TT       65.03        192\n\
                2026-03-02 08:15:05.0000000 A.PT       3.447         24\n\
                2026-03-02 08:15:05.0000000 A TT       65.37        192\n\n(4 rows affected)\n";
    let utc = with(&[("tz", "UTC")]);
    let recording = read(text.as_bytes(), &utc).unwrap();
    assert_eq!(values(&recording, "A TT"), [65.03, 65.37]);
    assert_eq!(values(&recording, "A.PT")[0], 3.2);
    assert!(values(&recording, "A.PT")[1].is_nan());
    assert_eq!(start(&recording), "2026-03-02T08:15:00Z");
}

#[test]
fn nanoseconds_beside_unix_seconds_belong_to_the_time() {
    let text = "series_id,time_in_seconds,offset_in_nanos,quality,double_value,alias\na,1772439300,0,GOOD,3.2,/p\n\
                b,1772439300,0,GOOD,65.0,/T\na,1772439300,250000001,GOOD,3.4,/p\nb,1772439300,250000001,BAD,65.5,/T\n\
                a,1772439301,7,GOOD,3.5,/p\nb,1772439301,7,GOOD,65.5,/T\n";
    let recording = parse(text).unwrap();
    assert_eq!(values(&recording, "/p"), [3.2, 3.4, 3.5]);
    assert!(values(&recording, "/T")[1].is_nan());
    assert_eq!(recording.signals.len(), 2);
    assert_eq!(instants(&recording), [0.0, 0.250_000_001, 1.000_000_007]);
}

#[test]
fn times_of_day_go_on_past_midnight() {
    let text = "Time,p\n23:59:58,1\n23:59:59,2\n00:00:00,3\n00:00:01,4\n";
    let recording = parse(text).unwrap();
    assert_eq!(instants(&recording), [0.0, 1.0, 2.0, 3.0]);
    assert!(told(&recording, "next_day"));
    let days = "Time,p\n12:00:00,1\n23:00:00,2\n01:00:00,3\n12:00:00,4\n23:30:00,5\n00:30:00,6\n";
    let hours: Vec<f64> = instants(&parse(days).unwrap())
        .iter()
        .map(|s| s / 3600.0)
        .collect();
    assert_eq!(hours, [0.0, 11.0, 13.0, 24.0, 35.5, 36.5]);
    // A fall of some hours is another recording, or a clock that was set.
    assert_eq!(
        codes("Time,p\n10:00:00,1\n10:00:01,2\n09:00:00,3\n09:00:01,4\n"),
        ["time_backwards"]
    );
    let newest_first = parse("Time,p\n10:00:02,1\n10:00:01,2\n10:00:00,3\n").unwrap();
    assert!(told(&newest_first, "newest_first") && !told(&newest_first, "next_day"));
}

#[test]
fn units_behind_blanks_are_taken_where_all_titles_have_one() {
    let recording = parse("t [s];PT101 bar;TT102 °C\n0;3.25;65\n1;3.5;66\n").unwrap();
    assert_eq!(values(&recording, "PT101 bar"), [3.25e5, 3.5e5]);
    assert_eq!(values(&recording, "TT102 °C")[0], 338.15);
    assert!(told(&recording, "unit_from_name"));
    let given = with(&[("units", "PT101.bar:mbar")]);
    let recording = read("t [s],PT101.bar,n.rpm\n0,3,60\n1,4,60\n".as_bytes(), &given).unwrap();
    assert_eq!(values(&recording, "PT101.bar"), [300.0, 400.0]);
    let recording = parse("t [s],PLC.A,PLC.B\n0,3,60\n1,4,60\n").unwrap();
    assert_eq!(values(&recording, "PLC.A"), [3.0, 4.0]);
}
