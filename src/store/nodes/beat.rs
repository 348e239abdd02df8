//! A node of a PostgreSQL says that it lives, and finds those that no longer do.

use std::io::ErrorKind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use sqlx::PgConnection;
use tokio::time::MissedTickBehavior;
use tokio_util::sync::CancellationToken;

use super::lives;
use super::watch::{Beat, Watch};
use crate::store::opening::SharedPostgres;
use crate::store::shared_database::Database;
use crate::store::writer::in_transaction;
use crate::store::{Change, OnChange};

/// How long a beat may take: after that its connection is given up and another one made.
const LONGEST_BEAT: Duration = Duration::from_secs(2);

/// How soon a beat that failed is tried again: until it succeeds the silence of others is not counted.
const RETRY_INTERVAL: Duration = Duration::from_millis(250);

/// What a node needs to say that it lives and to take over from others.
pub(super) struct Beats {
    pub(super) database: Arc<Database>,
    pub(super) shared: SharedPostgres,
    pub(super) on_change: OnChange,
    pub(super) in_charge: Arc<AtomicBool>,
    /// The place of this node among those that live, and how many live.
    pub(super) place: Arc<Mutex<Option<(u32, u32)>>>,
    pub(super) lost: CancellationToken,
}

impl Beats {
    /// Raises the node's counter and looks at those of the others until `closing`, or until others
    /// have declared it dead.
    pub(super) async fn run(self, closing: CancellationToken) {
        let mut due = tokio::time::interval(self.shared.beat);
        due.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut connection = None;
        let mut watch = Watch::of(self.database.life);
        loop {
            tokio::select! {
                () = closing.cancelled() => return,
                _ = due.tick() => {}
            }
            let beat = tokio::time::timeout(LONGEST_BEAT, self.beat(&mut connection)).await;
            let beat =
                beat.unwrap_or_else(|_too_long| Err(sqlx::Error::Io(ErrorKind::TimedOut.into())));
            match beat {
                Ok(live) if live.iter().any(|node| node.life == self.database.life) => {
                    let silent = self.look(&mut watch, &live);
                    note(&mut connection, &silent).await;
                }
                Ok(_without_this_one) => {
                    tracing::error!("other nodes have declared this one dead");
                    self.lost.cancel();
                    return;
                }
                Err(error) => {
                    tracing::warn!(%error, "this node could not say that it lives");
                    metrics::counter!("greybox_node_beats_missed_total").increment(1);
                    connection = None;
                    due.reset_after(RETRY_INTERVAL.min(self.shared.beat));
                }
            }
        }
    }

    /// Raises the counter; answers the counters of all nodes that live.
    async fn beat(&self, connection: &mut Option<PgConnection>) -> Result<Vec<Beat>, sqlx::Error> {
        let connection = match connection {
            Some(connection) => connection,
            None => {
                let new = self.shared.connect().await?;
                connection.insert(new)
            }
        };
        sqlx::query("update nodes set beat = beat + 1 where life = $1 and state = 'live'")
            .bind(self.database.life)
            .execute(&mut *connection)
            .await?;
        sqlx::query_as(
            "select life, beat, beat_ms, \
             case when silent_beat = beat then silence_ms else 0 end as silence_ms \
             from nodes where state = 'live' order by life",
        )
        .fetch_all(connection)
        .await
    }

    /// Looks at the counters of all nodes and has the jobs of dead ones taken over. Answers the nodes whose
    /// counters stand still.
    fn look(&self, watch: &mut Watch, live: &[Beat]) -> Vec<Beat> {
        metrics::gauge!("greybox_nodes").set(u32::try_from(live.len()).unwrap_or(u32::MAX));
        let this_node = live
            .iter()
            .zip(0..)
            .find(|(node, _)| node.life == self.database.life);
        let of = u32::try_from(live.len()).unwrap_or(u32::MAX);
        let place = this_node.filter(|_| of > 1).map(|(_, index)| (index, of));
        *self.place.lock().unwrap_or_else(PoisonError::into_inner) = place;
        let is_oldest = live
            .first()
            .is_some_and(|oldest| oldest.life == self.database.life);
        if self.in_charge.swap(is_oldest, Ordering::Relaxed) != is_oldest {
            // What waited for the node that was in charge waits for this one now.
            (self.on_change)(Change::Missed);
        }
        let own_ms = i64::try_from(self.shared.beat.as_millis()).unwrap_or(i64::MAX);
        let silent = watch.observe(own_ms, live);
        for dead in silent.iter().filter(|node| node.is_dead(own_ms)) {
            tokio::spawn(take_over(self.database.clone(), *dead));
        }
        silent
    }
}

/// Notes for how long counters have stood still, for observers that begin later. A counter that was raised since
/// is left alone. A connection on which that fails is given up.
async fn note(connection: &mut Option<PgConnection>, silent: &[Beat]) {
    for node in silent {
        let Some(open) = connection else {
            return;
        };
        let noting = sqlx::query(
            "update nodes set silent_beat = beat, silence_ms = \
             case when silent_beat = beat then greatest(silence_ms, $3) else $3 end \
             where life = $1 and beat = $2 and state = 'live'",
        )
        .bind(node.life)
        .bind(node.beat)
        .bind(node.silence_ms)
        .execute(open);
        let noted = tokio::time::timeout(LONGEST_BEAT, noting).await;
        if !matches!(noted, Ok(Ok(_))) {
            tracing::warn!(node = node.life, "the silence of a node could not be noted");
            *connection = None;
        }
    }
}

async fn take_over(database: Arc<Database>, dead: Beat) {
    let Beat { life, beat, .. } = dead;
    let taken = in_transaction!(database, |tx| lives::take_over(tx, life, beat)).await;
    if let Err(error) = taken {
        tracing::error!(node = life, %error, "the jobs of a dead node are not taken over yet");
    }
}
