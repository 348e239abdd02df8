//! Recordings: stored once, in SI, from CSV or JSON; refused with the place of every fault.

use reqwest::Method;
use serde_json::json;

use crate::app::{TestApp, drive_csv, drive_job, endless_job};

#[tokio::test(flavor = "multi_thread")]
async fn a_csv_recording_is_stored_in_si_with_its_quality_report() {
    let app = TestApp::start().await;
    let csv = "time [ms],reference [m],position [mm]\n0,0.03,0\n10,0.03,1.5\n20,0.03,\n30,0.03,3\n";
    let stored = app
        .post_csv("/v1/datasets?name=rig%204", csv)
        .await
        .expect(201);
    let dataset = stored.json();
    assert_eq!(dataset["name"], "rig 4");
    assert_eq!(dataset["samples"], 4);
    assert_eq!(dataset["sample_time_s"], 0.01);
    assert_eq!(dataset["uniform"], true);
    let position = &dataset["signals"][1];
    assert_eq!(position["name"], "position");
    assert_eq!(position["unit"], "m");
    assert_eq!(position["missing"], 1);
    assert_eq!(position["max"], 0.003);
    assert!(dataset["report"]["warnings"].is_array());
    assert!(dataset["digest"].as_str().unwrap().starts_with("sha256:"));
    let path = stored.header("location").to_owned();
    assert_eq!(
        path,
        format!("/v1/datasets/{}", dataset["id"].as_str().unwrap())
    );
    assert_eq!(app.get(&path).await.expect(200).json(), dataset);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_json_recording_is_stored_under_the_name_that_it_says() {
    let app = TestApp::start().await;
    let recording = json!({
        "name": "rig 4, run 3", "sample_time_s": 0.01, "start": "2026-03-02T08:15:00Z",
        "signals": {"reference": {"unit": "m", "values": [0.03, 0.03]},
                    "position": {"unit": "mm", "values": [0.0, null]}}
    });
    let dataset = app
        .post_json("/v1/datasets", &recording)
        .await
        .expect(201)
        .json();
    assert_eq!(dataset["name"], "rig 4, run 3");
    assert_eq!(dataset["signals"][1]["missing"], 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_bytes_and_options_are_the_same_recording() {
    let app = TestApp::start().await;
    let first = app.post_csv("/v1/datasets", drive_csv()).await.expect(201);
    let again = app.post_csv("/v1/datasets", drive_csv()).await.expect(200);
    assert_eq!(first.json(), again.json());
    let named = app
        .post_csv("/v1/datasets?name=x", drive_csv())
        .await
        .expect(201);
    assert_ne!(named.json()["id"], first.json()["id"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_compressed_recording_is_the_same_as_its_plain_text() {
    let app = TestApp::start().await;
    let plain = app
        .post_csv("/v1/datasets", "time [s],a [m]\n0,1\n1,2\n2,3\n")
        .await;
    let request = app
        .request(Method::POST, "/v1/datasets")
        .body(GZIPPED.to_vec());
    let request = request.header("content-type", "text/csv");
    let compressed = app.send(request.header("content-encoding", "gzip")).await;
    assert_eq!(compressed.expect(200).json(), plain.expect(201).json());
}

/// `time [s],a [m]\n0,1\n1,2\n2,3\n`, compressed by gzip 1.12.
const GZIPPED: &[u8] = &[
    31, 139, 8, 0, 0, 0, 0, 0, 0, 3, 43, 201, 204, 77, 85, 136, 46, 142, 213, 73, 84, 136, 206,
    141, 229, 50, 208, 49, 228, 50, 212, 49, 226, 50, 210, 49, 230, 2, 0, 125, 157, 154, 139, 27,
    0, 0, 0,
];

#[tokio::test(flavor = "multi_thread")]
async fn bytes_that_are_not_gzip_are_the_clients_fault() {
    let app = TestApp::start().await;
    let request = app.request(Method::POST, "/v1/datasets").body("not gzip");
    let request = request.header("content-type", "text/csv");
    app.send(request.header("content-encoding", "gzip"))
        .await
        .problem(400);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_larger_than_the_limit_is_refused_with_the_limit() {
    let app = TestApp::start().await;
    let rows = (0..200_000).map(|k| format!("{k},1\n"));
    let csv: String = std::iter::once("time [s],a\n".to_owned())
        .chain(rows)
        .collect();
    let problem = app.post_csv("/v1/datasets", csv).await.problem(413);
    assert!(
        problem["detail"].as_str().unwrap().contains("1048576"),
        "{problem}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn every_bad_line_of_a_recording_is_named() {
    let app = TestApp::start().await;
    let csv = "time [s],position [m]\n0,1\n1,n/a\n2,3\n3,x\n";
    let problem = app.post_csv("/v1/datasets", csv).await.problem(422);
    let lines: Vec<_> = problem["errors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|e| &e["line"])
        .collect();
    assert_eq!(lines, [&json!(3), &json!(5)]);
    assert_eq!(problem["errors"][0]["column"], "position");
}

#[tokio::test(flavor = "multi_thread")]
async fn text_that_is_not_json_is_told_with_line_and_column() {
    let app = TestApp::start().await;
    let request = app
        .request(Method::POST, "/v1/datasets")
        .body("{\"signals\":\n oops}");
    let answer = app
        .send(request.header("content-type", "application/json"))
        .await;
    let problem = answer.problem(400);
    assert_eq!(problem["errors"][0]["line"], 2);
    assert!(problem["errors"][0]["column"].is_string());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_of_another_type_is_refused() {
    let app = TestApp::start().await;
    let request = app.request(Method::POST, "/v1/datasets").body("<xml/>");
    let problem = app
        .send(request.header("content-type", "text/xml"))
        .await
        .problem(415);
    assert!(problem["detail"].as_str().unwrap().contains("text/csv"));
}

#[tokio::test(flavor = "multi_thread")]
async fn samples_come_decimated_as_json_or_whole_as_csv() {
    let app = TestApp::start().await;
    let id = app.store_drive().await;
    let path = format!("/v1/datasets/{id}/samples");
    let samples = app
        .get(&format!("{path}?signals=position&max_points=20"))
        .await
        .expect(200);
    let samples = samples.json();
    assert!(samples["time_s"].as_array().unwrap().len() <= 20);
    assert_eq!(samples["signals"].as_object().unwrap().len(), 1);
    assert_eq!(samples["signals"]["position"]["unit"], "m");

    let request = app.request(Method::GET, &path).header("accept", "text/csv");
    let csv = app.send(request).await.expect(200);
    assert_eq!(csv.header("content-type"), "text/csv; charset=utf-8");
    assert_eq!(csv.text.lines().count(), 401);
    assert_eq!(
        csv.text.lines().next(),
        Some("time [s],force [N],position [m]")
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_recording_comes_back_as_it_was_sent() {
    let app = TestApp::taking_mib(8).await;
    let samples = 150_000_u32;
    let rows = (0..samples).map(|k| {
        let second = f64::from(k);
        format!("{second:?},{:?},{:?}\n", second.sqrt(), second.sin())
    });
    let sent: String = std::iter::once("time [s],a [m],b [N]\n".to_owned())
        .chain(rows)
        .collect();
    let stored = app.post_csv("/v1/datasets", sent.clone()).await.expect(201);
    let dataset = stored.json();
    assert_eq!(dataset["samples"], samples);
    assert_eq!(dataset["signals"][0]["max"], f64::from(samples - 1).sqrt());
    let path = format!("{}/samples", stored.header("location"));
    let request = app.request(Method::GET, &path).header("accept", "text/csv");
    let back = app.send(request).await.expect(200);
    assert!(back.text == sent, "{} bytes came back", back.text.len());
}

#[tokio::test(flavor = "multi_thread")]
async fn samples_of_a_signal_that_is_not_there_are_refused() {
    let app = TestApp::start().await;
    let id = app.store_drive().await;
    let path = format!("/v1/datasets/{id}/samples?signals=speed&from=2&to=1");
    let problem = app.get(&path).await.problem(422);
    assert_eq!(problem["errors"][0]["parameter"], "from");
    let problem = app
        .get(&format!("/v1/datasets/{id}/samples?signals=speed"))
        .await
        .problem(422);
    assert_eq!(problem["errors"][0]["code"], "unknown_signal");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recording_is_removed_when_no_job_needs_it() {
    let app = TestApp::start().await;
    let id = app.store_drive().await;
    let path = format!("/v1/datasets/{id}");
    let job = app.submit(&endless_job(&id)).await;
    let problem = app.delete(&path).await.problem(409);
    assert!(problem["detail"].as_str().unwrap().contains(&job));
    app.post(&format!("/v1/jobs/{job}/cancel"))
        .await
        .expect(200);
    app.ended(&job).await;
    app.delete(&path).await.expect(204);
    app.get(&path).await.problem(404);
    app.post_json("/v1/jobs", &drive_job(&id))
        .await
        .problem(422);
}
