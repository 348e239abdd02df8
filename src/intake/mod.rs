//! Reading recordings: a file for each format that plants write.
//!
//! CSV ([`csv::read`]) and JSON ([`json::read`]) become [`Recording`](crate::recording::Recording)s
//! in SI units ([`units`]).

pub mod csv;
mod error;
pub mod json;
pub mod units;

pub use error::{Fault, MAX_FAULTS, ReadError};

#[cfg(test)]
mod round_trip {
    //! What one part writes the other reads back.

    use super::csv;
    use crate::recording::{Recording, Signal, TimeAxis};
    use proptest::prelude::*;

    fn value() -> impl Strategy<Value = f64> {
        prop_oneof![9 => -1e12..1e12, 1 => Just(f64::NAN), 1 => prop::num::f64::NORMAL]
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        let canonical = |v: &f64| {
            if v.is_nan() {
                f64::NAN.to_bits()
            } else {
                v.to_bits()
            }
        };
        values.iter().map(canonical).collect()
    }

    proptest! {
        #[test]
        fn a_recording_written_as_csv_reads_back_to_the_same_bits(
            rows in prop::collection::vec((value(), value()), 2..60),
            milliseconds in 1_u32..10_000,
        ) {
            let (a, b): (Vec<f64>, Vec<f64>) = rows.into_iter().unzip();
            let time =
                TimeAxis::Uniform { sample_time: f64::from(milliseconds) / 1e3, samples: a.len() };
            let signals =
                vec![Signal::new("spool, \"left\" [raw]", "", a), Signal::new("position", "m", b)];
            let written = Recording::new(time, signals);
            let mut text = Vec::new();
            written.write_csv(&mut text).unwrap();
            let read = csv::read(text.as_slice(), &csv::Options::default()).unwrap();
            prop_assert_eq!(&read.time, &written.time);
            for (read, written) in read.signals.iter().zip(&written.signals) {
                prop_assert_eq!(&read.name, &written.name);
                prop_assert_eq!(&read.unit, &written.unit);
                prop_assert_eq!(bits(&read.values), bits(&written.values));
            }
        }
    }
}
