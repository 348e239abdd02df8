//! What lines come to under a mapping: instants, values, refusals, and series without a rule.

use super::*;
use crate::Class;
use crate::intake::spread::{LastValue, MAX_UNMAPPED, MappedQuality, MappedSignal, MappingRule};

const STAMP: i64 = 1_465_839_830_100_400_207;

fn signal(name: &str, unit: &str) -> MappedSignal {
    MappedSignal {
        signal: name.to_owned(),
        unit: unit.to_owned(),
        interpolation: None,
    }
}

fn rule(hall: &str, stream: &str, signals: &[(&str, &str, &str)]) -> MappingRule {
    let signals = signals.iter();
    let signals = signals.map(|(field, name, unit)| ((*field).to_owned(), signal(name, unit)));
    MappingRule {
        measurement: "rig".to_owned(),
        tags: [("hall".to_owned(), hall.to_owned())].into(),
        stream: stream.to_owned(),
        signals: signals.collect(),
        quality: None,
    }
}

fn mapping() -> Mapping {
    let fields = [("position", "x", "mm"), ("open", "open", "")];
    Mapping {
        rules: vec![
            rule("2", "rig-4", &fields),
            rule("3", "rig-5", &[("position", "x", "m")]),
        ],
    }
}

fn write(text: &str) -> WrittenSamples {
    write_in(text, "ns")
}

fn write_in(text: &str, precision: &str) -> WrittenSamples {
    let precision = Precision::named(precision).unwrap();
    written(text.as_bytes(), &mapping(), precision, i64::MAX).unwrap()
}

#[test]
fn each_sample_lands_in_its_stream_with_its_own_instant_and_value() {
    let text = format!(
        "rig,hall=2,line=a position=1.5,open=t {}\nrig,hall=3 position=0.25 {STAMP}\n\
         rig,hall=2 position=2.5 {STAMP}\nrig,line=b,hall=2 position=3.5 {}\n",
        STAMP + 1,
        STAMP + 1
    );
    let written = write(&text);
    let [four, five] = &written.batches[..] else {
        panic!("two streams: {written:?}");
    };
    assert_eq!((four.stream.as_str(), four.points), ("rig-4", 3));
    assert_eq!(four.batch.rows.instants, [STAMP, STAMP + 1]);
    let names: Vec<&str> = four
        .batch
        .signals
        .iter()
        .map(|signal| signal.name.as_str())
        .collect();
    assert_eq!(names, ["open", "x"]);
    // The later of two lines at one instant counts.
    assert_eq!(four.batch.rows.columns[1].values, [2.5e-3, 3.5e-3]);
    assert!(four.batch.rows.columns[0].values[0].is_nan());
    assert_eq!(four.batch.rows.columns[0].values[1], 1.0);
    assert_eq!(
        (five.stream.as_str(), five.batch.rows.columns[0].values[0]),
        ("rig-5", 0.25)
    );
    assert_eq!((written.taken, written.refused.points), (4, 0));
}

#[test]
fn a_precision_is_a_whole_number_of_nanoseconds() {
    for (name, nanoseconds) in [
        ("n", 1),
        ("ns", 1),
        ("u", 1_000),
        ("us", 1_000),
        ("ms", 1_000_000),
        ("s", 1_000_000_000),
        ("m", 60_000_000_000),
        ("h", 3_600_000_000_000),
    ] {
        let written = write_in("rig,hall=2 position=1 407177\n", name);
        let instants = &written.batches[0].batch.rows.instants;
        assert_eq!(instants, &[407_177 * nanoseconds], "{name}");
    }
    assert_eq!(Precision::named("d"), None);
    let far = write_in("rig,hall=2 position=1 9223372036854775807\n", "h");
    assert!(
        far.refused.told[0].ends_with("time outside range"),
        "{:?}",
        far.refused
    );
}

#[test]
fn a_line_that_is_wrong_keeps_no_other_line_out() {
    let text = format!(
        "rig,hall=2 position=1\nrig,hall=2 position=\"up\" {STAMP}\nrig,hall=2 position= {STAMP}\n\
         rig,hall=2 position=4,open=f {STAMP}\nrig,hall=2 open=t,position=1e999 {STAMP}\n"
    );
    let written = write(&text);
    assert_eq!((written.taken, written.refused.points), (1, 4));
    let told = written.refused.told.join("\n");
    for sentence in [
        "unable to parse 'rig,hall=2 position=1': missing timestamp",
        "field type conflict: input field \"position\" on measurement \"rig\" is type string",
        "missing field value",
        "invalid number",
    ] {
        assert!(told.contains(sentence), "{sentence} in {told}");
    }
    let rows = &written.batches[0].batch.rows;
    assert_eq!(
        rows.columns[0].values,
        [0.0],
        "nothing of a line that is wrong is taken"
    );
}

