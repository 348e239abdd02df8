//! Compressed bodies: one that unpacks to very many times its size is no recording but a way to keep
//! the server busy. All but small ones are unpacked on a thread that gives way to others.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use axum::Error;
use axum::body::{Body, Bytes};
use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::middleware::Next;
use axum::response::Response;
use futures_util::StreamExt as _;
use tokio::sync::mpsc;

use super::background::BackgroundTasks;
use super::watched_body::watched;
use greybox::intake::{MOST_RATIO, may_unpack};

/// A compressed body.
#[derive(Clone)]
struct Packed {
    /// Bytes that have come.
    bytes: Arc<AtomicU64>,
    is_small: bool,
}

/// Counts what comes of a compressed body; stands outside of what unpacks it.
pub(super) async fn count(mut request: Request, next: Next) -> Response {
    if request.headers().contains_key(header::CONTENT_ENCODING) {
        let length = content_length(request.headers());
        let packed = Packed {
            bytes: Arc::default(),
            is_small: length.is_some_and(|bytes| bytes <= SMALL_BYTES),
        };
        request.extensions_mut().insert(packed.clone());
        request = request.map(|body| {
            watched(body, move |bytes| {
                packed
                    .bytes
                    .fetch_add(bytes.len() as u64, Ordering::Relaxed);
                Ok(())
            })
        });
    }
    next.run(request).await
}

/// A body of so many compressed bytes at the most is unpacked where its request is answered: that takes less time than
/// handing it to another thread.
const SMALL_BYTES: u64 = 16 << 10;
/// Unpacked pieces of a body that may wait for whoever reads them.
const PIECES_WAITING: usize = 2;

/// Ends a body that unpacks to too much; stands inside of what unpacks it.
pub(super) async fn bound(
    State(background): State<BackgroundTasks>,
    mut request: Request,
    next: Next,
) -> Response {
    if let Some(packed) = request.extensions_mut().remove::<Packed>() {
        let is_small = packed.is_small;
        let mut unpacked = 0;
        let see = move |bytes: &Bytes| {
            unpacked += bytes.len() as u64;
            packed.allows(unpacked)
        };
        request = request.map(|body| watched(body, see));
        if !is_small {
            request = request.map(|body| read_in(&background, body));
        }
    }
    next.run(request).await
}

/// The bytes of a body as they are sent, where the request says so.
fn content_length(headers: &HeaderMap) -> Option<u64> {
    let length = headers.get(header::CONTENT_LENGTH)?;
    length.to_str().ok()?.parse().ok()
}

/// A body whose pieces are made by a task of the background, for as long as somebody reads them.
fn read_in(background: &BackgroundTasks, body: Body) -> Body {
    let (made, pieces) = mpsc::channel(PIECES_WAITING);
    background.spawn(async move {
        let mut body = body.into_data_stream();
        loop {
            let piece = body.next().await;
            let is_last = piece.is_none();
            if made.send(piece).await.is_err() || is_last {
                break;
            }
        }
    });
    let next = |mut pieces: mpsc::Receiver<_>| async {
        // A task that ended without having said so leaves a body that is cut.
        let cut = || Some(Err(Error::new(io::Error::other("its end is missing"))));
        let piece = pieces.recv().await.unwrap_or_else(cut);
        piece.map(|piece| (piece, pieces))
    };
    Body::from_stream(futures_util::stream::unfold(pieces, next))
}

impl Packed {
    /// Refuses so many unpacked bytes where they are too many for what has come.
    fn allows(&self, unpacked: u64) -> Result<(), Error> {
        let packed = self.bytes.load(Ordering::Relaxed);
        if may_unpack(packed, unpacked) {
            return Ok(());
        }
        let why = format!("it unpacks to more than {MOST_RATIO} times its size");
        Err(Error::new(io::Error::other(why)))
    }
}
