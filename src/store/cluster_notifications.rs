//! What one node of a PostgreSQL changed, told to the others.
//!
//! After the commit, not in it: a transaction that tells others holds up every other commit. A task gathers
//! what was changed and tells it together, so that many changes cost little. Whoever was away, or could not
//! tell, says that anything may have changed ([`Change::Missed`]).

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use sqlx::PgPool;
use sqlx::postgres::{PgConnectOptions, PgListener, PgPoolOptions};
use tokio::sync::Notify;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use super::{Change, OnChange, StoreError};

/// What nodes listen to.
const CHANNEL: &str = "greybox";
/// Changes are gathered for so long.
const GATHERING: Duration = Duration::from_millis(5);
/// How soon it is tried again to tell or to listen.
const BACK_OFF: Duration = Duration::from_millis(500);
/// How long telling may take.
const LONGEST: Duration = Duration::from_secs(5);
/// Changes in one notification, which has room for 8000 bytes.
const TOGETHER: usize = 50;
/// Changes that are gathered; of more it is only told that there are many.
const MOST: usize = 5000;

/// What this node has changed and not yet told. Cheap to clone.
#[derive(Clone, Default)]
pub(super) struct ClusterNotifications(Arc<Untold>);

#[derive(Default)]
struct Untold {
    /// The changes that the other nodes are to be told of.
    changes: Mutex<BTreeSet<Change>>,
    /// Wakes the task that tells them.
    more: Notify,
}

impl ClusterNotifications {
    /// Takes a change that is to be told. It does not block.
    pub(super) fn add(&self, change: Change) {
        let mut changes = self.changes();
        if changes.len() >= MOST {
            changes.clear();
            changes.insert(Change::Missed);
        } else if !changes.contains(&Change::Missed) {
            changes.insert(change);
        }
        drop(changes);
        self.0.more.notify_one();
    }

    fn changes(&self) -> MutexGuard<'_, BTreeSet<Change>> {
        self.0
            .changes
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins to tell the others, and to hear from them through `on_change`, as the node of a life.
    pub(super) async fn exchange(
        &self,
        options: &PgConnectOptions,
        life: i64,
        on_change: OnChange,
        closing: CancellationToken,
    ) -> Result<JoinSet<()>, StoreError> {
        let pool = PgPoolOptions::new()
            .max_connections(2)
            .acquire_timeout(LONGEST)
            .connect_with(options.clone())
            .await?;
        let mut tasks = JoinSet::new();
        tasks.spawn(self.clone().tell(pool.clone(), life, closing.clone()));
        tasks.spawn(listen(pool, life, on_change, closing));
        Ok(tasks)
    }

    /// Tells what is gathered, until `closing`; then what is left.
    async fn tell(self, pool: PgPool, life: i64, closing: CancellationToken) {
        loop {
            tokio::select! {
                biased;
                () = self.0.more.notified() => {}
                () = closing.cancelled() => return,
            }
            tokio::time::sleep(GATHERING).await;
            let changes: Vec<Change> = std::mem::take(&mut *self.changes()).into_iter().collect();
            let texts: Vec<String> = changes
                .chunks(TOGETHER)
                .map(|some| written(life, some))
                .collect();
            let told = sqlx::query("select pg_notify($1, text) from unnest($2::text[]) as text")
                .bind(CHANNEL)
                .bind(&texts)
                .execute(&pool);
            let why = match tokio::time::timeout(LONGEST, told).await {
                Ok(Ok(_)) => continue,
                Ok(Err(error)) => error.to_string(),
                Err(_too_long) => "no answer in time".to_owned(),
            };
            tracing::warn!(why, "the other nodes could not be told of changes");
            if closing.is_cancelled() {
                return;
            }
            self.add(Change::Missed);
            tokio::time::sleep(BACK_OFF).await;
        }
    }
}

/// Hears what other nodes changed, until `closing`.
async fn listen(pool: PgPool, life: i64, on_change: OnChange, closing: CancellationToken) {
    let hear = async || {
        let mut listener = PgListener::connect_with(&pool).await?;
        listener.listen(CHANNEL).await?;
        // What was told before is missed.
        on_change(Change::Missed);
        while let Some(notification) = listener.try_recv().await? {
            match read(notification.payload()) {
                Some((other, _)) if other == life => {}
                Some((_, changes)) => changes.into_iter().for_each(|change| on_change(change)),
                None => on_change(Change::Missed),
            }
        }
        Ok::<_, sqlx::Error>(())
    };
    loop {
        let why = tokio::select! {
            () = closing.cancelled() => return,
            heard = hear() => heard.map_or_else(|error| error.to_string(), |()| "it broke off".to_owned()),
        };
        tracing::warn!(why, "what other nodes change is not heard");
        tokio::select! {
            () = closing.cancelled() => return,
            () = tokio::time::sleep(BACK_OFF) => {}
        }
    }
}

/// The number of the life and what it changed, in JSON.
fn written(life: i64, changes: &[Change]) -> String {
    serde_json::to_string(&(life, changes)).expect("changes are JSON")
}

/// Nothing where another version wrote what this one does not know.
fn read(text: &str) -> Option<(i64, Vec<Change>)> {
    serde_json::from_str(text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox::identification::JobId;

    #[test]
    fn what_is_told_is_read_as_it_was() {
        let changes: Vec<Change> = (0..TOGETHER).map(|_| Change::Job(JobId::new())).collect();
        let text = written(12, &changes);
        assert!(text.len() < 8000, "{} bytes", text.len());
        assert_eq!(read(&text), Some((12, changes)));
        assert_eq!(read("[12, [\"unheard of\"]]"), None);
    }

    #[test]
    fn of_very_many_changes_it_is_told_that_there_are_many() {
        let notifications = ClusterNotifications::default();
        for _ in 0..=MOST {
            notifications.add(Change::Job(JobId::new()));
        }
        notifications.add(Change::Stream);
        let told: Vec<Change> = notifications.changes().iter().cloned().collect();
        assert_eq!(told, [Change::Missed]);
    }
}
