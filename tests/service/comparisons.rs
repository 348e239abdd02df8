//! Comparisons: a job for each method and seed, and the table that their results make.

use serde_json::{Value, json};

use crate::app::{TestApp, drive_job};

fn comparison(dataset: &str) -> Value {
    let mut job = drive_job(dataset);
    job["labels"] = json!({"site": "hall 2"});
    json!({"job": job, "methods": ["icra_genetic", "multistart_lm"], "seeds": 2})
}

#[tokio::test(flavor = "multi_thread")]
async fn every_method_runs_with_every_seed_and_the_table_counts_who_found_the_minimum() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let answer = app
        .post_json("/v1/comparisons", &comparison(&dataset))
        .await;
    let answer = answer.expect(202);
    let path = answer.header("location").to_owned();
    let begun = answer.json();
    assert_eq!(
        path,
        format!("/v1/comparisons/{}", begun["id"].as_str().unwrap())
    );
    let jobs = begun["jobs"].as_array().unwrap();
    let runs: Vec<(&str, u64)> = jobs
        .iter()
        .map(|job| {
            (
                job["method"].as_str().unwrap(),
                job["seed"].as_u64().unwrap(),
            )
        })
        .collect();
    assert_eq!(
        runs,
        [
            ("icra_genetic", 1),
            ("icra_genetic", 2),
            ("multistart_lm", 1),
            ("multistart_lm", 2)
        ]
    );
    for job in jobs {
        let shown = app.ended(job["id"].as_str().unwrap()).await;
        assert_eq!(shown["status"], "succeeded");
        assert_eq!(shown["labels"]["site"], "hall 2");
    }
    let ended = app.get(&path).await.expect(200).json();
    assert_eq!(ended["finished"], true);
    assert!(ended["lowest_cost"].as_f64().unwrap() > 0.0);
    for method in ended["methods"].as_array().unwrap() {
        assert_eq!(method["runs"], 2, "{method}");
        assert!(method["cost_ratio"]["least"].as_f64().unwrap() >= 1.0);
        assert!(method["evaluations"]["median"].as_f64().unwrap() > 0.0);
    }
    let found = |index: usize| ended["methods"][index]["found"].as_u64().unwrap();
    assert!(found(0) + found(1) >= 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_key_makes_one_comparison_only() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let body = comparison(&dataset);
    let submit = async || {
        let request = app.request(reqwest::Method::POST, "/v1/comparisons");
        let request = request.header("idempotency-key", "a b").json(&body);
        app.send(request).await.expect(202).json()
    };
    let (first, second) = (submit().await, submit().await);
    assert_eq!(first["id"], second["id"]);
    assert_eq!(first, second, "the same answer again");
    let ids = |answer: &Value| -> Vec<String> {
        let jobs = answer["jobs"].as_array().unwrap().iter();
        jobs.map(|job| job["id"].as_str().unwrap().to_owned())
            .collect()
    };
    assert_eq!(ids(&first), ids(&second));
    assert_eq!(ids(&first).len(), 4);
}

#[tokio::test(flavor = "multi_thread")]
async fn faults_name_their_places_and_nothing_is_stored() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let mut body = comparison(&dataset);
    body["methods"] = json!(["icra_genetic", "guessing", "icra_genetic"]);
    body["seeds"] = json!(0);
    let pointers = |problem: &Value| -> Vec<String> {
        let errors = problem["errors"].as_array().unwrap().iter();
        errors
            .map(|error| error["pointer"].as_str().unwrap().to_owned())
            .collect()
    };
    let problem = app.post_json("/v1/comparisons", &body).await.problem(422);
    assert_eq!(pointers(&problem), ["/methods/1", "/methods/2", "/seeds"]);

    // The second method does not go with what the job asks for.
    let mut body = comparison(&dataset);
    body["job"]["method"] = json!({"refine": false});
    let problem = app.post_json("/v1/comparisons", &body).await.problem(422);
    assert_eq!(pointers(&problem), ["/job/method"]);
    let jobs = app.get("/v1/jobs").await.expect(200).json();
    assert_eq!(jobs["items"], json!([]));
    let nobody = "/v1/comparisons/cmp_0192d3a4b5c67d8e9f00112233445566";
    app.get(nobody).await.problem(404);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_key_with_other_methods_is_refused_and_makes_nothing() {
    let app = TestApp::start().await;
    let mut body = comparison(&app.store_drive().await);
    let submit = async |body: &Value| {
        let request = app.request(reqwest::Method::POST, "/v1/comparisons");
        app.send(request.header("idempotency-key", "a").json(body))
            .await
    };
    let first = submit(&body).await.expect(202);
    assert_eq!(first.header("idempotent-replayed"), "");
    let again = submit(&body).await.expect(202);
    assert_eq!(again.header("idempotent-replayed"), "true");
    assert_eq!(again.header("location"), first.header("location"));
    body["methods"] = json!(["cma_es"]);
    let problem = submit(&body).await.problem(422);
    assert_eq!(problem["type"], "/problems/idempotency-key-reused");
    let jobs = app.get("/v1/jobs").await.expect(200).json();
    assert_eq!(jobs["items"].as_array().unwrap().len(), 4);
    // Nor does the key make a job.
    let request = app.request(reqwest::Method::POST, "/v1/jobs");
    let request = request.header("idempotency-key", "a").json(&body["job"]);
    app.send(request).await.problem(422);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_with_the_label_of_a_comparison_is_none_of_its_runs() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    let made = app
        .post_json("/v1/comparisons", &comparison(&dataset))
        .await
        .expect(202)
        .json();
    let mut stranger = drive_job(&dataset);
    stranger["labels"] = json!({"comparison": made["id"]});
    let stranger = app.submit(&stranger).await;
    let path = format!("/v1/comparisons/{}", made["id"].as_str().unwrap());
    let shown = app.get(&path).await.expect(200).json();
    let ids = shown["jobs"].as_array().unwrap().iter();
    let ids: Vec<&str> = ids.map(|job| job["id"].as_str().unwrap()).collect();
    assert_eq!(ids.len(), 4);
    assert!(!ids.contains(&&*stranger));
}

#[tokio::test(flavor = "multi_thread")]
async fn comparisons_are_listed_newest_first() {
    let app = TestApp::start().await;
    let body = comparison(&app.store_drive().await);
    let mut made = Vec::new();
    for _ in 0..3 {
        let one = app.post_json("/v1/comparisons", &body).await.expect(202);
        made.push(one.json()["id"].clone());
    }
    let page = app.get("/v1/comparisons?limit=2").await.expect(200);
    assert!(page.header("link").contains("rel=\"next\""));
    let page = page.json();
    let token = page["next_page_token"].as_str().unwrap();
    let rest = app
        .get(&format!("/v1/comparisons?limit=2&page_token={token}"))
        .await
        .expect(200)
        .json();
    let items = [&page, &rest].map(|page| page["items"].as_array().unwrap().clone());
    let listed: Vec<Value> = items
        .concat()
        .iter()
        .map(|item| item["id"].clone())
        .collect();
    made.reverse();
    assert_eq!(listed, made);
    assert_eq!(page["items"][0]["runs"], 4);
}
