//! The connections of the server: each is taken, answered by the routes, and ended in order.
//!
//! They speak HTTP/1.1. A connection that waits holds its buffers and nothing else, so that
//! thousands of streams may be open. A client that does not come to the end of a request's head in
//! time, or takes nothing of its answer for as long, is let go.

use std::io;
use std::net::SocketAddr;
use std::pin::{Pin, pin};
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Router;
use axum::http::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpSocket, TcpStream};
use tokio::task::JoinSet;
use tokio_io_timeout::TimeoutStream;
use tokio_rustls::TlsAcceptor;
use tokio_util::sync::CancellationToken;
use tower::ServiceExt;

use super::addresses::Addresses;
use super::tls::Tls;
use crate::api::client::PeerAddress;

/// How long a client may take for the head of a request, counted from the answer before it.
const HEAD_TIME: Duration = Duration::from_secs(30);
/// How long a client may take nothing of an answer.
const WRITE_TIME: Duration = Duration::from_secs(30);
/// Headers that are read; with more than a few the routes refuse the request and say so.
const MOST_HEADERS: usize = 500;
/// Bytes of a connection's buffer: the head of a request is no longer.
const LARGEST_BUFFER: usize = 128 << 10;
/// How long nobody is taken after that failed, which it does when files are used up.
const BACK_OFF: Duration = Duration::from_secs(1);
/// After so many connections that were closed at once nobody is taken for a moment: who opens them as fast as the
/// system allows would have the time of the server else.
const REFUSED_TOGETHER: u64 = 8;
const PAUSE: Duration = Duration::from_millis(1);
/// Connections that may wait to be taken: all clients come back at once when a server starts again, and one
/// that finds no room tries again only after a second. The system may allow fewer.
const CONNECTIONS_WAITING: u32 = 4096;

/// Answers until `closing` is cancelled, then returns when the last connection has ended.
/// Dropping the future cuts the connections.
///
/// At most `at_once` connections are open; others wait for one of them to end. What an address opens
/// beyond what it may is closed at once.
pub(super) async fn serve(listening: Listening, routes: Router, closing: CancellationToken) {
    let Listening {
        listener,
        tls,
        at_once,
        addresses,
    } = listening;
    // Built once; each connection shares them.
    let routes: Router = routes.with_state(());
    let mut connections = JoinSet::new();
    let mut refused = 0_u64;
    loop {
        tokio::select! {
            () = closing.cancelled() => break,
            taken = take(&listener), if connections.len() < at_once => {
                let Some(place) = addresses.place(taken.1.ip(), Instant::now()) else {
                    metrics::counter!("greybox_connections_refused_total").increment(1);
                    refused += 1;
                    if refused.is_multiple_of(REFUSED_TOGETHER) {
                        tokio::time::sleep(PAUSE).await;
                    }
                    continue;
                };
                let (routes, closing) = (routes.clone(), closing.clone());
                let tls = tls.as_ref().map(|tls| tls.acceptor());
                connections.spawn(async move {
                    let _place = place;
                    match tls {
                        None => answer(taken, routes, TIMES, closing).await,
                        Some(tls) => answer_over_tls(tls, taken, routes, TIMES, closing).await,
                    }
                });
            }
            Some(ended) = connections.join_next() => {
                if let Err(error) = ended {
                    tracing::error!(%error, "a connection ended badly");
                }
            }
        }
    }
    drop(listener);
    while connections.join_next().await.is_some() {}
}

/// Begins to listen at an address.
pub(super) fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let socket = match address {
        SocketAddr::V4(_) => TcpSocket::new_v4()?,
        SocketAddr::V6(_) => TcpSocket::new_v6()?,
    };
    // The next server need not wait until the system has forgotten the connections of the one before.
    #[cfg(unix)]
    socket.set_reuseaddr(true)?;
    socket.bind(address)?;
    socket.listen(CONNECTIONS_WAITING)
}

