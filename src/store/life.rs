//! The lives of the server, and which jobs were at work in one that was cut off.
//!
//! A job that takes its server down must not do so for ever, and a job whose server was taken down
//! by something else must not be blamed. A life that is cut off speaks against the jobs that were at
//! work in it and for those that were not: a server that goes down without a job is not taken down by
//! it. A job that one life after another ends with waits a little longer each time, alone among its
//! like, so that there are lives without it; what fails in the end is a job that the server always
//! went down with and never without.
//!
//! A slice that the database refused leaves no trace: the life goes on, so nothing was cut off.

use std::time::Duration;

use super::database;
use super::writer::{Tx, Writer};
use super::{Store, StoreError};

/// From so many lives that ended with it a job waits before it is worked again.
pub(super) const SUSPECT_FROM: u32 = 3;
/// The longest wait.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// How long the server has to have been up before it works a job again that so many lives in a row
/// ended with: nothing for the first few, then a second, two, four …
pub(super) fn wait_after(deaths: u32) -> Duration {
    match deaths.checked_sub(SUSPECT_FROM) {
        None => Duration::ZERO,
        Some(doublings) => Duration::from_secs(1 << doublings.min(16)).min(LONGEST_WAIT),
    }
}

/// Begins a life, and tells the jobs what the one before says of them. Answers its number.
pub(super) async fn begin(writer: &Writer) -> Result<i64, StoreError> {
    writer.write(|tx| Box::pin(begin_in(tx))).await
}

async fn begin_in(tx: &mut Tx) -> Result<i64, StoreError> {
    let last: Option<(i64, bool)> =
        database::query_as("select number, ended_in_order from server_life")
            .fetch_optional(&mut **tx)
            .await?;
    let number = last.map_or(0, |(number, _)| number);
    if matches!(last, Some((_, false))) {
        database::query(
            "update jobs set deaths = case when at_work_in = $1 then deaths + 1 else 0 end \
             where at_work_in is not null or deaths > 0",
        )
        .bind(number)
        .execute(&mut **tx)
        .await?;
    }
    database::query("update jobs set at_work_in = null where at_work_in is not null")
        .execute(&mut **tx)
        .await?;
    database::query(
        "insert into server_life (id, number, ended_in_order) values (1, $1, false) \
         on conflict (id) do update set number = excluded.number, ended_in_order = false",
    )
    .bind(number + 1)
    .execute(&mut **tx)
    .await?;
    Ok(number + 1)
}

impl Store {
    /// Notes that the server ends in order.
    pub(super) async fn end_life(&self) -> Result<(), StoreError> {
        self.inner.writer.write(|tx| Box::pin(end_in(tx))).await
    }
}

async fn end_in(tx: &mut Tx) -> Result<(), StoreError> {
    database::query("update server_life set ended_in_order = true")
        .execute(&mut **tx)
        .await?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_job_waits_longer_with_each_life_that_ends_with_it() {
        let waits: Vec<u64> = (0..12).map(|deaths| wait_after(deaths).as_secs()).collect();
        assert_eq!(waits, [0, 0, 0, 1, 2, 4, 8, 16, 32, 60, 60, 60]);
    }
}
