//! The log of who did what: nobody is kept out of the log, and what stands there is not changed unseen.

use greybox_service::access::Scope;
use greybox_service::store::{DatabasePlace, backup, tokens};
use reqwest::Method;
use serde_json::Value;

use crate::app::{Answer, TestApp};

async fn log(app: &TestApp, admin: &str) -> Vec<Value> {
    let read = app.request(Method::GET, "/v1/audit?limit=500");
    let log = app.send(read.bearer_auth(admin)).await.expect(200).json();
    log["items"].as_array().unwrap().clone()
}

async fn ask(app: &TestApp, secret: &str) -> Answer {
    app.send(app.request(Method::GET, "/v1/jobs").bearer_auth(secret))
        .await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_strangers_guesses_keep_no_refusal_of_a_token_out_of_the_log() {
    let (app, [admin]) =
        TestApp::with_tokens([("it", Scope::Admin, "default")], |_settings| ()).await;
    let revoked = app.token(("lost", Scope::Read, "default"), None).await;
    assert!(tokens::revoke(&app.database(), "lost").await.unwrap());
    for guess in 0..80 {
        ask(&app, &format!("gbx_{guess:064x}")).await.problem(401);
    }
    for _ in 0..5 {
        ask(&app, &revoked).await.problem(401);
    }
    let log = log(&app, &admin).await;
    let of = |who: &str| log.iter().filter(|entry| entry["who"] == who).count();
    assert_eq!(of("token lost"), 5);
    assert_eq!(of("unknown"), 60);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tokens_that_are_made_and_revoked_stand_in_the_log_of_their_project() {
    let tokens = [
        ("it", Scope::Admin, "default"),
        ("hall", Scope::Admin, "hall-2"),
    ];
    let (app, [admin, hall]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    app.token(("mes", Scope::Submit, "hall-2"), None).await;
    assert!(tokens::revoke(&app.database(), "mes").await.unwrap());
    let commands = async |secret: &str| {
        let log = log(&app, secret).await;
        let commands = log.iter().filter(|entry| entry["who"] == "operator");
        let paths: Vec<String> = commands
            .map(|entry| entry["path"].as_str().unwrap().to_owned())
            .collect();
        paths
    };
    let expected = [
        "token revoke mes",
        "token create --name mes --scope submit --project hall-2",
        "token create --name hall --scope admin --project hall-2",
    ];
    assert_eq!(commands(&hall).await, expected);
    let expected = ["token create --name it --scope admin --project default"];
    assert_eq!(commands(&admin).await, expected);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_head_of_the_log_is_told_to_the_operator_and_is_that_of_a_check() {
    let tokens = [
        ("it", Scope::Admin, "default"),
        ("scraper", Scope::Read, "default"),
        ("hall", Scope::Admin, "hall-2"),
    ];
    let (app, [admin, scraper, hall]) = TestApp::with_tokens(tokens, |_settings| ()).await;
    ask(&app, "gbx_1").await.problem(401);
    let metrics = async |secret: &str| {
        let read = app.request(Method::GET, "/metrics").bearer_auth(secret);
        app.send(read).await.expect(200).text
    };
    let checked = match app.database() {
        DatabasePlace::File(path) => backup::check(&path).await.unwrap(),
        DatabasePlace::Postgres(options) => backup::check_postgres(&options).await.unwrap(),
    };
    assert_eq!(checked.findings, Vec::<String>::new());
    let head = checked.audit_head.unwrap();
    let line = format!(
        "greybox_audit_head{{sha256=\"{}\"}} {}\n",
        head.chain, head.entry
    );
    assert!(metrics(&admin).await.contains(&line));
    let read = app.request(Method::GET, "/v1/audit").bearer_auth(&admin);
    let read = read.header("accept", "application/x-ndjson");
    let exported = app.send(read).await.expect(200);
    assert_eq!(exported.header("content-type"), "application/x-ndjson");
    let newest: Value = serde_json::from_str(exported.text.lines().next().unwrap()).unwrap();
    assert_eq!(newest["chain"], head.chain);
    // A project reads nothing of the server and nothing of another project.
    assert!(!metrics(&scraper).await.contains("greybox_audit_head"));
    assert!(metrics(&scraper).await.contains("greybox_jobs{"));
    let of_hall = metrics(&hall).await;
    for line in of_hall.lines().filter(|line| !line.starts_with('#')) {
        assert!(line.contains("project=\"hall-2\""), "{line}");
    }
    app.shutdown().await;
}
