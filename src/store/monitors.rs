//! What is watched: monitors, their windows, alarms and events.
//!
//! A monitor goes on in steps. A step is one transaction: what became of a window, the job that
//! works the next, alarms and events come to be together or not at all, and only where no other step
//! came first. So a window is worked once, whenever the server dies.

mod monitor;
mod step;

use std::sync::Arc;

use jiff::Timestamp;

use super::StoreError;
use super::columns::{self, from_json};
use super::database::{self, QueryBuilder, Row};
use super::events::{self, StoredEvent};
use super::idempotency::Idempotency;
use super::page::Page;
use super::sealed::{MONITOR_ALARMS, MONITOR_EVENTS};
use super::shared_database::Database;
use super::submit::{self, Submitted};
use super::writer::in_transaction;
use crate::access::Project;
use crate::job::MonitorId;
use crate::monitor::{Alarm, ShownWindow};
pub use monitor::{Advance, AdvanceWindow, MonitorRow, NewMonitor, NewWindowJob};
use monitor::{SELECT, fetch, read, window};

/// What is watched: monitors, their windows, alarms and events.
#[derive(Clone)]
pub struct Monitors {
    pub(super) database: Arc<Database>,
}

impl Monitors {
    /// Stores a monitor. Nothing where there are too many, or where the stream is gone.
    pub async fn insert(
        &self,
        new: NewMonitor,
    ) -> Result<Option<Submitted<MonitorRow>>, StoreError> {
        in_transaction!(self.database, |tx| step::insert(tx, new)).await
    }

