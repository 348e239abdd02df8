//! Recordings that are prepared from others by a recipe, which leaves those as they are.

use serde_json::{Value, json};

use super::app::{TestApp, drive_job};
use super::faults::places;

fn path(dataset: &str) -> String {
    format!("/v1/datasets/{dataset}/prepared")
}

async fn samples(app: &TestApp, dataset: &str, signal: &str) -> Vec<Option<f64>> {
    let path = format!("/v1/datasets/{dataset}/samples?signals={signal}&max_points=100000");
    let samples = app.get(&path).await.expect(200).json();
    let values = samples["signals"][signal]["values"].as_array().unwrap();
    values.iter().map(Value::as_f64).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recipe_makes_another_recording_that_jobs_take_and_keeps_the_first() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let before = samples(&app, &dataset, "position").await;
    let recipe = json!({"name": "as it was meant", "steps": [
        {"step": "calculate", "signal": "twice", "unit": "mm", "equation": "2*position"},
        {"step": "cut", "from_s": 0.5},
    ]});
    let made = app.post_json(&path(&dataset), &recipe).await.expect(201);
    let location = made.header("location").to_owned();
    let made = made.json();
    let id = made["id"].as_str().unwrap();
    assert_eq!(location, format!("/v1/datasets/{id}"));
    assert_eq!(made["name"], "as it was meant");
    assert_eq!(made["source"]["format"], "prepared");
    assert_eq!(made["source"]["options"]["dataset"], dataset);
    let steps: Value =
        serde_json::from_str(made["source"]["options"]["steps"].as_str().unwrap()).unwrap();
    assert_eq!(steps, recipe["steps"]);
    let told = &made["report"]["warnings"];
    assert_eq!(told[0]["code"], "prepared");
    assert_eq!(told[0]["detail"], "step 1: `twice` [mm] = 2*position");
    let (position, twice) = (
        samples(&app, id, "position").await,
        samples(&app, id, "twice").await,
    );
    assert_eq!(position, before[before.len() - position.len()..]);
    assert!(position.len() < before.len());
    let doubled: Vec<Option<f64>> = position
        .iter()
        .map(|value| value.map(|value| 2.0 * value))
        .collect();
    assert_eq!(twice, doubled);
    assert_eq!(samples(&app, &dataset, "position").await, before);
    let again = app
        .post_json(&path(&dataset), &recipe)
        .await
        .expect(200)
        .json();
    assert_eq!(again["id"], made["id"]);
    let mut job = drive_job(id);
    job["method"] = json!({});
    let job = app.submit(&job).await;
    assert_eq!(app.ended(&job).await["status"], "succeeded");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recipe_is_looked_at_before_anything_is_stored() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let recipe = json!({"steps": [
        {"step": "cut", "from_s": 0.5},
        {"step": "calculate", "signal": "twice", "unit": "mm", "equation": "2*position"},
    ]});
    let asked = |query: &str| format!("{}?validate_only=true{query}", path(&dataset));
    let preview = app
        .post_json(&asked("&signals=twice&max_points=100000"), &recipe)
        .await
        .expect(200)
        .json();
    let listed = app.get("/v1/datasets").await.expect(200).json();
    assert_eq!(listed["items"].as_array().unwrap().len(), 1);
    let made = app
        .post_json(&path(&dataset), &recipe)
        .await
        .expect(201)
        .json();
    for member in ["samples", "duration_s", "signals", "report"] {
        assert_eq!(preview[member], made[member], "{member}");
    }
    let shown = preview["thinned"]["signals"].as_object().unwrap();
    assert_eq!(shown.keys().collect::<Vec<_>>(), ["twice"]);
    let values = shown["twice"]["values"].as_array().unwrap().iter();
    let values: Vec<Option<f64>> = values.map(Value::as_f64).collect();
    assert_eq!(
        values,
        samples(&app, made["id"].as_str().unwrap(), "twice").await
    );
    let thinned = app
        .post_json(&asked("&max_points=10"), &recipe)
        .await
        .expect(200)
        .json();
    let times = thinned["thinned"]["time_s"].as_array().unwrap();
    assert!(times.len() <= 10, "{times:?}");
    for (query, parameter) in [
        ("?validate_only=true&signals=speed", "signals"),
        ("?max_points=10", "max_points"),
    ] {
        let refused = app
            .post_json(&format!("{}{query}", path(&dataset)), &recipe)
            .await
            .problem(422);
        assert_eq!(refused["errors"][0]["parameter"], parameter);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn samples_that_a_version_marks_are_missing_before_the_first_step() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mark = json!({"marks": [{"from_s": 0.1, "to_s": 0.2, "signals": ["position"], "reason": "loose"}]});
    app.post_json(&format!("/v1/datasets/{dataset}/versions"), &mark)
        .await
        .expect(201);
    let recipe = |version: Option<u32>| json!({"version": version, "steps": [{"step": "median", "samples": 3, "signals": ["position"]}]});
    let newest = app
        .post_json(&path(&dataset), &recipe(None))
        .await
        .expect(201)
        .json();
    let unmarked = app
        .post_json(&path(&dataset), &recipe(Some(0)))
        .await
        .expect(201)
        .json();
    let missing = |dataset: &Value| {
        let signals = dataset["signals"].as_array().unwrap().iter();
        let mut position = signals.filter(|signal| signal["name"] == "position");
        position.next().unwrap()["missing"].as_u64().unwrap()
    };
    assert!(missing(&newest) > missing(&unmarked), "{newest} {unmarked}");
    assert_eq!(newest["source"]["options"]["version"], "1");
    let unknown = app
        .post_json(&path(&dataset), &recipe(Some(7)))
        .await
        .problem(422);
    assert_eq!(places(&unknown), [("/version", "unknown_version")]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_recipe_that_cannot_be_done_makes_nothing_and_names_the_place() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let recipe = json!({"steps": [
        {"step": "detrend", "trend": "mean"},
        {"step": "calculate", "signal": "p", "unit": "Pa", "equation": "position*force"},
    ]});
    let refused = app.post_json(&path(&dataset), &recipe).await.problem(422);
    assert_eq!(
        places(&refused),
        [("/steps/1/equation", "units_do_not_fit")]
    );
    let listed = app.get("/v1/datasets").await.expect(200).json();
    assert_eq!(listed["items"].as_array().unwrap().len(), 1);
    let nowhere = path("ds_01890a5d-ac96-774b-bcce-b302099a8057");
    app.post_json(&nowhere, &recipe).await.expect(404);
}
