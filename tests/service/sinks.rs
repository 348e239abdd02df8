//! What agents write as to InfluxDB: where it lands, what is listed, and how a refusal is told.

use reqwest::{Method, RequestBuilder};
use serde_json::{Value, json};

use super::app::{Answer, TestApp};

/// The line `rig,hall=2 position=1.5 1465839830100400200`, compressed by gzip.
const GZIPPED: &[u8] = b"\x1f\x8b\x08\x00\x00\x00\x00\x00\x02\x03\x2b\xca\x4c\xd7\xc9\x48\xcc\xc9\xb1\x35\x52\x28\xc8\x2f\xce\x2c\xc9\xcc\xcf\xb3\x35\xd4\x33\x55\x30\x34\x31\x33\xb5\x30\xb6\xb4\x30\x36\x30\x34\x30\x30\x31\x30\x30\x32\x30\xe0\x02\x00\x86\x5d\xd0\x9e\x2c\x00\x00\x00";

/// The rules of a rig in each of two halls.
pub fn rules() -> Value {
    json!({"rules": [
        {"measurement": "rig", "tags": {"hall": "2"}, "stream": "rig-4",
         "signals": {"position": {"signal": "position", "unit": "mm"}, "open": {"signal": "open"}}},
        {"measurement": "rig", "tags": {"hall": "3"}, "stream": "rig-5",
         "signals": {"position": {"signal": "position", "unit": "mm"}}}
    ]})
}

async fn put(app: &TestApp, rules: &Value) -> Answer {
    let request = app.request(Method::PUT, "/v1/mappings/plant").json(rules);
    app.send(request).await
}

/// A server with the rules of the rigs for the database or bucket `plant`.
async fn mapped() -> TestApp {
    let app = TestApp::start().await;
    put(&app, &rules()).await.expect(201);
    app
}

pub fn to_v1(app: &TestApp, query: &str, lines: impl Into<String>) -> RequestBuilder {
    let path = format!("/write?db=plant{query}");
    app.request(Method::POST, &path).body(lines.into())
}

pub fn to_v2(app: &TestApp, query: &str, lines: impl Into<String>) -> RequestBuilder {
    let path = format!("/api/v2/write?org=works&bucket=plant{query}");
    app.request(Method::POST, &path).body(lines.into())
}

/// A stream with all of its samples.
async fn stream(app: &TestApp, name: &str) -> Value {
    let path = format!("/v1/streams/{name}?from=1970-01-01T00:00:00Z");
    app.get(&path).await.expect(200).json()
}

