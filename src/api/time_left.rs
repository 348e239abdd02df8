//! How long a job may go on, by how long jobs like it took.

use std::time::Duration;

use axum::extract::State;
use axum::http::StatusCode;
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::error::Answer;
use super::extract::{Named, PathName as _};
use super::http_headers::json;
use super::query::{NoQuery, Params};
use crate::store::Jobs;
use greybox::identification::JobId;

/// The jobs that are looked at.
const MOST_JOBS: u32 = 500;
/// Fewer jobs that took longer tell nothing.
const LEAST_LONGER: usize = 5;

/// How long a job may go on, by the jobs like it that succeeded: those of its project, model and method, the 500
/// newest. Half of those that took longer than the job has so far ended within `half_s`, nine in ten within
/// `nine_in_ten_s`.
#[derive(Serialize, ToSchema)]
pub struct TimeLeft {
    /// How long the job has taken so far `[s]`: 0 before its first slice, and all of its time where it has ended.
    elapsed_s: f64,
    /// How many jobs are like it.
    jobs: usize,
    /// How many of them took longer than the job has so far.
    longer: usize,
    /// Half of those ended within this time from now `[s]`; `null` where fewer than five took longer, or the
    /// job has ended.
    half_s: Option<f64>,
    /// Nine in ten of those ended within this time from now `[s]`; `null` where fewer than five took longer, or the
    /// job has ended.
    nine_in_ten_s: Option<f64>,
}

impl TimeLeft {
    /// By the times that jobs took from their first slice to their end, all in `[s]`.
    fn by(mut took_s: Vec<f64>, elapsed_s: f64) -> Self {
        let jobs = took_s.len();
        took_s.retain(|took| *took > elapsed_s);
        took_s.sort_unstable_by(f64::total_cmp);
        let longer = took_s.len();
        let share = |share: f64| {
            let place = (share * longer as f64).ceil() as usize;
            let took = took_s.get(place.saturating_sub(1))?;
            (longer >= LEAST_LONGER).then_some(took - elapsed_s)
        };
        Self {
            elapsed_s,
            jobs,
            longer,
            half_s: share(0.5),
            nine_in_ten_s: share(0.9),
        }
    }
}

/// Tell how long a job may go on.
#[utoipa::path(
    get, path = "/v1/jobs/{id}/time-left", operation_id = "show_time_left", tag = "jobs",
    params(("id" = JobId, Path, description = "The job")),
    responses((status = 200, description = "By how long jobs like it took", body = TimeLeft))
)]
pub async fn show(
    State(jobs): State<Jobs>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
) -> Answer {
    let row = jobs.summaries_of(&[id]).await?.pop();
    let row = row.ok_or_else(|| id.not_found())?;
    let end = row.finished_at.unwrap_or_else(Timestamp::now);
    let elapsed = row
        .started_at
        .map(|started_at| end.duration_since(started_at));
    let elapsed_s = elapsed.map_or(0.0, |elapsed| elapsed.as_secs_f64().max(0.0));
    let took = jobs.times_like(&row, MOST_JOBS).await?;
    let took_s = took.iter().map(Duration::as_secs_f64).collect();
    let mut left = TimeLeft::by(took_s, elapsed_s);
    if row.status.is_terminal() {
        (left.half_s, left.nine_in_ten_s) = (None, None);
    }
    Ok(json(StatusCode::OK, &left))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn jobs_that_ended_sooner_say_nothing_of_the_time_left() {
        let took: Vec<f64> = (1..=20).map(f64::from).collect();
        let left = TimeLeft::by(took.clone(), 10.0);
        assert_eq!((left.jobs, left.longer), (20, 10));
        assert_eq!((left.half_s, left.nine_in_ten_s), (Some(5.0), Some(9.0)));
        let left = TimeLeft::by(took, 16.5);
        assert_eq!((left.longer, left.half_s), (4, None));
        assert_eq!(TimeLeft::by(Vec::new(), 0.0).half_s, None);
    }
}
