//! Samples of an InfluxDB, by InfluxQL over HTTP: version 1, and version 2 where a mapping of its database is made.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::Deserialize;
use serde_json::Value;

use super::cursors::nanoseconds;
use super::endpoint::Endpoint;
use super::error::CollectError;
use super::page::{PageWriter, ReadStretch, SeriesPage};
use super::query::{influx_name, influx_value};
use super::series::SourceSeries;

/// An InfluxDB and the database in it.
#[derive(Clone, Debug)]
pub struct Influx {
    pub(super) server: Endpoint,
    pub(super) database: String,
    pub(super) retention: Option<String>,
}

/// What InfluxDB answers to a query.
#[derive(Deserialize)]
struct InfluxAnswer {
    #[serde(default)]
    results: Vec<QueryResult>,
    error: Option<String>,
}

#[derive(Deserialize)]
struct QueryResult {
    #[serde(default)]
    series: Vec<CombinationRows>,
    error: Option<String>,
}

/// Rows of one combination of tags.
#[derive(Deserialize)]
struct CombinationRows {
    #[serde(default)]
    tags: BTreeMap<String, String>,
    /// Each row has the instant and then the fields in the order of the query.
    values: Vec<Vec<Value>>,
}

impl Influx {
    /// Rows of a series.
    pub(super) async fn read(
        &self,
        series: &SourceSeries,
        stretch: &ReadStretch,
    ) -> Result<SeriesPage, CollectError> {
        let mut url = self.server.address(&["query"]);
        url.query_pairs_mut()
            .append_pair("db", &self.database)
            .append_pair("epoch", "ns")
            .append_pair("q", &self.query(series, stretch));
        let answered = self.server.get(&url).await;
        let answered = answered.map_err(|error| CollectError::away(&error))?;
        let status = answered.status();
        let answer: Result<InfluxAnswer, _> = serde_json::from_slice(answered.body());
        if status.is_server_error() {
            return Err(CollectError::SourceAway(status.to_string()));
        }
        let answer = answer.map_err(|error| refusal(format!("{status}: {error}")))?;
        let results = answer.results.into_iter().next();
        let inner = results.as_ref().and_then(|result| result.error.clone());
        if let Some(error) = answer.error.or(inner) {
            return Err(refusal(error));
        }
        let rows = results.map_or(Vec::new(), |result| result.series);
        page(series, rows)
    }

    fn query(&self, series: &SourceSeries, stretch: &ReadStretch) -> String {
        let fields: Vec<String> = series
            .columns
            .iter()
            .map(|column| influx_name(&column.field))
            .collect();
        let retention = self.retention.as_ref();
        let retention = retention.map_or(String::new(), |name| format!("{}.", influx_name(name)));
        let filter = series.filter.iter();
        let filter = filter
            .map(|(name, value)| format!("{} = {} AND ", influx_name(name), influx_value(value)));
        // Combinations of tags come apart, so that two plants are never mixed into one signal.
        format!(
            "SELECT {} FROM {retention}{} WHERE {}time > {} AND time <= {} GROUP BY * ORDER BY time ASC LIMIT {}",
            fields.join(", "),
            influx_name(&series.table),
            filter.collect::<String>(),
            nanoseconds(stretch.between.start),
            nanoseconds(stretch.between.end),
            stretch.rows,
        )
    }
}

fn refusal(why: impl Into<String>) -> CollectError {
    CollectError::SourceRefuses(why.into())
}

fn page(
    series: &SourceSeries,
    combinations: Vec<CombinationRows>,
) -> Result<SeriesPage, CollectError> {
    if let [first, second, ..] = &combinations[..] {
        let detail = format!(
            "`{}` has samples of several combinations of tags there, such as {:?} and {:?}: `where` says of which one",
            series.table, first.tags, second.tags
        );
        return Err(refusal(detail));
    }
    let mut writer = PageWriter::new(&series.columns);
    for row in combinations.into_iter().flat_map(|rows| rows.values) {
        let (time, fields) = row.split_first().ok_or_else(|| refusal("a row is empty"))?;
        let instant = time.as_i64().map(i128::from);
        let instant = instant.and_then(|instant| Timestamp::from_nanosecond(instant).ok());
        let instant = instant.ok_or_else(|| refusal(format!("{time} is no instant")))?;
        let cells = fields
            .iter()
            .zip(&series.columns)
            .map(|(value, column)| match value {
                Value::Null => Ok(String::new()),
                Value::Bool(is_on) => Ok(u8::from(*is_on).to_string()),
                Value::Number(number) => Ok(number.to_string()),
                _ => Err(refusal(format!(
                    "the field `{}` is a text at {instant}",
                    column.field
                ))),
            });
        let cells = cells.collect::<Result<Vec<String>, _>>()?;
        let cells: Vec<&str> = cells.iter().map(String::as_str).collect();
        writer.row(instant, &cells);
    }
    Ok(writer.done())
}
