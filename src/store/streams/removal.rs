//! Parts of a stream that somebody takes out.

use super::blocks::{self, Span};
use super::stream::{StreamRow, fetch};
use crate::access::Project;
use crate::store::writer::Tx;
use crate::store::{Change, StoreError};

/// What became of a wish to remove samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Cleared {
    /// Samples that went.
    pub removed: u64,
    /// The stream as it then stood.
    pub stream: StreamRow,
}

/// Removes the samples of a span; nothing where there is no such stream.
pub(super) async fn remove(
    tx: &mut Tx,
    project: &Project,
    name: &str,
    span: Span,
) -> Result<Option<Cleared>, StoreError> {
    let Some(mut stream) = fetch(tx, project, name).await? else {
        return Ok(None);
    };
    let removed = blocks::remove(tx, &mut stream, span).await?;
    tx.announce(Change::Stream);
    Ok(Some(Cleared { removed, stream }))
}
