//! The recording and the jobs that the load is made of.

use std::fmt::Write;

use serde_json::{Value, json};

use crate::Outcome;
use crate::client::Connection;

/// Samples of a recording that is worked in milliseconds.
pub const FEW: u32 = 400;
/// Samples of one that a generation takes milliseconds for.
pub const MANY: u32 = 40_000;

/// A drive of 100 kg with 200 N·s/m of friction, pushed by ±50 N that turn every half second:
/// so many samples at 100 Hz, integrated exactly between them.
pub fn drive_csv(samples: u32) -> String {
    const MASS: f64 = 100.0;
    const FRICTION: f64 = 200.0;
    const SAMPLE_TIME: f64 = 0.01;
    let decay = (-FRICTION / MASS * SAMPLE_TIME).exp();
    let (mut position, mut velocity) = (0.0, 0.0);
    let mut text = String::from("time [s],force [N],position [m]\n");
    for k in 0..samples {
        let force = if (k / 50) % 2 == 0 { 50.0 } else { -50.0 };
        let time = f64::from(k) * SAMPLE_TIME;
        writeln!(text, "{time:.2},{force},{position}").expect("a string takes all");
        let terminal = force / FRICTION;
        position +=
            terminal * SAMPLE_TIME + (velocity - terminal) * (1.0 - decay) * MASS / FRICTION;
        velocity = terminal + (velocity - terminal) * decay;
    }
    text
}

/// A job of a few milliseconds where the recording has [`FEW`] samples.
pub fn small_job(dataset: &str, seed: usize) -> Value {
    json!({
        "model": "positioning_drive",
        "experiments": [{"dataset": dataset, "initial_state": {"position": 0, "velocity": 0}}],
        "parameters": {
            "mass": {"estimate": {"lower": 10, "upper": 1000}},
            "viscous_friction": {"estimate": {"lower": 1, "upper": 2000}},
            "coulomb_friction": {"value": 0},
            "offset": {"value": 0}
        },
        "method": {"population": 10, "generations": 5},
        "seed": seed
    })
}

/// A job that works until it is stopped.
pub fn endless_job(dataset: &str, seed: usize) -> Value {
    let mut job = small_job(dataset, seed);
    job["method"] = json!({"population": 10, "generations": 1_000_000,
                           "stagnation_generations": 0, "hill_climbing_interval": 0});
    job
}

/// Stores a recording of a drive and says its identifier.
pub async fn store_drive(connection: &mut Connection, samples: u32) -> Outcome<String> {
    let stored = connection
        .post(
            "/v1/datasets",
            "text/csv",
            drive_csv(samples).as_bytes(),
            201,
        )
        .await?;
    identifier(&stored)
}

/// Submits a job and says its identifier.
pub async fn submit(connection: &mut Connection, job: &Value) -> Outcome<String> {
    let body = job.to_string();
    let accepted = connection
        .post("/v1/jobs", "application/json", body.as_bytes(), 202)
        .await?;
    identifier(&accepted)
}

fn identifier(answer: &Value) -> Outcome<String> {
    Ok(answer["id"].as_str().ok_or("no identifier")?.to_owned())
}
