//! Reading the status of jobs, whole and where the client has it already.

use std::path::Path;
use std::time::{Duration, Instant};

use futures_util::future::try_join_all;

use crate::Outcome;
use crate::client::{Connection, get};
use crate::figure::{Figure, Target, percentile_ms};
use crate::jobs::{FEW, small_job, store_drive, submit};
use crate::server::Server;

const CONNECTIONS: usize = 64;
const JOBS: usize = 200;
const LENGTH: Duration = Duration::from_secs(5);

pub async fn measure(folder: &Path) -> Outcome<Vec<Figure>> {
    let server = Server::start(folder, &[]).await?;
    let mut connection = server.connect().await?;
    let dataset = store_drive(&mut connection, FEW).await?;
    let mut whole = Vec::new();
    let mut known = Vec::new();
    for seed in 0..JOBS {
        let id = submit(&mut connection, &small_job(&dataset, seed)).await?;
        let path = format!("/v1/jobs/{id}");
        let ended = connection.get(&format!("{path}?wait=60")).await?;
        if ended["status"] == "running" {
            connection.get(&format!("{path}?wait=60")).await?;
        }
        whole.push(get(&path, ""));
        let answer = connection.ask(&get(&path, "")).await?;
        let tag = answer.header("etag").ok_or("no etag")?;
        known.push(get(&path, &format!("if-none-match: {tag}\r\n")));
    }
    let (rate, p99) = read(&server, &whole, 200).await?;
    let (rate_known, p99_known) = read(&server, &known, 304).await?;
    Ok(vec![
        Figure::new("status reads", rate, "/s", Target::AtLeast(15_000.0)),
        Figure::new("status read, p99", p99, "ms", Target::None),
        Figure::new(
            "status reads answered 304",
            rate_known,
            "/s",
            Target::AtLeast(25_000.0),
        ),
        Figure::new(
            "status read answered 304, p99",
            p99_known,
            "ms",
            Target::None,
        ),
    ])
}

/// Reads on all connections at once; says how many a second and the 99th percentile of the wait.
async fn read(server: &Server, requests: &[Vec<u8>], status: u16) -> Outcome<(f64, f64)> {
    let mut clients = Vec::new();
    for number in 0..CONNECTIONS {
        clients.push((number, server.connect().await?));
    }
    let started = Instant::now();
    let readers = clients.into_iter().map(|(number, connection)| {
        read_until(started + LENGTH, connection, requests, (number, status))
    });
    let mut waits: Vec<Duration> = try_join_all(readers).await?.into_iter().flatten().collect();
    let rate = waits.len() as f64 / started.elapsed().as_secs_f64();
    Ok((rate, percentile_ms(&mut waits, 0.99)))
}

async fn read_until(
    end: Instant,
    mut connection: Connection,
    requests: &[Vec<u8>],
    (number, status): (usize, u16),
) -> Outcome<Vec<Duration>> {
    let mut waits = Vec::new();
    for request in requests.iter().cycle().skip(number) {
        let asked = Instant::now();
        if asked >= end {
            break;
        }
        let answer = connection.ask(request).await?;
        if answer.status != status {
            return Err(format!("{} instead of {status}", answer.status).into());
        }
        waits.push(asked.elapsed());
    }
    Ok(waits)
}
