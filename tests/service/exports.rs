//! Exports: a text of a stranger stays a text in the program that opens the export.

use greybox_service::access::Scope;
use reqwest::Method;

use crate::app::{TestApp, drive_job};

#[tokio::test(flavor = "multi_thread")]
async fn what_a_stranger_sends_is_no_formula_in_the_log_as_csv() {
    let (app, [admin]) =
        TestApp::with_tokens([("it", Scope::Admin, "default")], |_settings| ()).await;
    let formula = "=HYPERLINK(\"http://elsewhere.example\")";
    let stranger = app.request(Method::GET, "/v1/jobs/;=1+1");
    let refused = app.send(stranger.header("x-request-id", formula)).await;
    assert_eq!(refused.header("x-request-id"), formula);
    refused.problem(401);
    let read = app.request(Method::GET, "/v1/audit").bearer_auth(&admin);
    let log = app
        .send(read.header("accept", "text/csv"))
        .await
        .expect(200);
    let fields: Vec<Vec<&str>> = log
        .text
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    let place = |name: &str| fields[0].iter().position(|field| *field == name).unwrap();
    let (path, id) = (place("path"), place("request_id"));
    assert_eq!(fields[1][path], "/v1/jobs/;'=1+1");
    assert!(fields[1][id].starts_with("\"'=HYPERLINK"), "{}", log.text);
    // As JSON the log has what was sent.
    let log = app.request(Method::GET, "/v1/audit").bearer_auth(&admin);
    let log = app.send(log).await.expect(200).json();
    assert_eq!(log["items"][0]["request_id"], formula);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_column_of_a_recording_is_no_formula_in_its_csv() {
    let app = TestApp::start().await;
    let body = "time [s],=cmd [N],position [m]\n0,1,2\n1,2,3\n2,3,4\n";
    let stored = app.post_csv("/v1/datasets", body).await.expect(201).json();
    assert_eq!(stored["signals"][0]["name"], "=cmd");
    let path = format!("/v1/datasets/{}/samples", stored["id"].as_str().unwrap());
    let csv = app.request(Method::GET, &path).header("accept", "text/csv");
    let csv = app.send(csv).await.expect(200);
    assert_eq!(
        csv.text.lines().next(),
        Some("time [s],'=cmd [N],position [m]")
    );
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_report_opens_no_link_of_a_name_and_no_type_is_guessed() {
    let app = TestApp::start().await;
    let mut job = drive_job(&app.store_drive().await);
    job["name"] = "[x](javascript:alert(1)) ![y](http://elsewhere.example/y.png)".into();
    let id = app.submit(&job).await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    let path = format!("/v1/jobs/{id}/report?format=markdown");
    let report = app.get(&path).await.expect(200);
    let title = r"# \[x\](javascript:alert(1)) !\[y\](http://elsewhere.example/y.png)";
    assert_eq!(report.text.lines().next(), Some(title));
    for path in [&path, "/v1/jobs", "/v1/nothing"] {
        let answer = app.get(path).await;
        assert_eq!(answer.header("x-content-type-options"), "nosniff", "{path}");
        // Over plain HTTP a browser is not told to come by TLS.
        assert_eq!(answer.header("strict-transport-security"), "", "{path}");
    }
    app.shutdown().await;
}

/// A client that goes on sending the body of a refused request is told that nothing more is read.
#[tokio::test(flavor = "multi_thread")]
async fn a_request_that_is_refused_before_its_body_was_read_ends_its_connection() {
    let (app, [admin]) =
        TestApp::with_tokens([("it", Scope::Admin, "default")], |_settings| ()).await;
    let post = || {
        let request = app.request(Method::POST, "/v1/datasets");
        request.header("content-type", "text/csv")
    };
    let refused = app.send(post().body("x".repeat(100_000))).await;
    assert_eq!(refused.header("connection"), "close");
    refused.problem(401);
    // What was read to its end leaves nothing behind, and neither does a request without a body.
    let read = app.send(post().bearer_auth(&admin).body("no header")).await;
    assert_eq!(read.header("connection"), "");
    read.problem(400);
    let empty = app.send(app.request(Method::POST, "/v1/datasets")).await;
    assert_eq!(empty.header("connection"), "");
    empty.problem(401);
    app.shutdown().await;
}
