//! What operators and tools ask of a server.

use reqwest::Method;
use serde_json::json;

use crate::app::{TestApp, endless_job};

#[tokio::test(flavor = "multi_thread")]
async fn a_running_server_is_alive_and_ready_and_says_what_it_is() {
    let app = TestApp::start().await;
    assert_eq!(
        app.get("/livez").await.expect(200).json(),
        json!({"status": "alive"})
    );
    assert_eq!(
        app.get("/readyz").await.expect(200).json(),
        json!({"status": "ready"})
    );
    let version = app.get("/version").await.expect(200).json();
    assert_eq!(version["version"], env!("CARGO_PKG_VERSION"));
    assert!(version["schema"].as_i64() >= Some(1));
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_and_jobs_are_counted() {
    let app = TestApp::start().await;
    app.get("/livez").await.expect(200);
    let metrics = app.get("/metrics").await.expect(200);
    assert!(metrics.header("content-type").starts_with("text/plain"));
    assert!(
        metrics.text.contains("greybox_http_requests_total"),
        "{}",
        metrics.text
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_state_that_no_job_is_in_any_more_is_counted_as_none() {
    let app = TestApp::start().await;
    let id = app.submit(&endless_job(&app.store_drive().await)).await;
    let unfinished = async || -> f64 {
        let metrics = app.get("/metrics").await.expect(200).text;
        let lines = metrics.lines().filter(|line| {
            let of = |status| format!("greybox_jobs{{status=\"{status}\"}} ");
            line.starts_with(&of("queued")) || line.starts_with(&of("running"))
        });
        let counts = lines.map(|line| line.rsplit(' ').next().unwrap());
        counts.map(|count| count.parse::<f64>().unwrap()).sum()
    };
    assert_eq!(unfinished().await, 1.0);
    app.post(&format!("/v1/jobs/{id}/cancel")).await.expect(200);
    app.ended(&id).await;
    assert_eq!(unfinished().await, 0.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn methods_that_clients_invent_make_no_line_each() {
    let app = TestApp::start().await;
    for number in 0..50 {
        let method = Method::from_bytes(format!("INVENTED{number}").as_bytes()).unwrap();
        app.send(app.request(method, "/livez")).await.problem(405);
    }
    let metrics = app.get("/metrics").await.expect(200).text;
    assert!(!metrics.contains("INVENTED"), "{metrics}");
    assert!(metrics.contains("method=\"other\""), "{metrics}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_server_shows_the_committed_description_of_itself() {
    let app = TestApp::start().await;
    let shown = app.get("/openapi.json").await.expect(200).json();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi/openapi.json");
    let committed = std::fs::read_to_string(path).unwrap();
    let committed: serde_json::Value = serde_json::from_str(&committed).unwrap();
    assert!(
        shown == committed,
        "run `greybox openapi > openapi/openapi.json`"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_are_compressed_for_clients_that_take_it_under_another_tag() {
    let app = TestApp::start().await;
    let path = "/v1/models/single_rod_servo";
    let plain = app.get(path).await.expect(200);
    let request = app
        .request(Method::GET, path)
        .header("accept-encoding", "gzip");
    let response = request.send().await.unwrap();
    assert_eq!(response.headers()["content-encoding"], "gzip");
    let tag = response.headers()["etag"].to_str().unwrap().to_owned();
    assert_ne!(tag, plain.header("etag"));
    let bytes = response.bytes().await.unwrap();
    assert!(bytes.len() < plain.text.len() / 2);
    let again = app.request(Method::GET, path).header("if-none-match", tag);
    app.send(again).await.expect(304);
}

#[tokio::test(flavor = "multi_thread")]
async fn people_get_a_dashboard_and_a_reference() {
    let app = TestApp::start().await;
    for path in ["/", "/docs"] {
        let page = app.get(path).await.expect(200);
        assert!(
            page.header("content-type").starts_with("text/html"),
            "{path}"
        );
        assert!(!page.header("x-request-id").is_empty());
    }
    app.get("/assets/none.js").await.problem(404);
}
