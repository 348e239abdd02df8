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
    // A block of samples that are a second apart.
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
    // No fewer than is asked for, and not many more.
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

/// The samples of a signal of `rig-4`, as time of day in seconds past eight and value.
async fn samples(app: &TestApp, signal: &str) -> Vec<(f64, f64)> {
    let path = "/v1/streams/rig-4?from=2026-03-02T08:00:00Z&to=2026-03-02T09:00:00Z";
    let shown = app.get(path).await.expect(200).json();
    let window = &shown["window"];
    let start: jiff::Timestamp = window["start"].as_str().unwrap().parse().unwrap();
    let eight: jiff::Timestamp = "2026-03-02T08:00:00Z".parse().unwrap();
    let from = start.duration_since(eight).as_secs_f64();
    let times = window["samples"]["time_s"].as_array().unwrap().iter();
    let values = window["samples"]["signals"][signal]["values"].as_array();
    let pairs = times.zip(values.unwrap());
    let present = pairs.filter_map(|(time, value)| Some((time.as_f64()?, value.as_f64()?)));
    present
        .map(|(time, value)| (((from + time) * 1e6).round() / 1e6, value))
        .collect()
}

fn codes(answer: &Value) -> Vec<String> {
    let warnings = answer["report"]["warnings"].as_array().unwrap().iter();
    warnings
        .map(|warning| {
            let signal = warning["signal"].as_str().unwrap_or("all");
            format!("{signal}: {}", warning["code"].as_str().unwrap())
        })
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn each_sample_keeps_the_instant_at_which_it_was_taken() {
    let app = TestApp::start().await;
    // A command that is recorded when it changes, beside a position at a hertz.
    let mut long = String::from("timestamp,tag,value\n");
    for (time, value) in [("00", 1), ("02.5", 5), ("04.7", 9)] {
        long += &format!("2026-03-02T08:00:{time}Z,cmd,{value}\n");
    }
    for k in 0..6 {
        long += &format!("2026-03-02T08:00:0{k}Z,position,{k}\n");
    }
    let told = app.post_csv("/v1/streams/rig-4", long.clone()).await;
    let told = told.expect(201).json();
    assert_eq!(
        (&told["added"], &told["stream"]["samples"]),
        (&json!(8), &json!(8))
    );
    assert_eq!(
        samples(&app, "cmd").await,
        [(0.0, 1.0), (2.5, 5.0), (4.7, 9.0)]
    );
    let position: Vec<(f64, f64)> = (0..6).map(|k| (f64::from(k), f64::from(k))).collect();
    assert_eq!(samples(&app, "position").await, position);
    let again = app.post_csv("/v1/streams/rig-4", long.clone()).await;
    assert_eq!(again.expect(200).json()["repeated"], 8);

    // Stamps a little off a grid are not moved onto it.
    let wide = "time,level [m]\n2026-03-02T08:10:00Z,1\n2026-03-02T08:10:01.0004Z,2\n\
                2026-03-02T08:10:02Z,3\n";
    app.post_csv("/v1/streams/rig-4", wide).await.expect(200);
    let level = [(600.0, 1.0), (601.0004, 2.0), (602.0, 3.0)];
    assert_eq!(samples(&app, "level").await, level);

    let asked = app.post_csv("/v1/streams/rig-4?grid=1s", long).await;
    let problem = asked.problem(422);
    assert_eq!(problem["errors"][0]["parameter"], "grid");
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_gateway_sends_one_sample_at_a_time_in_any_format() {
    let app = TestApp::start().await;
    let csv = "time,a [m]\n2026-03-02T08:00:00Z,1\n";
    app.post_csv("/v1/streams/rig-4", csv).await.expect(201);
    let long = "timestamp,tag,value\n2026-03-02T08:00:01Z,a,2\n";
    let told = app.post_csv("/v1/streams/rig-4?units=a:m", long).await;
    told.expect(200);
    let document = json!({"start": "2026-03-02T08:00:02Z", "sample_time_s": 1,
                          "signals": {"a": {"unit": "m", "values": [3]}}});
    app.post_json("/v1/streams/rig-4", &document)
        .await
        .expect(200);
    let lines = "rig a=4 1772438403000000000\n";
    let request = app.request(Method::POST, "/v1/streams/rig-4?units=a:m&rename=a:a");
    let request = request.header("content-type", "text/plain").body(lines);
    app.send(request).await.expect(200);
    let expected = [(0.0, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 4.0)];
    assert_eq!(samples(&app, "a").await, expected);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn an_append_says_what_it_assumed_and_what_it_left_out() {
    let app = TestApp::start().await;
    let mut text = String::from("timestamp,p [bar],operator,q\n");
    for k in 0..20 {
        let p = if k == 7 {
            -9999.0
        } else {
            50.0 + f64::from(k % 3)
        };
        let q = if k == 3 { String::new() } else { k.to_string() };
        text += &format!("{},{p},Smith,{q}\n", 1_772_438_400 + k);
    }
    let told = app.post_csv("/v1/streams/rig-4", text).await.expect(201);
    let told = told.json();
    let expected = [
        "all: time_unit_from_size",
        "p: likely_sentinel",
        "operator: text_column",
        "q: missing_samples",
        "q: no_unit",
    ];
    assert_eq!(codes(&told), expected, "{told}");
    let alone = "time,p [bar]\n2026-03-02T08:15:00Z,-9999\n";
    let told = app
        .post_csv("/v1/streams/rig-4", alone)
        .await
        .expect(200)
        .json();
    assert!(
        codes(&told).contains(&"p: likely_sentinel".to_owned()),
        "{told}"
    );
    let twice = "time,p [bar]\n2026-03-02T08:16:00Z,1\n2026-03-02T08:16:00Z,2\n\
                 2026-03-02T08:16:01Z,3\n";
    let told = app
        .post_csv("/v1/streams/rig-4", twice)
        .await
        .expect(200)
        .json();
    assert!(
        codes(&told).contains(&"all: duplicate_time".to_owned()),
        "{told}"
    );
    let stored = samples(&app, "p").await;
    assert!(
        stored.contains(&(960.0, 2e5)),
        "the later statement counts: {stored:?}"
    );
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn samples_of_the_future_are_refused_by_name_and_those_of_today_do_not_count() {
    let app = TestApp::start().await;
    let now = jiff::Timestamp::now();
    let at = |hours: i64| now + jiff::SignedDuration::from_hours(hours);
    let row = |hours: i64, a: &str, b: &str| format!("{},{a},{b}\n", at(hours));
    let header = "time,a [m],b [m]\n".to_owned();
    let past: String = (-40..0).map(|k| row(k, "1", "2")).collect();
    let wrong = header.clone() + &past + &row(100, "", "3") + &row(101, "", "4");
    let problem = app.post_csv("/v1/streams/rig-4", wrong).await.problem(422);
    let fault = &problem["errors"][0];
    assert_eq!(fault["code"], "stamp_in_future");
    let detail = fault["detail"].as_str().unwrap();
    assert!(detail.contains("`b` has 2 samples"), "{detail}");
    assert!(detail.contains(&at(100).to_string()), "{detail}");
    app.get("/v1/streams/rig-4").await.problem(404);

    // Twelve hours ahead is taken, and pushes nothing out.
    let ahead = header + &past + &row(12, "5", "6");
    let told = app.post_csv("/v1/streams/rig-4?keep_s=172800", ahead).await;
    let told = told.expect(201).json();
    assert_eq!((&told["added"], &told["removed"]), (&json!(41), &json!(0)));
    let from = at(1).to_string();
    let path = format!("/v1/streams/rig-4/samples?from={from}");
    let gone = app.delete(&path).await.expect(200).json();
    assert_eq!(
        (&gone["removed"], &gone["stream"]["samples"]),
        (&json!(1), &json!(40))
    );
    assert_eq!(gone["stream"]["last"], at(-1).to_string());
    app.delete("/v1/streams/rig-4/samples").await.problem(422);
    app.delete("/v1/streams/none/samples?from=2026-03-02T08:15:00Z")
        .await
        .problem(404);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_hour_that_comes_twice_is_kept_twice() {
    let app = TestApp::start().await;
    let pass = |value: u32| {
        let rows = (0..60).map(|minute| format!("2025-10-26 02:{minute:02}:00,{value}\n"));
        rows.fold("time,a [m]\n".to_owned(), |text, row| text + &row)
    };
    let path = "/v1/streams/rig-4?tz=Europe/Berlin";
    app.post_csv(path, pass(1)).await.expect(201);
    let told = app.post_csv(path, pass(2)).await.expect(200).json();
    assert_eq!((&told["added"], &told["changed"]), (&json!(60), &json!(0)));
    assert!(
        codes(&told).contains(&"all: double_hour".to_owned()),
        "{told}"
    );
    assert_eq!(told["stream"]["first"], "2025-10-26T00:00:00Z");
    assert_eq!(told["stream"]["last"], "2025-10-26T01:59:00Z");
    let told = app.post_csv(path, pass(1)).await.expect(200).json();
    assert_eq!(told["repeated"], 60);
    let problem = app.post_csv(path, pass(3)).await.problem(422);
    assert_eq!(problem["errors"][0]["code"], "hour_came_twice");
    app.shutdown().await;
}