/// Where connections come in.
pub(super) struct Listening {
    pub(super) listener: TcpListener,
    /// Where the server speaks TLS, and nothing else.
    pub(super) tls: Option<Arc<Tls>>,
    /// Connections that are open at the same time at the most.
    pub(super) at_once: usize,
    /// How many of them one address may have.
    pub(super) addresses: Addresses,
}

/// How long a client is waited for.
#[derive(Clone, Copy)]
struct Times {
    head: Duration,
    write: Duration,
}

const TIMES: Times = Times {
    head: HEAD_TIME,
    write: WRITE_TIME,
};

/// A connection and who is at its other end.
type Taken = (TcpStream, SocketAddr);

/// The next connection.
async fn take(listener: &TcpListener) -> Taken {
    loop {
        match listener.accept().await {
            Ok(taken) => return taken,
            Err(error) => {
                tracing::error!(%error, "no connection could be taken");
                tokio::time::sleep(BACK_OFF).await;
            }
        }
    }
}

/// Answers the requests of a connection until its client leaves, or the answer under way when the
/// server goes down.
async fn answer((stream, peer): Taken, routes: Router, times: Times, closing: CancellationToken) {
    let stream = prepared(stream, times);
    answer_on(stream, peer, routes, times, closing).await;
}

/// Answers the requests of a connection over TLS. The TLS handshake may take as long as the
/// head of a request.
async fn answer_over_tls(
    tls: TlsAcceptor,
    (stream, peer): Taken,
    routes: Router,
    times: Times,
    closing: CancellationToken,
) {
    let agreeing = tokio::time::timeout(times.head, tls.accept(prepared(stream, times)));
    let agreed = tokio::select! {
        agreed = agreeing => agreed,
        () = closing.cancelled() => return,
    };
    match agreed {
        Ok(Ok(stream)) => answer_on(stream, peer, routes, times, closing).await,
        Ok(Err(error)) => tracing::debug!(%error, "a client does not speak TLS"),
        Err(_time_is_up) => tracing::debug!("a client took too long to agree on TLS"),
    }
}

/// A connection that waits neither to fill packets nor for ever to be read.
fn prepared(stream: TcpStream, times: Times) -> Pin<Box<TimeoutStream<TcpStream>>> {
    // An event is sent when it is written; waiting to fill a packet only delays it.
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "a connection delays small packets");
    }
    let mut stream = TimeoutStream::new(stream);
    stream.set_write_timeout(Some(times.write));
    Box::pin(stream)
}

