//! Historians of the tests: a PI Web API with its traps, and an InfluxDB. Each answers from a list of events.

use std::sync::{Arc, Mutex};

use axum::Json;
use axum::extract::{Query, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::{Router, get, post};
use jiff::Timestamp;
use serde::Deserialize;
use serde_json::{Value, json};
use tokio::net::TcpListener;

/// An event of a tag, or a row of a measurement.
#[derive(Clone)]
pub struct Event {
    pub instant: Timestamp,
    pub value: Value,
    pub good: bool,
    /// The tag `hall` of the row.
    pub hall: &'static str,
}

/// A good event at an instant.
pub fn event(instant: &str, value: impl Into<Value>) -> Event {
    Event {
        instant: instant.parse().unwrap(),
        value: value.into(),
        good: true,
        hall: "2",
    }
}

/// What a historian holds, and what it was asked.
#[derive(Default)]
pub struct Held {
    pub events: Vec<Event>,
    /// Events of an answer at the most, whatever is asked for.
    pub most: usize,
    /// The answers to come that are refusals.
    pub refusals: usize,
    pub requests: usize,
}

/// A historian of the tests. Clones are the same historian.
#[derive(Clone, Default)]
pub struct Historian(Arc<Mutex<Held>>);

impl Historian {
    /// A historian with events, whose answers have `most` of them at the most.
    pub fn holding(events: impl IntoIterator<Item = Event>, most: usize) -> Self {
        let historian = Self::default();
        historian.change(|held| {
            held.events.extend(events);
            held.most = most;
        });
        historian
    }

    /// Changes what the historian holds, or looks at it.
    pub fn change<T>(&self, change: impl FnOnce(&mut Held) -> T) -> T {
        let mut held = self.0.lock().unwrap();
        let changed = change(&mut held);
        held.events.sort_by_key(|event| event.instant);
        changed
    }

    /// Listens as a PI Web API, and says at which address.
    pub async fn as_pi(&self) -> String {
        let routes = Router::new()
            .route("/piwebapi/points", get(point))
            .route("/piwebapi/streams/{id}/recorded", get(recorded));
        format!("{}/piwebapi", listen(routes.with_state(self.clone())).await)
    }

    /// Listens as an InfluxDB 2 that is asked in Flux, and says at which address.
    pub async fn as_flux(&self) -> String {
        let routes = Router::new().route("/api/v2/query", post(flux));
        listen(routes.with_state(self.clone())).await
    }

    /// Listens as an InfluxDB, and says at which address.
    pub async fn as_influx(&self) -> String {
        let routes = Router::new().route("/query", get(query));
        listen(routes.with_state(self.clone())).await
    }

    /// Listens as a server with answers of its own shape, and says at which address.
    pub async fn as_json(&self) -> String {
        let routes = Router::new().route("/history", get(history));
        listen(routes.with_state(self.clone())).await
    }
}

async fn listen(routes: Router) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move { axum::serve(listener, routes).await });
    format!("http://{address}")
}

#[derive(Deserialize)]
struct PointQuery {
    path: String,
}

