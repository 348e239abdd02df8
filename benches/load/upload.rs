//! A recording of 64 MiB of CSV: parsed on one core, and taken in over HTTP, where one of a quarter
//! as long shows how memory grows.

use std::fmt::Write;
use std::path::Path;
use std::time::Instant;

use greybox::Recording;

use crate::Outcome;
use crate::figure::{Figure, Target};
use crate::server::Server;

/// The largest recording that a server takes by default.
const LIMIT: usize = 64 << 20;
const RUNS: usize = 3;

pub async fn measure(folder: &Path) -> Outcome<Vec<Figure>> {
    let server = Server::start(folder, &[]).await?;
    let mut connection = server.connect().await?;
    let idle = server.memory_kib()?;
    let mut figures = Vec::new();
    for (name, limit) in [("16 MiB of CSV", LIMIT / 4), ("64 MiB of CSV", LIMIT)] {
        let text = recording(limit);
        server.forget_peak()?;
        let started = Instant::now();
        connection
            .post("/v1/datasets", "text/csv", text.as_bytes(), 201)
            .await?;
        let seconds = started.elapsed().as_secs_f64();
        let held = server.memory_kib()? - idle;
        let peak = server.peak_kib()? - idle;
        let figure = |what: &str, value, unit| {
            Figure::new(format!("{name}, {what}"), value, unit, Target::None)
        };
        figures.extend([
            figure("sent to stored", seconds, "s"),
            figure("whole way", megabytes(&text) / seconds, "MB/s"),
            figure("memory at its peak", peak / 1024.0, "MiB"),
            figure("memory kept after it", held / 1024.0, "MiB"),
        ]);
    }
    Ok(figures)
}

/// The parser alone; the shortest of several runs.
pub fn parse() -> Outcome<Vec<Figure>> {
    let text = recording(LIMIT);
    let mut shortest = f64::INFINITY;
    for _ in 0..RUNS {
        let started = Instant::now();
        Recording::from_csv(text.as_bytes())?;
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
fn recording(limit: usize) -> String {
    let mut text = String::with_capacity(limit);
    text += "time [s],reference [m],position [mm],pressure [bar]\n";
    let mut sample = 0_u32;
    while text.len() < limit - 100 {
        let phase = f64::from(sample) * 1e-3;
        let (reference, position) = (0.03 * phase.sin().signum(), 30.0 * phase.sin());
        let pressure = 70.0 + 5.0 * phase.cos();
        writeln!(text, "{phase:.3},{reference},{position:.6},{pressure:.4}")
            .expect("a string takes all");
        sample += 1;
    }
    text
}
