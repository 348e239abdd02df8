//! Two thousand event streams of each server on running jobs, and readers that take a byte a second.

use std::net::SocketAddr;
use std::path::Path;
use std::time::{Duration, Instant};

use futures_util::future::join_all;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpSocket, TcpStream};
use tokio::task::JoinHandle;
use tokio_util::sync::CancellationToken;

use crate::Outcome;
use crate::client::{Connection, get};
use crate::figure::{Figure, Target, percentile_ms};
use crate::jobs::{MANY, endless_job, store_drive, submit};
use crate::observer::{Observer, Stored};
use crate::server::Server;

const STREAMS: usize = 2000;
const SLOW_READERS: usize = 20;
const JOBS: usize = 2;
const LENGTH: Duration = Duration::from_secs(10);
/// What was opened or resumed has come to rest after so long.
const SETTLING: Duration = Duration::from_secs(2);

/// How often the state of a job is asked for.
const LOOK: Duration = Duration::from_millis(20);

/// What a stream received: event ids and when.
type Received = Vec<(i64, Instant)>;

pub async fn measure(folder: &Path) -> Outcome<Vec<Figure>> {
    let servers = Server::start_all(folder).await?;
    let mut connection = servers[0].connect().await?;
    let dataset = store_drive(&mut connection, MANY).await?;
    let mut jobs = Vec::new();
    for seed in 0..JOBS {
        jobs.push(submit(&mut connection, &endless_job(&dataset, seed)).await?);
    }
    // The streams are opened while the jobs rest, so that what is added is theirs.
    control(&mut connection, &jobs, "pause", "paused").await?;
    let memory_before = memory_kib(&servers)?;
    let end = CancellationToken::new();
    let mut readers = Vec::new();
    let mut slow = Vec::new();
    for server in &servers {
        for number in 0..STREAMS {
            let job = jobs[number % JOBS].clone();
            let stream = open(server.address, &job, None).await?;
            readers.push((job, tokio::spawn(follow(stream, end.clone()))));
        }
        for number in 0..SLOW_READERS {
            let stream = open(server.address, &jobs[number % JOBS], Some(4096)).await?;
            slow.push(tokio::spawn(dawdle(stream, end.clone())));
        }
    }
    tokio::time::sleep(SETTLING).await;
    let memory = (memory_kib(&servers)? - memory_before) / (readers.len() + slow.len()) as f64;
    // One that was idle for long is closed.
    connection = servers[0].connect().await?;
    control(&mut connection, &jobs, "resume", "running").await?;
    tokio::time::sleep(SETTLING).await;
    let observer = Observer::start(folder);
    let generations = generation(&mut connection, &jobs).await?;
    let (begun, used_before) = (Instant::now(), cpu(&servers)?);
    tokio::time::sleep(LENGTH).await;
    let used = (cpu(&servers)? - used_before).as_secs_f64() / begun.elapsed().as_secs_f64();
    let generations = generation(&mut connection, &jobs).await? - generations;
    let memory_at_work = memory_kib(&servers)? / 1024.0;
    let stored = observer.finish()?;
    end.cancel();
    join_all(slow).await;
    let (mut delays, gaps) = delays(readers, &stored).await?;
    let mut figures = delivery(&mut delays, gaps);
    figures.extend([
        Figure::new("memory of a stream", memory, "KiB", Target::Below(20.0)),
        Figure::new(
            "memory of the servers with all streams and two jobs at work",
            memory_at_work,
            "MiB",
            Target::None,
        ),
        Figure::new("cores that the servers used", used, "", Target::None),
        Figure::new(
            "generations that the jobs went on",
            generations,
            "",
            Target::None,
        ),
    ]);
    Ok(figures)
}

/// Memory that the servers hold together.
fn memory_kib(servers: &[Server]) -> Outcome<f64> {
    servers.iter().map(Server::memory_kib).sum()
}

/// Processor time that the servers have used together.
fn cpu(servers: &[Server]) -> Outcome<Duration> {
    servers.iter().map(Server::cpu).sum()
}

