//! A server that starts on a database of thousands of jobs, and one that has nothing to do.

use std::path::Path;
use std::time::{Duration, Instant};

use crate::Outcome;
use crate::figure::{Figure, Target};
use crate::jobs::{FEW, small_job, store_drive, submit};
use crate::server::Server;

const JOBS: usize = 1000;
const STARTS: usize = 5;
/// What a start leaves behind has ended after so long.
const SETTLING: Duration = Duration::from_secs(3);
const IDLE: Duration = Duration::from_secs(20);

pub async fn measure(folder: &Path) -> Outcome<Vec<Figure>> {
    fill(folder).await?;
    let mut ready = Vec::new();
    for _ in 0..STARTS {
        ready.push(Server::start(folder, &[]).await?.ready_after);
    }
    let slowest = ready.iter().max().copied().unwrap_or_default();
    let server = Server::start(folder, &[]).await?;
    tokio::time::sleep(SETTLING).await;
    let (begun, cpu) = (Instant::now(), server.cpu()?);
    tokio::time::sleep(IDLE).await;
    let share = (server.cpu()? - cpu).as_secs_f64() / begun.elapsed().as_secs_f64();
    let memory = server.memory_kib()? / 1024.0;
    Ok(vec![
        Figure::new(
            format!("ready on a database of {JOBS} jobs, slowest of {STARTS} starts"),
            slowest.as_secs_f64() * 1e3,
            "ms",
            Target::Below(300.0),
        ),
        Figure::new(
            "idle, share of a core",
            1e2 * share,
            "%",
            Target::Below(1.0),
        ),
        Figure::new("idle, memory", memory, "MiB", Target::Below(60.0)),
    ])
}

/// Works a thousand jobs, so that the database is one that was in use.
async fn fill(folder: &Path) -> Outcome {
    let server = Server::start(folder, &[]).await?;
    let mut connection = server.connect().await?;
    let dataset = store_drive(&mut connection, FEW).await?;
    for seed in 0..JOBS {
        submit(&mut connection, &small_job(&dataset, seed)).await?;
    }
    crate::small_jobs::wait_for(&mut connection, JOBS).await
}
