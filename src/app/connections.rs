//! The connections of the server: each is taken, answered by the routes, and ended in order.
//!
//! They speak HTTP/1.1. A connection that waits holds its buffers and nothing else, so that
//! thousands of streams may be open; a client that does not come to the end of a request's head in
//! time is let go.

use std::pin::pin;
use std::time::Duration;

use axum::Router;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// How long a client may take for the head of a request, counted from the answer before it.
const HEAD_TIME: Duration = Duration::from_secs(60);
/// How long nobody is taken after that failed, which it does when files are used up.
const BACK_OFF: Duration = Duration::from_secs(1);

/// Answers until `closing` is cancelled, then returns when the last connection has ended.
/// Dropping the future cuts the connections.
pub(super) async fn serve(listener: TcpListener, routes: Router, closing: CancellationToken) {
    // Built once; each connection shares them.
    let routes: Router = routes.with_state(());
    let mut connections = JoinSet::new();
    loop {
        tokio::select! {
            () = closing.cancelled() => break,
            taken = take(&listener) => {
                let connection = answer(taken, routes.clone(), HEAD_TIME, closing.clone());
                connections.spawn(connection);
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

/// The next connection.
async fn take(listener: &TcpListener) -> TcpStream {
    loop {
        match listener.accept().await {
            Ok((stream, _)) => return stream,
            Err(error) => {
                tracing::error!(%error, "no connection could be taken");
                tokio::time::sleep(BACK_OFF).await;
            }
        }
    }
}

/// Answers the requests of a connection until its client leaves, or the answer under way when the
/// server goes down.
async fn answer(
    stream: TcpStream,
    routes: Router,
    head_time: Duration,
    closing: CancellationToken,
) {
    // An event is sent when it is written; waiting to fill a packet only delays it.
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "a connection delays small packets");
    }
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(head_time)
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
    use axum::routing::get;
    use tokio::io::{AsyncReadExt, AsyncWriteExt};

    use super::*;

    async fn server() -> (std::net::SocketAddr, CancellationToken, JoinSet<()>) {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let routes = Router::new().route("/", get(|| async { "here" }));
        let closing = CancellationToken::new();
        let mut server = JoinSet::new();
        server.spawn(serve(listener, routes, closing.clone()));
        (address, closing, server)
    }

    #[tokio::test]
    async fn a_client_that_never_ends_its_request_is_let_go() {
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let mut client = TcpStream::connect(address).await.expect("a connection");
        let begun = b"GET / HTTP/1.1\r\nhost:";
        client.write_all(begun).await.expect("a write");
        let head_time = Duration::from_millis(20);
        let closing = CancellationToken::new();
        let taken = take(&listener).await;
        let answered = answer(taken, Router::new(), head_time, closing);
        let mut received = Vec::new();
        let (_, read) = tokio::join!(answered, client.read_to_end(&mut received));
        read.expect("an end");
        assert!(received.is_empty(), "{received:?}");
    }

    #[tokio::test]
    async fn connections_that_wait_end_with_the_server() {
        let (address, closing, mut server) = server().await;
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