/// How the events came.
fn delivery(delays: &mut [Duration], gaps: usize) -> Vec<Figure> {
    let rate = delays.len() as f64 / LENGTH.as_secs_f64();
    vec![
        Figure::new(
            "2000 streams of each server, event stored to received, p95",
            percentile_ms(delays, 0.95),
            "ms",
            Target::Below(150.0),
        ),
        Figure::new(
            "event stored to received, median",
            percentile_ms(delays, 0.5),
            "ms",
            Target::None,
        ),
        Figure::new(
            "event stored to received, longest",
            percentile_ms(delays, 1.0),
            "ms",
            Target::None,
        ),
        Figure::new("events delivered", rate, "/s", Target::None),
        Figure::new("gaps in any stream", gaps as f64, "", Target::Below(1.0)),
    ]
}

/// Asks for a change of the jobs and returns when all are in that state.
async fn control(
    connection: &mut Connection,
    jobs: &[String],
    verb: &str,
    status: &str,
) -> Outcome {
    for job in jobs {
        let path = format!("/v1/jobs/{job}/{verb}");
        connection.post(&path, "application/json", b"", 200).await?;
    }
    for job in jobs {
        while connection.get(&format!("/v1/jobs/{job}")).await?["status"] != status {
            tokio::time::sleep(LOOK).await;
        }
    }
    Ok(())
}

/// The generations that the jobs have behind them together.
async fn generation(connection: &mut Connection, jobs: &[String]) -> Outcome<f64> {
    let mut sum = 0.0;
    for job in jobs {
        let shown = connection.get(&format!("/v1/jobs/{job}")).await?;
        sum += shown["progress"]["generation"].as_f64().unwrap_or(0.0);
    }
    Ok(sum)
}

/// Opens a stream of a job's events, from the first; with a small window where one is given.
async fn open(address: SocketAddr, job: &str, window: Option<u32>) -> Outcome<TcpStream> {
    let socket = TcpSocket::new_v4()?;
    if let Some(bytes) = window {
        socket.set_recv_buffer_size(bytes)?;
    }
    let mut stream = socket.connect(address).await?;
    stream
        .write_all(&get(&format!("/v1/jobs/{job}/events"), ""))
        .await?;
    Ok(stream)
}

/// Reads all that comes and notes the ids of the events.
async fn follow(mut stream: TcpStream, end: CancellationToken) -> Received {
    let mut received = Received::new();
    let mut text = Vec::with_capacity(2048);
    loop {
        let read = tokio::select! {
            read = stream.read_buf(&mut text) => read.unwrap_or(0),
            () = end.cancelled() => 0,
        };
        if read == 0 {
            return received;
        }
        let now = Instant::now();
        let whole = text
            .iter()
            .rposition(|byte| *byte == b'\n')
            .map_or(0, |at| at + 1);
        let lines = text[..whole].split(|byte| *byte == b'\n');
        let ids = lines.filter_map(|line| {
            std::str::from_utf8(line.strip_prefix(b"id: ")?)
                .ok()?
                .parse()
                .ok()
        });
        received.extend(ids.map(|id: i64| (id, now)));
        text.drain(..whole);
    }
}

/// Reads a byte a second.
async fn dawdle(mut stream: TcpStream, end: CancellationToken) {
    let mut byte = [0];
    loop {
        tokio::select! {
            read = stream.read(&mut byte) => if read.unwrap_or(0) == 0 { return },
            () = end.cancelled() => return,
        }
        tokio::select! {
            () = tokio::time::sleep(Duration::from_secs(1)) => {}
            () = end.cancelled() => return,
        }
    }
}

/// How long after its storing each event reached each stream, and the gaps in the streams.
async fn delays(
    readers: Vec<(String, JoinHandle<Received>)>,
    stored: &Stored,
) -> Outcome<(Vec<Duration>, usize)> {
    let mut delays = Vec::new();
    let mut gaps = 0;
    for (job, reader) in readers {
        let received = reader.await?;
        let expected = (1..).zip(&received);
        gaps += expected.filter(|(id, (seen, _))| id != seen).count().min(1);
        gaps += usize::from(received.is_empty());
        for (id, at) in received {
            if let Some(since) = stored.get(&(job.clone(), id)) {
                delays.push(at.saturating_duration_since(*since));
            }
        }
    }
    Ok((delays, gaps))
}
