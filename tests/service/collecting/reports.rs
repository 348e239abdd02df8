//! What the server is told of sources, and shows of them.

use greybox_service::access::Scope;
use reqwest::Method;
use serde_json::{Value, json};

use super::historian::Historian;
use super::{Collector, PRESSURE, pi, seconds};
use crate::app::{Answer, TestApp};

async fn put(app: &TestApp, state: &Value) -> Answer {
    let request = app.request(Method::PUT, "/v1/sources/press%20hall");
    app.send(request.json(state)).await
}

#[tokio::test(flavor = "multi_thread")]
async fn the_server_is_told_how_far_each_series_has_come_and_why_one_stands() {
    let tokens = [("someone", Scope::Admin, "default")];
    let (app, [admin]) = TestApp::with_tokens(tokens, |_| ()).await;
    let shown = |path: &str| app.send(app.request(Method::GET, path).bearer_auth(&admin));
    let secret = app.append_token("collector", "rig-4,rig-5").await;
    let pi_server = Historian::holding(seconds(0..20), 100);
    let address = pi_server.as_pi().await;
    let both = format!("{PRESSURE}{}", PRESSURE.replace("rig-4", "rig-6"));
    let server = format!(
        "url = \"http://{}\"\ntoken = {{ file = \"token\" }}",
        app.address()
    );
    let collector = |series: &str| {
        let collector = Collector::with_server(&server, &pi(&address, series));
        std::fs::write(collector.folder.path().join("token"), &secret).unwrap();
        collector
    };
    let following = collector(PRESSURE);
    assert_eq!(following.once().await, 0);
    let source = shown("/v1/sources/pi").await.expect(200).json();
    assert_eq!(
        (&source["health"], &source["kind"]),
        (&json!("following"), &json!("pi_web_api"))
    );
    let series = &source["series"][0];
    assert_eq!(series["stream"], "rig-4");
    assert_eq!(series["reached"], "2026-03-02T08:15:19Z");
    assert_eq!(series["fault"], json!(null));
    // A token that does not append to a stream says nothing of it, and the samples come all the same.
    assert_eq!(collector(&both).once().await, 1);
    let unchanged = shown("/v1/sources/pi").await.expect(200).json();
    assert_eq!(unchanged, source);
    pi_server.change(|held| held.refusals = 100);
    assert_eq!(following.once().await, 1);
    let away = shown("/v1/sources").await.expect(200).json();
    let away = &away["items"][0];
    assert_eq!(away["health"], "away");
    assert!(away["away"].as_str().unwrap().contains("503"), "{away}");
    assert_eq!(away["series"][0]["reached"], "2026-03-02T08:15:19Z");
    // What is refused stands in the audit log, and what is only said does not.
    let log = shown("/v1/audit").await.expect(200).json();
    let entries = log["items"].as_array().unwrap().iter();
    let of_sources = entries.filter(|entry| entry["path"] == "/v1/sources/pi");
    let statuses: Vec<&Value> = of_sources.map(|entry| &entry["status"]).collect();
    assert_eq!(statuses, [403]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_source_is_said_seen_and_forgotten_and_a_wrong_state_names_its_places() {
    let app = TestApp::start().await;
    let series = json!({"series": "PT-101", "stream": "rig-4", "reached": null, "fault": "the server refuses the samples"});
    let state = json!({"kind": "postgresql", "every_s": 60.0, "away": null, "series": [series]});
    put(&app, &state).await.expect(204);
    let listed = app.get("/v1/sources").await.expect(200).json();
    assert_eq!(listed["items"][0]["name"], "press hall");
    assert_eq!(listed["items"][0]["health"], "refused");
    let wrong = json!({"kind": "", "every_s": -1, "series": [{"series": "a", "stream": "b c", "reached": "x"}], "token": 1});
    let refused = put(&app, &wrong).await.expect(422).json();
    let mut places: Vec<_> = refused["errors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|fault| fault["pointer"].clone())
        .collect();
    places.sort_by_key(ToString::to_string);
    let expected = [
        "/every_s",
        "/kind",
        "/series/0/reached",
        "/series/0/stream",
        "/token",
    ];
    assert_eq!(places, expected);
    app.delete("/v1/sources/press%20hall").await.expect(204);
    app.get("/v1/sources/press%20hall").await.problem(404);
    app.delete("/v1/sources/press%20hall").await.problem(404);
}
