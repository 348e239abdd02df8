//! What senders of the Open Message Format write: definitions that last, samples that land, and refusals that are told.

use greybox_service::access::Scope;
use reqwest::{Method, RequestBuilder};
use serde_json::{Value, json};

use super::app::TestApp;

fn message(app: &TestApp, path: &str, message_type: &str, body: &Value) -> RequestBuilder {
    let request = app.request(Method::POST, path).json(body);
    request
        .header("omfversion", "1.2")
        .header("messagetype", message_type)
        .header("messageformat", "json")
}

/// A server with a mapping `plant` for two tanks.
async fn mapped() -> TestApp {
    let app = TestApp::start().await;
    put_rules(&app, "plant", None).await;
    app
}

async fn put_rules(app: &TestApp, name: &str, secret: Option<&str>) {
    let rules = json!({"rules": [
        {"measurement": "Tank-1.Pressure", "stream": "tank-1", "quality": {"codes": "opc_da"},
         "signals": {"Value": {"signal": "pressure"}}},
        {"measurement": "Tank-2.Pressure", "stream": "tank-2", "quality": {"codes": "opc_da"},
         "signals": {"Value": {"signal": "pressure", "unit": "kPa"}}}
    ]});
    let path = format!("/v1/mappings/{name}");
    let mut request = app.request(Method::PUT, &path).json(&rules);
    if let Some(secret) = secret {
        request = request.bearer_auth(secret);
    }
    app.send(request).await.expect(201);
}

fn types(unit: &str) -> Value {
    json!([{"id": "Pressure", "type": "object", "classification": "dynamic", "properties": {
        "Timestamp": {"type": "string", "format": "date-time", "isindex": true},
        "Value": {"type": "number", "uom": unit, "interpolation": "continuous"},
        "Quality": {"type": "integer", "isquality": true}}}])
}

fn containers() -> Value {
    let ids = ["Tank-1.Pressure", "Tank-2.Pressure", "Tank-3.Pressure"];
    Value::Array(ids.map(|id| json!({"id": id, "typeid": "Pressure"})).into())
}

/// A value and, a second later, twice as much.
fn values(container: &str, value: f64) -> Value {
    json!([{"containerid": container, "values": [
        {"Timestamp": "2026-03-02T08:15:00Z", "Value": value, "Quality": 192},
        {"Timestamp": "2026-03-02T08:15:01Z", "Value": 2.0 * value, "Quality": 192}]}])
}

async fn define(app: &TestApp) {
    for (message_type, body) in [("type", types("bar")), ("container", containers())] {
        let answer = app
            .send(message(app, "/omf/plant", message_type, &body))
            .await;
        let answer = answer.expect(200).json();
        let status = json!({"Code": 200, "HighestSeverity": "Information"});
        assert_eq!(answer["Messages"][0]["Status"], status, "{answer}");
    }
}

/// The values of the signal `pressure` of a stream.
async fn pressures(app: &TestApp, stream: &str) -> Value {
    let path = format!("/v1/streams/{stream}?from=1970-01-01T00:00:00Z");
    let shown = app.get(&path).await.expect(200).json();
    shown["window"]["samples"]["signals"]["pressure"]["values"].clone()
}

/// The sentences of a refusal.
fn sentences(answer: &Value) -> String {
    let events = answer["Messages"][0]["Events"].as_array().unwrap();
    let sentences = events
        .iter()
        .map(|event| event["Event"]["Message"].as_str().unwrap());
    sentences.collect::<Vec<_>>().join("\n")
}