    /// What became of the monitor that came with this key before, if one did.
    pub async fn earlier(
        &self,
        idempotency: &Idempotency,
    ) -> Result<Option<Submitted<MonitorRow>>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        submit::earlier(&mut connection, idempotency).await
    }

    /// A monitor, if there is one.
    pub async fn find(&self, id: MonitorId) -> Result<Option<MonitorRow>, StoreError> {
        let mut connection = self.database.readers.acquire().await?;
        fetch(&mut connection, id).await
    }

    /// The project of a monitor, if there is one.
    pub async fn project_of(&self, id: MonitorId) -> Result<Option<Project>, StoreError> {
        let key = id.to_string();
        let name: Option<String> =
            database::query_scalar("select project from monitors where id = $1")
                .bind(&key)
                .fetch_optional(&self.database.readers)
                .await?;
        name.map(|name| columns::project(&key, &name)).transpose()
    }

    /// Monitors of a project, newest first, older than `before`.
    pub async fn list(
        &self,
        project: &Project,
        before: Option<MonitorId>,
        limit: u32,
    ) -> Result<Page<MonitorRow, MonitorId>, StoreError> {
        let mut query = QueryBuilder::new(SELECT);
        query
            .push(" where monitors.project = ")
            .push_bind(project.as_str().to_owned());
        if let Some(before) = before {
            query.push(" and id < ").push_bind(before.to_string());
        }
        query
            .push(" order by id desc limit ")
            .push_bind(i64::from(limit) + 1);
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let rows = rows.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.id))
    }

    /// Removes a monitor with its windows, alarms and events. Jobs stay.
    pub async fn delete(&self, id: MonitorId) -> Result<bool, StoreError> {
        in_transaction!(self.database, |tx| step::delete(tx, id)).await
    }

    /// Monitors that have something to do: a window is due, its job has ended, or data stopped. Those that are
    /// damaged are left out, noted and logged.
    pub async fn to_step(&self) -> Result<Vec<MonitorRow>, StoreError> {
        let mut query = QueryBuilder::new(SELECT);
        query.push(
            " where case when job is null then \
               exists (select 1 from streams where streams.identity = monitors.stream \
                and last_ns >= due_ns and due_ns <= ",
        );
        query.push_bind(i64::try_from(Timestamp::now().as_nanosecond()).unwrap_or(i64::MAX));
        query.push(
            ") \
              else not exists (select 1 from jobs where jobs.id = monitors.job \
                and finished_at is null) end \
             or silent = (select case when received_at >= ",
        );
        query.push(self.database.readers.kind().either(
            "strftime('%Y-%m-%dT%H:%M:%fZ', 'now', '-' || (patience_ms / 1000.0) || ' seconds')",
            "to_char(now() at time zone 'utc' - patience_ms * interval '1 millisecond', \
             'YYYY-MM-DD\"T\"HH24:MI:SS.MS\"Z\"')",
        ));
        query.push(
            " then 1 else 0 end from streams where streams.identity = monitors.stream) order by id",
        );
        let rows = query.build().fetch_all(&self.database.readers).await?;
        let sound = rows.iter().filter_map(|row| {
            read(row)
                .inspect_err(|error| {
                    self.database.damage.note(error);
                    tracing::error!(%error, "a monitor cannot go on");
                })
                .ok()
        });
        Ok(sound.collect())
    }

    /// Takes a step; says whether it was taken.
    ///
    /// # Errors
    /// The project has no room for the job or the recording of the step ([`StoreError::Quota`]), or the database
    /// fails. Nothing of the step is written then.
    pub async fn advance(&self, step: Advance) -> Result<bool, StoreError> {
        in_transaction!(self.database, |tx| step::advance(tx, step)).await
    }

    /// A window of a monitor.
    pub async fn window(
        &self,
        id: MonitorId,
        number: i64,
    ) -> Result<Option<ShownWindow>, StoreError> {
        let row = database::query(
            "select monitor, number, job, dataset, row, seal, state_seal from monitor_windows \
             where monitor = $1 and number = $2",
        )
        .bind(id.to_string())
        .bind(number)
        .fetch_optional(&self.database.readers)
        .await?;
        row.as_ref().map(window).transpose()
    }

    /// Windows of a monitor, newest first, before `before`.
    pub async fn windows(
        &self,
        id: MonitorId,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Page<ShownWindow, i64>, StoreError> {
        let rows = database::query(
            "select monitor, number, job, dataset, row, seal, state_seal from monitor_windows \
             where monitor = $1 and number < $2 order by number desc limit $3",
        )
        .bind(id.to_string())
        .bind(before.unwrap_or(i64::MAX))
        .bind(i64::from(limit) + 1)
        .fetch_all(&self.database.readers)
        .await?;
        let rows = rows.iter().map(window).collect::<Result<Vec<_>, _>>()?;
        Ok(Page::cut(rows, limit, |row| row.window.number))
    }

    /// Alarms of a monitor, newest first, before `before`.
    pub async fn alarms(
        &self,
        id: MonitorId,
        before: Option<i64>,
        limit: u32,
    ) -> Result<Page<Alarm, i64>, StoreError> {
        let rows = database::query(
            "select monitor, id, row, seal from monitor_alarms where monitor = $1 and id < $2 \
             order by id desc limit $3",
        )
        .bind(id.to_string())
        .bind(before.unwrap_or(i64::MAX))
        .bind(i64::from(limit) + 1)
        .fetch_all(&self.database.readers)
        .await?;
        let alarm = |row: &Row| {
            MONITOR_ALARMS.verify(row)?;
            from_json("alarm", row.try_get("monitor")?, row.try_get("row")?)
        };
        let rows = rows
            .iter()
            .map(alarm)
            .collect::<Result<Vec<_>, StoreError>>()?;
        Ok(Page::cut(rows, limit, |alarm: &Alarm| alarm.id))
    }

    /// Events of a monitor with an id above `after`, in order, at most `limit`.
    ///
    /// # Errors
    /// One of them is damaged, or the database fails.
    pub async fn events_after(
        &self,
        id: MonitorId,
        after: i64,
        limit: u32,
    ) -> Result<Vec<StoredEvent>, StoreError> {
        let rows = database::query(
            "select monitor, id, name, data, seal from monitor_events where monitor = $1 and id > $2 \
             order by id limit $3",
        )
        .bind(id.to_string())
        .bind(after)
        .bind(limit)
        .fetch_all(&self.database.readers)
        .await?;
        events::read(&MONITOR_EVENTS, &rows)
    }
}
