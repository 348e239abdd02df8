//! The bytes of a recording, read as each of the formats: the first byte says as which, the second with
//! which options.

#![no_main]

use greybox::intake::{self, MediaKind, Options};
use libfuzzer_sys::fuzz_target;
use std::sync::LazyLock;

/// What `format` may name.
const FORMATS: [&str; 21] = [
    "json",
    "wide_csv",
    "senseye",
    "ignition",
    "long_csv",
    "paired_csv",
    "aveva_sql",
    "simulink_csv",
    "influx_csv",
    "influx_line_protocol",
    "pi_web_api",
    "omf",
    "aveva_odata",
    "canary",
    "opc_ua_json",
    "cognite",
    "pandas_records",
    "pandas_split",
    "pandas_table",
    "excel",
    "parquet",
];

/// Those that `FORMATS` names, all of them without it.
static CHOSEN: LazyLock<Vec<&str>> = LazyLock::new(|| {
    let asked = std::env::var("FORMATS").unwrap_or_default();
    let is_asked = |name: &&&str| asked.is_empty() || asked.split(',').any(|own| own == **name);
    FORMATS.iter().filter(is_asked).copied().collect()
});

/// An option for each bit of the second byte.
const OPTIONS: [(&str, &str); 8] = [
    ("tz", "Europe/Berlin"),
    ("time_unit", "ms"),
    ("decimal", ","),
    ("encoding", "utf-16le"),
    ("missing", "-9999,Bad"),
    ("interpolation", "hold"),
    ("quality_scheme", "opc_ua"),
    ("grid", "10ms"),
];

/// Panics of the libraries that read files are caught where they are called; all others are faults.
static HOOK: LazyLock<()> = LazyLock::new(|| {
    let ends = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let file = panic.location().map_or("", |place| place.file());
        let is_caught = ["/parquet-", "/calamine-"].iter().any(|one| file.contains(one));
        if !is_caught {
            ends(panic);
        }
    }));
});

fuzz_target!(|bytes: &[u8]| {
    LazyLock::force(&HOOK);
    let [first, second, bytes @ ..] = bytes else {
        return;
    };
    let mut options = Options::default();
    let format = CHOSEN[usize::from(*first) % CHOSEN.len()];
    options.set("format", format).expect("it is one");
    for (bit, (name, text)) in OPTIONS.iter().enumerate() {
        if second & (1 << bit) != 0 {
            options.set(name, text).expect("it is sound");
        }
    }
    if let Ok(recording) = intake::read(bytes, MediaKind::Binary, &options) {
        let _ = recording.summary();
    }
});
