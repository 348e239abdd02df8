//! Connections to a PostgreSQL that were lost and never say so.
//!
//! A statement whose answer never comes would wait for as long as the system takes its connection for open: a quarter
//! of an hour. Whoever finds that connections were lost notes it; statements that are under way then end with an
//! error, and connections from before are asked whether they are there.

use std::io::ErrorKind;
use std::time::{Duration, Instant};

use tokio::sync::watch;

/// How long after a loss statements that are under way may still end by themselves: the database may have stood
/// still.
const GRACE: Duration = Duration::from_secs(1);

/// When connections of this server were lost the last time. Cheap to clone.
#[derive(Clone, Debug, Default)]
pub(in crate::store) struct Losses(watch::Sender<Option<Instant>>);

impl Losses {
    /// Notes that connections which were open until now may be lost.
    pub(in crate::store) fn note(&self) {
        self.0.send_replace(Some(Instant::now()));
    }

    /// Whether a connection of this age was open when connections were lost.
    pub(super) fn concern(&self, age: Duration) -> bool {
        let last = *self.0.borrow();
        last.is_some_and(|last| last.elapsed() <= age)
    }

    /// The outcome of a statement; an error where its connection may be lost meanwhile.
    pub(in crate::store) async fn unless_lost<T>(
        &self,
        statement: impl Future<Output = Result<T, sqlx::Error>>,
    ) -> Result<T, sqlx::Error> {
        let mut losses = self.0.subscribe();
        let lost = async {
            match losses.changed().await {
                Ok(()) => tokio::time::sleep(GRACE).await,
                Err(_nobody_notes_any) => std::future::pending().await,
            }
        };
        tokio::select! {
            outcome = statement => outcome,
            () = lost => Err(sqlx::Error::Io(ErrorKind::ConnectionReset.into())),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_statement_that_is_under_way_when_connections_are_lost_ends() {
        let losses = Losses::default();
        let statement = losses.unless_lost(std::future::pending::<Result<(), sqlx::Error>>());
        let noted = async {
            losses.note();
            assert!(losses.concern(Duration::from_secs(3600)));
            assert!(!losses.concern(Duration::ZERO));
        };
        let (outcome, ()) = tokio::join!(statement, noted);
        assert!(matches!(outcome, Err(sqlx::Error::Io(_))));
        let later = losses.unless_lost(async { Ok(7) }).await;
        assert_eq!(later.expect("a statement after the loss"), 7);
    }
}
