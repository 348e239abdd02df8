//! Names by which columns and fields are the time.

use super::super::csv::time_name_and_unit;

/// Names of fields that are the time, in the order in which they are looked for.
const TIMES: [&str; 10] = [
    "timestamp",
    "time",
    "datetime",
    "date",
    "date_time",
    "ts",
    "t",
    "t_stamp",
    "index",
    "level_0",
];

/// The first of these names that is the time of a table by its name alone.
pub(super) fn named<'k>(mut keys: impl Iterator<Item = &'k str>) -> Option<&'k str> {
    let is_called = |key: &str, time: &str| {
        let (plain, _) = time_name_and_unit(key);
        plain.to_lowercase() == time || key.to_lowercase() == time
    };
    keys.find(|key| TIMES.iter().any(|time| is_called(key, time)))
}
