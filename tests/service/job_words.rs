//! What people call a job: its name, labels and note, changed in any state, found by them and kept.

use greybox_service::access::Scope;
use reqwest::Method;
use serde_json::{Value, json};

use super::app::{Answer, TestApp};
use super::designs;

async fn rename(app: &TestApp, id: &str, change: &Value) -> Answer {
    let request = app.request(Method::PATCH, &format!("/v1/jobs/{id}"));
    app.send(request.json(change)).await
}

async fn submitted(app: &TestApp) -> String {
    let dataset = app.store_drive().await;
    let job = json!({
        "name": "first try", "labels": {"site": "hall 2", "draft": "yes"}, "model": "positioning_drive",
        "experiments": [{"dataset": dataset}], "method": {"generations": 3}, "seed": 1
    });
    app.submit(&job).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_is_called_otherwise_in_any_state_and_stays_what_it_is() {
    let app = TestApp::start().await;
    let id = submitted(&app).await;
    let note = "valve 7 was replaced\nbefore this <recording>";
    let change =
        json!({"labels": {"site": "hall 3", "draft": null, "shift": "night"}, "note": note});
    let renamed = rename(&app, &id, &change).await.expect(200).json();
    let labels = json!({"site": "hall 3", "shift": "night"});
    assert_eq!(
        (&renamed["labels"], &renamed["note"]),
        (&labels, &json!(note))
    );
    assert_eq!(renamed["name"], "first try", "what is left out stays");
    let ended = app.ended(&id).await;
    assert_eq!(ended["status"], "succeeded");
    assert_eq!(ended["labels"], labels, "the end of a job changes no word");
    let path = format!("/v1/jobs/{id}");
    let tag = app.get(&path).await.expect(200).header("etag").to_owned();
    let result = app.get(&format!("{path}/result")).await.expect(200).json();
    let renamed = rename(&app, &id, &json!({"name": "rig 4"})).await;
    let renamed = renamed.expect(200).json();
    for word in ["name", "labels", "note"] {
        assert_eq!(renamed["spec"][word], renamed[word], "{word}");
    }
    let app = app.restarted().await;
    let shown = app.get(&path).await.expect(200);
    assert_ne!(shown.header("etag"), tag);
    assert_eq!(shown.json(), renamed);
    let again = app.get(&format!("{path}/result")).await.expect(200).json();
    assert_eq!(again, result);
    for (query, n) in [
        ("label=shift:night", 1),
        ("label=draft", 0),
        ("text=rig%204", 1),
        ("text=first", 0),
    ] {
        let listed = app
            .get(&format!("/v1/jobs?{query}"))
            .await
            .expect(200)
            .json();
        assert_eq!(listed["items"].as_array().unwrap().len(), n, "{query}");
    }
    let report = app.get(&format!("{path}/report")).await.expect(200).text;
    assert!(report.contains("<h1>rig 4</h1>"));
    assert!(report.contains("before this &lt;recording&gt;"));
    let bare = json!({"name": null, "labels": null, "note": null});
    let renamed = rename(&app, &id, &bare).await.expect(200).json();
    let words = (&renamed["name"], &renamed["labels"], &renamed["note"]);
    assert_eq!(words, (&Value::Null, &json!({}), &Value::Null));
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_change_that_is_wrong_names_its_place_and_changes_nothing() {
    let app = TestApp::start().await;
    let id = submitted(&app).await;
    for (change, place) in [
        (json!({"name": 7}), "/name"),
        (json!({"name": "x".repeat(201)}), "/name"),
        (json!({"labels": {"site": 7}}), "/labels/site"),
        (json!({"labels": {"": "x"}}), "/labels/"),
        (json!({"note": "x".repeat(4001)}), "/note"),
        (json!({"state": "succeeded"}), "/state"),
    ] {
        let problem = rename(&app, &id, &change).await.problem(422);
        assert_eq!(problem["errors"][0]["pointer"], place, "{problem}");
    }
    let labels = (0..17).map(|place| (format!("label{place}"), json!("x")));
    let labels: serde_json::Map<String, Value> = labels.collect();
    let many = rename(&app, &id, &json!({ "labels": labels })).await;
    let many = many.problem(422);
    assert_eq!(many["detail"], "a job has 16 labels at the most");
    let shown = app.get(&format!("/v1/jobs/{id}")).await.expect(200).json();
    assert_eq!(shown["labels"], json!({"site": "hall 2", "draft": "yes"}));
    rename(&app, "job_0192d3a4b5c67d8e9f00112233445566", &json!({}))
        .await
        .problem(404);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn who_may_not_submit_calls_no_job_otherwise() {
    let tokens = [
        ("mes", Scope::Submit, "default"),
        ("screen", Scope::Read, "default"),
        ("neighbour", Scope::Submit, "hall-3"),
    ];
    let (app, [mes, screen, neighbour]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let request = app
        .request(Method::POST, "/v1/designs")
        .json(&designs::document());
    let request = request.header("Prefer", "respond-async");
    let queued = app.send(request.bearer_auth(&mes)).await.expect(202);
    let id = queued.json()["id"].as_str().unwrap().to_owned();
    let path = format!("/v1/jobs/{id}");
    for (secret, status) in [(&screen, 403), (&neighbour, 403)] {
        let request = app
            .request(Method::PATCH, &path)
            .json(&json!({"name": "x"}));
        app.send(request.bearer_auth(secret)).await.problem(status);
    }
    let request = app.request(Method::PATCH, &path);
    let request = request.json(&json!({"note": "a design has a note too", "name": "next week"}));
    let renamed = app.send(request.bearer_auth(&mes)).await.expect(200).json();
    assert_eq!(
        (&renamed["name"], &renamed["note"]),
        (&json!("next week"), &json!("a design has a note too"))
    );
    app.shutdown().await;
}
