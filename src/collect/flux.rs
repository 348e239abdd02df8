//! Samples of an InfluxDB 2, by Flux over HTTP: no mapping of a database is needed.
//!
//! Source: the documents of InfluxDB 2, "Query with the InfluxDB API" (`/api/v2/query`) and "Annotated CSV".

use hyper::body::Bytes;
use jiff::{SignedDuration, Timestamp};
use serde_json::json;

use super::endpoint::Endpoint;
use super::error::CollectError;
use super::page::{PageWriter, ReadStretch, SeriesPage};
use super::series::SourceSeries;

/// The columns of an answer that are neither tags nor fields.
const OF_EVERY_ROW: [&str; 7] = [
    "",
    "result",
    "table",
    "_start",
    "_stop",
    "_time",
    "_measurement",
];

/// An InfluxDB 2 and the bucket in it.
#[derive(Clone, Debug)]
pub struct FluxBucket {
    pub(super) server: Endpoint,
    pub(super) organization: String,
    pub(super) bucket: String,
}

impl FluxBucket {
    /// Rows of a series.
    pub(super) async fn read(
        &self,
        series: &SourceSeries,
        stretch: &ReadStretch,
    ) -> Result<SeriesPage, CollectError> {
        let mut url = self.server.address(&["api", "v2", "query"]);
        url.query_pairs_mut().append_pair("org", &self.organization);
        let dialect = json!({"header": true, "annotations": [], "delimiter": ","});
        let body =
            json!({"query": self.query(series, stretch), "type": "flux", "dialect": dialect});
        let body = Bytes::from(body.to_string());
        let answered = self.server.post(&url, "application/json", body).await;
        let answered = answered.map_err(|error| CollectError::away(&error))?;
        let status = answered.status();
        if status.is_server_error() {
            return Err(CollectError::SourceAway(status.to_string()));
        }
        if !status.is_success() {
            let text = String::from_utf8_lossy(answered.body());
            let text: String = text.chars().take(300).collect();
            return Err(refusal(format!("{status}: {}", text.trim())));
        }
        page(series, answered.body())
    }

    fn query(&self, series: &SourceSeries, stretch: &ReadStretch) -> String {
        let is = |name: &str, value: &str| format!("r[{}] == {}", text(name), text(value));
        let filter = series.filter.iter().map(|(name, value)| is(name, value));
        let conditions: Vec<String> = [is("_measurement", &series.table)]
            .into_iter()
            .chain(filter)
            .collect();
        let fields: Vec<String> = series
            .columns
            .iter()
            .map(|column| is("_field", &column.field))
            .collect();
        // A range has its beginning and not its end; a stretch has its end and not its beginning.
        let behind = |instant: Timestamp| {
            let step = SignedDuration::from_nanos(1);
            instant.checked_add(step).unwrap_or(Timestamp::MAX)
        };
        format!(
            "from(bucket: {}) |> range(start: {}, stop: {}) |> filter(fn: (r) => {}) \
             |> filter(fn: (r) => {}) \
             |> pivot(rowKey: [\"_time\"], columnKey: [\"_field\"], valueColumn: \"_value\") \
             |> sort(columns: [\"_time\"]) |> limit(n: {})",
            text(&self.bucket),
            behind(stretch.between.start),
            behind(stretch.between.end),
            conditions.join(" and "),
            fields.join(" or "),
            stretch.rows,
        )
    }
}

/// A text in the words of Flux. `${` would begin an expression.
fn text(words: &str) -> String {
    let escaped = words.replace('\\', "\\\\").replace('"', "\\\"");
    format!("\"{}\"", escaped.replace("${", "\\${"))
}

fn refusal(why: impl Into<String>) -> CollectError {
    CollectError::SourceRefuses(why.into())
}

/// The rows of an answer. Each table of it is of one combination of tags; a table of other columns begins with a
/// header of its own, behind an empty line.
fn page(series: &SourceSeries, answer: &[u8]) -> Result<SeriesPage, CollectError> {
    let rows = csv::ReaderBuilder::new()
        .flexible(true)
        .has_headers(false)
        .from_reader(answer);
    let mut writer = PageWriter::new(&series.columns);
    let mut header = csv::StringRecord::new();
    let mut tags = None;
    for row in rows.into_records() {
        let row = row.map_err(|error| refusal(format!("the answer is no CSV: {error}")))?;
        if row.get(1) == Some("result") && row.get(2) == Some("table") {
            header = row;
            continue;
        }
        let field = |name: &str| {
            let place = header.iter().position(|title| title == name)?;
            row.get(place).filter(|text| !text.is_empty())
        };
        if let Some(error) = field("error") {
            return Err(refusal(error));
        }
        let of_row = tags_of(series, &header, &row);
        let of_rows = tags.get_or_insert_with(|| of_row.clone());
        if *of_rows != of_row {
            return Err(refusal(format!(
                "`{}` has samples of several combinations of tags there, such as {of_rows} and {of_row}: `where` says \
                 of which one",
                series.table
            )));
        }
        let time = field("_time").ok_or_else(|| refusal("a row has no `_time`"))?;
        let instant: Timestamp = time
            .parse()
            .map_err(|_| refusal(format!("{time} is no instant")))?;
        let cell = |name: &str| match field(name) {
            None => Ok(""),
            Some("true") => Ok("1"),
            Some("false") => Ok("0"),
            Some(number) if number.parse::<f64>().is_ok() => Ok(number),
            Some(_) => Err(refusal(format!(
                "the field `{name}` is a text at {instant}"
            ))),
        };
        let cells = series.columns.iter().map(|column| cell(&column.field));
        let cells = cells.collect::<Result<Vec<&str>, _>>()?;
        writer.row(instant, &cells);
    }
    Ok(writer.done())
}

/// The tags of a row, as a text.
fn tags_of(series: &SourceSeries, header: &csv::StringRecord, row: &csv::StringRecord) -> String {
    let is_tag = |title: &str| {
        !OF_EVERY_ROW.contains(&title) && series.columns.iter().all(|column| column.field != title)
    };
    let tags = header.iter().zip(row).filter(|(title, _)| is_tag(title));
    let tags: Vec<String> = tags.map(|(tag, value)| format!("{tag}={value}")).collect();
    tags.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_end_where_they_end() {
        assert_eq!(text("hall 2"), "\"hall 2\"");
        assert_eq!(text(r#"a"b\c"#), r#""a\"b\\c""#);
        assert_eq!(text("${r}"), "\"\\${r}\"");
    }
}
