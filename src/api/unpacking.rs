//! Compressed bodies: one that unpacks to very many times its size is no recording but a way to keep
//! the server busy.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use axum::Error;
use axum::body::Bytes;
use axum::extract::Request;
use axum::http::header;
use axum::middleware::Next;
use axum::response::Response;

use super::watched_body::watched;
use greybox::intake::{MOST_RATIO, may_unpack};

/// Bytes of a compressed body that have come.
#[derive(Clone, Default)]
struct Packed(Arc<AtomicU64>);

/// Counts what comes of a compressed body; stands outside of what unpacks it.
pub(super) async fn count(mut request: Request, next: Next) -> Response {
    if request.headers().contains_key(header::CONTENT_ENCODING) {
        let packed = Packed::default();
        request.extensions_mut().insert(packed.clone());
        request = request.map(|body| {
            watched(body, move |bytes| {
                packed.0.fetch_add(bytes.len() as u64, Ordering::Relaxed);
                Ok(())
            })
        });
    }
    next.run(request).await
}

/// Ends a body that unpacks to too much; stands inside of what unpacks it.
pub(super) async fn bound(mut request: Request, next: Next) -> Response {
    if let Some(packed) = request.extensions_mut().remove::<Packed>() {
        let mut unpacked = 0;
        let see = move |bytes: &Bytes| {
            unpacked += bytes.len() as u64;
            packed.allows(unpacked)
        };
        request = request.map(|body| watched(body, see));
    }
    next.run(request).await
}

impl Packed {
    /// Refuses so many unpacked bytes where they are too many for what has come.
    fn allows(&self, unpacked: u64) -> Result<(), Error> {
        let packed = self.0.load(Ordering::Relaxed);
        if may_unpack(packed, unpacked) {
            return Ok(());
        }
        let why = format!("it unpacks to more than {MOST_RATIO} times its size");
        Err(Error::new(std::io::Error::other(why)))
    }
}
