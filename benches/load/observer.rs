//! Sees in the database itself when an event is stored: the moment that its delivery counts from.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use sqlx::{Connection as _, PgConnection, SqliteConnection};

use crate::{Outcome, server};

/// How often it looks. An event counts as stored from the look before the one that found it, so
/// its delivery is never told for shorter than it was.
const LOOK: Duration = Duration::from_millis(2);

/// What it asks.
const LAST_EVENTS: &str = "select id, last_event from jobs where status = 'running'";

/// When the events of jobs were stored, by job and event id.
pub type Stored = HashMap<(String, i64), Instant>;

/// Looks on from a thread of its own.
pub struct Observer {
    thread: JoinHandle<Result<Stored, sqlx::Error>>,
    done: Arc<AtomicBool>,
}

impl Observer {
    /// Begins to look at the running jobs of a database.
    pub fn start(folder: &Path) -> Self {
        let database = server::database(folder);
        let done = Arc::new(AtomicBool::new(false));
        let seen = done.clone();
        let thread = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_current_thread()
                .enable_all()
                .build();
            runtime.map_err(sqlx::Error::from)?.block_on(async {
                let connection = Connection::open(&database).await?;
                look(connection, &seen).await
            })
        });
        Self { thread, done }
    }

    /// What it saw.
    pub fn finish(self) -> Outcome<Stored> {
        self.done.store(true, Ordering::Relaxed);
        let seen = self.thread.join().map_err(|_| "the observer panicked")?;
        Ok(seen?)
    }
}

enum Connection {
    Sqlite(SqliteConnection),
    Postgres(PgConnection),
}

impl Connection {
    async fn open(database: &str) -> Result<Self, sqlx::Error> {
        if database.starts_with("sqlite:") {
            let connection = SqliteConnection::connect(database).await?;
            Ok(Self::Sqlite(connection))
        } else {
            PgConnection::connect(database).await.map(Self::Postgres)
        }
    }

    async fn last_events(&mut self) -> Result<Vec<(String, i64)>, sqlx::Error> {
        match self {
            Self::Sqlite(connection) => sqlx::query_as(LAST_EVENTS).fetch_all(connection).await,
            Self::Postgres(connection) => sqlx::query_as(LAST_EVENTS).fetch_all(connection).await,
        }
    }
}

async fn look(mut connection: Connection, done: &AtomicBool) -> Result<Stored, sqlx::Error> {
    let mut newest: HashMap<String, i64> = HashMap::new();
    let mut stored = Stored::new();
    let mut absent = Instant::now();
    while !done.load(Ordering::Relaxed) {
        let look = Instant::now();
        for (job, last) in connection.last_events().await? {
            let before = newest.insert(job.clone(), last).unwrap_or(last);
            stored.extend((before + 1..=last).map(|event| ((job.clone(), event), absent)));
        }
        absent = look;
        tokio::time::sleep(LOOK).await;
    }
    Ok(stored)
}
