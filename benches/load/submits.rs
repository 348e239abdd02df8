//! Durable submissions: each is answered after its transaction is on disk. The workers work the
//! jobs meanwhile, as they do in earnest.

use std::path::Path;
use std::time::{Duration, Instant};

use futures_util::future::try_join_all;

use crate::Outcome;
use crate::client::{Connection, post};
use crate::figure::{Figure, Target, percentile_ms};
use crate::jobs::{FEW, small_job, store_drive};
use crate::server::Server;

const CONNECTIONS: usize = 64;
const LENGTH: Duration = Duration::from_secs(8);

pub async fn measure(folder: &Path) -> Outcome<Vec<Figure>> {
    let servers = Server::start_all(folder).await?;
    let first = &servers[0];
    let dataset = store_drive(&mut first.connect().await?, FEW).await?;
    let mut clients = Vec::new();
    for (number, server) in (0..CONNECTIONS).zip(servers.iter().cycle()) {
        clients.push((number, server.connect().await?));
    }
    let started = Instant::now();
    let submitted = clients
        .into_iter()
        .map(|(number, connection)| submit_until(started + LENGTH, connection, &dataset, number));
    let answered = try_join_all(submitted).await?;
    let elapsed = started.elapsed();
    let mut waits: Vec<Duration> = answered.into_iter().flatten().collect();
    let rate = waits.len() as f64 / elapsed.as_secs_f64();
    let (median, p99) = (
        percentile_ms(&mut waits, 0.5),
        percentile_ms(&mut waits, 0.99),
    );
    let ended = ended_jobs(&mut first.connect().await?).await?;
    let worked = ended / elapsed.as_secs_f64();
    Ok(vec![
        Figure::new(
            "submits, 64 connections",
            rate,
            "/s",
            Target::AtLeast(2000.0),
        ),
        Figure::new("submit, median", median, "ms", Target::None),
        Figure::new("submit, p99", p99, "ms", Target::Below(60.0)),
        Figure::new("jobs worked meanwhile", worked, "/s", Target::None),
    ])
}

/// Submits one job after the other and says how long each answer took.
async fn submit_until(
    end: Instant,
    mut connection: Connection,
    dataset: &str,
    number: usize,
) -> Outcome<Vec<Duration>> {
    let mut waits = Vec::new();
    while Instant::now() < end {
        let seed = number + CONNECTIONS * waits.len();
        let body = small_job(dataset, seed).to_string();
        let request = post("/v1/jobs", "application/json", body.as_bytes());
        let asked = Instant::now();
        let answer = connection.ask(&request).await?;
        if answer.status != 202 {
            return answer.json(202).map(|_| waits);
        }
        waits.push(asked.elapsed());
    }
    Ok(waits)
}

/// How many jobs have succeeded, by the server's own count.
pub async fn ended_jobs(connection: &mut Connection) -> Outcome<f64> {
    let metrics = connection.ask(&crate::client::get("/metrics", "")).await?;
    let text = std::str::from_utf8(metrics.body)?;
    let line = text
        .lines()
        .find(|line| line.starts_with("greybox_jobs{") && line.contains("\"succeeded\""));
    let count = line.and_then(|line| line.rsplit(' ').next());
    Ok(count.map_or(Ok(0.0), str::parse)?)
}
