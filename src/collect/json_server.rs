//! Samples of any server that answers JSON over HTTP, by the shape that the sources file declares: where the list of
//! rows is, and where in a row the instant and the values are.

use jiff::Timestamp;
use serde_json::Value;
use url::Url;

use super::cursors::nanoseconds;
use super::endpoint::Endpoint;
use super::error::CollectError;
use super::page::{PageWriter, ReadStretch, SeriesPage};
use super::series::{SourceSeries, TIME_UNITS};

/// A server that answers JSON.
#[derive(Clone, Debug)]
pub struct JsonServer {
    pub(super) server: Endpoint,
}

impl JsonServer {
    /// Rows of a series, whose `table` is the path and the query of the request.
    pub(super) async fn read(
        &self,
        series: &SourceSeries,
        stretch: &ReadStretch,
    ) -> Result<SeriesPage, CollectError> {
        let url = self.request(series, stretch)?;
        let answer = self.server.get(&url).await;
        let answer = answer.map_err(|error| CollectError::away(&error))?;
        let status = answer.status();
        if status.is_server_error() {
            return Err(CollectError::SourceAway(status.to_string()));
        }
        if !status.is_success() {
            let body: String = String::from_utf8_lossy(answer.body())
                .chars()
                .take(300)
                .collect();
            return Err(refusal(format!("{status}: {body}")));
        }
        let document: Value = serde_json::from_slice(answer.body())
            .map_err(|error| refusal(format!("the answer is no JSON: {error}")))?;
        let place = &*series.rows;
        let rows = document.pointer(place).and_then(Value::as_array);
        let rows = rows.ok_or_else(|| refusal(format!("the answer has no list at `{place}`")))?;
        let mut writer = PageWriter::new(&series.columns);
        let mut before = Timestamp::MIN;
        for row in rows {
            let instant = instant(row, series)?;
            if instant < before {
                return Err(refusal(format!(
                    "the row of {instant} comes after that of {before}: ask for the oldest row first, or pages lose rows"
                )));
            }
            before = instant;
            let cells = cells(row, series, instant)?;
            let cells: Vec<&str> = cells.iter().map(String::as_str).collect();
            writer.row(instant, &cells);
        }
        Ok(writer.done())
    }

    /// The address with the stretch in the place of `{from}`, `{to}` and `{rows}`.
    fn request(&self, series: &SourceSeries, stretch: &ReadStretch) -> Result<Url, CollectError> {
        let mut text = series.table.replace("{rows}", &stretch.rows.to_string());
        let bounds = [("from", stretch.between.start), ("to", stretch.between.end)];
        for (name, instant) in bounds {
            text = text.replace(&format!("{{{name}}}"), &instant.to_string());
            for (unit, size) in TIME_UNITS {
                let count = nanoseconds(instant).div_euclid(size);
                text = text.replace(&format!("{{{name}_{unit}}}"), &count.to_string());
            }
        }
        let (path, query) = text.split_once('?').unwrap_or((&text, ""));
        let parts: Vec<&str> = path.split('/').filter(|part| !part.is_empty()).collect();
        let mut url = self.server.address(&parts);
        url.set_query((!query.is_empty()).then_some(query));
        Ok(url)
    }
}

fn refusal(why: impl Into<String>) -> CollectError {
    CollectError::SourceRefuses(why.into())
}

/// The instant of a row: a text with its offset, or a number of the unit that the series says.
fn instant(row: &Value, series: &SourceSeries) -> Result<Timestamp, CollectError> {
    let place = &series.time;
    let value = row.pointer(place).unwrap_or(&Value::Null);
    let unit = series.time_unit.as_deref();
    let unit = unit.and_then(|unit| TIME_UNITS.iter().find(|(name, _)| *name == unit));
    let instant = match (value, unit) {
        (Value::String(text), _) => text.parse().ok(),
        (Value::Number(number), Some((_, size))) => match number.as_i64() {
            Some(count) => Timestamp::from_nanosecond(i128::from(count) * i128::from(*size)).ok(),
            None => {
                let count = number.as_f64().unwrap_or(f64::NAN) * *size as f64;
                (count.abs() < 9e18)
                    .then(|| Timestamp::from_nanosecond(count as i128).ok())
                    .flatten()
            }
        },
        _ => None,
    };
    instant.ok_or_else(|| {
        refusal(format!(
            "{value} at `{place}` of a row is no instant: a text with its offset, or a number with `time_unit`"
        ))
    })
}

/// The values of a row and their qualities, in the order of the titles.
fn cells(
    row: &Value,
    series: &SourceSeries,
    instant: Timestamp,
) -> Result<Vec<String>, CollectError> {
    let mut cells = Vec::new();
    for column in &series.columns {
        let places = std::iter::once(&column.field).chain(&column.quality);
        for place in places {
            cells.push(match row.pointer(place) {
                None | Some(Value::Null) => String::new(),
                Some(Value::Bool(is_on)) => u8::from(*is_on).to_string(),
                Some(Value::Number(number)) => number.to_string(),
                Some(Value::String(text)) => text.clone(),
                Some(_) => {
                    let detail =
                        format!("`{place}` of the row of {instant} is a list or an object");
                    return Err(refusal(detail));
                }
            });
        }
    }
    Ok(cells)
}
