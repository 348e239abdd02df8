//! Jobs that are asked to stop while their result is computed.

use serde_json::json;

use super::descent::unbroken;
use super::{LONG, Server, names};
use crate::job::Status;
use greybox::estimation::StopReason;
use greybox::identification::JobId;

/// A job whose run has finished, and whose result is held back until the gate is opened.
async fn with_its_result_at_hand(server: &Server) -> JobId {
    let held = json!({"generations": 20, "refinements": 3, "hold_result": true});
    let id = server.submit(held, json!({})).await;
    server.gate.wait_for_arrival();
    id
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_is_cancelled_while_its_result_is_computed_is_cancelled_with_that_result() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let id = with_its_result_at_hand(&server).await;
    server.store.jobs().cancel(id).await.expect("a wish");
    server.gate.open();
    let events = server.wait_for_end(id).await;
    assert_eq!(
        names(&events)[events.len() - 3..],
        ["result", "state", "end"]
    );
    assert_eq!(server.job(id).await.status, Status::Cancelled);
    assert_eq!(server.result(id).await.stop_reason, StopReason::Cancelled);
    assert_eq!(server.estimate(id).await, unbroken(20, 3));
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_that_is_paused_while_its_result_is_computed_comes_to_it_when_it_is_resumed() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    let id = with_its_result_at_hand(&server).await;
    server.store.jobs().pause(id).await.expect("a wish");
    server.gate.open();
    server.wait_for_status(id, Status::Paused).await;
    assert_eq!(server.result(id).await.stop_reason, StopReason::Paused);
    assert_eq!(server.estimate(id).await, unbroken(20, 3));
    server.store.jobs().resume(id).await.expect("a wish");
    let events = server.wait_for_end(id).await;
    let results = names(&events)
        .iter()
        .filter(|name| **name == "result")
        .count();
    assert_eq!(results, 1);
    assert_eq!(server.job(id).await.status, Status::Succeeded);
    assert_eq!(
        server.result(id).await.stop_reason,
        StopReason::GenerationLimit
    );
    assert_eq!(server.estimate(id).await, unbroken(20, 3));
    server.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_whose_pause_is_taken_back_while_it_stops_goes_on_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), 1, LONG).await;
    // The first arrival is that of the run, the second that of what is said of the best so far.
    let held = json!({"generations": 20, "refinements": 3, "wait_once_at": 7, "hold_best": true});
    let id = server.submit(held, json!({})).await;
    server.gate.wait_for_arrival();
    server.store.jobs().pause(id).await.expect("a wish");
    server.gate.wait_for_arrivals(2);
    server.store.jobs().resume(id).await.expect("a wish");
    server.gate.open();
    let events = server.wait_for_end(id).await;
    let paused = events.iter().filter(|event| event.data.contains("paused"));
    assert_eq!(paused.count(), 0);
    assert_eq!(server.estimate(id).await, unbroken(20, 3));
    server.shutdown().await;
}
