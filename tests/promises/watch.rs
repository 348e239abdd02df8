//! A monitor whose server is killed fifty times: no window is lost, and none is worked twice.

use std::path::Path;
use std::time::{Duration, Instant};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

use super::server::{Options, PATIENCE, Server, answer, text};

const KILLS: usize = 50;
const WINDOWS: usize = 40;
const SAMPLES: usize = 100;
const SAMPLE_TIME: f64 = 0.1;

const OPTIONS: Options = Options::new(2, 0.05);

/// The samples of a window: a lag of 1 s and of the gain 2, under a square wave.
fn window(number: usize, random: &mut ChaCha8Rng) -> Value {
    let decay = f64::exp(-SAMPLE_TIME);
    // Each window begins where the one before ended; that of a settled square wave is the same.
    let mut output = -2.0 * (1.0 - f64::exp(-2.5)) / (1.0 + f64::exp(-2.5));
    let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
    for k in 0..SAMPLES {
        let input = if (k / 25) % 2 == 0 { 1.0 } else { -1.0 };
        inputs.push(input);
        outputs.push(output + 0.05 * (random.random::<f64>() - 0.5));
        output = 2.0 * input + (output - 2.0 * input) * decay;
    }
    let start: jiff::Timestamp = "2026-03-02T08:00:00Z".parse().expect("an instant");
    let begin = (number * SAMPLES) as f64 * SAMPLE_TIME;
    json!({"start": start + jiff::SignedDuration::from_secs_f64(begin),
           "sample_time_s": SAMPLE_TIME,
           "signals": {"u": {"unit": "V", "values": inputs}, "y": {"unit": "V", "values": outputs}}})
}

fn monitor() -> Value {
    json!({
        "stream": "lag",
        "window": {"length_s": SAMPLES as f64 * SAMPLE_TIME},
        "job": {
            "model": {
                "name": "lag",
                "inputs": {"u": {"unit": "V"}},
                "parameters": {
                    "time": {"symbol": "T", "unit": "s", "default": 1, "lower": 0.1, "upper": 10,
                             "scale": "log", "unknown": true},
                    "gain": {"symbol": "K", "unit": "", "default": 1, "lower": 0.1, "upper": 10,
                             "unknown": true}
                },
                "states": {"x": {"unit": "V", "derivative": "(gain*u - x)/time", "initial": 0}},
                "outputs": {"y": {"unit": "V", "expression": "x"}}
            },
            "experiments": [{"initial_state": {"x": {"estimate": {"lower": -5, "upper": 5}}}}],
            "outputs": {"y": {"noise_std": 0.0144}},
            "method": {"population": 10, "generations": 10}
        }
    })
}

/// Sends the windows that have not come, until the server dies; says how many have come.
async fn send(server: &Server, windows: &[Value], from: usize) -> usize {
    for (number, window) in windows.iter().enumerate().skip(from) {
        let request = server
            .post("/v1/streams/lag")
            .header("idempotency-key", format!("window {number}"))
            .json(window);
        match answer(request).await {
            Ok((status, body)) => assert!(status.is_success(), "{body}"),
            Err(_) => return number,
        }
    }
    windows.len()
}

/// Has a server live for a moment, with samples that come all the while.
async fn live(folder: &Path, windows: &[Value], sent: usize, moment: Duration) -> usize {
    let server = Server::start(folder, OPTIONS);
    let sending = tokio::time::timeout(moment, send(&server, windows, sent)).await;
    if sending.is_ok() {
        tokio::time::sleep(moment).await;
    }
    server.kill();
    sending.unwrap_or(sent)
}

async fn all_windows(server: &Server, monitor: &str) -> Vec<Value> {
    let path = format!("/v1/monitors/{monitor}/windows?limit=500");
    let page = server.show(&path).await;
    page["items"].as_array().expect("windows").clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn no_window_is_lost_or_worked_twice_over_fifty_kills() {
    let mut random = ChaCha8Rng::seed_from_u64(17);
    let windows: Vec<Value> = (0..=WINDOWS).map(|k| window(k, &mut random)).collect();
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), OPTIONS);
    let mut sent = send(&server, &windows[..1], 0).await;
    let request = server.post("/v1/monitors").json(&monitor());
    let (status, made) = answer(request).await.expect("an answer");
    assert_eq!(status, 201, "{made}");
    let id = text(&made["id"]);
    server.kill();
    for life in 0..KILLS {
        // Samples come over all lives.
        let due = (life + 1) * windows.len() / KILLS;
        let moment = Duration::from_millis(random.random_range(20..300));
        sent = sent.max(live(folder.path(), &windows[..due.max(1)], sent, moment).await);
    }
    let server = Server::start(folder.path(), OPTIONS);
    assert_eq!(send(&server, &windows, 0).await, windows.len());
    let asked = Instant::now();
    let ended = loop {
        let all = all_windows(&server, &id).await;
        let ended = all.iter().filter(|window| window["status"] == "estimated");
        if ended.count() == WINDOWS {
            break all;
        }
        assert!(asked.elapsed() < PATIENCE, "{} windows", all.len());
        tokio::time::sleep(Duration::from_millis(100)).await;
    };
    let numbers = ended.iter().rev().map(|window| window["number"].as_u64());
    assert!(
        numbers.eq((0..WINDOWS as u64).map(Some)),
        "each once, in order"
    );

    // A job for each window and no more; each recording has the samples of its window.
    let jobs = server
        .show(&format!("/v1/jobs?limit=500&label=monitor:{id}"))
        .await;
    assert_eq!(jobs["items"].as_array().expect("jobs").len(), WINDOWS);
    for window in &ended {
        let dataset = server
            .show(&format!("/v1/datasets/{}", text(&window["dataset"])))
            .await;
        assert_eq!(dataset["samples"], SAMPLES, "{dataset}");
        assert_eq!(dataset["start"], window["from"]);
    }
    let stream = server.show("/v1/streams/lag").await;
    assert_eq!(stream["samples"], SAMPLES * windows.len());
}
