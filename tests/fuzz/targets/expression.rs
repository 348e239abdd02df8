//! An expression, as a state's rate of change in a small model.

#![no_main]

use greybox_fuzz::read_and_run;
use libfuzzer_sys::fuzz_target;
use serde_json::json;

fuzz_target!(|text: &str| {
    read_and_run(&json!({
        "name": "fuzzed",
        "title": "One expression",
        "inputs": {"u": {"unit": "1"}},
        "parameters": {"k": {"unit": "1", "default": 2.0}, "m": {"unit": "kg", "default": 3.0}},
        "constants": {"c": {"value": 0.5}},
        "tables": {"curve": {"x": [-1, 0, 2], "y": [0, 1, 3]}},
        "sampled": {"held": {"expression": "u - x"}},
        "quantities": {"twice": {"expression": "2*x"}},
        "states": {"x": {"unit": "1", "derivative": text, "initial": 0.25}},
        "outputs": {"y": {"unit": "1", "expression": "x"}}
    }));
});
