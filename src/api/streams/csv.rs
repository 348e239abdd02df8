//! Samples of a part of a stream as CSV, read and written block by block, so that the part may be of any length.

use std::io;
use std::ops::Range;

use axum::body::{Body, Bytes};
use axum::http::{HeaderValue, header};
use axum::response::Response;
use futures_util::{StreamExt, TryStreamExt, stream};

use crate::api::ApiState;
use crate::api::error::{Answer, Problem};
use crate::api::spreadsheet::inert;
use crate::api::work::Work;
use crate::store::{StoreError, StreamRow, Streams};
use greybox::recording::{CsvWriter, RowSignal, Rows};

/// The part of a stream that is still to be written.
struct Rest {
    streams: Streams,
    work: Work,
    stream: StreamRow,
    /// The instants that are left, nanoseconds since 1970.
    span: Range<i64>,
    /// The first instant of the part, from which times count.
    start: i64,
}

/// All samples of a span as CSV, each with its time from the first of them.
pub(super) async fn answer(state: &ApiState, stream: StreamRow, span: Range<i64>) -> Answer {
    let mut rest = Rest {
        streams: state.store.streams().clone(),
        work: state.work.clone(),
        stream,
        span,
        start: 0,
    };
    // What goes wrong before the first sample is answered as a problem.
    let first = rest.next_rows().await?;
    rest.start = first.as_ref().map_or(0, |rows| rows.instants[0]);
    let begun = rest.text(first.unwrap_or_default(), true).await?;
    let later = stream::try_unfold(rest, |mut rest| async move {
        let Some(rows) = rest.next_rows().await? else {
            return Ok(None);
        };
        let text = rest.text(rows, false).await?;
        Ok::<_, Problem>(Some((text, rest)))
    });
    let later = later.map_err(|_| io::Error::other("the rest cannot be read"));
    let chunks = stream::iter([Ok::<_, io::Error>(begun)]).chain(later);
    let mut response = Response::new(Body::from_stream(chunks));
    let csv_type = HeaderValue::from_static("text/csv; charset=utf-8");
    response
        .headers_mut()
        .insert(header::CONTENT_TYPE, csv_type);
    Ok(response)
}

impl Rest {
    /// Takes the rows of the next block off.
    async fn next_rows(&mut self) -> Result<Option<Rows>, StoreError> {
        let rows = self
            .streams
            .first_rows(&self.stream, self.span.clone())
            .await?;
        if let Some(last) = rows.as_ref().and_then(|rows| rows.instants.last()) {
            self.span.start = last.saturating_add(1);
        }
        Ok(rows)
    }

    /// The lines of some rows, after the titles where they are the first.
    async fn text(&self, rows: Rows, are_first: bool) -> Answer<Bytes> {
        let start = self.start;
        let signals = self.stream.signals.clone();
        let written = self.work.convert(move || {
            let titles = are_first.then_some(&*signals);
            let text = csv(&rows, start, titles);
            Ok(Bytes::from(text.expect("memory takes all")))
        });
        written.await
    }
}

/// Rows as lines, after a line of titles where there are any. Times count from `start`.
fn csv(rows: &Rows, start: i64, titles: Option<&[RowSignal]>) -> io::Result<Vec<u8>> {
    let mut text = Vec::new();
    let mut writer = CsvWriter::new(&mut text);
    if let Some(signals) = titles {
        let names: Vec<_> = signals.iter().map(|signal| inert(&signal.name)).collect();
        let units = signals.iter().map(|signal| &*signal.unit);
        writer.titles(names.iter().map(|name| &**name).zip(units))?;
    }
    writer.rows(rows, start)?;
    writer.finish()?;
    Ok(text)
}
