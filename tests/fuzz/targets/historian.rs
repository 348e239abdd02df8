//! The bytes of a recording in the JSON or the lines of a historian; the first byte says of which
//! kind.

#![no_main]

use greybox::intake::{self, MediaKind, Options};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Some((first, bytes)) = bytes.split_first() else {
        return;
    };
    let kind = match first % 2 {
        0 => MediaKind::Json,
        _ => MediaKind::Text,
    };
    if let Ok(recording) = intake::read(bytes, kind, &Options::default()) {
        let _ = recording.summary();
    }
});
