//! The bytes of a model document.

#![no_main]

use greybox::parsing;
use greybox_fuzz::read_and_run;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(document) = parsing::json::parse(bytes) {
        read_and_run(&document);
    }
});
