//! A recording of 64 MiB of CSV: parsed on one core, and taken in over HTTP.

use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use greybox::dataset::csv;

use crate::Outcome;
use crate::figure::{Figure, Target};
use crate::server::Server;

/// The largest recording that a server takes by default.
const LIMIT: usize = 64 << 20;
const RUNS: usize = 3;

pub async fn measure(folder: &Path) -> Outcome<Vec<Figure>> {
    let text = recording();
    let server = Server::start(folder, &[]).await?;
    let mut connection = server.connect().await?;
    let idle = server.memory_kib()?;
    server.forget_peak()?;
    let started = Instant::now();
    connection
        .post("/v1/datasets", "text/csv", text.as_bytes(), 201)
        .await?;
    let seconds = started.elapsed().as_secs_f64();
    let held = server.memory_kib()? - idle;
    let peak = server.peak_kib()? - idle;
    Ok(vec![
        Figure::new("64 MiB of CSV, sent to stored", seconds, "s", Target::None),
        Figure::new(
            "upload, whole way",
            megabytes(&text) / seconds,
            "MB/s",
            Target::None,
        ),
        Figure::new(
            "upload, memory at its peak",
            peak / 1024.0,
            "MiB",
            Target::None,
        ),
        Figure::new(
            "upload, memory kept after it",
            held / 1024.0,
            "MiB",
            Target::None,
        ),
    ])
}

/// The parser alone; the shortest of several runs.
pub fn parse() -> Outcome<Vec<Figure>> {
    let text = recording();
    let mut shortest = f64::INFINITY;
    for _ in 0..RUNS {
        let started = Instant::now();
        csv::read(text.as_bytes(), &csv::Options::default())?;
        shortest = shortest.min(started.elapsed().as_secs_f64());
    }
    let rate = megabytes(&text) / shortest;
    Ok(vec![Figure::new(
        "64 MiB of CSV, parsed",
        rate,
        "MB/s",
        Target::AtLeast(100.0),
    )])
}

fn megabytes(text: &str) -> f64 {
    text.len() as f64 / 1e6
}

/// Just less than the limit: a time column and three signals.
fn recording() -> String {
    let mut text = String::with_capacity(LIMIT);
    text += "time [s],reference [m],position [mm],pressure [bar]\n";
    let mut sample = 0_u32;
    while text.len() < LIMIT - 100 {
        let phase = f64::from(sample) * 1e-3;
        let (reference, position) = (0.03 * phase.sin().signum(), 30.0 * phase.sin());
        let pressure = 70.0 + 5.0 * phase.cos();
        writeln!(text, "{phase:.3},{reference},{position:.6},{pressure:.4}")
            .expect("a string takes all");
        sample += 1;
    }
    text
}
