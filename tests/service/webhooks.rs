//! Events that are delivered: signed, at least once, and nowhere that the operator does not name.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use greybox_service::config::Settings;
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::mpsc;

use crate::app::{TestApp, drive_job};
use crate::monitors::{Plant, append, monitor};

/// What came to a receiver.
struct Came {
    headers: HeaderMap,
    body: Bytes,
}

/// What it answers, from the first attempt on; success after that.
type Answers = Arc<Mutex<Vec<Response>>>;

/// A receiver on this machine: its address, and what comes.
async fn receiver(answers: Vec<Response>) -> (String, mpsc::UnboundedReceiver<Came>) {
    let (sender, came) = mpsc::unbounded_channel();
    let answers: Answers = Arc::new(Mutex::new(answers.into_iter().rev().collect()));
    let take = |State((sender, answers)): State<(mpsc::UnboundedSender<Came>, Answers)>,
                headers: HeaderMap,
                body: Bytes| async move {
        sender.send(Came { headers, body }).unwrap();
        let answer = answers.lock().unwrap().pop();
        answer.unwrap_or_else(|| StatusCode::NO_CONTENT.into_response())
    };
    let routes = Router::new().fallback(take).with_state((sender, answers));
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    tokio::spawn(async move { axum::serve(listener, routes).await });
    (format!("http://{address}/hook?plant=4"), came)
}

pub(super) fn to_this_machine(settings: &mut Settings) {
    settings.webhook_to = vec!["127.0.0.1".to_owned()];
}

async fn webhook(app: &TestApp, url: &str) -> Value {
    let spec = json!({"url": url, "events": ["job.ended"]});
    app.post_json("/v1/webhooks", &spec)
        .await
        .expect(201)
        .json()
}