#[tokio::test(flavor = "multi_thread")]
async fn definitions_last_and_samples_land_in_the_units_that_they_declare() {
    let app = mapped().await;
    define(&app).await;
    let app = app.restarted().await;
    for (container, value) in [("Tank-1.Pressure", 1.5), ("Tank-2.Pressure", 150.0)] {
        let body = values(container, value);
        app.send(message(&app, "/omf/plant", "Data", &body))
            .await
            .expect(200);
    }
    assert_eq!(pressures(&app, "tank-1").await, json!([1.5e5, 3e5]));
    assert_eq!(
        pressures(&app, "tank-2").await,
        json!([1.5e5, 3e5]),
        "the rule's unit counts"
    );
    // A definition that comes again changes what comes after it.
    let body = types("mbar");
    let changed = message(&app, "/omf/plant", "type", &body).header("action", "update");
    app.send(changed).await.expect(200);
    let body = json!([{"containerid": "Tank-1.Pressure", "values": [
        {"Timestamp": "2026-03-02T08:15:02Z", "Value": 1500, "Quality": 192},
        {"Timestamp": "2026-03-02T08:15:03Z", "Value": 0, "Quality": 0}]}]);
    app.send(message(&app, "/omf/plant", "data", &body))
        .await
        .expect(200);
    assert_eq!(
        pressures(&app, "tank-1").await,
        json!([1.5e5, 3e5, 1.5e5, null])
    );
    // What no rule names is listed.
    let body = values("Tank-3.Pressure", 2.5);
    app.send(message(&app, "/omf/plant", "data", &body))
        .await
        .expect(200);
    let shown = app.get("/v1/mappings/plant").await.expect(200).json();
    let seen: Vec<(&str, &str)> = shown["unmapped"]
        .as_array()
        .unwrap()
        .iter()
        .map(|series| {
            (
                series["measurement"].as_str().unwrap(),
                series["field"].as_str().unwrap(),
            )
        })
        .collect();
    assert!(seen.contains(&("Tank-3.Pressure", "Value")), "{seen:?}");
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_not_defined_or_wrong_is_refused_and_the_rest_is_stored() {
    let app = mapped().await;
    let early = message(&app, "/omf/plant", "data", &values("Tank-1.Pressure", 1.0));
    let early = app.send(early).await.expect(400).json();
    assert!(
        sentences(&early).contains("it is not defined here"),
        "{early}"
    );
    assert_eq!(early["Messages"][0]["Status"]["HighestSeverity"], "Error");
    define(&app).await;
    let body = json!([
        {"containerid": "Tank-1.Pressure", "values": [
            {"Timestamp": "2026-03-02T08:15:00Z", "Value": 1, "Quality": 192}, {"Value": 2},
            {"Timestamp": "2026-03-02T08:15:02Z", "Value": 3}]},
        {"typeid": "__Link", "values": []}
    ]);
    let partial = app.send(message(&app, "/omf/plant", "data", &body)).await;
    let partial = sentences(&partial.expect(400).json());
    assert!(partial.starts_with("partial write: "), "{partial}");
    assert!(partial.ends_with("dropped=1"), "{partial}");
    assert_eq!(pressures(&app, "tank-1").await, json!([1e5, 3e5]));
    // A container that is removed has to be defined again.
    let body = json!([{"id": "Tank-1.Pressure", "typeid": "Pressure"}]);
    let removed = message(&app, "/omf/plant", "container", &body).header("action", "delete");
    app.send(removed).await.expect(200);
    let body = values("Tank-1.Pressure", 1.0);
    app.send(message(&app, "/omf/plant", "data", &body))
        .await
        .expect(400);
    let links = json!([{"typeid": "__Link", "values": []}]);
    let links = app.send(message(&app, "/omf/plant", "data", &links)).await;
    assert!(sentences(&links.expect(200).json()).contains("1 messages with static data"));
    for (path, message_type, body, status, word) in [
        ("/omf", "data", json!([]), 404, "no mapping called \"omf\""),
        ("/omf/plant", "data", json!({}), 400, "an array"),
        ("/omf/plant", "schema", json!({}), 400, "omfversion"),
        (
            "/omf/plant",
            "type",
            json!([{"id": "T", "properties": 7}]),
            400,
            "`T`",
        ),
    ] {
        let refused = app.send(message(&app, path, message_type, &body)).await;
        let refused = refused.expect(status).json();
        assert_eq!(
            refused["Messages"][0]["Status"]["Code"], status,
            "{refused}"
        );
        assert!(sentences(&refused).contains(word), "{refused}");
    }
    let large = json!([{"id": "x".repeat(3 << 20)}]);
    let large = app.send(message(&app, "/omf/plant", "type", &large)).await;
    large.expect(413);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn definitions_have_bounds_and_go_with_their_mapping() {
    let app = mapped().await;
    define(&app).await;
    // Ten bodies of 1.8 MB of names each are more than the 16 MiB that a mapping keeps.
    let mut statuses = Vec::new();
    for place in 0..10 {
        let names = (0..1000).map(|n| json!({"name": format!("{n:0450}"), "value": n}));
        let names: Vec<Value> = names.collect();
        let types =
            (0..4).map(|n| json!({"id": format!("T{place}-{n}"), "enum": {"values": names}}));
        let types = Value::Array(types.collect());
        let answer = app.send(message(&app, "/omf/plant", "type", &types)).await;
        statuses.push(answer.status);
    }
    assert_eq!(statuses, [200, 200, 200, 200, 200, 200, 200, 200, 200, 400]);
    // The definitions of a mapping go with it.
    app.delete("/v1/mappings/plant").await.expect(204);
    put_rules(&app, "plant", None).await;
    let body = values("Tank-2.Pressure", 1.0);
    app.send(message(&app, "/omf/plant", "data", &body))
        .await
        .expect(400);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn credentials_come_in_every_way_of_omf() {
    let tokens = [
        ("mes", Scope::Submit, "default"),
        ("screen", Scope::Read, "default"),
    ];
    let (app, [mes, screen]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    put_rules(&app, "omf", Some(&mes)).await;
    let adapter = app.append_token("adapter", "tank-1").await;
    let (types, containers) = (types("bar"), containers());
    for (message_type, body) in [("type", &types), ("container", &containers)] {
        let request = message(&app, "/omf", message_type, body);
        app.send(request.header("producertoken", &adapter))
            .await
            .expect(200);
    }
    let body = values("Tank-1.Pressure", 1.0);
    let data = |container: &str| message(&app, "/omf", "data", &values(container, 1.0));
    for request in [
        data("Tank-1.Pressure").bearer_auth(&adapter),
        data("Tank-1.Pressure").basic_auth("adapter", Some(&adapter)),
        message(&app, "/omf/omf", "data", &body).bearer_auth(&mes),
    ] {
        app.send(request).await.expect(200);
    }
    let refused = app.send(data("Tank-1.Pressure")).await.expect(401);
    assert_eq!(
        refused.header("www-authenticate"),
        "Basic realm=\"greybox\""
    );
    assert_eq!(refused.json()["Messages"][0]["Status"]["Code"], 401);
    for request in [
        data("Tank-2.Pressure").bearer_auth(&adapter),
        data("Tank-1.Pressure").bearer_auth(&screen),
    ] {
        app.send(request).await.expect(403);
    }
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rule_says_how_its_lines_tell_good_values() {
    let app = TestApp::start().await;
    let rules = |quality: Value| {
        json!({"rules": [{"measurement": "rig", "stream": "rig-4", "quality": quality,
                          "signals": {"position": {"signal": "pressure"}}}]})
    };
    let put = |quality: Value| {
        let request = app.request(Method::PUT, "/v1/mappings/plant");
        app.send(request.json(&rules(quality)))
    };
    for (quality, place) in [
        (json!({"codes": "opc"}), "/rules/0/quality/codes"),
        (json!({"fields": []}), "/rules/0/quality/fields"),
        (json!({"fields": [""]}), "/rules/0/quality/fields/0"),
        (json!({"field": "q"}), "/rules/0/quality/field"),
    ] {
        let problem = put(quality).await.problem(422);
        assert_eq!(problem["errors"][0]["pointer"], place, "{problem}");
    }
    let quality = json!({"fields": ["Quality"], "codes": "opc_ua"});
    let shown = put(quality.clone()).await.expect(201).json();
    assert_eq!(shown["rules"][0]["quality"], quality);
    let lines = "rig Quality=\"OK (0x0)\",position=1 1465839830000000000\n\
                 rig Quality=\"BadTimeout (0x800A0000)\",position=2 1465839831000000000\n";
    let written = app.request(Method::POST, "/write?db=plant").body(lines);
    app.send(written).await.expect(204);
    assert_eq!(pressures(&app, "rig-4").await, json!([1.0, null]));
    app.shutdown().await;
}
