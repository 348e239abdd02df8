//! P9: clients that are slow on purpose hold nothing that others need.

use serde_json::json;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::app::{TestApp, drive_job, endless_job};

/// A connection over which this was said and nothing more will be.
async fn say(app: &TestApp, words: &str) -> TcpStream {
    let mut stream = TcpStream::connect(app.address()).await.unwrap();
    stream.write_all(words.as_bytes()).await.unwrap();
    stream
}

/// A POST that breaks off in its body.
fn begun(path: &str, content_type: &str, body: &str) -> String {
    format!(
        "POST {path} HTTP/1.1\r\nhost: localhost\r\ncontent-type: {content_type}\r\n\
         content-length: 500000\r\n\r\n{body}"
    )
}

/// Everything that another client may want, as if nobody else were there.
async fn others_are_served(app: &TestApp) {
    let dataset = app.store_drive().await;
    let samples = format!("/v1/datasets/{dataset}/samples");
    app.get(&samples).await.expect(200);
    let job = drive_job(&dataset);
    app.post_json("/v1/jobs?validate_only=true", &job)
        .await
        .expect(200);
    let simulation = json!({"model": "positioning_drive", "dataset": dataset});
    app.post_json("/v1/simulations", &simulation)
        .await
        .expect(200);
    let id = app.submit(&job).await;
    assert_eq!(app.ended(&id).await["status"], "succeeded");
    app.get(&format!("/v1/jobs/{id}/trajectory"))
        .await
        .expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn clients_that_stop_in_the_middle_of_their_uploads_hold_up_nobody() {
    let app = TestApp::start().await;
    let mut slow = Vec::new();
    for _ in 0..20 {
        let upload = begun("/v1/datasets", "text/csv", "time [s],force [N]\n0,");
        slow.push(say(&app, &upload).await);
    }
    others_are_served(&app).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn documents_that_never_come_to_their_end_stop_no_job() {
    let app = TestApp::start().await;
    let mut slow = Vec::new();
    // More than the threads that the runtime has for what blocks, and larger than what is read
    // without one.
    let document = begun("/v1/jobs", "application/json", &" ".repeat(40_000));
    for _ in 0..600 {
        slow.push(say(&app, &document).await);
    }
    others_are_served(&app).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn readers_that_never_read_hold_up_nobody() {
    let app = TestApp::taking_mib(16).await;
    let mut text = String::from("time [s],force [N]\n");
    for k in 0..300_000 {
        text += &format!("{k},{}\n", f64::from(k) / 7.0);
    }
    let stored = app.post_csv("/v1/datasets", text).await.expect(201).json();
    let path = format!("/v1/datasets/{}/samples", stored["id"].as_str().unwrap());
    let request = format!("GET {path} HTTP/1.1\r\nhost: localhost\r\naccept: text/csv\r\n\r\n");
    let mut slow = Vec::new();
    for _ in 0..8 {
        let mut reader = say(&app, &request).await;
        // The answer has begun, and with it whatever it holds.
        let mut beginning = [0; 15];
        reader.read_exact(&mut beginning).await.unwrap();
        assert_eq!(&beginning, b"HTTP/1.1 200 OK");
        slow.push(reader);
    }
    others_are_served(&app).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_shutdown_waits_for_no_client() {
    let app = TestApp::start().await;
    let dataset = app.store_drive().await;
    app.submit(&endless_job(&dataset)).await;
    let upload = begun("/v1/datasets", "text/csv", "time [s],force [N]\n0,");
    let document = begun("/v1/jobs", "application/json", &" ".repeat(40_000));
    let mut slow = Vec::new();
    for words in [&upload, &document, "GET / HTTP/1.1\r\n"] {
        slow.push(say(&app, words).await);
    }
    app.shutdown().await;
    for mut client in slow {
        let mut rest = Vec::new();
        // It is answered or cut, and waited for in no case.
        let _ = client.read_to_end(&mut rest).await;
        assert!(rest.is_empty() || rest.starts_with(b"HTTP/1.1 "));
    }
}
