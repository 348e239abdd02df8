//! Windows of monitors that say nothing of the plant, or nothing that is true.

use serde_json::{Value, json};

use super::app::TestApp;
use super::monitors::{Events, Plant, append, monitor};

/// A monitor of a stream that begins with a window, and its events.
async fn watched(app: &TestApp, first: &Value) -> (String, Events) {
    append(app, first).await.expect(201);
    let made = app.post_json("/v1/monitors", &monitor()).await;
    let id = made.expect(201).json()["id"].as_str().unwrap().to_owned();
    let events = Events::of(app, &id).await;
    (format!("/v1/monitors/{id}"), events)
}

/// A window at its end.
async fn ended(events: &mut Events, number: usize) -> Value {
    let mut told = events.until_window(number as u64).await;
    told.pop().expect("the window").2
}

/// The kinds of the alarms that a monitor raised.
async fn alarms(app: &TestApp, path: &str) -> Vec<Value> {
    let shown = app.get(path).await.expect(200).json();
    let alarms = shown["alarms"].as_array().unwrap().iter();
    alarms.map(|alarm| alarm["kind"].clone()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sensor_that_stands_still_is_named_and_no_change_of_the_plant_is_told() {
    let app = TestApp::start().await;
    let mut plant = Plant::new();
    let (path, mut events) = watched(&app, &plant.window(0, 2.0, 1.0)).await;
    for number in 1..8 {
        let mut next = plant.window(number, 2.0, 1.0);
        if (4..6).contains(&number) {
            let values = next["signals"]["y"]["values"].as_array_mut().unwrap();
            values.fill(json!(0.7));
        }
        append(&app, &next).await.expect(200);
        let window = ended(&mut events, number - 1).await;
        if (4..6).contains(&(number - 1)) {
            assert_eq!(window["status"], "failed", "{window}");
            assert_eq!(window["reason"], "`y` stood still while u moved");
        } else {
            assert_eq!(window["status"], "estimated", "{window}");
        }
    }
    assert_eq!(alarms(&app, &path).await, ["no_estimate"]);
    app.shutdown().await;
}

/// A jitter of the input that hardly shows in the output [V].
const JITTER: f64 = 2e-4;

#[tokio::test(flavor = "multi_thread")]
async fn windows_of_a_plant_that_rests_are_quiet_until_one_says_something() {
    let app = TestApp::start().await;
    let mut plant = Plant::new();
    let (path, mut events) = watched(&app, &plant.window(0, 2.0, JITTER)).await;
    for number in 1..7 {
        let size = if number < 3 { JITTER } else { 1.0 };
        let next = plant.window(number, 2.0, size);
        append(&app, &next).await.expect(200);
        let window = ended(&mut events, number - 1).await;
        if number <= 3 {
            assert_eq!(window["status"], "quiet", "{window}");
            assert!(window["start"] == "cold", "{window}");
        } else {
            assert_eq!(window["status"], "estimated", "{window}");
            assert_ne!(window["trust"], "low", "{window}");
        }
    }
    // Once there is an estimate nothing is tried on a window that would say nothing. In the first window at rest
    // the output still falls, which shows the time constant.
    for number in 7..10 {
        let next = plant.window(number, 2.0, JITTER);
        append(&app, &next).await.expect(200);
        let window = ended(&mut events, number - 1).await;
        if number == 9 {
            assert_eq!(window["status"], "quiet", "{window}");
            let reason = "it would fix no parameter to within half its value";
            assert_eq!(window["reason"], reason);
            assert!(window["start"].is_null(), "{window}");
        } else {
            assert_eq!(window["status"], "estimated", "{window}");
        }
    }
    assert_eq!(alarms(&app, &path).await, Vec::<Value>::new());
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_that_starts_where_the_plant_does_not_is_refused_with_what_to_do() {
    let app = TestApp::start().await;
    let mut plant = Plant::new();
    for number in 0..2 {
        let window = plant.window(number, 2.0, 1.0);
        append(&app, &window).await;
    }
    let mut document = monitor();
    document["job"]["experiments"] = json!([{}]);
    let problem = app.post_json("/v1/monitors", &document).await.problem(422);
    let error = &problem["errors"][0];
    assert_eq!(error["code"], "starts_elsewhere", "{problem}");
    assert_eq!(error["pointer"], "/job/experiments/0/initial_state");
    let detail = error["detail"].as_str().unwrap();
    assert!(detail.contains("`y` is 0 V"), "{detail}");
    assert!(detail.contains("\"x\": {\"estimate\""), "{detail}");
    // Who says where each window begins is believed.
    document["job"]["experiments"] = json!([{"initial_state": {"x": 0}}]);
    app.post_json("/v1/monitors", &document).await.expect(201);
    app.shutdown().await;
}
