//! Recordings as CSV.

use std::io::{self, BufWriter, Write};

use axum::http::{HeaderValue, header};
use axum::response::Response;

use crate::admission::Permit;
use crate::api::body::{Bodies, scratch_failed};
use crate::api::error::Answer;
use crate::api::spreadsheet::inert_names;
use greybox::recording::Recording;

/// Bytes of CSV that are written at once.
const CSV_BUFFER_BYTES: usize = 64 * 1024;

/// A recording as CSV: written to disk at once and from there as fast as its client reads, so that
/// nothing in memory waits for a slow one. The permit is for the recording.
pub(in crate::api) async fn answer(
    bodies: &Bodies,
    recording: Recording,
    permit: Permit,
) -> Answer {
    let spools = bodies.clone();
    let written = bodies.work.convert_bytes(recording.bytes(), move || {
        let (_permit, mut recording) = (permit, recording);
        inert_names(&mut recording);
        let write = || {
            let mut spool = spools.spool()?;
            let mut buffered = BufWriter::with_capacity(CSV_BUFFER_BYTES, &mut spool);
            recording.write_csv(&mut buffered)?;
            buffered.flush()?;
            drop(buffered);
            spool.into_body()
        };
        write().map_err(|error: io::Error| scratch_failed(&error))
    });
    let mut response = Response::new(written.await?);
    let csv_type = HeaderValue::from_static("text/csv; charset=utf-8");
    response
        .headers_mut()
        .insert(header::CONTENT_TYPE, csv_type);
    Ok(response)
}
