//! Versions of recordings: stretches that people mark as bad, which jobs do without and the recording keeps.

use greybox_service::access::Scope;
use reqwest::Method;
use serde_json::{Value, json};

use super::app::{TestApp, drive_csv, drive_job};
use super::faults::places;

/// A recording of the drive whose position is 5 cm off for a while, which nothing but its marks says.
async fn store_disturbed(app: &TestApp) -> String {
    let rows = drive_csv();
    let rows = rows.lines().enumerate().map(|(line, row)| {
        let (rest, position) = row.rsplit_once(',').unwrap();
        match position.parse::<f64>() {
            Ok(position) if (100..140).contains(&line) => format!("{rest},{}\n", position + 0.05),
            _ => format!("{row}\n"),
        }
    });
    let csv: String = rows.collect();
    let stored = app.post_csv("/v1/datasets", csv).await.expect(201).json();
    assert_eq!(stored["version"], 0);
    stored["id"].as_str().unwrap().to_owned()
}

fn bad_stretch() -> Value {
    json!({"from_s": 0.98, "to_s": 1.4, "signals": ["position"], "reason": "sensor was <loose>"})
}

async fn mark(app: &TestApp, dataset: &str, marks: Value) -> Value {
    let body = json!({ "marks": marks });
    let path = format!("/v1/datasets/{dataset}/versions");
    app.post_json(&path, &body).await.expect(201).json()
}

/// A job on a version of a recording.
fn job_on(dataset: &str, version: Option<&Value>) -> Value {
    let mut job = drive_job(dataset);
    job["method"] = json!({});
    if let Some(version) = version {
        job["experiments"][0]["version"] = version.clone();
    }
    job
}

async fn completed(app: &TestApp, job: &Value) -> Value {
    let checked = app.post_json("/v1/jobs?validate_only=true", job).await;
    checked.expect(200).json()["spec"]["experiments"][0].clone()
}

