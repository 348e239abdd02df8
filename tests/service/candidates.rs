//! The record of candidates: complete, without repeats, as JSON and as CSV.

use std::collections::{BTreeMap, HashMap, HashSet};

use reqwest::Method;
use serde_json::{Value, json};

use crate::app::{TestApp, drive_job, endless_job};
use crate::events::{Stream, StreamEvent};
use crate::life::status_after;

/// A job whose every simulation is one of its search.
fn search_alone(dataset: &str) -> Value {
    let mut job = drive_job(dataset);
    job["method"] = json!({"population": 20, "generations": 25, "stagnation_generations": 0,
                           "hill_climbing_interval": 0, "refine": false});
    job
}

/// Every candidate, read `limit` generations at a time along the links.
async fn in_parts(app: &TestApp, id: &str, limit: u32) -> Vec<Value> {
    let mut items = Vec::new();
    let mut path = format!("/v1/jobs/{id}/candidates?limit={limit}");
    loop {
        let answer = app.get(&path).await.expect(200);
        let part = answer.json();
        items.extend(part["items"].as_array().unwrap().iter().cloned());
        let link = answer.header("link");
        let Some(after) = part["next_after"].as_u64() else {
            assert_eq!(link, "");
            return items;
        };
        assert_eq!(items.last().unwrap()["generation"], after);
        path = format!("/v1/jobs/{id}/candidates?after={after}&limit={limit}");
        assert_eq!(link, format!("<{path}>; rel=\"next\""));
    }
}

/// Where a candidate lies, to the last bit.
fn place(item: &Value) -> Vec<u64> {
    let values = item["values"].as_object().unwrap().values();
    values.map(|v| v.as_f64().unwrap().to_bits()).collect()
}

fn lowest_cost(items: &[Value]) -> f64 {
    let costs = items.iter().filter_map(|item| item["cost"].as_f64());
    costs.fold(f64::INFINITY, f64::min)
}

async fn last_generation(app: &TestApp, id: &str) -> Value {
    let path = format!("/v1/jobs/{id}/generations?limit=10000");
    let rows = app.get(&path).await.expect(200).json();
    rows["items"].as_array().unwrap().last().unwrap().clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_candidate_that_was_simulated_is_told_once_with_its_cost_and_its_values() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&search_alone(&dataset)).await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    let result = app.get(&format!("/v1/jobs/{id}/result")).await.expect(200);
    let simulated = result.json()["search"]["distinct_evaluations"].clone();
    let path = format!("/v1/jobs/{id}/candidates");
    let whole = app.get(&path).await.expect(200).json();
    let items = whole["items"].as_array().unwrap();
    assert_eq!(simulated, items.len());
    assert_eq!(whole["kept"], simulated);
    assert_eq!(whole["cut_in_generation"], Value::Null);
    assert_eq!(
        whole["columns"],
        json!([{"name": "mass", "unit": "kg", "experiment": null, "state": null},
               {"name": "viscous_friction", "unit": "N*s/m", "experiment": null, "state": null}])
    );
    let places: HashSet<Vec<u64>> = items.iter().map(place).collect();
    assert_eq!(places.len(), items.len());
    for item in items {
        let mass = item["values"]["mass"].as_f64().unwrap();
        let friction = item["values"]["viscous_friction"].as_f64().unwrap();
        assert!(
            (10.0..=1000.0).contains(&mass) && (1.0..=2000.0).contains(&friction),
            "{item}"
        );
        assert!(item["place"].as_u64().unwrap() < 20, "{item}");
    }
    let last = last_generation(&app, &id).await;
    assert_eq!(Some(lowest_cost(items)), last["best_cost"].as_f64());
    let champion = items
        .iter()
        .find(|item| item["cost"] == last["best_cost"])
        .unwrap();
    assert_eq!(champion["values"], last["best"]);
    for limit in [1, 7] {
        assert_eq!(&in_parts(&app, &id, limit).await, items);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_table_says_the_same_as_the_json() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&search_alone(&dataset)).await;
    app.ended(&id).await;
    let path = format!("/v1/jobs/{id}/candidates?after=3&limit=4");
    let told = app.get(&path).await.expect(200).json();
    let request = app.request(Method::GET, &path).header("accept", "text/csv");
    let table = app.send(request).await.expect(200);
    assert_eq!(table.header("content-type"), "text/csv; charset=utf-8");
    let next = format!("after={}&limit=4", told["next_after"]);
    assert!(table.header("link").contains(&next), "{next}");
    let mut lines = table.text.lines();
    let head = lines.next().unwrap();
    assert_eq!(head, "generation,place,cost,failure,mass,viscous_friction");
    let items = told["items"].as_array().unwrap();
    assert_eq!(items[0]["generation"], 4);
    assert_eq!(lines.clone().count(), items.len());
    for (line, item) in lines.zip(items) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |field: usize| fields[field].parse::<f64>().ok();
        assert_eq!(number(0), item["generation"].as_f64());
        assert_eq!(number(1), item["place"].as_f64());
        assert_eq!(number(2), item["cost"].as_f64());
        assert_eq!(fields[3], "");
        assert_eq!(number(4), item["values"]["mass"].as_f64());
        assert_eq!(number(5), item["values"]["viscous_friction"].as_f64());
    }
}

