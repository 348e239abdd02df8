//! Lists come newest first, page by page, and filtered.

use serde_json::{Value, json};

use crate::app::{TestApp, drive_csv, drive_job, endless_job};

fn ids(page: &Value) -> Vec<String> {
    let items = page["items"].as_array().unwrap();
    items
        .iter()
        .map(|item| item["id"].as_str().unwrap().to_owned())
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn pages_follow_each_other_newest_first_without_loss() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut submitted = Vec::new();
    for _ in 0..5 {
        submitted.push(app.submit(&drive_job(&dataset)).await);
    }
    submitted.reverse();
    let mut path = "/v1/jobs?limit=2".to_owned();
    let mut listed = Vec::new();
    for pages_left in (0..3).rev() {
        let answer = app.get(&path).await.expect(200);
        let page = answer.json();
        listed.extend(ids(&page));
        let link = answer.header("link").to_owned();
        if pages_left == 0 {
            assert_eq!(link, "");
            assert!(page["next_page_token"].is_null());
            break;
        }
        let (url, relation) = link.split_once(">; ").expect("a link");
        assert_eq!(relation, "rel=\"next\"");
        path = url.trim_start_matches('<').to_owned();
        assert!(path.contains(page["next_page_token"].as_str().unwrap()));
    }
    assert_eq!(listed, submitted);
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_are_found_by_label_and_by_status() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut job = drive_job(&dataset);
    job["labels"] = json!({"site": "hall 2"});
    let labelled = app.submit(&job).await;
    let other = app.submit(&drive_job(&dataset)).await;
    app.ended(&labelled).await;
    app.ended(&other).await;
    let found = async |query: &str| ids(&app.get(&format!("/v1/jobs?{query}")).await.json());
    assert_eq!(found("label=site").await, [labelled.as_str()]);
    assert_eq!(found("label=site:hall%202").await, [labelled.as_str()]);
    assert!(found("label=site:hall%203").await.is_empty());
    assert_eq!(found("status=succeeded").await, [other, labelled]);
    assert!(found("status=paused").await.is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn recordings_are_listed_newest_first() {
    let app = TestApp::start().await;
    let mut stored = Vec::new();
    for name in ["a", "b", "c"] {
        let answer = app
            .post_csv(&format!("/v1/datasets?name={name}"), drive_csv())
            .await;
        stored.push(answer.expect(201).json()["id"].as_str().unwrap().to_owned());
    }
    stored.reverse();
    let first = app.get("/v1/datasets?limit=2").await.expect(200).json();
    assert_eq!(ids(&first), stored[..2]);
    let token = first["next_page_token"].as_str().unwrap();
    let rest = app
        .get(&format!("/v1/datasets?limit=2&page_token={token}"))
        .await
        .json();
    assert_eq!(ids(&rest), stored[2..]);
}

#[tokio::test(flavor = "multi_thread")]
async fn models_are_listed_and_shown_with_their_parameters() {
    let app = TestApp::start().await;
    let models = app.get("/v1/models").await.expect(200).json();
    let names: Vec<_> = models["items"]
        .as_array()
        .unwrap()
        .iter()
        .map(|m| &m["name"])
        .collect();
    assert!(names.contains(&&json!("single_rod_servo")));
    let drive = app
        .get("/v1/models/positioning_drive")
        .await
        .expect(200)
        .json();
    let mass = &drive["parameters"][0];
    for field in [
        "name", "symbol", "unit", "meaning", "default", "lower", "upper",
    ] {
        assert!(!mass[field].is_null(), "{field}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_list_in_short_tells_jobs_apart_and_is_narrowed_by_what_it_shows() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let named = app
        .post_csv(
            "/v1/datasets?name=Rig_4%20100%25",
            format!("{}\n", drive_csv()),
        )
        .await;
    let other = named.expect(201).json()["id"].as_str().unwrap().to_owned();
    let first = app.submit(&drive_job(&dataset)).await;
    let mut job = drive_job(&other);
    job["name"] = json!("Commissioning");
    job["labels"] = json!({"site": "hall 2"});
    job["note"] = json!("The bearing was changed.");
    job["method"]["name"] = json!("multistart_lm");
    let second = app.submit(&job).await;
    app.ended(&first).await;
    app.ended(&second).await;
    let list = async |query: &str| {
        let path = format!("/v1/jobs?view=summary&{query}");
        app.get(&path).await.expect(200).json()
    };
    let all = list("").await;
    assert_eq!(ids(&all), [second.as_str(), first.as_str()]);
    let shown = &all["items"][0];
    assert!(shown["spec"].is_null());
    assert_eq!(shown["method"], "multistart_lm");
    assert_eq!(
        shown["datasets"],
        json!([{"id": other, "name": "Rig_4 100%"}])
    );
    let result = app.get(&format!("/v1/jobs/{second}/result")).await.json();
    assert_eq!(shown["trust"], result["verdict"]["trust"]);
    let trust = shown["trust"].as_str().unwrap();
    for query in [
        "method=multistart_lm".to_owned(),
        format!("dataset={other}"),
        "text=commis".to_owned(),
        "text=HALL".to_owned(),
        "text=BEARING".to_owned(),
        "text=rig_4%20100%25".to_owned(),
        format!("text={second}"),
    ] {
        assert_eq!(ids(&list(&query).await), [second.as_str()], "{query}");
    }
    assert!(ids(&list(&format!("trust={trust}")).await).contains(&second));
    // What a pattern of the database would take for any letter is a letter.
    assert!(ids(&list("text=rig%254").await).is_empty());
    assert_eq!(
        ids(&list("model=positioning_drive&limit=1").await),
        [second]
    );
    let problem = app.get("/v1/jobs?trust=good&view=short&text=a").await;
    let problem = problem.problem(422);
    assert_eq!(problem["errors"].as_array().unwrap().len(), 2, "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_list_in_short_has_the_estimates_that_it_is_asked_for() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let id = app.submit(&drive_job(&dataset)).await;
    let endless = app.submit(&endless_job(&dataset)).await;
    app.ended(&id).await;
    let list = app
        .get("/v1/jobs?view=summary&estimates=mass,nothing")
        .await
        .expect(200)
        .json();
    assert_eq!(ids(&list), [endless.as_str(), id.as_str()]);
    assert_eq!(list["items"][0]["estimates"], json!({}));
    let result = app.get(&format!("/v1/jobs/{id}/result")).await.json();
    let mut parameters = result["parameters"].as_array().unwrap().iter();
    let mass = parameters
        .find(|parameter| parameter["name"] == "mass")
        .unwrap();
    let expected = json!({"mass": {
        "value": mass["estimate"], "unit": "kg", "total_error": mass["total_standard_error"], "trust": mass["trust"]
    }});
    assert_eq!(list["items"][1]["estimates"], expected);
    let without = app.get("/v1/jobs?view=summary").await.expect(200).json();
    assert!(without["items"][1].get("estimates").is_none());
    app.get("/v1/jobs?estimates=mass").await.problem(422);
}
