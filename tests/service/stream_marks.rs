//! Marks of streams: what is marked as bad stays in the stream, and what is cut out of it does without.

use reqwest::Method;
use serde_json::{Value, json};

use super::app::TestApp;
use super::faults::places;

const MARKS: &str = "/v1/streams/rig-4/marks";

/// A minute of two signals, a sample a second.
async fn filled() -> TestApp {
    let app = TestApp::start().await;
    let rows = (0..60).map(|k| format!("2026-03-02T08:15:{k:02}Z,{k},{}\n", 100 - k));
    let csv = format!("time,position [mm],level [m]\n{}", rows.collect::<String>());
    app.post_csv("/v1/streams/rig-4", csv).await.expect(201);
    app
}

async fn put(app: &TestApp, body: &Value) -> super::app::Answer {
    app.send(app.request(Method::PUT, MARKS).json(body)).await
}

async fn cut(app: &TestApp) -> Value {
    let part = json!({"from": "2026-03-02T08:15:00Z", "to": "2026-03-02T08:16:00Z"});
    let cut = app.post_json("/v1/streams/rig-4/recordings", &part).await;
    assert!(cut.status == 200 || cut.status == 201);
    cut.json()
}

fn mark() -> Value {
    json!({"from": "2026-03-02T08:15:10Z", "to": "2026-03-02T08:15:14Z", "signals": ["position"], "reason": "loose"})
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_that_is_cut_does_without_what_is_marked_and_the_stream_keeps_it() {
    let app = filled().await;
    assert_eq!(app.get(MARKS).await.expect(200).json()["number"], 0);
    let before = cut(&app).await;
    let stored = put(&app, &json!({"marks": [mark()], "based_on": 0}))
        .await
        .expect(200)
        .json();
    assert_eq!(
        (&stored["number"], &stored["marks"]),
        (&json!(1), &json!([mark()]))
    );
    assert_eq!(stored["changed_by"], "local");
    assert_eq!(app.get(MARKS).await.json(), stored);
    let after = cut(&app).await;
    assert_ne!(after["id"], before["id"]);
    let missing = |name: &str| {
        let mut signals = after["signals"].as_array().unwrap().iter();
        signals.find(|signal| signal["name"] == name).unwrap()["missing"].clone()
    };
    // Both ends of a mark belong to it, and the signal that it does not name keeps its samples.
    assert_eq!(
        (missing("position"), missing("level")),
        (json!(5), json!(0))
    );
    let warnings = after["report"]["warnings"].as_array().unwrap();
    let told = warnings
        .iter()
        .find(|warning| warning["code"] == "marked_in_stream");
    assert!(
        told.unwrap()["detail"].as_str().unwrap().ends_with("loose"),
        "{warnings:?}"
    );
    let shown = app.get("/v1/streams/rig-4?from=2026-03-02T08:15:00Z&to=2026-03-02T08:16:00Z");
    let shown = shown.await.expect(200).json();
    assert_eq!(
        shown["window"]["samples"]["signals"]["position"]["values"][12],
        0.012
    );
    // Without the mark the recording is the one that it was.
    put(&app, &json!({"marks": []})).await.expect(200);
    assert_eq!(cut(&app).await["id"], before["id"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn marks_that_somebody_changed_meanwhile_or_that_are_wrong_are_not_stored() {
    let app = filled().await;
    put(&app, &json!({"marks": [mark()]})).await.expect(200);
    put(&app, &json!({"marks": [], "based_on": 0}))
        .await
        .problem(409);
    let wrong = json!({"marks": [
        {"from": "2026-03-02T08:15:10Z", "to": "2026-03-02T08:15:09Z", "reason": "x"},
        {"from": "2026-03-02T08:15:10Z", "to": "2026-03-02T08:15:11Z", "signals": ["positon"], "reason": " "},
    ]});
    let problem = put(&app, &wrong).await.problem(422);
    assert_eq!(
        places(&problem),
        [
            ("/marks/0", "bounds_reversed"),
            ("/marks/1/reason", "out_of_range"),
            ("/marks/1/signals/0", "unknown_signal"),
        ]
    );
    assert_eq!(app.get(MARKS).await.json()["marks"], json!([mark()]));
    app.get("/v1/streams/rig-5/marks").await.expect(404);
    // The marks go with their stream, and a new one of the name begins without.
    app.delete("/v1/streams/rig-4").await.expect(204);
    app.post_csv(
        "/v1/streams/rig-4",
        "time,position [mm]\n2026-03-02T08:15:00Z,1\n",
    )
    .await
    .expect(201);
    assert_eq!(app.get(MARKS).await.expect(200).json()["number"], 0);
}