async fn answer_on(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    peer: SocketAddr,
    routes: Router,
    times: Times,
    closing: CancellationToken,
) {
    let routes = routes.map_request(move |mut request: Request<Incoming>| {
        request.extensions_mut().insert(PeerAddress(peer.ip()));
        request
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(times.head)
        .max_headers(MOST_HEADERS)
        .max_buf_size(LARGEST_BUFFER)
        .serve_connection(TokioIo::new(stream), TowerToHyperService::new(routes));
    let mut connection = pin!(connection);
    let ended = tokio::select! {
        ended = connection.as_mut() => ended,
        () = closing.cancelled() => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(error) = ended {
        tracing::debug!(%error, "a connection broke off");
    }
}

#[cfg(test)]
mod tests {
    use axum::body::Body;
    use axum::routing::get;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    use super::*;

    #[tokio::test]
    async fn hundreds_of_clients_may_come_before_the_first_is_taken() {
        let listener = listen("127.0.0.1:0".parse().expect("an address")).expect("a port");
        let address = listener.local_addr().expect("an address");
        // Of more than the system allows none can be promised room.
        let allowed = std::fs::read_to_string("/proc/sys/net/core/somaxconn").ok();
        let allowed = allowed.and_then(|text| text.trim().parse().ok());
        let number = allowed.map_or(400, |allowed: usize| allowed.min(400));
        // A client that finds no room is not answered at all while nobody is taken.
        let connect = || std::net::TcpStream::connect_timeout(&address, Duration::from_secs(10));
        let clients: Result<Vec<_>, _> = (0..number).map(|_| connect()).collect();
        assert_eq!(clients.expect("there is room").len(), number);
    }

    async fn server(at_once: usize) -> (SocketAddr, CancellationToken, JoinSet<()>) {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let routes = Router::new().route("/", get(|| async { "here" }));
        let closing = CancellationToken::new();
        let mut server = JoinSet::new();
        let listening = Listening {
            listener,
            tls: None,
            at_once,
            addresses: Addresses::new(2, &[]),
        };
        server.spawn(serve(listening, routes, closing.clone()));
        (address, closing, server)
    }

    #[tokio::test]
    async fn a_client_that_never_ends_its_request_is_let_go() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let mut client = TcpStream::connect(address).await.expect("a connection");
        let begun = b"GET / HTTP/1.1\r\nhost:";
        client.write_all(begun).await.expect("a write");
        let times = Times {
            head: Duration::from_millis(20),
            ..TIMES
        };
        let closing = CancellationToken::new();
        let taken = take(&listener).await;
        let answered = answer(taken, Router::new(), times, closing);
        let mut received = Vec::new();
        let (_, read) = tokio::join!(answered, client.read_to_end(&mut received));
        read.expect("an end");
        assert!(received.is_empty(), "{received:?}");
    }

    #[tokio::test]
    async fn a_client_that_never_reads_its_answer_is_let_go() {
        // More than any two buffers of a connection hold.
        const ANSWER_BYTES: usize = 64 << 20;
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let mut client = TcpStream::connect(address).await.expect("a connection");
        let request = b"GET / HTTP/1.1\r\nhost: x\r\n\r\n";
        client.write_all(request).await.expect("a write");
        let times = Times {
            write: Duration::from_millis(20),
            ..TIMES
        };
        let large = || async { Body::from(vec![b' '; ANSWER_BYTES]) };
        let routes = Router::new().route("/", get(large));
        let taken = take(&listener).await;
        answer(taken, routes, times, CancellationToken::new()).await;
        let mut received = Vec::new();
        // The connection was cut: what was on its way may end in an error.
        let _ = client.read_to_end(&mut received).await;
        assert!(received.len() < ANSWER_BYTES);
    }

    #[tokio::test]
    async fn a_connection_beyond_the_limit_waits_for_one_that_ends() {
        let (address, _closing, _server) = server(1).await;
        let first = TcpStream::connect(address).await.expect("a connection");
        let mut second = TcpStream::connect(address).await.expect("a place in line");
        let request = b"GET / HTTP/1.1\r\nhost: x\r\nconnection: close\r\n\r\n";
        second.write_all(request).await.expect("a write");
        drop(first);
        let mut received = Vec::new();
        second.read_to_end(&mut received).await.expect("an answer");
        assert!(received.ends_with(b"here"));
    }

    #[tokio::test]
    async fn what_an_address_opens_beyond_its_places_is_closed() {
        let (address, _closing, _server) = server(10).await;
        let _first = TcpStream::connect(address).await.expect("a connection");
        let _second = TcpStream::connect(address).await.expect("a connection");
        let mut third = TcpStream::connect(address).await.expect("a connection");
        let mut received = Vec::new();
        // It was closed with nothing, or cut.
        let _ = third.read_to_end(&mut received).await;
        assert!(received.is_empty());
    }

    #[tokio::test]
    async fn connections_that_wait_end_with_the_server() {
        let (address, closing, mut server) = server(10).await;
        let mut client = TcpStream::connect(address).await.expect("a connection");
        client
            .write_all(b"GET / HTTP/1.1\r\nhost: x\r\n\r\n")
            .await
            .expect("a write");
        let mut beginning = [0; 15];
        client.read_exact(&mut beginning).await.expect("an answer");
        assert_eq!(&beginning, b"HTTP/1.1 200 OK");
        closing.cancel();
        let mut rest = Vec::new();
        client.read_to_end(&mut rest).await.expect("an end");
        assert!(rest.ends_with(b"here"));
        server
            .join_next()
            .await
            .expect("a server")
            .expect("no panic");
        assert!(TcpStream::connect(address).await.is_err());
    }
}