#[test]
fn a_stamp_ahead_of_the_clock_is_refused_with_its_line() {
    let text = format!(
        "rig,hall=2 position=1 {STAMP}\nrig,hall=2 position=2 {}\n",
        STAMP + 2
    );
    let precision = Precision::NANOSECONDS;
    let written = written(text.as_bytes(), &mapping(), precision, STAMP + 1).unwrap();
    assert_eq!((written.taken, written.refused.points), (1, 1));
    assert_eq!(written.batches[0].batch.rows.instants, [STAMP]);
}

#[test]
fn series_without_a_rule_are_listed_and_not_taken() {
    let text = format!(
        "rig,hall=2 speed=1 {STAMP}\nrig,hall=2 speed=2 {}\npump,b=2,a=1 on=t 7\npump,a=1,b=2 on=f 8\n\
         pump state=\"{}\" 9\n",
        STAMP - 5,
        "x".repeat(500)
    );
    let written = write(&text);
    assert!(written.batches.is_empty());
    assert_eq!((written.taken, written.unlisted), (5, 0));
    let listed: Vec<(&str, u64, i64)> = written
        .unmapped
        .iter()
        .map(|series| (series.field.as_str(), series.samples, series.last_ns))
        .collect();
    assert_eq!(listed, [("speed", 2, STAMP), ("on", 2, 8), ("state", 1, 9)]);
    assert_eq!(written.unmapped[0].last_value, LastValue::Number(1.0));
    assert_eq!(written.unmapped[1].last_value, LastValue::Boolean(false));
    assert_eq!(
        written.unmapped[2].last_value,
        LastValue::Text("x".repeat(100))
    );
}

#[test]
fn the_list_of_series_is_bounded_and_counts_the_others() {
    use std::fmt::Write as _;
    let mut text = String::new();
    for k in 0..1500 {
        writeln!(text, "cpu,core={k} load=1 7").unwrap();
    }
    writeln!(text, "cpu,core={} load=1 7", "x".repeat(2000)).unwrap();
    let written = write(&text);
    assert_eq!(
        (written.unmapped.len(), written.unlisted),
        (MAX_UNMAPPED, 501)
    );
}

#[test]
fn samples_that_would_take_too_much_memory_are_refused() {
    use std::fmt::Write as _;
    let fields: Vec<String> = (0..1000).map(|k| format!("f{k}")).collect();
    let fields: Vec<(&str, &str, &str)> =
        fields.iter().map(|name| (&**name, &**name, "")).collect();
    let mapping = Mapping {
        rules: vec![rule("2", "rig-4", &fields)],
    };
    let mut text = String::new();
    for k in 0..10_000 {
        writeln!(text, "rig,hall=2 f{}=1 {k}", k % 1000).unwrap();
    }
    let refused = written(text.as_bytes(), &mapping, Precision::NANOSECONDS, i64::MAX);
    let told = refused.unwrap_err().to_string();
    assert!(told.contains("1000 signals at 10000 instants"), "{told}");
}

#[test]
fn a_field_may_say_how_good_the_others_of_its_line_are() {
    let mut mapping = mapping();
    mapping.rules[0].quality = Some(MappedQuality {
        fields: vec!["Quality".to_owned(), "trusted".to_owned()],
        codes: Some("opc_ua".to_owned()),
    });
    let text = "rig,hall=2 Quality=\"OK (0x0)\",position=1 1\n\
                rig,hall=2 position=2,Quality=\"BadTimeout (0x800A0000)\" 2\n\
                rig,hall=2 position=3,Quality=0i,trusted=f 3\n\
                rig,hall=2 position=4,Quality=\"?\" 4\nrig,hall=3 position=5,Quality=0 5\n";
    let written = written(text.as_bytes(), &mapping, Precision::NANOSECONDS, i64::MAX).unwrap();
    let column = &written.batches[0].batch.rows.columns[0];
    assert_eq!(column.classes, [Class::Good, Class::Bad, Class::Bad]);
    assert_eq!((column.values[0], column.values[1].is_nan()), (1e-3, true));
    assert_eq!((written.taken, written.refused.points), (4, 1));
    assert!(
        written.refused.told[0].contains("`quality.codes`"),
        "{:?}",
        written.refused
    );
    let unmapped: Vec<&str> = written
        .unmapped
        .iter()
        .map(|series| series.field.as_str())
        .collect();
    assert_eq!(
        unmapped,
        ["Quality"],
        "the rule of the third hall says nothing of quality"
    );
}