fn values<'v>(stream: &'v Value, signal: &str) -> &'v Value {
    &stream["window"]["samples"]["signals"][signal]["values"]
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sample_lands_with_its_own_instant_at_each_precision() {
    for (precision, stamp, first) in [
        (
            "",
            1_465_839_830_100_400_207_i64,
            "2016-06-13T17:43:50.100400207Z",
        ),
        (
            "&precision=n",
            1_465_839_830_100_400_207,
            "2016-06-13T17:43:50.100400207Z",
        ),
        (
            "&precision=ns",
            1_465_839_830_100_400_207,
            "2016-06-13T17:43:50.100400207Z",
        ),
        (
            "&precision=u",
            1_465_839_830_100_401,
            "2016-06-13T17:43:50.100401Z",
        ),
        (
            "&precision=us",
            1_465_839_830_100_401,
            "2016-06-13T17:43:50.100401Z",
        ),
        (
            "&precision=ms",
            1_465_839_830_101,
            "2016-06-13T17:43:50.101Z",
        ),
        ("&precision=s", 1_465_839_831, "2016-06-13T17:43:51Z"),
        ("&precision=m", 24_430_663, "2016-06-13T17:43:00Z"),
        ("&precision=h", 407_177, "2016-06-13T17:00:00Z"),
        ("&precision=ms", -1, "1969-12-31T23:59:59.999Z"),
    ] {
        let app = mapped().await;
        let line = format!("rig,hall=2 position=0.1 {stamp}\n");
        let written = app
            .send(to_v1(&app, precision, line.clone()))
            .await
            .expect(204);
        assert_eq!(written.header("x-influxdb-version"), "1.8.10");
        assert_eq!(written.text, "");
        let shown = app.get("/v1/streams/rig-4").await.expect(200).json();
        assert_eq!(
            (&shown["samples"], &shown["first"]),
            (&json!(1), &json!(first)),
            "{precision}"
        );
        // A line that is written again, by the protocol of InfluxDB 2, changes nothing.
        app.send(to_v2(&app, precision, line)).await.expect(204);
        let again = app.get("/v1/streams/rig-4").await.expect(200).json();
        assert_eq!(
            (&again["samples"], &again["first"]),
            (&json!(1), &json!(first))
        );
        app.shutdown().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn one_batch_goes_to_several_streams_in_si() {
    let app = mapped().await;
    let lines = "rig,hall=2,line=a position=101.2,open=true 1465839830000000000\n\
                 rig,hall=3 position=7 1465839830000000000\n\
                 rig,hall=2,line=b position=101.3 1465839831000000000\n\
                 rig,hall=3 position=8i 1465839831500000000\n";
    app.send(to_v1(&app, "&rp=autogen&consistency=one", lines))
        .await
        .expect(204);
    let four = stream(&app, "rig-4").await;
    assert_eq!(values(&four, "position"), &json!([0.1012, 0.1013]));
    assert_eq!(values(&four, "open"), &json!([1.0, null]));
    let position = four["signals"].as_array().unwrap();
    let position = position
        .iter()
        .find(|signal| signal["name"] == "position")
        .unwrap();
    assert_eq!(
        (&position["unit"], &position["recorded_unit"]),
        (&json!("m"), &json!("mm"))
    );
    let five = stream(&app, "rig-5").await;
    assert_eq!(values(&five, "position"), &json!([0.007, 0.008]));
    assert_eq!(five["window"]["samples"]["time_s"], json!([0.0, 1.5]));
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn series_without_a_rule_are_listed_and_not_stored() {
    let app = mapped().await;
    let lines = "rig,hall=2 position=1,speed=3.5 1465839830000000000\n\
                 pump,hall=2 state=\"on\" 1465839830000000000\n\
                 pump,hall=2 state=\"off\" 1465839831000000000\n";
    app.send(to_v1(&app, "", lines)).await.expect(204);
    app.send(to_v2(&app, "", "pump,hall=2 state=\"old\" 1\n"))
        .await
        .expect(204);
    let shown = app.get("/v1/mappings/plant").await.expect(200).json();
    let expected = json!([
        {"measurement": "pump", "tags": {"hall": "2"}, "field": "state", "samples": 3,
         "last_value": "off", "last_at": "2016-06-13T17:43:51Z"},
        {"measurement": "rig", "tags": {"hall": "2"}, "field": "speed", "samples": 1,
         "last_value": 3.5, "last_at": "2016-06-13T17:43:50Z"}
    ]);
    assert_eq!(shown["unmapped"], expected);
    assert_eq!(shown["unlisted"], 0);
    let streams = app.get("/v1/streams").await.expect(200).json();
    assert_eq!(streams["items"].as_array().unwrap().len(), 1);
    assert_eq!(streams["items"][0]["signals"].as_array().unwrap().len(), 1);
    // New rules begin the list anew.
    let replaced = put(&app, &rules()).await.expect(200).json();
    assert_eq!(replaced["unmapped"], json!([]));
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_list_of_series_is_bounded_and_survives_a_restart() {
    let app = mapped().await;
    let lines = |from: u32, to: u32| -> String {
        let line = |k| format!("cpu,core={k} load=0.5 1465839830000000000\n");
        (from..to).map(line).collect()
    };
    app.send(to_v1(&app, "", lines(0, 800))).await.expect(204);
    app.send(to_v1(&app, "", lines(500, 1500)))
        .await
        .expect(204);
    app.send(to_v1(&app, "", lines(1400, 3000)))
        .await
        .expect(204);
    let app = app.restarted().await;
    let shown = app.get("/v1/mappings/plant").await.expect(200).json();
    let listed = shown["unmapped"].as_array().unwrap();
    assert_eq!(listed.len(), 1000);
    let samples: u64 = listed
        .iter()
        .map(|series| series["samples"].as_u64().unwrap())
        .sum();
    let unlisted = shown["unlisted"].as_u64().unwrap();
    assert_eq!(samples + unlisted, 800 + 1000 + 1600);
    let streams = app.get("/v1/streams").await.expect(200).json();
    assert_eq!(streams["items"], json!([]));
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn lines_that_are_wrong_are_told_and_the_others_stored() {
    let app = mapped().await;
    let lines = "rig,hall=2 position=1 1465839830000000000\n\
                 rig,hall=2 position=2\n\
                 rig,hall=2 position= 1465839832000000000\n\
                 rig,hall=2 position=\"up\" 1465839833000000000\n\
                 rig,hall=2 position=5 1465839834000000000\n";
    let refused = app.send(to_v1(&app, "", lines)).await.expect(400);
    assert_eq!(refused.header("content-type"), "application/json");
    assert!(
        refused
            .header("x-influxdb-error")
            .starts_with("partial write: ")
    );
    let body = refused.json();
    let error = body["error"].as_str().unwrap();
    assert!(error.starts_with("partial write: unable to parse 'rig,hall=2 position=2': missing"));
    assert!(error.contains("field type conflict: input field \"position\" on measurement \"rig\""));
    assert!(error.ends_with(" dropped=3"), "{error}");
    assert_eq!(
        values(&stream(&app, "rig-4").await, "position"),
        &json!([1e-3, 5e-3])
    );

    let refused = app.send(to_v2(&app, "", lines)).await.expect(400).json();
    assert_eq!(refused["code"], "invalid");
    assert_eq!(refused["message"], error);
    // Where every line is wrong nothing is a partial write.
    let refused = app.send(to_v1(&app, "", "rig\n")).await.expect(400).json();
    assert_eq!(
        refused,
        json!({"error": "unable to parse 'rig': missing fields"})
    );
    app.send(to_v1(&app, "", "")).await.expect(204);
    app.send(to_v1(&app, "", "# a comment\n\n"))
        .await
        .expect(204);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_that_does_not_take_its_samples_keeps_no_other_out() {
    let app = mapped().await;
    let csv = "time,position [bar]\n2016-06-13T17:00:00Z,1\n";
    app.post_csv("/v1/streams/rig-5", csv).await.expect(201);
    let lines = "rig,hall=2 position=1 1465839830000000000\nrig,hall=3 position=2 1465839830000000000\n\
                 rig,hall=3 position=3 1465839831000000000\n";
    let refused = app.send(to_v1(&app, "", lines)).await.expect(400).json();
    let error = refused["error"].as_str().unwrap();
    let expected =
        "partial write: field type conflict: signal \"position\" of stream \"rig-5\" is in `Pa`";
    assert!(
        error.starts_with(expected) && error.ends_with("dropped=2"),
        "{error}"
    );
    let four = app.get("/v1/streams/rig-4").await.expect(200).json();
    let five = app.get("/v1/streams/rig-5").await.expect(200).json();
    assert_eq!((&four["samples"], &five["samples"]), (&json!(1), &json!(1)));
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stamp_too_far_ahead_is_refused() {
    let app = mapped().await;
    let lines = "rig,hall=2 position=1 1465839830\nrig,hall=2 position=2 4102444800\n";
    let refused = app
        .send(to_v1(&app, "&precision=s", lines))
        .await
        .expect(400)
        .json();
    let error = refused["error"].as_str().unwrap();
    assert!(
        error.contains("further ahead of this server's clock"),
        "{error}"
    );
    let shown = app.get("/v1/streams/rig-4").await.expect(200).json();
    assert_eq!(
        (&shown["samples"], &shown["last"]),
        (&json!(1), &json!("2016-06-13T17:43:50Z"))
    );
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn bodies_come_packed_with_gzip() {
    let app = mapped().await;
    let request = app
        .request(Method::POST, "/api/v2/write?bucket=plant")
        .body(GZIPPED);
    app.send(request.header("content-encoding", "gzip"))
        .await
        .expect(204);
    let shown = app.get("/v1/streams/rig-4").await.expect(200).json();
    assert_eq!(shown["first"], "2016-06-13T17:43:50.1004002Z");
    let broken = to_v1(&app, "", "no gzip").header("content-encoding", "gzip");
    let broken = app.send(broken).await.expect(400).json();
    assert!(broken["error"].is_string());
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn refusals_have_the_form_of_the_protocol() {
    let app = mapped().await;
    let line = "rig,hall=2 position=1 1\n";
    let write = |path: &str| app.send(app.request(Method::POST, path).body(line));
    let unknown = write("/write?db=other").await.expect(404).json();
    assert_eq!(unknown, json!({"error": "database not found: \"other\""}));
    let unknown = write("/api/v2/write?bucket=other").await.expect(404);
    assert_eq!(unknown.header("x-platform-error-code"), "not found");
    let expected = json!({"code": "not found", "message": "bucket \"other\" not found"});
    assert_eq!(unknown.json(), expected);
    let missing = write("/write").await.expect(400).json();
    assert_eq!(missing["error"], "database is required");
    let missing = write("/api/v2/write?org=works").await.expect(400).json();
    assert_eq!(missing["message"], "bucket is required");
    let precision = write("/write?db=plant&precision=d")
        .await
        .expect(400)
        .json();
    assert!(
        precision["error"]
            .as_str()
            .unwrap()
            .starts_with("invalid precision")
    );
    let method = app.get("/write?db=plant").await.expect(405).json();
    assert!(method["error"].is_string());
    let large = "rig,hall=2 position=1 1\n".repeat(60_000);
    let large = app.send(to_v2(&app, "", large)).await.expect(413).json();
    assert_eq!(large["code"], "request too large");
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_quota_refuses_may_be_sent_again() {
    let app = TestApp::with(|settings| settings.max_stored_mib = 0).await;
    put(&app, &rules()).await.expect(201);
    let lines = "rig,hall=2 position=1,speed=2 1465839830000000000\n";
    // Telegraf drops what InfluxDB 1 answers with any 4xx.
    let refused = app.send(to_v1(&app, "", lines)).await.expect(503);
    assert_eq!(refused.header("retry-after"), "60");
    let refused = app.send(to_v2(&app, "", lines)).await.expect(429);
    assert_eq!(refused.header("retry-after"), "60");
    assert_eq!(refused.json()["code"], "too many requests");
    // Nothing of the request is stored, the list of series neither.
    let shown = app.get("/v1/mappings/plant").await.expect(200).json();
    assert_eq!(shown["unmapped"], json!([]));
    app.get("/v1/streams/rig-4").await.problem(404);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn rules_that_are_wrong_are_told_all_at_once() {
    let app = TestApp::start().await;
    let wrong = json!({"rules": [
        {"measurement": "rig", "stream": "a b", "signals": {"x": {"signal": "x", "unit": "furlongs"}}},
        {"measurement": "", "tags": {"hall": 2}, "stream": "rig-4", "signals": {}},
        {"measurement": "rig", "stream": "s", "signals": {"x": {"signal": "x", "unit": "mm"}}},
        {"measurement": "pump", "stream": "s", "signals": {"y": {"signal": "x", "unit": "bar"}}, "tag": {}}
    ], "rule": []});
    let problem = put(&app, &wrong).await.problem(422);
    let mut codes: Vec<&str> = problem["errors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|fault| fault["code"].as_str().unwrap())
        .collect();
    codes.sort_unstable();
    let expected = [
        "empty",
        "invalid_length",
        "invalid_name",
        "units_differ",
        "unknown_field",
        "unknown_field",
        "unknown_unit",
        "wrong_type",
    ];
    assert_eq!(codes, expected);
    app.get("/v1/mappings/plant").await.problem(404);
    put(&app, &json!({"rules": []})).await.expect(201);
    put(&app, &rules()).await.expect(200);
    let listed = app.get("/v1/mappings").await.expect(200).json();
    assert_eq!(listed["items"][0]["rules"][0]["stream"], "rig-4");
    app.delete("/v1/mappings/plant").await.expect(204);
    app.delete("/v1/mappings/plant").await.problem(404);
    let gone = app.send(to_v1(&app, "", "rig,hall=2 position=1 1\n")).await;
    gone.expect(404);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_server_says_that_it_is_there_and_well() {
    let app = TestApp::start().await;
    for method in [Method::GET, Method::HEAD] {
        let ping = app.send(app.request(method, "/ping")).await.expect(204);
        assert_eq!(ping.header("x-influxdb-version"), "1.8.10");
    }
    let verbose = app.get("/ping?verbose=true").await.expect(200).json();
    assert_eq!(verbose, json!({"version": "1.8.10"}));
    let health = app.get("/health").await.expect(200).json();
    assert_eq!(
        (&health["status"], &health["name"]),
        (&json!("pass"), &json!("greybox"))
    );
    app.shutdown().await;
}
