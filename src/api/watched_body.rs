//! A body whose pieces are seen as they pass.

use std::pin::Pin;
use std::task::{Context, Poll, ready};

use axum::Error;
use axum::body::{Body, Bytes, HttpBody};
use http_body::{Frame, SizeHint};

/// The body with `see` called for each piece of it; what `see` refuses ends it. `see` lives as long
/// as the body.
pub(super) fn watched(
    body: Body,
    see: impl FnMut(&Bytes) -> Result<(), Error> + Send + Unpin + 'static,
) -> Body {
    Body::new(Watched { body, see })
}

struct Watched<F> {
    body: Body,
    see: F,
}

impl<F: FnMut(&Bytes) -> Result<(), Error> + Unpin> HttpBody for Watched<F> {
    type Data = Bytes;
    type Error = Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Error>>> {
        let frame = ready!(Pin::new(&mut self.body).poll_frame(context));
        let piece = frame.as_ref().and_then(|frame| frame.as_ref().ok());
        let seen = match piece.and_then(Frame::data_ref) {
            Some(bytes) => (self.see)(bytes),
            None => Ok(()),
        };
        Poll::Ready(match seen {
            Ok(()) => frame,
            Err(refusal) => Some(Err(refusal)),
        })
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
