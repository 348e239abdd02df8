//! Names and values as SQL and InfluxQL write them.

/// A name in quotes.
pub(super) fn name(text: &str) -> String {
    format!("\"{}\"", text.replace('"', "\"\""))
}

/// A name that a dot may part, as that of a schema and its table: each part in quotes.
pub(super) fn dotted(text: &str) -> String {
    let parts: Vec<String> = text.split('.').map(name).collect();
    parts.join(".")
}

/// A text as a value of SQL.
pub(super) fn value(text: &str) -> String {
    format!("'{}'", text.replace('\'', "''"))
}

/// A name as InfluxQL writes it, with a backslash before quotes.
pub(super) fn influx_name(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\""))
}

/// A text as a value of InfluxQL.
pub(super) fn influx_value(text: &str) -> String {
    format!("'{}'", text.replace('\\', "\\\\").replace('\'', "\\'"))
}
