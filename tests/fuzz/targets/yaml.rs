//! A model document in YAML.

#![no_main]

use greybox::parsing;
use greybox_fuzz::read_and_run;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    if let Ok(document) = parsing::yaml::parse(text) {
        read_and_run(&document);
    }
});
