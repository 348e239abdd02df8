//! What columns of times are called.

/// Names of columns that are a time in seconds where nothing else is said.
pub(in crate::intake) const TIMES: [&str; 13] = [
    "time",
    "t",
    "times",
    "seconds",
    "sec",
    "secs",
    "second",
    "elapsed",
    "elapsedtime",
    "zeit",
    "temps",
    "tiempo",
    "xvalue",
];

/// Names of columns that count samples.
pub(super) const COUNTERS: [&str; 12] = [
    "sample",
    "samples",
    "sampleindex",
    "sampleno",
    "samplenumber",
    "index",
    "idx",
    "row",
    "n",
    "k",
    "i",
    "no",
];
