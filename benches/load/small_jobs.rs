//! A thousand small jobs queued at once: what the service adds to the work of each.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use futures_util::future::try_join_all;
use greybox::Recording;
use greybox::identification::JobId;
use greybox::model::Catalogue;
use greybox_service::job::{JobTask, Status};
use greybox_service::store::JobRow;
use greybox_service::worker::method::Methods;
use greybox_service::worker::run::{Advance, Assignment, Method};
use jiff::Timestamp;

use crate::Outcome;
use crate::client::Connection;
use crate::figure::{Figure, Target};
use crate::jobs::{FEW, drive_csv, small_job, store_drive, submit};
use crate::server::Server;
use crate::submits::ended_jobs;

const JOBS: usize = 1000;
const CONNECTIONS: usize = 20;
/// How often the count of the ended jobs is asked for.
const LOOK: Duration = Duration::from_millis(20);

pub async fn measure(folder: &Path) -> Outcome<Vec<Figure>> {
    let server = Server::start(folder, &[]).await?;
    let mut connection = server.connect().await?;
    let dataset = store_drive(&mut connection, FEW).await?;
    let started = Instant::now();
    let mut clients = Vec::new();
    for number in 0..CONNECTIONS {
        let mut client = server.connect().await?;
        let dataset = &dataset;
        clients.push(async move {
            for seed in (number..JOBS).step_by(CONNECTIONS) {
                submit(&mut client, &small_job(dataset, seed)).await?;
            }
            Outcome::Ok(())
        });
    }
    try_join_all(clients).await?;
    let queued = started.elapsed();
    wait_for(&mut connection, JOBS).await?;
    let through = started.elapsed();
    let task = task_of_a_job(&mut connection).await?;
    drop(server);
    let work = tokio::task::spawn_blocking(move || work_alone(&task)).await?;
    let per_job = |time: Duration| 1e3 * time.as_secs_f64() / JOBS as f64;
    Ok(vec![
        Figure::new(
            "1000 small jobs, all accepted",
            queued.as_secs_f64(),
            "s",
            Target::None,
        ),
        Figure::new(
            "1000 small jobs, all ended",
            through.as_secs_f64(),
            "s",
            Target::None,
        ),
        Figure::new(
            "small job in the service",
            per_job(through),
            "ms",
            Target::None,
        ),
        Figure::new("its work alone", per_job(work), "ms", Target::None),
        Figure::new(
            "what the service adds to a small job, submission included",
            per_job(through) - per_job(work),
            "ms",
            Target::None,
        ),
    ])
}

/// Returns when so many jobs have succeeded.
pub async fn wait_for(connection: &mut Connection, jobs: usize) -> Outcome {
    while ended_jobs(connection).await? < jobs as f64 {
        tokio::time::sleep(LOOK).await;
    }
    Ok(())
}

/// The task of one of the jobs.
async fn task_of_a_job(connection: &mut Connection) -> Outcome<JobTask> {
    let page = connection.get("/v1/jobs?limit=1").await?;
    Ok(JobTask::read(&page["items"][0]["spec"].to_string())?)
}

/// Works the same jobs, as many at once as the server does, without a service.
fn work_alone(task: &JobTask) -> Duration {
    let method = Methods::new(Catalogue::built_in());
    let next = AtomicUsize::new(0);
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let started = Instant::now();
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| work_until_none_is_left(&method, task, &next));
        }
    });
    started.elapsed()
}

fn work_until_none_is_left(method: &Methods, task: &JobTask, next: &AtomicUsize) {
    while next.fetch_add(1, Ordering::Relaxed) < JOBS {
        work_one(method, task.clone());
    }
}

fn work_one(method: &Methods, task: JobTask) {
    let recording = Recording::from_csv(drive_csv(FEW).as_bytes());
    let assignment = Assignment {
        job: row(task),
        model: None,
        datasets: vec![(String::new(), recording.expect("a recording").into())],
        checkpoint: None,
        past: None,
        stream: None,
    };
    let mut run = method.begin(assignment).expect("a run");
    let stop = AtomicBool::new(false);
    while run.advance(&stop, &mut |_row| ()) == Advance::Working {}
    run.outcome(None, &stop).expect("an outcome");
}

/// A job as the store hands it to a worker.
fn row(task: JobTask) -> JobRow {
    JobRow {
        project: Default::default(),
        id: JobId::new(),
        name: None,
        labels: Default::default(),
        model: "positioning_drive".to_owned(),
        task,
        status: Status::Running,
        stop_request: None,
        progress: None,
        attempt: 1,
        error: None,
        created_at: Timestamp::now(),
        started_at: None,
        finished_at: None,
        last_event: 1,
        revision: 1,
    }
}
