//! What a collector of OpenTelemetry is told: requests in the trace of whoever asked, and slices of jobs.

use std::sync::{Arc, Mutex};

use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::StatusCode;
use axum::routing::post;
use opentelemetry_proto::tonic::collector::trace::v1::ExportTraceServiceRequest;
use opentelemetry_proto::tonic::common::v1::{KeyValue, any_value};
use opentelemetry_proto::tonic::trace::v1::Span;
use prost::Message as _;
use tokio::net::TcpListener;

use crate::plant;
use crate::server::{Options, Server, answer};

type Sent = Arc<Mutex<Vec<ExportTraceServiceRequest>>>;

async fn take(State(sent): State<Sent>, body: Bytes) -> StatusCode {
    let request = ExportTraceServiceRequest::decode(body).expect("a message of OTLP");
    sent.lock().expect("unpoisoned").push(request);
    StatusCode::OK
}

/// What an attribute says, as text.
fn said(attributes: &[KeyValue], key: &str) -> Option<String> {
    let found = attributes.iter().find(|own| own.key == key)?;
    match found.value.as_ref()?.value.as_ref()? {
        any_value::Value::StringValue(text) => Some(text.clone()),
        any_value::Value::IntValue(number) => Some(number.to_string()),
        _ => None,
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_collector_is_told_of_requests_and_slices() {
    const TRACE: &str = "4bf92f3577b34da6a3ce929d0e0e4736";
    const PARENT: &str = "00f067aa0ba902b7";
    let sent = Sent::default();
    let routes = Router::new()
        .route("/v1/traces", post(take))
        .with_state(sent.clone());
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let collector = format!("http://{}/", listener.local_addr().expect("an address"));
    tokio::spawn(async move { axum::serve(listener, routes).await });

    let folder = tempfile::tempdir().expect("a folder");
    let options = Options::new(1, 0.2);
    let server = Server::start_traced(folder.path(), options, &collector);
    let dataset = server.store(&plant::recording(100)).await;
    let job = server.submit(&plant::job(&dataset, 5, 1), "one").await;
    let job = job.expect("a job");
    server.ended(&job).await;
    let traced = server.get("/v1/jobs/job_of_nobody");
    let traced = traced.header("traceparent", format!("00-{TRACE}-{PARENT}-01"));
    let (status, _) = answer(traced).await.expect("an answer");
    assert_eq!(status.as_u16(), 404);
    // What it has not sent by then it sends at its end.
    assert!(server.terminate().0.success());

    let sent = sent.lock().expect("unpoisoned");
    let resources = || sent.iter().flat_map(|request| &request.resource_spans);
    for own in resources() {
        let resource = own.resource.as_ref().expect("a resource");
        assert_eq!(
            said(&resource.attributes, "service.name").as_deref(),
            Some("greybox")
        );
    }
    let scopes = resources().flat_map(|own| &own.scope_spans);
    let spans: Vec<&Span> = scopes.flat_map(|scope| &scope.spans).collect();
    let of = |key: &str, value: &str| -> Vec<&Span> {
        let found = spans
            .iter()
            .filter(|span| said(&span.attributes, key).as_deref() == Some(value));
        found.copied().collect()
    };
    let submits = of("http.route", "/v1/jobs");
    let submit = submits.first().expect("the span of the submit");
    assert_eq!(submit.name, "POST /v1/jobs");
    assert_eq!(
        said(&submit.attributes, "http.response.status_code").as_deref(),
        Some("202")
    );
    assert!(submit.parent_span_id.is_empty());
    assert!(submit.end_time_unix_nano > submit.start_time_unix_nano);
    let slices = of("job", &job);
    assert!(!slices.is_empty());
    assert!(slices.iter().all(|slice| slice.name == "slice"));
    let refused = of("http.response.status_code", "404");
    let [refused] = refused[..] else {
        panic!("{} spans of one refusal", refused.len());
    };
    assert_eq!(hex(&refused.trace_id), TRACE);
    assert_eq!(hex(&refused.parent_span_id), PARENT);
}
