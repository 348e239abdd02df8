//! Whether the body of a request was read to its end. A request that is refused before that leaves the rest of its body
//! on the connection, which then serves no other request: the answer says so.

use std::pin::Pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Poll, ready};

use axum::Error;
use axum::body::{Body, Bytes, HttpBody};
use axum::extract::Request;
use http_body::{Frame, SizeHint};

/// Whether the body of a request was read to its end.
pub(super) struct UnreadBody {
    was_read: Arc<AtomicBool>,
}

impl UnreadBody {
    /// The request with a body that is looked after.
    pub(super) fn of(request: Request) -> (Request, Self) {
        let was_read = Arc::new(AtomicBool::new(request.body().is_end_stream()));
        let unread = Self {
            was_read: was_read.clone(),
        };
        let request = request.map(|body| Body::new(LookedAfter { body, was_read }));
        (request, unread)
    }

    /// Whether some of the body was not read.
    pub(super) fn is_left(&self) -> bool {
        !self.was_read.load(Ordering::Relaxed)
    }
}

struct LookedAfter {
    body: Body,
    was_read: Arc<AtomicBool>,
}

impl HttpBody for LookedAfter {
    type Data = Bytes;
    type Error = Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        if frame.is_none() || self.body.is_end_stream() {
            self.was_read.store(true, Ordering::Relaxed);
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
