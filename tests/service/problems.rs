//! Whatever is asked, an error is a problem document, and none is the server's fault.

use reqwest::Method;

use crate::app::TestApp;

#[tokio::test(flavor = "multi_thread")]
async fn a_path_or_an_identifier_that_names_nothing_is_404() {
    let app = TestApp::start().await;
    for path in [
        "/v2/jobs",
        "/v1/jobs/",
        "/v1/jobs/job_x",
        "/v1/jobs/ds_00000000000000000000000000000000",
        "/v1/jobs/job_00000000000000000000000000000000",
        "/v1/jobs/job_00000000000000000000000000000000/events",
        "/v1/jobs/job_00000000000000000000000000000000/result",
        "/v1/jobs/job_00000000000000000000000000000000/generations",
        "/v1/jobs/job_00000000000000000000000000000000/candidates",
        "/v1/jobs/%ff",
        "/v1/datasets/%00",
        "/v1/datasets/ds_00000000000000000000000000000000/samples",
        "/v1/models/none",
    ] {
        let problem = app.get(path).await.problem(404);
        assert_eq!(problem["type"], "/problems/not-found", "{path}");
        assert_eq!(problem["instance"], path);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_method_that_a_resource_does_not_know_is_405_with_those_that_it_does() {
    let app = TestApp::start().await;
    for (method, path, allowed) in [
        (Method::PUT, "/v1/jobs", ["POST", "GET"]),
        (Method::DELETE, "/v1/datasets", ["POST", "GET"]),
        (Method::PATCH, "/v1/models", ["POST", "GET"]),
    ] {
        let answer = app.send(app.request(method, path)).await;
        let allow = answer.header("allow").to_owned();
        answer.problem(405);
        assert!(
            allowed.iter().all(|method| allow.contains(method)),
            "{allow}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_query_is_refused_with_all_its_faults() {
    let app = TestApp::start().await;
    let problem = app
        .get("/v1/jobs?status=done&limit=0&page_token=x&pages=2")
        .await
        .problem(422);
    let errors = problem["errors"].as_array().unwrap();
    let mut named: Vec<_> = errors
        .iter()
        .map(|e| e["parameter"].as_str().unwrap())
        .collect();
    named.sort_unstable();
    assert_eq!(named, ["limit", "page_token", "pages", "status"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_that_is_not_json_is_400_and_one_without_a_type_415() {
    let app = TestApp::start().await;
    let post = || app.request(Method::POST, "/v1/jobs");
    let json = |text: &'static str| post().header("content-type", "application/json").body(text);
    for text in [
        "",
        "{",
        "{\"seed\": 1, \"seed\": 2}",
        "{} {}",
        "\u{feff}{}",
        "[1e999]",
    ] {
        let problem = app.send(json(text)).await.problem(400);
        assert!(problem["errors"][0]["line"].is_u64(), "{text}");
    }
    app.send(post().body("{}")).await.problem(415);
    app.send(json("{}").header("content-encoding", "br"))
        .await
        .problem(415);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_document_that_is_too_large_or_too_deep_is_refused() {
    let app = TestApp::start().await;
    let json = |text: String| {
        let request = app.request(Method::POST, "/v1/jobs").body(text);
        request.header("content-type", "application/json")
    };
    app.send(json(format!("\"{}\"", "x".repeat(1 << 20))))
        .await
        .problem(413);
    app.send(json("[".repeat(100_000))).await.problem(400);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_id_is_echoed() {
    let app = TestApp::start().await;
    let request = app
        .request(Method::GET, "/v1/nothing")
        .header("x-request-id", "plant-7");
    let problem = app.send(request).await.problem(404);
    assert_eq!(problem["request_id"], "plant-7");
}
