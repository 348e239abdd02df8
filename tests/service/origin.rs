//! What a browser is made to ask by a page of another site is refused.

use reqwest::Method;

use crate::app::{TestApp, endless_job};

#[tokio::test(flavor = "multi_thread")]
async fn a_name_that_somebody_pointed_at_the_server_reads_and_submits_nothing() {
    let app = TestApp::start().await;
    for (method, path) in [
        (Method::GET, "/v1/jobs"),
        (Method::GET, "/"),
        (Method::POST, "/v1/jobs"),
    ] {
        let request = app.request(method, path).header("host", "attacker.example");
        let problem = app.send(request).await.problem(421);
        assert_eq!(problem["type"], "/problems/wrong-host");
    }
    let port = app.address().port();
    let by_name = app
        .request(Method::GET, "/v1/jobs")
        .header("host", format!("localhost:{port}"));
    app.send(by_name).await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_form_on_another_site_cancels_no_job() {
    let app = TestApp::start().await;
    let id = app.submit(&endless_job(&app.store_drive().await)).await;
    let cancel = format!("/v1/jobs/{id}/cancel");
    let form = || app.request(Method::POST, &cancel);
    for (header, value) in [
        ("origin", "http://attacker.example"),
        ("origin", "null"),
        ("sec-fetch-site", "cross-site"),
    ] {
        for content_type in ["text/plain", ""] {
            let request = form().header(header, value);
            let request = match content_type {
                "" => request,
                given => request.header("content-type", given),
            };
            let problem = app.send(request).await.problem(403);
            assert_eq!(problem["type"], "/problems/wrong-origin");
        }
    }
    let status = app.get(&format!("/v1/jobs/{id}")).await.expect(200).json()["status"].clone();
    assert!(status == "running" || status == "queued", "{status}");
    let own = format!("http://{}", app.address());
    app.send(form().header("origin", own)).await.expect(200);
    app.ended(&id).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_path_that_is_too_long_is_a_problem() {
    let app = TestApp::start().await;
    let path = format!("/v1/jobs?label={}", "x".repeat(10_000));
    let problem = app.get(&path).await.problem(414);
    assert_eq!(problem["type"], "/problems/path-too-long");
}
