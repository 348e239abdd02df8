//! How soon a job is at work while nothing else is: one after the other, each asked for at the next server.

use std::path::Path;
use std::time::Duration;

use jiff::Timestamp;
use serde_json::Value;

use crate::Outcome;
use crate::figure::{Figure, Target, percentile_ms};
use crate::jobs::{FEW, small_job, store_drive, submit};
use crate::server::Server;

const JOBS: usize = 200;

pub async fn measure(folder: &Path) -> Outcome<Vec<Figure>> {
    let servers = Server::start_all(folder).await?;
    let mut clients = Vec::new();
    for server in &servers {
        clients.push(server.connect().await?);
    }
    let dataset = store_drive(&mut clients[0], FEW).await?;
    let mut waits = Vec::new();
    for number in 0..JOBS {
        let asked = number % servers.len();
        let client = &mut clients[asked];
        let id = submit(client, &small_job(&dataset, number)).await?;
        let path = format!("/v1/jobs/{id}?wait=60");
        let mut job = Value::Null;
        while job["finished_at"].is_null() {
            job = client.get(&path).await?;
        }
        waits.push(waited(&job)?);
    }
    let (median, p99) = (
        percentile_ms(&mut waits, 0.5),
        percentile_ms(&mut waits, 0.99),
    );
    Ok(vec![
        Figure::new(
            "submission to start, median",
            median,
            "ms",
            Target::Below(20.0),
        ),
        Figure::new("submission to start, p99", p99, "ms", Target::None),
    ])
}

/// From a job's submission to its start, by the clock that all share.
fn waited(job: &Value) -> Outcome<Duration> {
    let at =
        |name: &str| -> Outcome<Timestamp> { Ok(job[name].as_str().ok_or("no instant")?.parse()?) };
    let waited = at("started_at")?.duration_since(at("created_at")?);
    Ok(Duration::try_from(waited)?)
}