async fn point(Query(asked): Query<PointQuery>) -> Response {
    match &*asked.path {
        r"\\pi.plant.example\PT-101" => {
            Json(json!({"WebId": "F1", "Step": false, "EngineeringUnits": "bar"})).into_response()
        }
        r"\\pi.plant.example\XV-7" => {
            Json(json!({"WebId": "F2", "Step": true, "EngineeringUnits": ""})).into_response()
        }
        _ => (StatusCode::NOT_FOUND, "The specified path was not found.").into_response(),
    }
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct RecordedQuery {
    start_time: Timestamp,
    end_time: Timestamp,
    max_count: usize,
}

async fn recorded(
    State(historian): State<Historian>,
    Query(asked): Query<RecordedQuery>,
) -> Response {
    historian.change(|held| {
        held.requests += 1;
        if held.refusals > 0 {
            held.refusals -= 1;
            return StatusCode::SERVICE_UNAVAILABLE.into_response();
        }
        let between = asked.start_time..=asked.end_time;
        let events = held.events.iter();
        let events = events.filter(|event| between.contains(&event.instant));
        let items = events.take(asked.max_count.min(held.most)).map(
            |event| json!({"Timestamp": event.instant, "Value": event.value, "Good": event.good}),
        );
        let items: Vec<Value> = items.collect();
        Json(json!({"Items": items})).into_response()
    })
}

#[derive(Deserialize)]
struct InfluxQuery {
    q: String,
}

/// The whole number behind a text of a query.
fn number_behind(query: &str, text: &str) -> i128 {
    let behind = query.split_once(text).expect(query).1;
    let digits = behind.split(' ').next().unwrap();
    digits.parse().expect(query)
}

async fn query(State(historian): State<Historian>, Query(asked): Query<InfluxQuery>) -> Response {
    let after = number_behind(&asked.q, "time > ");
    let until = number_behind(&asked.q, "time <= ");
    let rows = usize::try_from(number_behind(&asked.q, "LIMIT ")).unwrap();
    let wanted = asked.q.contains("\"hall\" = '2'").then_some("2");
    let held = historian.change(|held| held.events.clone());
    let series = |hall: &str| {
        let events = held.iter().filter(|event| {
            let instant = event.instant.as_nanosecond();
            event.hall == hall && after < instant && instant <= until
        });
        let values = events.take(rows).map(|event| {
            let instant = i64::try_from(event.instant.as_nanosecond()).unwrap();
            json!([instant, event.value])
        });
        let values: Vec<Value> = values.collect();
        (!values.is_empty()).then(|| {
            json!({"name": "rig", "tags": {"hall": hall}, "columns": ["time", "position"], "values": values})
        })
    };
    let halls = ["2", "3"].into_iter();
    let halls = halls.filter(|hall| wanted.is_none_or(|wanted| wanted == *hall));
    let series: Vec<Value> = halls.filter_map(series).collect();
    Json(json!({"results": [{"statement_id": 0, "series": series}]})).into_response()
}

/// The text behind a part of a query of Flux, up to the next sign of its end.
fn text_behind<'q>(query: &'q str, part: &str, ends: &[char]) -> &'q str {
    let behind = query.split_once(part).expect(query).1;
    behind.split(ends).next().unwrap()
}

/// A field of a row as annotated CSV has it.
fn flux_cell(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        value => value.to_string(),
    }
}

/// Answers as InfluxDB 2 does: a table for each combination of tags, sorted by instants, the lines ended as on the
/// network.
async fn flux(
    State(historian): State<Historian>,
    headers: HeaderMap,
    Json(asked): Json<Value>,
) -> Response {
    if headers
        .get("authorization")
        .is_none_or(|token| token != "Token secret")
    {
        let body = Json(json!({"code": "unauthorized", "message": "unauthorized access"}));
        return (StatusCode::UNAUTHORIZED, body).into_response();
    }
    let query = asked["query"].as_str().unwrap();
    assert_eq!(text_behind(query, "from(bucket: ", &[')']), "\"plant\"");
    let start: Timestamp = text_behind(query, "start: ", &[',']).parse().unwrap();
    let stop: Timestamp = text_behind(query, "stop: ", &[')']).parse().unwrap();
    let rows: usize = text_behind(query, "limit(n: ", &[')']).parse().unwrap();
    let wanted = query.contains("r[\"hall\"] == \"2\"").then_some("2");
    let held = historian.change(|held| held.events.clone());
    let mut answer = String::new();
    let halls = ["2", "3"].into_iter();
    let halls = halls.filter(|hall| wanted.is_none_or(|wanted| wanted == *hall));
    for (table, hall) in halls.enumerate() {
        answer += ",result,table,_start,_stop,_time,_measurement,hall,position\r\n";
        let of_hall = held.iter().filter(|event| event.hall == hall);
        let between = of_hall.filter(|event| (start..stop).contains(&event.instant));
        for event in between.take(rows) {
            let value = flux_cell(&event.value);
            answer += &format!(
                ",_result,{table},{start},{stop},{},rig,{hall},{value}\r\n",
                event.instant
            );
        }
        answer += "\r\n";
    }
    ([("content-type", "text/csv; charset=utf-8")], answer).into_response()
}

#[derive(Deserialize)]
struct HistoryQuery {
    from: i64,
    to: Timestamp,
    order: String,
}

async fn history(
    State(historian): State<Historian>,
    Query(asked): Query<HistoryQuery>,
) -> Response {
    historian.change(|held| {
        let is_asked = |event: &&Event| {
            (asked.from..=asked.to.as_millisecond()).contains(&event.instant.as_millisecond())
        };
        let rows = held
            .events
            .iter()
            .filter(is_asked)
            .take(held.most)
            .map(|event| {
                let quality = if event.good { "good" } else { "bad" };
                let pressure = json!({"value": event.value, "is": quality});
                json!({"at": event.instant.as_millisecond(), "pressure": pressure})
            });
        let mut rows: Vec<Value> = rows.collect();
        if asked.order == "newest" {
            rows.reverse();
        }
        Json(json!({"data": {"rows": rows}})).into_response()
    })
}