async fn mass(app: &TestApp, job: &Value) -> f64 {
    let id = app.submit(job).await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    let result = app.get(&format!("/v1/jobs/{id}/result")).await.expect(200);
    let result = result.json();
    let parameters = result["parameters"].as_array().unwrap();
    let named = |parameter: &&Value| parameter["name"] == "mass";
    let mass = parameters.iter().find(named).unwrap();
    mass["estimate"].as_f64().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_does_without_what_the_version_of_its_recording_marks() {
    let app = TestApp::start().await;
    let dataset = store_disturbed(&app).await;
    let as_it_came = mass(&app, &job_on(&dataset, None)).await;
    let version = mark(&app, &dataset, json!([bad_stretch()])).await;
    assert_eq!(version["number"], 1);
    // The drive of the recording has a mass of 100 kg.
    let marked = job_on(&dataset, None);
    assert!((mass(&app, &marked).await - 100.0).abs() < 0.1);
    assert!((as_it_came - 100.0).abs() > 1.0, "{as_it_came} kg");
    let unmarked = mass(&app, &job_on(&dataset, Some(&json!(0)))).await;
    assert_eq!(unmarked.to_bits(), as_it_came.to_bits());

    let id = app.submit(&marked).await;
    app.ended(&id).await;
    let path = format!("/v1/jobs/{id}/report");
    let told = "Left out of experiment 1: 0.98 to 1.4 s of position: sensor was &lt;loose&gt; (version 1 of the recording).";
    let report = app.get(&path).await.expect(200).text;
    assert!(report.contains(told), "the report names the marks");
    let samples = format!("/v1/datasets/{dataset}/samples?max_points=1000");
    let samples = app.get(&samples).await.expect(200).json();
    let values = samples["signals"]["position"]["values"].as_array().unwrap();
    assert!(
        values.iter().all(Value::is_number),
        "the recording keeps what is marked"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_names_its_version_and_keeps_it() {
    let app = TestApp::start().await;
    let dataset = store_disturbed(&app).await;
    let before = completed(&app, &job_on(&dataset, None)).await;
    assert_eq!(before.get("version"), None, "nothing is marked yet");
    let first = mark(&app, &dataset, json!([bad_stretch()])).await;
    let submitted = app.submit(&job_on(&dataset, None)).await;
    let second = json!([bad_stretch(), {"from_s": 2, "to_s": 2, "reason": "a spike"}]);
    let second = mark(&app, &dataset, second).await;
    let path = format!("/v1/jobs/{submitted}");
    let job = app.get(&path).await.expect(200).json();
    let kept = job["spec"]["experiments"][0]["version"].clone();
    assert_eq!(kept, json!({"number": 1, "marks": first["marks"]}));

    let newest = completed(&app, &job_on(&dataset, None)).await;
    assert_eq!(
        newest["version"],
        json!({"number": 2, "marks": second["marks"]})
    );
    for (named, number) in [
        (json!(1), 1),
        (kept.clone(), 1),
        (json!(0), 0),
        (json!(2), 2),
    ] {
        let version = completed(&app, &job_on(&dataset, Some(&named))).await;
        assert_eq!(version["version"]["number"], number, "{named}");
    }
    let other_marks = json!({"number": 1, "marks": second["marks"]});
    for (named, code) in [
        (json!(3), "unknown_version"),
        (other_marks, "version_differs"),
        (json!("newest"), "wrong_type"),
    ] {
        let job = job_on(&dataset, Some(&named));
        let problem = app.post_json("/v1/jobs", &job).await.problem(422);
        let fault = &problem["errors"][0];
        assert_eq!(
            (&fault["pointer"], &fault["code"]),
            (&json!("/experiments/0/version"), &json!(code))
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn versions_are_listed_taken_back_and_kept_over_a_restart() {
    let app = TestApp::start().await;
    let dataset = store_disturbed(&app).await;
    let path = format!("/v1/datasets/{dataset}/versions");
    let none = app
        .post_json(&path, &json!({"marks": []}))
        .await
        .expect(200);
    assert_eq!(
        none.json()["number"],
        0,
        "nothing was marked, and nothing is"
    );
    let first = mark(&app, &dataset, json!([bad_stretch()])).await;
    let same = json!({"marks": [bad_stretch()], "based_on": 0});
    let same = app.post_json(&path, &same).await.expect(200).json();
    assert_eq!(same, first, "a request that is sent again makes nothing");
    let late = json!({"marks": [], "based_on": 0});
    let problem = app.post_json(&path, &late).await.problem(409);
    assert!(problem["detail"].as_str().unwrap().contains("version is 1"));
    let taken_back = json!({"marks": [], "based_on": 1});
    let second = app.post_json(&path, &taken_back).await.expect(201).json();
    assert_eq!(
        (&second["number"], &second["made_by"]),
        (&json!(2), &json!("local"))
    );

    let app = app.restarted().await;
    let list = app.get(&format!("{path}?limit=1")).await.expect(200).json();
    assert_eq!(list["items"], json!([second]));
    let token = list["next_page_token"].as_str().unwrap();
    let list = app
        .get(&format!("{path}?page_token={token}"))
        .await
        .expect(200)
        .json();
    assert_eq!(
        (&list["items"], &list["next_page_token"]),
        (&json!([first]), &Value::Null)
    );
    assert_eq!(
        app.get(&format!("{path}/1")).await.expect(200).json(),
        first
    );
    let unmarked = json!({"number": 0, "marks": [], "created_at": null, "made_by": null});
    assert_eq!(
        app.get(&format!("{path}/0")).await.expect(200).json(),
        unmarked
    );
    for missing in ["3", "-1", "newest"] {
        app.get(&format!("{path}/{missing}")).await.problem(404);
    }
    let shown = app
        .get(&format!("/v1/datasets/{dataset}"))
        .await
        .expect(200);
    assert_eq!(shown.json()["version"], 2);
    let listed = app.get("/v1/datasets").await.expect(200).json();
    assert_eq!(listed["items"][0]["version"], 2);
    app.delete(&format!("/v1/datasets/{dataset}"))
        .await
        .expect(204);
    app.get(&path).await.problem(404);
}

#[tokio::test(flavor = "multi_thread")]
async fn of_two_who_change_one_version_at_once_one_is_told() {
    let app = TestApp::start().await;
    let dataset = store_disturbed(&app).await;
    let path = format!("/v1/datasets/{dataset}/versions");
    let body =
        |from: u32| json!({"marks": [{"from_s": from, "to_s": 3, "reason": "x"}], "based_on": 0});
    let (one, two) = (body(1), body(2));
    let (one, two) = tokio::join!(app.post_json(&path, &one), app.post_json(&path, &two));
    let mut answers = [one.status.as_u16(), two.status.as_u16()];
    answers.sort_unstable();
    assert_eq!(answers, [201, 409]);
}

#[tokio::test(flavor = "multi_thread")]
async fn marks_that_are_wrong_name_their_places() {
    let app = TestApp::start().await;
    let dataset = store_disturbed(&app).await;
    let marks = json!([
        {"from_s": 2, "to_s": 1, "reason": "x"},
        {"from_s": 2, "to_s": 100, "reason": "x"},
        {"from_s": 1, "to_s": 2, "signals": ["positon"], "reason": "x"},
        {"from_s": 1, "to_s": 2},
        {"from_s": 1, "to_s": 2, "reason": " "}
    ]);
    let path = format!("/v1/datasets/{dataset}/versions");
    let problem = app
        .post_json(&path, &json!({ "marks": marks }))
        .await
        .problem(422);
    assert_eq!(
        places(&problem),
        [
            ("/marks/0", "bounds_reversed"),
            ("/marks/1/to_s", "outside_recording"),
            ("/marks/2/signals/0", "unknown_dataset_signal"),
            ("/marks/3", "missing_field"),
            ("/marks/4/reason", "out_of_range"),
        ]
    );
    let list = app.get(&path).await.expect(200).json();
    assert_eq!(list["items"], json!([]), "nothing is stored");
}

#[tokio::test(flavor = "multi_thread")]
async fn marks_take_the_right_to_submit_in_the_project_of_the_recording() {
    let tokens = [
        ("hall", Scope::Submit, "hall"),
        ("reader", Scope::Read, "hall"),
        ("stranger", Scope::Submit, "yard"),
    ];
    let (app, [hall, reader, stranger]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let post = async |token: &str, path: &str, body: &Value| {
        let request = app.request(Method::POST, path).bearer_auth(token);
        app.send(request.json(body)).await
    };
    let request = app.request(Method::POST, "/v1/datasets").bearer_auth(&hall);
    let request = request.header("content-type", "text/csv").body(drive_csv());
    let stored = app.send(request).await.expect(201).json();
    let path = format!("/v1/datasets/{}/versions", stored["id"].as_str().unwrap());
    let marks = json!({"marks": [bad_stretch()]});
    post(&reader, &path, &marks).await.problem(403);
    post(&stranger, &path, &marks).await.problem(403);
    let made = post(&hall, &path, &marks).await.expect(201).json();
    assert_eq!(made["made_by"], "token hall");
    let list = app.request(Method::GET, &format!("{path}/1"));
    app.send(list.bearer_auth(&stranger)).await.problem(403);
}
