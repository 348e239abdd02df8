//! P9: one bad job or one bad client never stops another.

use std::io::Write;
use std::net::TcpStream;

use super::plant;
use super::server::{Options, Server};

#[tokio::test(flavor = "multi_thread")]
async fn p9_jobs_and_clients_that_go_wrong_stop_no_other_job() {
    let folder = tempfile::tempdir().expect("a folder");
    let options = Options::new(2, 0.05);
    let server = Server::start(folder.path(), options);
    let dataset = server.store(&plant::recording(150)).await;
    // A client that says half a request and nothing more.
    let address = server.url.trim_start_matches("http://");
    let mut mute = TcpStream::connect(address).expect("a connection");
    mute.write_all(b"POST /v1/jobs HTTP/1.1\r\nhost: localhost\r\ncontent-length: 100\r\n\r\n{")
        .expect("half a request");
    // A job without any candidate that explains the data: the true mass is far outside.
    let mut hopeless = plant::job(&dataset, 3, 1);
    hopeless["parameters"]["mass"]["estimate"] = serde_json::json!({"lower": 1e-9, "upper": 2e-9});
    let hopeless = server
        .submit(&hopeless, "hopeless")
        .await
        .expect("an answer");
    let sound = plant::job(&dataset, 40, 2);
    let sound = server.submit(&sound, "sound").await.expect("an answer");
    assert_eq!(server.ended(&sound).await["status"], "succeeded");
    let ended = server.ended(&hopeless).await;
    assert!(ended["status"] == "succeeded" || ended["error"]["detail"].is_string());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_log_that_nobody_reads_holds_up_nobody() {
    /// What a pipe holds until it is read is less than the lines of so many requests.
    const REQUESTS: usize = 1000;
    let folder = tempfile::tempdir().expect("a folder");
    let options = Options::new(1, 1.0);
    let server = Server::start_unread(folder.path(), options);
    for _ in 0..REQUESTS {
        server.show("/v1/jobs?limit=1").await;
    }
    let (status, _) = server.terminate();
    assert!(status.success());
}
