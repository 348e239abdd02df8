//! Parts of a stream that somebody takes out.

use super::blocks::{self, Span};
use super::{StreamRow, fetch, identity, note};
use crate::access::Project;
use crate::store::writer::Tx;
use crate::store::{Change, Store, StoreError};

/// What became of a wish to remove samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Cleared {
    /// Samples that went.
    pub removed: u64,
    /// The stream as it then stood.
    pub stream: StreamRow,
}

impl Store {
    /// Removes the samples of a stream from one instant up to, and without, another, nanoseconds
    /// since 1970; nothing where there is no such stream. The answer means that they are gone.
    pub async fn remove_samples(
        &self,
        project: &Project,
        name: &str,
        (from, to): (i64, i64),
    ) -> Result<Option<Cleared>, StoreError> {
        let identity = identity(project, name);
        let span = Span { from, to };
        self.inner
            .writer
            .write(move |tx| Box::pin(remove(tx, identity, span)))
            .await
    }
}

async fn remove(tx: &mut Tx, identity: String, span: Span) -> Result<Option<Cleared>, StoreError> {
    let Some(mut stream) = fetch(tx, &identity).await? else {
        return Ok(None);
    };
    let removed = blocks::remove(tx, &stream, span).await?;
    let left = blocks::all(tx, &identity).await?;
    note(tx, &mut stream, &left).await?;
    tx.announce(Change::Stream);
    Ok(Some(Cleared { removed, stream }))
}
