//! Layouts that are kept under a name, and read the next export of the kind.

use greybox_service::access::Scope;
use reqwest::Method;
use serde_json::{Value, json};

use super::app::{Answer, TestApp};
use super::faults::places;

/// Two exports of one program, a week apart: each row names its signal.
fn export(day: u8) -> String {
    let mut rows = "Messstelle;Zeit;Wert\n".to_owned();
    for second in 0..4 {
        rows += &format!("druck;0{day}.03.2026 08:00:0{second};1,{second}\n");
        rows += &format!("weg;0{day}.03.2026 08:00:0{second};2,{second}\n");
    }
    rows
}

fn options() -> Value {
    json!({
        "tag": "Messstelle", "value": "Wert", "time": "Zeit", "decimal": ",", "tz": "Europe/Berlin",
        "time_unit": "dmy", "units": "druck:bar,weg:mm"
    })
}

const LAYOUT: &str = "/v1/layouts/weekly%20export";

async fn put(app: &TestApp, path: &str, options: &Value) -> Answer {
    let request = app.request(Method::PUT, path);
    app.send(request.json(&json!({ "options": options }))).await
}

fn names(recording: &Value) -> Vec<&str> {
    let signals = recording["signals"].as_array().unwrap().iter();
    signals
        .map(|signal| signal["name"].as_str().unwrap())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn an_export_is_read_with_the_layout_that_it_names() {
    let app = TestApp::start().await;
    let kept = put(&app, LAYOUT, &options()).await.expect(201).json();
    assert_eq!(
        (&kept["name"], &kept["options"]),
        (&json!("weekly export"), &options())
    );
    let stored = app.post_csv("/v1/datasets?layout=weekly%20export", export(2));
    let stored = stored.await.expect(201).json();
    assert_eq!(names(&stored), ["druck", "weg"]);
    assert_eq!(stored["start"], "2026-03-02T07:00:00Z");
    assert_eq!(stored["signals"][0]["unit"], "Pa");
    // The options make the recording, wherever they are from.
    let explicit = "/v1/datasets?tag=Messstelle&value=Wert&time=Zeit&decimal=,&tz=Europe/Berlin\
                    &time_unit=dmy&units=druck:bar,weg:mm";
    let explicit = app.post_csv(explicit, export(2)).await.expect(200).json();
    assert_eq!(explicit["id"], stored["id"]);
    // An option of the query wins.
    let elsewhere = "/v1/datasets?layout=weekly%20export&tz=UTC";
    let elsewhere = app.post_csv(elsewhere, export(3)).await.expect(201).json();
    assert_eq!(elsewhere["start"], "2026-03-03T08:00:00Z");
    let preview = app.post_csv("/v1/layouts?layout=weekly%20export", export(2));
    let preview = preview.await.expect(200).json();
    assert_eq!(preview["format"], "long_csv", "{preview}");

    let append = async |options: &str| {
        app.post_csv(&format!("/v1/streams/line?{options}"), export(2))
            .await
    };
    let appended = append("layout=weekly%20export").await.expect(201).json();
    assert_eq!(appended["added"], 4, "{appended}");
    let mut on_a_grid = options();
    on_a_grid["grid"] = json!("1s");
    put(&app, LAYOUT, &on_a_grid).await.expect(200);
    let problem = append("layout=weekly%20export").await.problem(422);
    assert_eq!(problem["errors"][0]["parameter"], "grid");
    let problem = append("layout=monthly").await.problem(422);
    assert_eq!(problem["errors"][0]["parameter"], "layout");
}

#[tokio::test(flavor = "multi_thread")]
async fn layouts_are_listed_replaced_removed_and_kept_over_a_restart() {
    let app = TestApp::start().await;
    let first = put(&app, LAYOUT, &options()).await.expect(201).json();
    put(&app, "/v1/layouts/a", &json!({"sheet": "Data"}))
        .await
        .expect(201);
    let second = put(&app, LAYOUT, &json!({"tag": "tag"}))
        .await
        .expect(200)
        .json();
    assert_eq!(second["options"], json!({"tag": "tag"}));
    assert_eq!(second["created_at"], first["created_at"]);
    let app = app.restarted().await;
    let listed = app.get("/v1/layouts").await.expect(200).json();
    let items = listed["items"].as_array().unwrap().iter();
    let listed: Vec<&str> = items
        .map(|layout| layout["name"].as_str().unwrap())
        .collect();
    assert_eq!(listed, ["a", "weekly export"]);
    assert_eq!(app.get(LAYOUT).await.expect(200).json(), second);
    app.delete(LAYOUT).await.expect(204);
    app.delete(LAYOUT).await.problem(404);
    app.get(LAYOUT).await.problem(404);
}

#[tokio::test(flavor = "multi_thread")]
async fn options_that_are_wrong_name_their_places() {
    let app = TestApp::start().await;
    let wrong =
        json!({"tz": "Europe/Bonn", "units": "p:furlongs", "header": "1", "tag": 3, "value": ""});
    let problem = put(&app, LAYOUT, &wrong).await.problem(422);
    assert_eq!(
        places(&problem),
        [
            ("/options/header", "unknown_field"),
            ("/options/tag", "wrong_type"),
            ("/options/tz", "invalid_option"),
            ("/options/units", "invalid_option"),
            ("/options/value", "invalid_option"),
        ]
    );
    let nothing = put(&app, LAYOUT, &json!({})).await.problem(422);
    assert_eq!(places(&nothing), [("/options", "missing_field")]);
    app.get(LAYOUT).await.problem(404);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_layout_is_of_one_project_and_takes_the_right_to_submit() {
    let tokens = [
        ("hall", Scope::Submit, "hall"),
        ("reader", Scope::Read, "hall"),
        ("yard", Scope::Submit, "yard"),
    ];
    let (app, [hall, reader, yard]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    let put = async |token: &str| {
        let request = app.request(Method::PUT, LAYOUT).bearer_auth(token);
        app.send(request.json(&json!({ "options": options() })))
            .await
    };
    put(&reader).await.problem(403);
    put(&hall).await.expect(201);
    let show = async |token: &str| {
        app.send(app.request(Method::GET, LAYOUT).bearer_auth(token))
            .await
    };
    show(&reader).await.expect(200);
    show(&yard).await.problem(404);
    let request = app
        .request(Method::POST, "/v1/datasets?layout=weekly%20export")
        .bearer_auth(&yard)
        .header("content-type", "text/csv");
    let problem = app.send(request.body(export(2))).await.problem(422);
    assert_eq!(problem["errors"][0]["parameter"], "layout");
}
