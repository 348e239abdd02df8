//! A stream of the store, read from the thread of a computation.

use std::ops::Range;
use std::sync::Arc;

use tokio::runtime::Handle;

use super::run::StreamReader;
use crate::access::Project;
use crate::job::Failure;
use crate::store::{Meaning, Store, StoreError, StreamRow, Streams};
use greybox::recording::{RowSignal, Rows};

/// A stream of the store.
struct StoredStream {
    streams: Streams,
    row: StreamRow,
    runtime: Handle,
}

/// The stream of a project as it stands, or why a job cannot go through it.
pub(super) async fn stored_stream(
    store: &Store,
    project: &Project,
    name: &str,
) -> Result<Result<Arc<dyn StreamReader>, Failure>, StoreError> {
    let Some(row) = store.streams().find(project, name).await? else {
        let detail = format!("the stream `{name}` is no longer stored");
        return Ok(Err(Failure::cannot_run(detail, Vec::new())));
    };
    Ok(Ok(Arc::new(StoredStream {
        streams: store.streams().clone(),
        row,
        runtime: Handle::current(),
    })))
}

impl StreamReader for StoredStream {
    fn signals(&self) -> &[RowSignal] {
        &self.row.signals
    }

    fn rows(&self, span: Range<i64>, most: usize) -> Result<Option<Rows>, Failure> {
        let rows = self
            .runtime
            .block_on(self.streams.unmarked_rows(&self.row, span, most));
        let rows = rows.map(|unmarked| unmarked.map(|unmarked| unmarked.rows));
        rows.map_err(|error| match error.meaning() {
            Meaning::Damaged => Failure::damaged_data(&error),
            _ => Failure::cannot_run(format!("the stream cannot be read: {error}"), Vec::new()),
        })
    }
}

impl std::fmt::Debug for StoredStream {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter
            .debug_tuple("StoredStream")
            .field(&self.row.name)
            .finish()
    }
}
