//! What a collector of OpenTelemetry is told: requests in the trace of whoever asked, and slices of jobs.

use std::fs;
use std::path::Path;
use std::sync::{Arc, Mutex};

use axum::Router;
use axum::body::Bytes;
use axum::extract::State;
use axum::http::StatusCode;
use axum::routing::post;
use axum::serve::Listener;
use opentelemetry_proto::tonic::collector::trace::v1::ExportTraceServiceRequest;
use opentelemetry_proto::tonic::common::v1::{KeyValue, any_value};
use opentelemetry_proto::tonic::trace::v1::Span;
use prost::Message as _;
use rcgen::CertifiedKey;
use rustls::ServerConfig;
use rustls::pki_types::PrivateKeyDer;
use tokio::net::{TcpListener, TcpStream};
use tokio_rustls::TlsAcceptor;
use tokio_rustls::server::TlsStream;

use crate::plant;
use crate::server::{Options, Server, answer};

type Sent = Arc<Mutex<Vec<ExportTraceServiceRequest>>>;

async fn take(State(sent): State<Sent>, body: Bytes) -> StatusCode {
    let request = ExportTraceServiceRequest::decode(body).expect("a message of OTLP");
    sent.lock().expect("unpoisoned").push(request);
    StatusCode::OK
}

/// A collector that keeps what it is sent.
fn collector(sent: &Sent) -> Router {
    Router::new()
        .route("/v1/traces", post(take))
        .with_state(sent.clone())
}

/// Connections over TLS; those that break off before they are made are none.
struct TlsListener {
    listener: TcpListener,
    acceptor: TlsAcceptor,
}

impl Listener for TlsListener {
    type Io = TlsStream<TcpStream>;
    type Addr = std::net::SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        loop {
            let (stream, address) = self.listener.accept().await.expect("a connection");
            if let Ok(stream) = self.acceptor.accept(stream).await {
                return (stream, address);
            }
        }
    }

    fn local_addr(&self) -> std::io::Result<Self::Addr> {
        self.listener.local_addr()
    }
}

/// Serves a collector over TLS under a certificate; gives its address.
async fn serve_over_tls(sent: &Sent, certificate: CertifiedKey<rcgen::KeyPair>) -> String {
    let key = PrivateKeyDer::Pkcs8(certificate.signing_key.serialize_der().into());
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .expect("versions")
        .with_no_client_auth()
        .with_single_cert(vec![certificate.cert.der().clone()], key)
        .expect("a certificate");
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let port = listener.local_addr().expect("an address").port();
    let acceptor = TlsAcceptor::from(Arc::new(config));
    let listener = TlsListener { listener, acceptor };
    let routes = collector(sent);
    tokio::spawn(async move { axum::serve(listener, routes).await });
    format!("https://localhost:{port}")
}

/// Has a server work a job and end, with a collector and the authorities of a file.
async fn work_a_job(collector: &str, authorities: &Path) {
    let folder = tempfile::tempdir().expect("a folder");
    let options = Options::new(1, 0.2);
    let server = Server::start_traced(folder.path(), options, collector, Some(authorities));
    let dataset = server.store(&plant::recording(100)).await;
    let job = server.submit(&plant::job(&dataset, 5, 1), "one").await;
    server.ended(&job.expect("a job")).await;
    assert!(server.terminate().0.success());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_collector_over_tls_is_told_where_an_authority_vouches_for_it() {
    let names = || vec!["localhost".to_owned()];
    let certificate = rcgen::generate_simple_self_signed(names()).expect("a certificate");
    let stranger = rcgen::generate_simple_self_signed(names()).expect("a certificate");
    let folder = tempfile::tempdir().expect("a folder");
    let (authorities, strangers) = (
        folder.path().join("ca.pem"),
        folder.path().join("stranger.pem"),
    );
    fs::write(&authorities, certificate.cert.pem()).expect("a file");
    fs::write(&strangers, stranger.cert.pem()).expect("a file");
    let sent = Sent::default();
    let address = serve_over_tls(&sent, certificate).await;
    work_a_job(&address, &strangers).await;
    assert!(sent.lock().expect("unpoisoned").is_empty());
    work_a_job(&address, &authorities).await;
    assert!(!sent.lock().expect("unpoisoned").is_empty());
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
    let routes = collector(&sent);
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
    let address = format!("http://{}/", listener.local_addr().expect("an address"));
    tokio::spawn(async move { axum::serve(listener, routes).await });

    let folder = tempfile::tempdir().expect("a folder");
    let options = Options::new(1, 0.2);
    let server = Server::start_traced(folder.path(), options, &address, None);
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
