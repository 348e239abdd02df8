//! Compressed bodies: one that unpacks to very many times its size is no recording but a way to keep
//! the server busy.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::{Context, Poll, ready};

use axum::body::{Body, Bytes, HttpBody};
use axum::extract::Request;
use axum::http::header;
use axum::middleware::Next;
use axum::response::Response;

/// Bytes that each byte of a compressed body may unpack to, on the whole.
const MOST_RATIO: u64 = 250;
/// Bytes that any body may unpack to: short ones have large ratios.
const ALWAYS: u64 = 1 << 20;

/// Bytes of a compressed body that have come.
#[derive(Clone, Default)]
struct Packed(Arc<AtomicU64>);

/// Counts what comes of a compressed body; stands outside of what unpacks it.
pub(super) async fn count(mut request: Request, next: Next) -> Response {
    if request.headers().contains_key(header::CONTENT_ENCODING) {
        let packed = Packed::default();
        request.extensions_mut().insert(packed.clone());
        request = request.map(|body| Body::new(Counted { body, packed }));
    }
    next.run(request).await
}

/// Ends a body that unpacks to too much; stands inside of what unpacks it.
pub(super) async fn bound(mut request: Request, next: Next) -> Response {
    if let Some(packed) = request.extensions_mut().remove::<Packed>() {
        request = request.map(|body| {
            Body::new(Bounded {
                body,
                packed,
                unpacked: 0,
            })
        });
    }
    next.run(request).await
}

struct Counted {
    body: Body,
    packed: Packed,
}

impl HttpBody for Counted {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<http_body::Frame<Bytes>, axum::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        if let Some(Ok(frame)) = &frame {
            let bytes = frame.data_ref().map_or(0, Bytes::len);
            self.packed.0.fetch_add(bytes as u64, Ordering::Relaxed);
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> http_body::SizeHint {
        self.body.size_hint()
    }
}

struct Bounded {
    body: Body,
    packed: Packed,
    unpacked: u64,
}

impl HttpBody for Bounded {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<http_body::Frame<Bytes>, axum::Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        if let Some(Ok(frame)) = &frame {
            self.unpacked += frame.data_ref().map_or(0, Bytes::len) as u64;
            let packed = self.packed.0.load(Ordering::Relaxed);
            if self.unpacked > ALWAYS && self.unpacked / MOST_RATIO > packed {
                let why = format!("it unpacks to more than {MOST_RATIO} times its size");
                return Poll::Ready(Some(Err(axum::Error::new(std::io::Error::other(why)))));
            }
        }
        Poll::Ready(frame)
    }
}