/// A state that runs away where its rate is above nought.
fn runaway(dataset: &str) -> Value {
    let rate = json!({"unit": "1/s", "default": -1, "lower": -100, "upper": 200, "unknown": true});
    json!({
        "model": {
            "name": "runaway",
            "inputs": {"force": {"unit": "N"}},
            "parameters": {
                "rate": rate,
                "gain": {"unit": "m/N/s", "default": 0.01, "lower": 0.001, "upper": 0.1, "unknown": true}
            },
            "states": {"x": {"unit": "m", "derivative": "rate*x + gain*force", "initial": 1}},
            "outputs": {"position": {"unit": "m", "expression": "x"}}
        },
        "experiments": [{"dataset": dataset}],
        "method": {"population": 20, "generations": 3, "hill_climbing_interval": 0, "refine": false}
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn candidates_that_failed_are_told_with_the_reason_and_without_a_cost() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&runaway(&dataset)).await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    let result = app.get(&format!("/v1/jobs/{id}/result")).await.expect(200);
    let counted = result.json()["search"]["failed_evaluations"].clone();
    let items = in_parts(&app, &id, 2).await;
    let mut told = BTreeMap::new();
    for item in items.iter().filter(|item| item["cost"].is_null()) {
        *told.entry(item["failure"].as_str().unwrap()).or_insert(0) += 1;
        assert!(item["values"]["rate"].as_f64().unwrap() > 0.0, "{item}");
    }
    assert!(!told.is_empty());
    assert_eq!(json!(told), counted);
    let path = format!("/v1/jobs/{id}/candidates");
    let request = app.request(Method::GET, &path).header("accept", "text/csv");
    let table = app.send(request).await.expect(200).text;
    for (failure, count) in told {
        assert_eq!(table.matches(&format!(",,{failure},")).count(), count);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_was_paused_tells_no_candidate_twice_and_leaves_none_out() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&endless_job(&dataset)).await;
    let path = format!("/v1/jobs/{id}");
    let mut seen = 0;
    for _ in 0..3 {
        let stream = Stream::open(&app, &id, None).await;
        let later = |event: &StreamEvent| event.data["generation"].as_u64() > Some(seen);
        stream.until(later).await;
        app.post(&format!("{path}/pause")).await.expect(200);
        let paused = status_after(&app, &id, "paused").await;
        seen = paused["progress"]["generation"].as_u64().unwrap();
        app.post(&format!("{path}/resume")).await.expect(200);
    }
    let stream = Stream::open(&app, &id, None).await;
    let later = |event: &StreamEvent| event.data["generation"].as_u64() > Some(seen);
    stream.until(later).await;
    app.post(&format!("{path}/cancel")).await.expect(200);
    status_after(&app, &id, "cancelled").await;

    let items = in_parts(&app, &id, 10_000).await;
    let places: HashSet<Vec<u64>> = items.iter().map(place).collect();
    assert_eq!(places.len(), items.len());
    let result = app.get(&format!("{path}/result")).await.expect(200).json();
    let simulated = result["search"]["distinct_evaluations"].as_u64().unwrap();
    assert!(
        simulated >= items.len() as u64 + 3,
        "each resumption simulates the elite again"
    );
    let first_with_cost: HashMap<u64, u64> = items
        .iter()
        .rev()
        .filter_map(|item| {
            Some((
                item["cost"].as_f64()?.to_bits(),
                item["generation"].as_u64()?,
            ))
        })
        .collect();
    let rows = app.get(&format!("{path}/generations?limit=10000")).await;
    for row in rows.expect(200).json()["items"].as_array().unwrap() {
        let cost = row["generation_best_cost"].as_f64().unwrap().to_bits();
        assert!(
            Some(first_with_cost[&cost]) <= row["generation"].as_u64(),
            "{row}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_waits_has_no_candidates_and_one_that_there_is_not_is_404() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    // Every place is taken by a job that does not end.
    let n_places = std::thread::available_parallelism().map_or(1, usize::from);
    let mut busy = Vec::new();
    for _ in 0..n_places {
        let id = app.submit(&endless_job(&dataset)).await;
        let stream = Stream::open(&app, &id, None).await;
        stream.until(|event| event.name == "generation").await;
        busy.push(id);
    }
    let id = app.submit(&search_alone(&dataset)).await;
    let path = format!("/v1/jobs/{id}/candidates");
    let empty = app.get(&path).await.expect(200).json();
    let nothing = json!({"columns": [], "kept": 0, "cut_in_generation": null, "items": [],
                         "next_after": null});
    assert_eq!(empty, nothing);
    let request = app.request(Method::GET, &path).header("accept", "text/csv");
    let table = app.send(request).await.expect(200).text;
    assert_eq!(table, "generation,place,cost,failure\n");
    let problem = app
        .get(&format!("{path}?limit=0&before=3"))
        .await
        .problem(422);
    assert_eq!(problem["errors"].as_array().unwrap().len(), 2);
    let unknown = "/v1/jobs/job_00000000000000000000000000000000/candidates";
    app.get(unknown).await.problem(404);
    // The job that waits is cancelled first: the end of another would let the job begin.
    for id in [&id].into_iter().chain(&busy) {
        app.post(&format!("/v1/jobs/{id}/cancel")).await.expect(200);
    }
}
