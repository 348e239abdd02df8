//! What a verdict says, what its rules mean, and what it asks to be done next.

use serde_json::{Value, json};

use crate::app::{TestApp, drive_job};

/// The document with a JSON merge patch (RFC 7396).
fn patched(document: &Value, patch: &Value) -> Value {
    let Value::Object(members) = patch else {
        return patch.clone();
    };
    let mut result = document.as_object().cloned().unwrap_or_default();
    for (name, part) in members {
        let former = result.remove(name).unwrap_or_default();
        if !part.is_null() {
            result.insert(name.clone(), patched(&former, part));
        }
    }
    Value::Object(result)
}

#[tokio::test(flavor = "multi_thread")]
async fn every_reason_is_explained_and_its_next_steps_can_be_submitted() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut job = drive_job(&dataset);
    job["parameters"]["mass"] = json!({"estimate": {"lower": 10, "upper": 60}});
    let id = app.submit(&job).await;
    let spec = app.ended(&id).await["spec"].clone();
    let path = format!("/v1/jobs/{id}/result");
    let result = app.get(&path).await.expect(200).json();
    let rules = app.get("/v1/verdict-rules").await.expect(200).json();
    let reasons = result["verdict"]["reasons"].as_array().unwrap();
    let mut labels = Vec::new();
    for reason in reasons {
        let mut rules = rules["items"].as_array().unwrap().iter();
        let rule = rules.find(|rule| rule["code"] == reason["code"]);
        assert!(rule.unwrap()["title"].is_string(), "{reason}");
        for step in reason["next"].as_array().unwrap() {
            let job = patched(&spec, &step["patch"]);
            app.post_json("/v1/jobs?validate_only=true", &job)
                .await
                .expect(200);
            labels.push(step["label"].as_str().unwrap());
        }
    }
    assert!(labels.contains(&"Widen the range of mass"), "{labels:?}");
    let report = app
        .get(&format!("/v1/jobs/{id}/report?format=markdown"))
        .await;
    let report = report.expect(200).text;
    assert!(report.contains("  - Widen the range of mass."), "{report}");
}
