//! What one node of a PostgreSQL changed, told to the others.
//!
//! After the commit, not in it: a transaction that tells others holds up every other commit. A task gathers
//! what was changed and tells it together, so that many changes cost little. Whoever was away, or could not
//! tell, says that anything may have changed ([`Change::Missed`]).
//!
//! A connection that is lost silently never says so to one who only listens. So each node notifies at the least once
//! in a [`BEAT`], and hears its own notifications; a listener that hears nothing begins anew.

use std::collections::BTreeSet;
use std::io::ErrorKind;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use sqlx::PgConnection;
use sqlx::postgres::{PgConnectOptions, PgListener};
use tokio::sync::Notify;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

use super::database::Losses;
use super::database::postgres::{self, Use};
use super::opening::SharedPostgres;
use super::{Change, OnChange};

/// What nodes listen to.
const CHANNEL: &str = "greybox";
/// Changes are gathered for so long.
const GATHERING: Duration = Duration::from_millis(5);
/// How soon it is tried again to tell or to listen.
const BACK_OFF: Duration = Duration::from_millis(500);
/// How long telling may take, or beginning to listen.
const LONGEST: Duration = Duration::from_secs(2);
/// How often a node notifies at the least.
const BEAT: Duration = Duration::from_secs(1);
/// A listener that hears nothing for so long, not even its own node, has lost its connection.
const SILENCE: Duration = Duration::from_millis(2500);
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
    pub(super) fn exchange(
        &self,
        shared: &SharedPostgres,
        life: i64,
        on_change: OnChange,
        closing: CancellationToken,
    ) -> JoinSet<()> {
        let mut tasks = JoinSet::new();
        let options = shared.options().clone();
        tasks.spawn(self.clone().tell(options, life, closing.clone()));
        tasks.spawn(listen(shared.clone(), life, on_change, closing));
        tasks
    }

    /// Tells what is gathered, until `closing`; then what is left. Where nothing is, the others and this node are
    /// told so again and again.
    async fn tell(self, options: PgConnectOptions, life: i64, closing: CancellationToken) {
        let mut connection = None;
        loop {
            tokio::select! {
                biased;
                () = self.0.more.notified() => tokio::time::sleep(GATHERING).await,
                () = closing.cancelled() => return,
                () = tokio::time::sleep(BEAT) => {}
            }
            let changes: Vec<Change> = std::mem::take(&mut *self.changes()).into_iter().collect();
            let mut texts: Vec<String> = changes
                .chunks(TOGETHER)
                .map(|some| written(life, some))
                .collect();
            if texts.is_empty() {
                texts.push(written(life, &[]));
            }
            let told = in_time(LONGEST, notify(&mut connection, &options, &texts)).await;
            let Err(why) = told else {
                continue;
            };
            tracing::warn!(%why, "the other nodes could not be told of changes");
            connection = None;
            if closing.is_cancelled() {
                return;
            }
            self.add(Change::Missed);
            tokio::time::sleep(BACK_OFF).await;
        }
    }
}

/// Sends notifications over the connection, or over a new one where there is none.
async fn notify(
    connection: &mut Option<PgConnection>,
    options: &PgConnectOptions,
    texts: &[String],
) -> Result<(), sqlx::Error> {
    let connection = match connection {
        Some(connection) => connection,
        None => connection.insert(postgres::connect(options, Use::Tells).await?),
    };
    sqlx::query("select pg_notify($1, text) from unnest($2::text[]) as text")
        .bind(CHANNEL)
        .bind(texts)
        .execute(connection)
        .await?;
    Ok(())
}

/// Hears what other nodes changed, until `closing`.
async fn listen(
    shared: SharedPostgres,
    life: i64,
    on_change: OnChange,
    closing: CancellationToken,
) {
    let mut was_silent = false;
    let hear = async |was_silent: &mut bool| {
        let mut listener = in_time(LONGEST, subscribe(shared.options())).await?;
        if std::mem::take(was_silent) {
            shared.losses.note();
        }
        // Notifications before this instant were missed.
        on_change(Change::Missed);
        while let Some(notification) = in_time(SILENCE, listener.try_recv()).await? {
            match read(notification.payload()) {
                Some((node, _)) if node == life => {}
                Some((_, changes)) => changes.into_iter().for_each(|change| on_change(change)),
                None => on_change(Change::Missed),
            }
        }
        Ok::<_, sqlx::Error>(())
    };
    loop {
        let heard = tokio::select! {
            () = closing.cancelled() => return,
            heard = hear(&mut was_silent) => heard,
        };
        was_silent |= heard.as_ref().is_err_and(is_silence);
        let why = heard.map_or_else(|error| error.to_string(), |()| "it broke off".to_owned());
        tracing::warn!(why, "what other nodes change is not heard");
        tokio::select! {
            () = closing.cancelled() => return,
            () = tokio::time::sleep(BACK_OFF) => {}
        }
    }
}

/// Listens on a connection that no earlier listener had.
async fn subscribe(options: &PgConnectOptions) -> Result<PgListener, sqlx::Error> {
    let pool = postgres::pool(options, 1, Use::Listens, &Losses::default()).await?;
    let mut listener = PgListener::connect_with(&pool).await?;
    listener.eager_reconnect(false);
    listener.listen(CHANNEL).await?;
    Ok(listener)
}

/// Whether an error says that there was no answer in time: the other connections may be lost too.
fn is_silence(error: &sqlx::Error) -> bool {
    matches!(error, sqlx::Error::Io(error) if error.kind() == ErrorKind::TimedOut)
}

/// The outcome of `work`; an error where that takes longer than `limit`.
async fn in_time<T>(
    limit: Duration,
    work: impl Future<Output = Result<T, sqlx::Error>>,
) -> Result<T, sqlx::Error> {
    let outcome = tokio::time::timeout(limit, work).await;
    outcome.unwrap_or_else(|_too_long| Err(sqlx::Error::Io(ErrorKind::TimedOut.into())))
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