/// The one delivery of a webhook when it is in a state.
async fn delivery(app: &TestApp, webhook: &Value, is_there: impl Fn(&Value) -> bool) -> Value {
    let path = format!(
        "/v1/webhooks/{}/deliveries",
        webhook["id"].as_str().unwrap()
    );
    loop {
        let listed = app.get(&path).await.expect(200).json();
        let delivery = &listed["items"][0];
        if is_there(delivery) {
            return delivery.clone();
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

fn signed_by(came: &Came, secret: &str) {
    let verifier = standardwebhooks::Webhook::new(secret).unwrap();
    verifier.verify(&came.body, &came.headers).unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn the_end_of_a_job_is_delivered_signed() {
    let app = TestApp::with(to_this_machine).await;
    let (url, mut came) = receiver(Vec::new()).await;
    let webhook = webhook(&app, &url).await;
    let shown = app
        .get(&format!("/v1/webhooks/{}", webhook["id"].as_str().unwrap()))
        .await;
    assert!(shown.expect(200).json().get("secret").is_none());
    let id = app.submit(&drive_job(&app.store_drive().await)).await;
    let first = came.recv().await.unwrap();
    signed_by(&first, webhook["secret"].as_str().unwrap());
    assert_eq!(first.headers[header::CONTENT_TYPE], "application/json");
    let event: Value = serde_json::from_slice(&first.body).unwrap();
    assert_eq!(event["type"], "job.ended");
    assert_eq!(event["data"]["job"], id);
    assert_eq!(event["data"]["status"], "succeeded");
    let told = delivery(&app, &webhook, |delivery| delivery["state"] == "delivered").await;
    assert_eq!(first.headers["webhook-id"], told["id"].as_str().unwrap());
    assert_eq!(
        (&told["attempts"], &told["last_status"]),
        (&json!(1), &json!(204))
    );
    // Seen, and sent once more when asked.
    let path = format!("/v1/deliveries/{}", told["id"].as_str().unwrap());
    app.post(&format!("{path}/resend")).await.expect(202);
    let again = came.recv().await.unwrap();
    assert_eq!(again.headers["webhook-id"], first.headers["webhook-id"]);
    assert_eq!(again.body, first.body);
    app.get(&path).await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_alarm_of_a_monitor_is_delivered() {
    let app = TestApp::with(to_this_machine).await;
    let (url, mut came) = receiver(Vec::new()).await;
    let wanted = json!({"url": url, "events": ["monitor.alarm"]});
    app.post_json("/v1/webhooks", &wanted).await.expect(201);
    let batch = Plant::new().window(0, 2.0, 1.0);
    append(&app, &batch).await.expect(201);
    let mut document = monitor();
    document["alarms"]["data_stopped_after_s"] = json!(0.01);
    let made = app.post_json("/v1/monitors", &document).await.expect(201);
    // The job of the first window ends too, and is not asked for.
    let event: Value = serde_json::from_slice(&came.recv().await.unwrap().body).unwrap();
    assert_eq!(event["type"], "monitor.alarm");
    assert_eq!(event["data"]["monitor"], made.json()["id"]);
    assert_eq!(event["data"]["alarm"]["kind"], "data_stopped");
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_receiver_does_not_take_is_tried_again() {
    let app = TestApp::with(to_this_machine).await;
    let (url, mut came) = receiver(vec![StatusCode::BAD_GATEWAY.into_response()]).await;
    let webhook = webhook(&app, &url).await;
    app.submit(&drive_job(&app.store_drive().await)).await;
    came.recv().await.unwrap();
    let told = delivery(&app, &webhook, |delivery| delivery["attempts"] == 1).await;
    assert_eq!(told["state"], "waiting");
    assert_eq!(told["last_status"], 502);
    assert!(told["next_attempt_at"].is_string());
    // Its own time comes after five seconds.
    came.recv().await.unwrap();
    delivery(&app, &webhook, |delivery| delivery["state"] == "delivered").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_receiver_that_is_gone_is_sent_nothing_more() {
    let app = TestApp::with(to_this_machine).await;
    let (url, mut came) = receiver(vec![StatusCode::GONE.into_response()]).await;
    let webhook = webhook(&app, &url).await;
    app.submit(&drive_job(&app.store_drive().await)).await;
    let told = delivery(&app, &webhook, |delivery| delivery["attempts"] == 1).await;
    assert_eq!(told["state"], "given_up", "{told}");
    assert_eq!(told["last_status"], 410);
    assert!(told["next_attempt_at"].is_null());
    assert!(came.try_recv().is_ok());
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_redirect_is_not_followed_and_is_written_down() {
    let app = TestApp::with(to_this_machine).await;
    let (elsewhere, mut strangers) = receiver(Vec::new()).await;
    let redirect = (StatusCode::FOUND, [(header::LOCATION, elsewhere)]).into_response();
    let (url, _came) = receiver(vec![redirect]).await;
    let webhook = webhook(&app, &url).await;
    app.submit(&drive_job(&app.store_drive().await)).await;
    let told = delivery(&app, &webhook, |delivery| delivery["attempts"] == 1).await;
    assert_eq!(told["last_status"], 302);
    assert!(strangers.try_recv().is_err());
    let log = app.get("/v1/audit").await.expect(200).json();
    let entry = &log["items"][0];
    assert_eq!(
        (&entry["method"], &entry["status"]),
        (&json!("DELIVER"), &json!(302))
    );
    // The path and the query of a receiver may be secrets.
    let receiver = url.strip_suffix("/hook?plant=4").unwrap();
    assert_eq!(entry["address"], receiver);
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_delivered_where_the_operator_does_not_say() {
    let app = TestApp::with(|settings| settings.webhook_to = vec!["*".to_owned()]).await;
    for url in [
        "http://127.0.0.1:9/",
        "http://[::1]/",
        "http://169.254.169.254/latest/meta-data",
        "http://10.0.0.1/",
    ] {
        let problem = app
            .post_json("/v1/webhooks", &json!({"url": url}))
            .await
            .problem(403);
        assert_eq!(problem["type"], "/problems/forbidden", "{url}");
    }
    let none = TestApp::start().await;
    let public = json!({"url": "https://mes.example.com/"});
    none.post_json("/v1/webhooks", &public).await.problem(403);
    app.post_json("/v1/webhooks", &public).await.expect(201);
    let log = app.get("/v1/audit").await.expect(200).json();
    let refused = log["items"].as_array().unwrap().iter();
    assert_eq!(refused.filter(|entry| entry["status"] == 403).count(), 4);
    let wrong = json!({"url": "ftp://mes.example.com/", "events": ["job.began"], "x": 1});
    let problem = app.post_json("/v1/webhooks", &wrong).await.problem(422);
    assert_eq!(problem["errors"].as_array().unwrap().len(), 2, "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_name_that_comes_to_mean_this_machine_is_not_asked() {
    // The name is allowed; what it stands for is not.
    let app = TestApp::with(|settings| settings.webhook_to = vec!["localhost".to_owned()]).await;
    let (url, mut came) = receiver(Vec::new()).await;
    let webhook = webhook(&app, &url.replace("127.0.0.1", "localhost")).await;
    app.submit(&drive_job(&app.store_drive().await)).await;
    let told = delivery(&app, &webhook, |delivery| delivery["attempts"] == 1).await;
    assert!(
        told["last_error"]
            .as_str()
            .unwrap()
            .contains("not a public address")
    );
    assert!(came.try_recv().is_err());
    let log = app.get("/v1/audit").await.expect(200).json();
    assert_eq!(log["items"][0]["method"], "DELIVER");
}
