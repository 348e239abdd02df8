//! A wrong job is refused with everything that is wrong with it.

use serde_json::{Value, json};

use crate::app::{TestApp, drive_job};

/// The places and codes of the faults of a problem, sorted.
pub fn places(problem: &Value) -> Vec<(&str, &str)> {
    let errors = problem["errors"].as_array().unwrap();
    let mut places: Vec<_> = errors
        .iter()
        .map(|error| {
            (
                error["pointer"].as_str().unwrap(),
                error["code"].as_str().unwrap(),
            )
        })
        .collect();
    places.sort_unstable();
    places
}

#[tokio::test(flavor = "multi_thread")]
async fn all_faults_of_a_job_are_told_at_once_with_their_places() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut job = drive_job(&dataset);
    job["parameters"]["mass"]["estimate"] = json!({"lower": 120, "upper": 20});
    job["parameters"]["mas"] = json!({"value": 1});
    job["method"]["populaton"] = json!(30);
    job["validation"] = json!({"fraction": 2});
    job["experiments"][0]["window"] = json!({"from_s": 3, "to_s": 100});
    let problem = app.post_json("/v1/jobs", &job).await.problem(422);
    assert_eq!(
        places(&problem),
        [
            ("/experiments/0/window/to_s", "outside_recording"),
            ("/method/populaton", "unknown_field"),
            ("/parameters/mas", "unknown_parameter"),
            ("/parameters/mass/estimate/lower", "bounds_reversed"),
            ("/validation/fraction", "out_of_range"),
        ]
    );
    let text = problem.to_string();
    assert!(text.contains("lower 120 is not below upper 20"));
    assert!(text.contains("did you mean `population`?"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_fault_in_validation_only_mode_is_the_same_fault() {
    let app = TestApp::start().await;
    let job = json!({"model": "positioning_drive", "experiments": [{"dataset": "ds_x"}]});
    let submitted = app.post_json("/v1/jobs", &job).await.problem(422);
    let validated = app
        .post_json("/v1/jobs?validate_only=true", &job)
        .await
        .problem(422);
    assert_eq!(places(&submitted), places(&validated));
    assert_eq!(
        places(&submitted),
        [("/experiments/0/dataset", "unknown_dataset")]
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_document_of_any_kind_gets_an_answer() {
    let app = TestApp::start().await;
    for document in [
        json!(null),
        json!([]),
        json!("job"),
        json!({}),
        json!({"model": 3, "experiments": {}}),
        json!({"model": "positioning_drive", "experiments": [1, null, []]}),
        json!({"model": "x".repeat(100_000), "experiments": []}),
    ] {
        app.post_json("/v1/jobs", &document).await.problem(422);
    }
}
