//! The bytes of a recording in CSV.

#![no_main]

use greybox::recording::Recording;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(recording) = Recording::from_csv(bytes) {
        let _ = recording.summary();
    }
});
