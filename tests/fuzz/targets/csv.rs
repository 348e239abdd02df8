//! The bytes of a recording in CSV.

#![no_main]

use greybox::intake::csv::{self, Options};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(recording) = csv::read(bytes, &Options::default()) {
        let _ = recording.summary();
    }
});
