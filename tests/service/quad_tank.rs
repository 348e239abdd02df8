//! A quadruple tank whose outlet opens while it is watched: the plant of the tutorial of
//! LowLevelParticleFilters.jl (F. Bagge Carlson), generated anew. Tank 1's outlet has 0.03 cm² and from
//! 500 s on 0.06 cm².

use serde_json::{Value, json};

use super::app::TestApp;

/// Samples in a window, one a second.
const SAMPLES: usize = 100;
/// When the outlet opens [s].
const OPENS: usize = 500;
/// The standard deviation of the noise of a level [cm].
const NOISE: f64 = 0.01;

/// Outflow of a level through an outlet, over the tank's area.
fn outflow(outlet: f64, level: f64) -> f64 {
    outlet / 4.9 * (2.0 * 9.81 * level.max(0.0) + 1e-3).sqrt()
}

fn derivatives(levels: [f64; 4], [u1, u2]: [f64; 2], outlet: f64) -> [f64; 4] {
    const GAIN: f64 = 1.6 / 4.9;
    const SPLIT: f64 = 0.2;
    let out = levels.map(|level| outflow(0.03, level));
    [
        -outflow(outlet, levels[0]) + out[2] + SPLIT * GAIN * u1,
        -out[1] + out[3] + SPLIT * GAIN * u2,
        -out[2] + (1.0 - SPLIT) * GAIN * u2,
        -out[3] + (1.0 - SPLIT) * GAIN * u1,
    ]
}

/// The pumps: square waves of 200 s, a quarter of a period apart.
fn pumps(second: usize) -> [f64; 2] {
    let high = |shift: usize| {
        if ((second + shift) / 100).is_multiple_of(2) {
            0.5
        } else {
            0.0
        }
    };
    [high(0), high(50)]
}

/// The recording, as batches of a window each.
fn batches(windows: usize) -> Vec<Value> {
    let mut levels = [2.0, 2.0, 3.0, 3.0];
    let mut random = 7_u64;
    let mut noise = || {
        let sum: f64 = (0..12)
            .map(|_| {
                random ^= random << 13;
                random ^= random >> 7;
                random ^= random << 17;
                (random >> 11) as f64 / (1_u64 << 53) as f64
            })
            .sum();
        NOISE * (sum - 6.0)
    };
    let start: jiff::Timestamp = "2026-03-02T08:00:00Z".parse().unwrap();
    let batch = |window: usize| {
        let mut columns: [Vec<f64>; 4] = Default::default();
        for second in window * SAMPLES..(window + 1) * SAMPLES {
            let input = pumps(second);
            let row = [input[0], input[1], levels[0] + noise(), levels[1] + noise()];
            columns
                .iter_mut()
                .zip(row)
                .for_each(|(column, value)| column.push(value));
            let outlet = if second < OPENS { 0.03 } else { 0.06 };
            for _ in 0..20 {
                let slope = derivatives(levels, input, outlet);
                levels
                    .iter_mut()
                    .zip(slope)
                    .for_each(|(level, slope)| *level += 0.05 * slope);
            }
        }
        let [u1, u2, h1, h2] = columns;
        let begin = jiff::SignedDuration::from_secs((window * SAMPLES) as i64);
        json!({"start": start + begin, "sample_time_s": 1,
               "signals": {"u1": {"values": u1}, "u2": {"values": u2},
                           "y1": {"values": h1}, "y2": {"values": h2}}})
    };
    (0..windows).map(batch).collect()
}

fn monitor() -> Value {
    let flow =
        |level: &str, outlet: &str| format!("{outlet}/4.9*sqrt(19.62*max({level}, 0) + 0.001)");
    let [o1, o2] = [flow("h1", "outlet"), flow("h2", "0.03")];
    let [o3, o4] = [flow("h3", "0.03"), flow("h4", "0.03")];
    let free = json!({"estimate": {"lower": 0, "upper": 10}});
    json!({
        "stream": "tanks",
        "window": {"length_s": SAMPLES},
        "job": {
            "model": {
                "name": "tanks",
                "inputs": {"u1": {"unit": ""}, "u2": {"unit": ""}},
                "parameters": {
                    "outlet": {"symbol": "a", "unit": "", "default": 0.03, "lower": 0.005,
                               "upper": 0.2, "scale": "log", "unknown": true}
                },
                "states": {
                    "h1": {"unit": "", "derivative": format!("-{o1} + {o3} + 0.2*1.6/4.9*u1"), "initial": 2},
                    "h2": {"unit": "", "derivative": format!("-{o2} + {o4} + 0.2*1.6/4.9*u2"), "initial": 2},
                    "h3": {"unit": "", "derivative": format!("-{o3} + 0.8*1.6/4.9*u2"), "initial": 3},
                    "h4": {"unit": "", "derivative": format!("-{o4} + 0.8*1.6/4.9*u1"), "initial": 3}
                },
                "outputs": {"y1": {"unit": "", "expression": "h1"},
                            "y2": {"unit": "", "expression": "h2"}}
            },
            "experiments": [{"initial_state": {"h1": free, "h2": free, "h3": free, "h4": free}}],
            "outputs": {"y1": {"noise_std": NOISE}, "y2": {"noise_std": NOISE}},
            "method": {"population": 12, "generations": 20}
        }
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn an_outlet_that_opens_is_found_and_dated_within_two_windows() {
    const WINDOWS: usize = 9;
    let app = TestApp::start().await;
    for batch in batches(WINDOWS + 1) {
        let told = app.post_json("/v1/streams/tanks", &batch).await;
        assert!(told.status.is_success(), "{}", told.text);
    }
    let made = app
        .post_json("/v1/monitors", &monitor())
        .await
        .expect(201)
        .json();
    let id = made["id"].as_str().unwrap();
    let path = format!("/v1/monitors/{id}/events");
    let mut events = app
        .request(reqwest::Method::GET, &path)
        .send()
        .await
        .unwrap();
    let mut told = String::new();
    let is_told = |told: &str| {
        let events = told
            .split("\n\n")
            .filter(|event| event.contains("event: window"));
        let data = events.filter_map(|event| event.split_once("data: "));
        let mut windows = data.filter_map(|(_, data)| serde_json::from_str::<Value>(data).ok());
        windows.any(|w| w["number"] == WINDOWS as u64 - 1 && w["status"] == "estimated")
    };
    while !is_told(&told) {
        let chunk = events.chunk().await.unwrap().expect("the stream goes on");
        told += std::str::from_utf8(&chunk).unwrap();
    }
    let alarms = app
        .get(&format!("/v1/monitors/{id}/alarms"))
        .await
        .expect(200)
        .json();
    let alarms = alarms["items"].as_array().unwrap().iter();
    let changes: Vec<&Value> = alarms.filter(|alarm| alarm["kind"] == "change").collect();
    let first = changes
        .last()
        .unwrap_or_else(|| panic!("no change: {told}"));
    let opens = (OPENS / SAMPLES) as u64;
    assert!(
        (opens..=opens + 2).contains(&first["window"].as_u64().unwrap()),
        "{first}"
    );
    let since = first["change"]["since_window"].as_u64().unwrap();
    assert!(since.abs_diff(opens) <= 1, "{first}");
    let side = |side: &str| first["change"][side].as_f64().unwrap();
    assert!((side("before") / 0.03 - 1.0).abs() < 0.1, "{first}");
    assert!((side("after") / 0.06 - 1.0).abs() < 0.1, "{first}");
    drop(events);
    app.shutdown().await;
}
