//! Who may write as an agent: the credentials of InfluxDB, tokens that append alone, and the audit log.

use greybox_service::access::Scope;
use reqwest::Method;
use serde_json::json;

use super::app::TestApp;
use super::sinks::{rules, to_v1, to_v2};

#[tokio::test(flavor = "multi_thread")]
async fn credentials_come_in_every_way_of_influxdb() {
    let tokens = [
        ("mes", Scope::Submit, "default"),
        ("hall", Scope::Submit, "hall-2"),
    ];
    let (app, [mes, hall]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let request = app
        .request(Method::PUT, "/v1/mappings/plant")
        .json(&rules());
    app.send(request.bearer_auth(&mes)).await.expect(201);
    let line = "rig,hall=2 position=1 1465839830000000000\n";
    for request in [
        to_v1(&app, "", line).basic_auth("telegraf", Some(&mes)),
        to_v1(&app, &format!("&u=telegraf&p={mes}"), line),
        to_v1(&app, "", line).header("authorization", format!("Token telegraf:{mes}")),
        to_v1(&app, "", line).bearer_auth(&mes),
        to_v2(&app, "", line).header("authorization", format!("Token {mes}")),
        to_v2(&app, "", line).bearer_auth(&mes),
    ] {
        app.send(request).await.expect(204);
    }
    let guessed = format!("gbx_{}", "0".repeat(64));
    for request in [
        to_v1(&app, "", line),
        to_v1(&app, "", line).basic_auth("telegraf", Some(&guessed)),
        to_v1(&app, &format!("&u=telegraf&p={guessed}"), line),
    ] {
        let refused = app.send(request).await.expect(401);
        assert_eq!(
            refused.header("www-authenticate"),
            "Basic realm=\"greybox\""
        );
        let refused = refused.json();
        assert!(
            refused["error"]
                .as_str()
                .unwrap()
                .starts_with("authorization failed")
        );
    }
    let refused = to_v2(&app, "", line).header("authorization", "Token x");
    let refused = app.send(refused).await.expect(401).json();
    assert_eq!(refused["code"], "unauthorized");
    // A mapping is of one project.
    let of_hall = to_v2(&app, "", line).header("authorization", format!("Token {hall}"));
    app.send(of_hall).await.expect(404);
    // These ways are for these paths alone.
    let listed = app.request(Method::GET, "/v1/streams");
    app.send(listed.basic_auth("x", Some(&mes)))
        .await
        .problem(401);
    let listed = app.request(Method::GET, &format!("/v1/streams?u=x&p={mes}"));
    app.send(listed).await.problem(401);
    app.get("/ping").await.expect(204);
    app.get("/health").await.expect(200);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_that_appends_does_nothing_else() {
    let tokens = [
        ("mes", Scope::Submit, "default"),
        ("screen", Scope::Read, "default"),
    ];
    let (app, [mes, screen]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let agent = app.append_token("agent", "rig-4").await;
    let put = app
        .request(Method::PUT, "/v1/mappings/plant")
        .json(&rules());
    app.send(put.bearer_auth(&mes)).await.expect(201);
    let write = |lines: &str, secret: &str| {
        let token = format!("Token {secret}");
        app.send(to_v2(&app, "", lines).header("authorization", token))
    };
    let four = "rig,hall=2 position=1,speed=1 1465839830000000000\n";
    let five = "rig,hall=3 position=1 1465839830000000000\n";
    write(four, &agent).await.expect(204);
    let refused = write(&format!("{four}{five}"), &agent)
        .await
        .expect(403)
        .json();
    assert_eq!(refused["code"], "forbidden");
    assert!(refused["message"].as_str().unwrap().contains("`rig-5`"));
    write(four, &screen).await.expect(403);
    let csv = "time,position [mm]\n2016-06-13T17:44:00Z,1\n";
    let append = |path: &str, secret: &str| {
        let request = app.request(Method::POST, path).bearer_auth(secret);
        app.send(request.header("content-type", "text/csv").body(csv))
    };
    append("/v1/streams/rig-4", &agent).await.expect(200);
    append("/v1/streams/rig-5", &agent).await.problem(403);
    append("/v1/streams/rig-4", &screen).await.problem(403);
    // What a stream keeps would remove samples.
    append("/v1/streams/rig-4?keep_s=1", &agent)
        .await
        .problem(403);
    for (method, path) in [
        (Method::GET, "/v1/streams"),
        (Method::GET, "/v1/streams/rig-4"),
        (Method::DELETE, "/v1/streams/rig-4"),
        (
            Method::DELETE,
            "/v1/streams/rig-4/samples?from=2016-06-13T00:00:00Z",
        ),
        (Method::POST, "/v1/streams/rig-4/recordings"),
        (Method::GET, "/v1/mappings"),
        (Method::GET, "/v1/mappings/plant"),
        (Method::PUT, "/v1/mappings/plant"),
        (Method::DELETE, "/v1/mappings/plant"),
        (Method::POST, "/v1/datasets"),
        (Method::GET, "/v1/jobs"),
        (Method::GET, "/v1/session"),
        (Method::GET, "/v1/audit"),
        (Method::GET, "/v1/events"),
        (Method::GET, "/metrics"),
    ] {
        let request = app.request(method, path).bearer_auth(&agent);
        app.send(request).await.problem(403);
    }
    app.post_json("/v1/session", &json!({"token": agent}))
        .await
        .problem(403);
    let shown = app
        .request(Method::GET, "/v1/streams/rig-4")
        .bearer_auth(&screen);
    assert_eq!(app.send(shown).await.expect(200).json()["samples"], 2);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_agents_write_is_in_the_audit_log_with_its_mapping() {
    let tokens = [("it", Scope::Admin, "default")];
    let (app, [it]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let put = app
        .request(Method::PUT, "/v1/mappings/plant")
        .json(&rules());
    app.send(put.bearer_auth(&it)).await.expect(201);
    let line = "rig,hall=2 position=1 1465839830000000000\nrig\n";
    let request = to_v1(&app, &format!("&u=telegraf&p={it}"), line);
    app.send(request).await.expect(400);
    let log = app.request(Method::GET, "/v1/audit").bearer_auth(&it);
    let log = app.send(log).await.expect(200);
    let entries = log.json()["items"].as_array().unwrap().clone();
    assert_eq!(entries[0]["path"], "/write?db=plant");
    assert_eq!(
        (&entries[0]["who"], &entries[0]["status"]),
        (&json!("token it"), &json!(400))
    );
    assert_eq!(
        (&entries[1]["method"], &entries[1]["path"]),
        (&json!("PUT"), &json!("/v1/mappings/plant"))
    );
    assert!(!log.text.contains(&it));
    app.shutdown().await;
}
