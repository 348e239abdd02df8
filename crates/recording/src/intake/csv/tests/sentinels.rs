//! Numbers that loggers write where they have no value.

use super::{parse, read, values};
use crate::intake::{Options, ReadingPurpose};
use crate::{NewScratch, Scratch};
use std::io::Cursor;

fn with(option: &str, text: &str) -> Options {
    let mut options = Options::default();
    options.set(option, text).unwrap();
    options
}

fn missing(values: &[f64]) -> Vec<usize> {
    (0..values.len()).filter(|k| values[*k].is_nan()).collect()
}

/// Six samples, of which the third is a sentinel.
fn text(unit: &str, sentinel: &str) -> String {
    format!("t [s],p [{unit}],n\n0,1.5,1\n1,1.6,1\n2,{sentinel},1\n3,1.8,2\n4,1.9,1\n5,1.7,1\n")
}

#[test]
fn a_sentinel_far_from_values_that_vary_is_missing_and_told() {
    for sentinel in ["-9999", "-999.25", "-7999", "-32768", "65535", "999999"] {
        let recording = parse(&text("bar", sentinel)).unwrap();
        assert_eq!(missing(&values(&recording, "p")), [2], "{sentinel}");
        assert_eq!(values(&recording, "p")[3], 1.8e5);
        let told = recording
            .notes
            .iter()
            .find(|note| note.code == "likely_sentinel")
            .unwrap();
        assert!(
            told.detail.contains("missing=none keeps them"),
            "{}",
            told.detail
        );
    }
    // Degrees have an offset, and the rows of a historian name their tags.
    let degrees = parse(&text("degC", "-9999")).unwrap();
    assert_eq!(missing(&values(&degrees, "p")), [2]);
    let long = "timestamp,tag,value\n2026-03-02T08:15:00Z,p,1\n2026-03-02T08:15:01Z,p,-9999\n\
                2026-03-02T08:15:02Z,p,2\n2026-03-02T08:15:03Z,p,3\n";
    assert_eq!(missing(&values(&parse(long).unwrap(), "p")), [1]);
    // Newest first.
    let reversed = "t [s],p\n5,1\n4,2\n3,-9999\n2,4\n";
    assert_eq!(missing(&values(&parse(reversed).unwrap(), "p")), [1]);
}

#[test]
fn a_sentinel_that_may_be_a_value_is_kept() {
    let kept = |text: &str, options: &Options| {
        let recording = read(text.as_bytes(), options).unwrap();
        missing(&values(&recording, "p")).is_empty()
    };
    let option = |text: &str| with("missing", text);
    assert!(kept(&text("bar", "-9999"), &option("none")));
    assert!(kept(&text("bar", "-9999"), &option("none,-7999")));
    assert!(!kept(&text("bar", "-9999"), &option("none,-9999")));
    assert!(!kept(&text("bar", "-9999"), &option("Bad")));
    // A batch of a stream cannot be judged.
    let stream = Options::default().for_purpose(ReadingPurpose::Stream);
    let batch =
        "time,p\n2026-03-02T08:15:00Z,1\n2026-03-02T08:15:01Z,-9999\n2026-03-02T08:15:02Z,3\n";
    assert!(kept(batch, &stream));
    for text in [
        // A number that is on no list, one near the others, a signal of two levels, and one that is dead mostly.
        "t [s],p\n0,1\n1,-9998\n2,3\n3,4\n",
        "t [s],p\n0,-9000\n1,-9999\n2,-9500\n3,-9600\n",
        "t [s],p\n0,0\n1,65535\n2,0\n3,0\n",
        "t [s],p\n0,1\n1,-9999\n2,-9999\n3,2\n",
        "t [s],p\n0,1\n1,9999\n2,2\n3,3\n",
    ] {
        assert!(kept(text, &Options::default()), "{text}");
    }
}

#[test]
fn sentinels_of_a_long_recording_are_missing_in_the_scratch_too() {
    let rows = 300_000;
    let rows = (0..rows).map(|k| match k {
        7 | 250_000 | 299_999 => format!("{k},-9999\n"),
        k => format!("{k},{}\n", k % 10),
    });
    let text: String = std::iter::once("t [s],p [bar]\n".to_owned())
        .chain(rows)
        .collect();
    let new: NewScratch = Box::new(|| Ok(Box::new(Cursor::new(Vec::new())) as Box<dyn Scratch>));
    let options = Options::default();
    let kind = crate::intake::MediaKind::Csv;
    let received = crate::intake::receive(text.as_bytes(), kind, &options, Some(new)).unwrap();
    let recording = received.into_recording().unwrap();
    assert_eq!(missing(&values(&recording, "p")), [7, 250_000, 299_999]);
    assert_eq!(values(&recording, "p")[250_001], 1e5);
}

#[test]
fn a_status_behind_a_number_says_how_good_it_is() {
    let text = "t [s],p [bar]\n0,3.200 (Good NonSpecific)\n1,3.3 (Uncertain LastUsable)\n2,9.9 (Bad Device Failure)\n\
                3,3.5 (Good NonSpecific)\n";
    let recording = parse(text).unwrap();
    let pressures = values(&recording, "p");
    assert_eq!(
        (pressures[0], pressures[1], pressures[3]),
        (3.2e5, 3.3e5, 3.5e5)
    );
    assert_eq!(missing(&pressures), [2]);
    let told = recording
        .notes
        .iter()
        .find(|note| note.code == "status_in_cells")
        .unwrap();
    assert!(
        told.detail.starts_with("4 cells") && told.detail.contains("1 bad"),
        "{}",
        told.detail
    );
    let comma = "t [s];p [bar]\n0;3,2 (Good)\n1;3,35 (Good)\n2;3,4 (Good)\n";
    assert_eq!(values(&parse(comma).unwrap(), "p"), [3.2e5, 3.35e5, 3.4e5]);
    let words = "t [s],p\n0,1\n1,3.2 (left)\n2,3\n";
    assert_eq!(super::codes(words), ["not_a_number"]);
}
