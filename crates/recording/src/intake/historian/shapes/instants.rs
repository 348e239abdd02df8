//! Times of a document: which field is the time, and what is one by its look.

use super::super::super::csv::time_name_and_unit;
use super::super::super::epochs::is_unix_time;
use super::super::super::stamp;
use super::super::leaf::{Fields, JsonLeaf};
use super::super::time_names;
use super::keys::is_any;
use jiff::Timestamp;
use std::borrow::Cow;

/// Names of fields that are the time where their values are instants, in small letters without signs.
const INSTANTS: [&str; 13] = [
    "time",
    "timestamp",
    "timestamps",
    "lastchanged",
    "lastupdated",
    "enqueuedtime",
    "eventtime",
    "sourcetimestamp",
    "observedat",
    "createdat",
    "receivedat",
    "recordedat",
    "timestampms",
];

/// Names of fields that are a time even where their values are plain numbers.
pub(super) const CLOCKS: [&str; 5] = ["timestamp", "time", "datetime", "ts", "t"];

/// Whether a text is a date or a Unix time by its look.
pub(super) fn is_instant_text(text: &str) -> bool {
    text.parse()
        .map_or_else(|_| stamp::is_one(text), is_unix_time)
}

/// Whether a leaf is an instant by its look.
pub(super) fn is_instant(leaf: &JsonLeaf) -> bool {
    match leaf {
        JsonLeaf::Integer(number) => is_unix_time(*number as f64),
        JsonLeaf::Number(number) => is_unix_time(*number),
        JsonLeaf::Text(text) => is_instant_text(text),
        JsonLeaf::Object(parts) => {
            of_parts(parts).is_some() || of_date(parts).is_some_and(is_instant)
        }
        _ => false,
    }
}

/// Whether a field is an instant: a date by its look, or a Unix time where its key is that of a time too.
pub(super) fn is_instant_field(key: &str, leaf: &JsonLeaf) -> bool {
    /// Parts of the keys of times.
    const PARTS: [&str; 4] = ["time", "date", "stamp", "zeit"];
    let lower = key.to_lowercase();
    let is_time =
        || is_any(key, &["x", "t", "ts"]) || PARTS.iter().any(|part| lower.contains(part));
    let is_number = match leaf {
        JsonLeaf::Text(text) => text.parse::<f64>().is_ok(),
        JsonLeaf::Object(_) => false,
        _ => true,
    };
    is_instant(leaf) && (!is_number || is_time())
}

/// The instant that stands in an object of MongoDB.
fn of_date(parts: &Fields) -> Option<&JsonLeaf> {
    match parts.get("$date")? {
        JsonLeaf::Object(number) => number.get("$numberLong"),
        leaf => Some(leaf),
    }
}

/// The leaf that is read as the time of a sample.
pub(super) fn of_leaf(leaf: &JsonLeaf) -> Cow<'_, JsonLeaf> {
    let JsonLeaf::Object(parts) = leaf else {
        return Cow::Borrowed(leaf);
    };
    match of_parts(parts) {
        Some(instant) => Cow::Owned(JsonLeaf::Text(instant)),
        None => Cow::Borrowed(of_date(parts).unwrap_or(leaf)),
    }
}

/// The instant that is written as seconds and nanoseconds.
pub(super) fn of_parts(parts: &Fields) -> Option<String> {
    let whole = |names: [&str; 2]| {
        names.iter().find_map(|name| match parts.get(name)? {
            JsonLeaf::Integer(number) => Some(*number),
            JsonLeaf::Text(text) => text.parse().ok(),
            _ => None,
        })
    };
    let seconds = whole(["timeInSeconds", "seconds"])?;
    let nanoseconds = whole(["offsetInNanos", "nanos"]).unwrap_or(0);
    let instant = Timestamp::new(seconds, i32::try_from(nanoseconds).ok()?).ok()?;
    Some(instant.to_string())
}

/// The field of an object that is its time: the one that the option names, one that has the name of a time and is
/// an instant, or a number under a name that is that of a time alone.
pub(super) fn time_key<'f>(fields: &'f Fields, option: Option<&str>) -> Option<&'f str> {
    if let Some((key, _)) = option.and_then(|time| fields.0.iter().find(|(key, _)| **key == *time))
    {
        return Some(key);
    }
    let keys = || fields.0.iter();
    let is_scalar = |leaf: &JsonLeaf| leaf.is_scalar() && *leaf != JsonLeaf::Null;
    let by_name = time_names::named(keys().map(|(key, _)| &**key));
    let by_name = keys().find(|(key, leaf)| {
        Some(&**key) == by_name
            && (is_instant(leaf) || is_scalar(leaf) && is_any(time_name_and_unit(key).0, &CLOCKS))
    });
    let by_look = || {
        let mut names = INSTANTS.iter();
        names.find_map(|name| keys().find(|(key, leaf)| is_any(key, &[name]) && is_instant(leaf)))
    };
    by_name.or_else(by_look).map(|(key, _)| &**key)
}
