//! Samples of a PI server, by PI Web API: recorded events of a tag, in pages.

use jiff::Timestamp;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use tokio::sync::Mutex;
use url::Url;

use std::collections::HashMap;

use super::endpoint::Endpoint;
use super::error::CollectError;
use super::page::{PageWriter, ReadStretch, SeriesPage};
use super::series::SourceSeries;

/// A PI Web API, and what it has body of tags.
#[derive(Debug)]
pub struct PiWebApi {
    server: Endpoint,
    points: Mutex<HashMap<String, PiPoint>>,
}

/// What PI says of a tag.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "PascalCase")]
struct PiPoint {
    web_id: String,
    /// Whether the value holds until the next event.
    #[serde(default)]
    step: bool,
    #[serde(default)]
    engineering_units: String,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct PiEvents {
    items: Vec<RecordedEvent>,
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct RecordedEvent {
    timestamp: Timestamp,
    value: Value,
    #[serde(default = "good")]
    good: bool,
}

fn good() -> bool {
    true
}

impl PiWebApi {
    pub(super) fn at(server: Endpoint) -> Self {
        Self {
            server,
            points: Mutex::default(),
        }
    }

    /// Events of a tag. What PI cuts off at its own maximum comes with the next page: pages go on until one has no
    /// newer event, whatever number of events was asked for.
    pub(super) async fn read(
        &self,
        series: &SourceSeries,
        stretch: &ReadStretch,
    ) -> Result<SeriesPage, CollectError> {
        let point = self.point(&series.table).await?;
        let mut columns = series.columns.clone();
        let unit = point.engineering_units.trim();
        for column in &mut columns {
            let of_pi = (!unit.is_empty()).then(|| unit.to_owned());
            column.unit = column.unit.take().or(of_pi);
        }
        let mut url = self.server.address(&["streams", &point.web_id, "recorded"]);
        url.query_pairs_mut()
            .append_pair("startTime", &stretch.between.start.to_string())
            .append_pair("endTime", &stretch.between.end.to_string())
            .append_pair("boundaryType", "Inside")
            .append_pair("maxCount", &stretch.rows.to_string())
            .append_pair("selectedFields", "Items.Timestamp;Items.Value;Items.Good");
        let recorded: PiEvents = self.document(&url).await?;
        let mut writer = PageWriter::new(&columns);
        if point.step {
            writer.option("interpolation", "hold");
        }
        for event in recorded.items {
            let value = number_of(&event.value);
            let is_good = event.good && value.is_some();
            let quality = if is_good { "Good" } else { "Bad" };
            writer.row(event.timestamp, &[&value.unwrap_or_default(), quality]);
        }
        Ok(writer.done())
    }

    /// What PI says of a tag, asked once.
    async fn point(&self, path: &str) -> Result<PiPoint, CollectError> {
        let mut points = self.points.lock().await;
        if let Some(point) = points.get(path) {
            return Ok(point.clone());
        }
        let mut url = self.server.address(&["points"]);
        url.query_pairs_mut()
            .append_pair("path", path)
            .append_pair("selectedFields", "WebId;Step;EngineeringUnits");
        let point: PiPoint = self.document(&url).await?;
        points.insert(path.to_owned(), point.clone());
        Ok(point)
    }

    async fn document<T: DeserializeOwned>(&self, url: &Url) -> Result<T, CollectError> {
        let answer = self.server.get(url).await;
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
            return Err(CollectError::SourceRefuses(format!("{status}: {body}")));
        }
        let document = serde_json::from_slice(answer.body());
        document.map_err(|error| CollectError::SourceRefuses(format!("no answer of PI: {error}")))
    }
}

/// The number that an event has: a number, a switch, or the number of a state. A state of the system, such as
/// `I/O Timeout`, has none.
fn number_of(value: &Value) -> Option<String> {
    match value {
        Value::Number(number) => Some(number.to_string()),
        Value::Bool(is_on) => Some(u8::from(*is_on).to_string()),
        Value::Object(state) => {
            let is_system = state.get("IsSystem").and_then(Value::as_bool);
            let number = state.get("Value")?.as_number()?;
            (is_system != Some(true)).then(|| number.to_string())
        }
        _ => None,
    }
}
