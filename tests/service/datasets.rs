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
    let detail = problem["detail"].as_str().unwrap();
    assert!(
        detail.contains("1048576") && detail.contains("Parquet"),
        "{problem}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn every_bad_line_of_a_recording_is_named() {
    let app = TestApp::start().await;
    let csv = "time [s],position [m]\n0,1\n1,1..2\n2,3\n3,x\n";
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

const PI: &str = r#"{"Items": [
  {"Name": "force", "Items": [
    {"Timestamp": "2026-03-02T08:15:02Z", "Value": 3, "UnitsAbbreviation": "kN", "Good": true},
    {"Timestamp": "2026-03-02T08:15:01Z", "Value": 2, "UnitsAbbreviation": "kN", "Good": true},
    {"Timestamp": "2026-03-02T08:15:00Z", "Value": 1, "UnitsAbbreviation": "kN", "Good": true,
     "Questionable": true}]}]}"#;

#[tokio::test(flavor = "multi_thread")]
async fn a_historians_answer_is_taken_as_it_is_and_gives_its_start_and_quality_back() {
    let app = TestApp::start().await;
    let request = app
        .request(Method::POST, "/v1/datasets?interpolation=force:hold")
        .body(PI);
    let request = request.header("content-type", "application/json");
    let stored = app.send(request).await.expect(201);
    let dataset = stored.json();
    assert_eq!(dataset["start"], "2026-03-02T08:15:00Z");
    assert_eq!(dataset["source"]["format"], "pi_web_api");
    assert_eq!(dataset["source"]["options"]["interpolation"], "force:hold");
    let force = &dataset["signals"][0];
    assert_eq!(
        (&force["unit"], &force["max"]),
        (&json!("N"), &json!(3000.0))
    );
    assert_eq!(force["interpolation"], "hold");
    assert_eq!(force["quality"]["uncertain"], 1);
    let warning = &dataset["report"]["warnings"][0];
    assert_eq!(warning["code"], "uncertain_samples");
    assert_eq!(warning["spans"], json!([{"from_s": 0.0, "to_s": 0.0}]));
    assert_eq!(
        app.get(stored.header("location")).await.expect(200).json(),
        dataset
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn other_options_make_another_recording_and_wrong_ones_are_named() {
    let app = TestApp::start().await;
    let csv = "time [s],p\n0,1\n1,-9999\n2,3\n";
    let as_it_is = app.post_csv("/v1/datasets", csv).await.expect(201).json();
    let codes = |dataset: &serde_json::Value| -> Vec<String> {
        let warnings = dataset["report"]["warnings"].as_array().unwrap();
        warnings
            .iter()
            .map(|w| w["code"].as_str().unwrap().to_owned())
            .collect()
    };
    assert!(
        codes(&as_it_is).contains(&"likely_sentinel".to_owned()),
        "{as_it_is}"
    );
    let path = "/v1/datasets?missing=-9999&units=p:bar";
    let left_out = app.post_csv(path, csv).await.expect(201).json();
    assert_eq!(left_out["signals"][0]["missing"], 1);
    assert_eq!(left_out["signals"][0]["min"], 1e5);
    let wrong = "/v1/datasets?tz=Mars&units=p:parsec&grid=fine";
    let problem = app.post_csv(wrong, csv).await.problem(422);
    let errors = problem["errors"].as_array().unwrap();
    let parameters: Vec<_> = errors.iter().map(|error| &error["parameter"]).collect();
    assert_eq!(parameters, ["tz", "units", "grid"]);
    let problem = app
        .post_csv("/v1/datasets?units=q:bar", csv)
        .await
        .problem(422);
    assert_eq!(problem["errors"][0]["parameter"], "units");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_format_that_is_known_and_not_read_is_named() {
    let app = TestApp::start().await;
    let request = app
        .request(Method::POST, "/v1/datasets")
        .body(&b"ARROW1\0\0"[..]);
    let request = request.header("content-type", "application/vnd.apache.arrow.file");
    let problem = app.send(request).await.problem(415);
    assert!(
        problem["detail"].as_str().unwrap().contains("Arrow"),
        "{problem}"
    );
    let request = app
        .request(Method::POST, "/v1/datasets")
        .body(&b"PAR1\x15\x04"[..]);
    let request = request.header("content-type", "application/vnd.apache.parquet");
    let problem = app.send(request).await.problem(400);
    assert_eq!(problem["errors"][0]["code"], "not_parquet");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_window_may_be_given_as_times_of_day_and_samples_left_out() {
    let app = TestApp::start().await;
    let rows: String = drive_csv()
        .lines()
        .skip(1)
        .fold(String::new(), |text, row| {
            let (seconds, rest) = row.split_once(',').unwrap();
            text + &format!("2026-03-02T08:15:0{seconds}Z,{rest}\n")
        });
    let csv = format!("time,force [N],position [m]\n{rows}");
    let dataset = app.post_csv("/v1/datasets", csv).await.expect(201).json();
    let id = dataset["id"].as_str().unwrap();
    let mut job = drive_job(id);
    job["experiments"][0]["window"] = json!({"from": "2026-03-02T09:15:00.5+01:00", "to_s": 3.0});
    job["experiments"][0]["exclude"] = json!({"classes": ["spike"], "spans": [{"from_s": 1, "to_s": 1.5, "signals": ["position"]}]});
    let checked = app
        .post_json("/v1/jobs?validate_only=true", &job)
        .await
        .expect(200)
        .json();
    let text = checked.to_string();
    assert!(text.contains("\"from_s\":0.5"), "{text}");
    assert!(text.contains("excluded_samples"), "{text}");
    job["experiments"][0]["window"] = json!({"from": "2027-01-01T00:00:00Z"});
    let problem = app.post_json("/v1/jobs", &job).await.problem(422);
    assert_eq!(problem["errors"][0]["code"], "outside_recording");
    let undated = app.store_drive().await;
    let mut job = drive_job(&undated);
    job["experiments"][0]["window"] = json!({"from": "2026-03-02T08:15:00Z"});
    let problem = app.post_json("/v1/jobs", &job).await.problem(422);
    assert_eq!(problem["errors"][0]["code"], "no_start");
}
