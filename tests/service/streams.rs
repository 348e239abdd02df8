//! Recordings that grow.

use reqwest::Method;
use serde_json::{Value, json};

use super::app::TestApp;

/// Samples `k` in a range: position `k` mm at `k` seconds past a quarter past eight.
fn batch(samples: std::ops::Range<u32>) -> String {
    let mut text = String::from("time,position [mm]\n");
    for k in samples {
        text += &format!("2026-03-02T08:{:02}:{:02}Z,{k}\n", 15 + k / 60, k % 60);
    }
    text
}

async fn window(app: &TestApp) -> Value {
    let path = "/v1/streams/rig-4?from=2026-03-02T08:15:00Z&to=2026-03-02T09:00:00Z";
    app.get(path).await.expect(200).json()
}

#[tokio::test(flavor = "multi_thread")]
async fn batches_in_any_order_and_more_than_once_are_one_stream() {
    let app = TestApp::start().await;
    let first = app
        .post_csv("/v1/streams/rig-4", batch(40..60))
        .await
        .expect(201);
    assert_eq!(first.header("location"), "/v1/streams/rig-4");
    for (samples, added, repeated) in [(80..100, 20, 0), (0..50, 40, 10), (55..85, 20, 10)] {
        let told = app.post_csv("/v1/streams/rig-4", batch(samples)).await;
        let told = told.expect(200).json();
        assert_eq!(
            (&told["added"], &told["repeated"]),
            (&json!(added), &json!(repeated))
        );
    }
    let shown = window(&app).await;
    assert_eq!(shown["samples"], 100);
    assert_eq!(shown["first"], "2026-03-02T08:15:00Z");
    let samples = &shown["window"]["samples"];
    let expected: Vec<f64> = (0..100).map(|k| f64::from(k) * 1e-3).collect();
    assert_eq!(samples["signals"]["position"]["values"], json!(expected));
    assert_eq!(samples["time_s"][99], 99.0);

    let later = "time,position [mm]\n2026-03-02T08:15:07Z,70\n2026-03-02T08:15:08Z,8\n";
    let told = app
        .post_csv("/v1/streams/rig-4", later)
        .await
        .expect(200)
        .json();
    assert_eq!(
        (&told["changed"], &told["repeated"]),
        (&json!(1), &json!(1))
    );
    let shown = window(&app).await;
    assert_eq!(
        shown["window"]["samples"]["signals"]["position"]["values"][7],
        0.07
    );
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_batch_comes_once_by_its_key() {
    let app = TestApp::start().await;
    let post = |body: String, key: &str| {
        let request = app.request(Method::POST, "/v1/streams/rig-4").body(body);
        let request = request.header("content-type", "text/csv");
        app.send(request.header("idempotency-key", key))
    };
    let first = post(batch(0..10), "one").await.expect(201);
    post(batch(10..20), "two").await.expect(200);
    let again = post(batch(0..10), "one").await.expect(200);
    assert_eq!(again.header("idempotent-replayed"), "true");
    assert_eq!(again.text, first.text);
    post(batch(0..11), "one").await.problem(422);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_window_is_cut_into_a_recording_that_late_samples_do_not_change() {
    let app = TestApp::start().await;
    app.post_csv("/v1/streams/rig-4", batch(0..50))
        .await
        .expect(201);
    let part = json!({"from": "2026-03-02T09:15:10+01:00", "to": "2026-03-02T08:15:40Z"});
    let path = "/v1/streams/rig-4/recordings";
    let cut = app.post_json(path, &part).await.expect(201).json();
    assert_eq!(
        (&cut["samples"], &cut["start"]),
        (&json!(30), &json!("2026-03-02T08:15:10Z"))
    );
    assert_eq!(
        (&cut["sample_time_s"], &cut["uniform"]),
        (&json!(1.0), &json!(true))
    );
    let same = app.post_json(path, &part).await.expect(200).json();
    assert_eq!(same["id"], cut["id"]);
    let late = "time,position [mm]\n2026-03-02T08:15:20.5Z,20.5\n2026-03-02T08:15:21.5Z,21.5\n";
    app.post_csv("/v1/streams/rig-4", late).await.expect(200);
    let other = app.post_json(path, &part).await.expect(201).json();
    assert_eq!(other["samples"], 32);
    let id = cut["id"].as_str().unwrap();
    let kept = app
        .get(&format!("/v1/datasets/{id}"))
        .await
        .expect(200)
        .json();
    assert_eq!(kept["samples"], 30);
    app.delete("/v1/streams/rig-4").await.expect(204);
    app.get("/v1/streams/rig-4").await.problem(404);
    app.get(&format!("/v1/datasets/{id}/samples"))
        .await
        .expect(200);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_wrong_with_a_batch_is_told() {
    let app = TestApp::start().await;
    let no_start = "time [s],position [mm]\n0,1\n1,2\n";
    let problem = app
        .post_csv("/v1/streams/rig-4", no_start)
        .await
        .problem(422);
    assert_eq!(problem["errors"][0]["code"], "no_start");
    app.post_csv("/v1/streams/rig-4", batch(0..5))
        .await
        .expect(201);
    let other_unit = batch(0..5).replace("[mm]", "[bar]");
    let problem = app
        .post_csv("/v1/streams/rig-4", other_unit)
        .await
        .problem(422);
    assert_eq!(problem["errors"][0]["code"], "units_differ");
    app.post_csv("/v1/streams/a%20b", batch(0..5))
        .await
        .problem(404);
    app.post_csv("/v1/streams/rig-4?keep_s=0", batch(0..5))
        .await
        .problem(422);
    let part = json!({"from": "2026-03-02T08:15:00Z", "to": "yesterday", "till": 3});
    let problem = app
        .post_json("/v1/streams/rig-4/recordings", &part)
        .await
        .problem(422);
    assert_eq!(problem["errors"].as_array().unwrap().len(), 2);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_keeps_what_it_is_told_to_keep() {
    let app = TestApp::taking_mib(8).await;
    // Two blocks of some 16 000 samples each, a second apart.
    let values: Vec<u32> = (0..40_000).collect();
    let body = |start: &str, values: &[u32]| {
        json!({"start": start, "sample_time_s": 1,
               "signals": {"a": {"unit": "m", "values": values}, "b": {"values": values}}})
    };
    let all = body("2026-03-02T00:00:00Z", &values);
    let told = app.post_json("/v1/streams/rig-4?keep_s=20000", &all).await;
    let told = told.expect(201).json();
    let (kept, removed) = (&told["stream"]["samples"], &told["removed"]);
    assert_eq!(kept.as_u64().unwrap() + removed.as_u64().unwrap(), 40_000);
    // Whole blocks go: no more than is asked for, and all but a block of it.
    let kept = kept.as_u64().unwrap();
    assert!(
        (20_000..20_000 + (1 << 15)).contains(&kept) && kept < 40_000,
        "{kept}"
    );
    let more = body("2026-03-02T11:06:40Z", &values[..10]);
    let told = app
        .post_json("/v1/streams/rig-4?keep_mib=1", &more)
        .await
        .expect(200);
    assert!(told.json()["stream"]["bytes"].as_u64().unwrap() <= 1 << 20);
    app.shutdown().await;
}
