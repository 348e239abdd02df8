//! Streams that are watched.

use serde_json::{Value, json};

use super::app::{Answer, TestApp};

/// Samples in a window, and the time between two [s].
const SAMPLES: usize = 200;
const SAMPLE_TIME: f64 = 0.1;
const LENGTH_S: f64 = SAMPLES as f64 * SAMPLE_TIME;
/// The standard deviation of the noise [V].
const NOISE: f64 = 0.02;

/// A lag of first order under a square wave, window after window.
pub(super) struct Plant {
    output: f64,
    random: u64,
}

impl Plant {
    pub(super) fn new() -> Self {
        Self {
            output: 0.0,
            random: 1,
        }
    }

    /// Noise of deviation one: twelve uniform numbers (xorshift) less six.
    fn noise(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.random ^= self.random << 13;
            self.random ^= self.random >> 7;
            self.random ^= self.random << 17;
            sum += (self.random >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }

    /// A window, as a batch: of this gain, and with an input of this size.
    pub(super) fn window(&mut self, number: usize, gain: f64, size: f64) -> Value {
        let decay = f64::exp(-SAMPLE_TIME / 1.5);
        let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
        for k in 0..SAMPLES {
            let input = if (k / 35) % 2 == 0 { size } else { -size };
            inputs.push(input);
            outputs.push(self.output + NOISE * self.noise());
            self.output = gain * input + (self.output - gain * input) * decay;
        }
        let start: jiff::Timestamp = "2026-03-02T08:00:00Z".parse().unwrap();
        let begin = jiff::SignedDuration::from_secs_f64(number as f64 * LENGTH_S);
        json!({"start": start + begin, "sample_time_s": SAMPLE_TIME,
               "signals": {"u": {"unit": "V", "values": inputs},
                           "y": {"unit": "V", "values": outputs}}})
    }
}

pub(super) fn monitor() -> Value {
    json!({
        "name": "a lag",
        "stream": "lag",
        "window": {"length_s": LENGTH_S},
        "alarms": {"false_alarm_rate": 0.001},
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
            "outputs": {"y": {"noise_std": NOISE}},
            "method": {"population": 12, "generations": 12}
        }
    })
}

/// The events of a monitor, as they come.
pub(super) struct Events {
    response: reqwest::Response,
    text: String,
}

/// An event of a stream; nothing for a comment.
fn parsed(block: &str) -> Option<(u64, String, Value)> {
    let field = |name: &str| block.lines().find_map(|line| line.strip_prefix(name));
    let id = field("id:")?.trim().parse().unwrap();
    let data = serde_json::from_str(field("data:")?).unwrap();
    Some((id, field("event:")?.trim().to_owned(), data))
}

impl Events {
    pub(super) async fn of(app: &TestApp, id: &str) -> Self {
        let path = format!("/v1/monitors/{id}/events");
        let response = app
            .request(reqwest::Method::GET, &path)
            .send()
            .await
            .unwrap();
        assert_eq!(response.status(), 200);
        Self {
            response,
            text: String::new(),
        }
    }

    /// The first event that has come whole.
    fn arrived(&mut self) -> Option<(u64, String, Value)> {
        while let Some((block, rest)) = self.text.split_once("\n\n") {
            let (event, rest) = (parsed(block), rest.to_owned());
            self.text = rest;
            if event.is_some() {
                return event;
            }
        }
        None
    }

    /// The next event: its id, its name and its data.
    async fn next(&mut self) -> (u64, String, Value) {
        loop {
            if let Some(event) = self.arrived() {
                return event;
            }
            let chunk = self.response.chunk().await.unwrap();
            let chunk = chunk.expect("the stream goes on");
            self.text += std::str::from_utf8(&chunk).unwrap();
        }
    }

    /// Everything up to the end of a window.
    pub(super) async fn until_window(&mut self, number: u64) -> Vec<(u64, String, Value)> {
        let mut all = Vec::new();
        loop {
            let event = self.next().await;
            let is_it = event.1 == "window"
                && event.2["number"] == number
                && event.2["status"] != "running";
            all.push(event);
            if is_it {
                return all;
            }
        }
    }
}

pub(super) async fn append(app: &TestApp, window: &Value) -> Answer {
    app.post_json("/v1/streams/lag", window).await
}

/// The quiet window, the first of another gain, and how many there are.
const QUIET: usize = 6;
const CHANGE: usize = 12;
const WINDOWS: usize = 16;

fn gain_of(number: usize) -> f64 {
    if number < CHANGE { 2.0 } else { 2.2 }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_change_is_found_and_dated_and_a_quiet_window_estimates_nothing() {
    let app = TestApp::start().await;
    let mut plant = Plant::new();
    append(&app, &plant.window(0, 2.0, 1.0)).await.expect(201);
    let made = app.post_json("/v1/monitors", &monitor()).await;
    let id = made.expect(201).json()["id"].as_str().unwrap().to_owned();
    let mut events = Events::of(&app, &id).await;
    let mut told = Vec::new();
    for number in 1..=WINDOWS {
        let size = if number == QUIET { 0.0 } else { 1.0 };
        if number == QUIET {
            // The plant came to rest before.
            plant.output = 0.0;
        }
        let window = plant.window(number, gain_of(number), size);
        append(&app, &window).await.expect(200);
        told.extend(events.until_window(number as u64 - 1).await);
    }
    let ids: Vec<u64> = told.iter().map(|(id, _, _)| *id).collect();
    assert!(ids.iter().copied().eq(1..=ids.len() as u64), "{ids:?}");

    let shown = app
        .get(&format!("/v1/monitors/{id}"))
        .await
        .expect(200)
        .json();
    check_windows(shown["windows"].as_array().unwrap());
    check_alarms(shown["alarms"].as_array().unwrap());
    let path = format!("/v1/monitors/{id}/windows?limit=100");
    let request = app.request(reqwest::Method::GET, &path);
    let csv = app
        .send(request.header("accept", "text/csv"))
        .await
        .expect(200)
        .text;
    let header = csv.lines().next().unwrap();
    assert!(
        header.starts_with("window,from,to,status,trust,"),
        "{header}"
    );
    assert!(
        header.contains(",gain,gain_standard_error,gain_lower,gain_upper,"),
        "{header}"
    );
    assert_eq!(csv.lines().count(), WINDOWS + 1);
    app.delete("/v1/streams/lag").await.problem(409);
    app.delete(&format!("/v1/monitors/{id}")).await.expect(204);
    app.delete("/v1/streams/lag").await.expect(204);
    app.shutdown().await;
}

/// Each window once, the quiet one without an estimate, and most intervals with the truth in them.
fn check_windows(windows: &[Value]) {
    assert_eq!(windows.len(), WINDOWS);
    let mut covered = 0;
    for (number, window) in windows.iter().enumerate() {
        assert_eq!(window["number"], number as u64);
        if number == QUIET {
            assert_eq!(window["status"], "quiet", "{window}");
            assert!(window["job"].is_null() && window["parameters"] == json!([]));
            continue;
        }
        assert_eq!(window["status"], "estimated", "{window}");
        // The first has nothing to begin with, and the first of the new gain contradicts the old.
        if number == 0 {
            assert_eq!(window["start"], "cold", "{window}");
        } else if number != CHANGE {
            assert_eq!(window["start"], "warm", "{window}");
        }
        let parameters = window["parameters"].as_array().unwrap();
        let gain = parameters.iter().find(|own| own["name"] == "gain").unwrap();
        let end = |end: &str| gain["confidence_interval"][end].as_f64().unwrap();
        covered += usize::from((end("lower")..=end("upper")).contains(&gain_of(number)));
    }
    assert!(
        covered >= 12,
        "{covered} of 15 intervals of 95 % hold the gain"
    );
}

/// One change, of the gain, found at once and dated.
fn check_alarms(alarms: &[Value]) {
    let changes = alarms.iter().filter(|alarm| alarm["kind"] == "change");
    let changes: Vec<&Value> = changes.collect();
    let [change] = &changes[..] else {
        panic!("{alarms:?}");
    };
    assert_eq!(change["change"]["parameter"], "gain");
    let since = change["change"]["since_window"].as_u64().unwrap();
    assert!(since.abs_diff(CHANGE as u64) <= 1, "{change}");
    let found = change["window"].as_u64().unwrap();
    assert!(
        (CHANGE as u64..CHANGE as u64 + 2).contains(&found),
        "{change}"
    );
    let after = change["change"]["after"].as_f64().unwrap();
    assert!((after - 2.2).abs() < 0.1, "{change}");
}

#[tokio::test(flavor = "multi_thread")]
async fn data_that_stop_raise_one_alarm_and_a_gap_is_not_estimated() {
    let app = TestApp::start().await;
    let mut plant = Plant::new();
    append(&app, &plant.window(0, 2.0, 1.0)).await.expect(201);
    let mut document = monitor();
    document["alarms"]["data_stopped_after_s"] = json!(0.01);
    let made = app
        .post_json("/v1/monitors", &document)
        .await
        .expect(201)
        .json();
    let id = made["id"].as_str().unwrap().to_owned();
    let mut events = Events::of(&app, &id).await;
    let (_, name, alarm) = events.next().await;
    assert_eq!(
        (name.as_str(), &alarm["kind"]),
        ("alarm", &json!("data_stopped"))
    );
    // Windows 1 to 99 never come.
    append(&app, &plant.window(100, 2.0, 1.0)).await.expect(200);
    let told = events.until_window(1).await;
    assert_eq!(told.last().unwrap().2["status"], "no_data");
    append(&app, &plant.window(101, 2.0, 1.0)).await.expect(200);
    let told = events.until_window(100).await;
    assert_eq!(told.last().unwrap().2["status"], "estimated");
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_wrong_with_a_monitor_is_told_with_its_place() {
    let app = TestApp::start().await;
    let problem = app.post_json("/v1/monitors", &monitor()).await.problem(422);
    assert_eq!(problem["errors"][0]["pointer"], "/stream");
    append(&app, &Plant::new().window(0, 2.0, 1.0))
        .await
        .expect(201);
    let places = async |change: fn(&mut Value)| {
        let mut document = monitor();
        change(&mut document);
        let problem = app.post_json("/v1/monitors", &document).await.problem(422);
        let errors = problem["errors"].as_array().unwrap().iter();
        let places: Vec<String> = errors
            .map(|error| error["pointer"].as_str().unwrap().to_owned())
            .collect();
        places
    };
    let wrong = places(|d| d["job"]["parameters"] = json!({"gian": {"value": 1}})).await;
    assert_eq!(wrong, ["/job/parameters/gian"]);
    let wrong = places(|d| d["job"]["experiments"][0]["window"] = json!({"from_s": 1})).await;
    assert_eq!(wrong, ["/job/experiments/0/window"]);
    let wrong = places(|d| {
        d["drift"] = json!({"mass": {"std": 1, "per_s": 1}});
        d["only_when"] = json!({"signal": "v", "moves_more_than": 0.2});
    });
    assert_eq!(wrong.await, ["/drift/mass", "/only_when/signal"]);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn the_same_key_never_makes_two_monitors() {
    let app = TestApp::start().await;
    append(&app, &Plant::new().window(0, 2.0, 1.0))
        .await
        .expect(201);
    let post = |document: Value| {
        let request = app
            .request(reqwest::Method::POST, "/v1/monitors")
            .json(&document);
        app.send(request.header("idempotency-key", "one"))
    };
    let first = post(monitor()).await.expect(201);
    let again = post(monitor()).await.expect(201);
    assert_eq!(again.header("idempotent-replayed"), "true");
    assert_eq!(again.json()["id"], first.json()["id"]);
    let mut other = monitor();
    other["keep_jobs"] = json!(5);
    post(other).await.problem(422);
    let listed = app.get("/v1/monitors").await.expect(200).json();
    assert_eq!(listed["items"].as_array().unwrap().len(), 1);
    app.shutdown().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn samples_far_in_the_future_do_not_end_a_monitor_and_it_can_be_moved() {
    let app = TestApp::with(|settings| settings.stamps_ahead_h = 100 * 366 * 24).await;
    let mut plant = Plant::new();
    append(&app, &plant.window(0, 2.0, 1.0)).await.expect(201);
    let made = app.post_json("/v1/monitors", &monitor()).await;
    let id = made.expect(201).json()["id"].as_str().unwrap().to_owned();
    let path = format!("/v1/monitors/{id}");
    let mut events = Events::of(&app, &id).await;
    append(&app, &plant.window(1, 2.0, 1.0)).await.expect(200);
    events.until_window(0).await;
    let in_2126 = json!({"start": "2126-03-02T08:00:00Z", "sample_time_s": 1,
                         "signals": {"u": {"unit": "V", "values": [1, 2]}}});
    append(&app, &in_2126).await.expect(200);
    let shown = app.get(&path).await.expect(200).json();
    let waits_for = &shown["waits_for"];
    assert_eq!(waits_for["window"], 1, "{waits_for}");
    assert_eq!(waits_for["due"], "2026-03-02T08:00:40Z");
    assert_eq!(waits_for["reached"], "2026-03-02T08:00:39.9Z");
    append(&app, &plant.window(2, 2.0, 1.0)).await.expect(200);
    let told = events.until_window(1).await;
    assert_eq!(told.last().unwrap().2["status"], "estimated");

    let move_to = async |from: &str| {
        let path = format!("{path}/move");
        app.post_json(&path, &json!({"from": from})).await
    };
    let moved = move_to("2036-03-02T08:00:00Z").await.expect(200).json();
    assert_eq!(moved["next_window"], 15_780_960);
    let problem = move_to("2026-03-02T08:00:20Z").await.problem(422);
    assert_eq!(problem["errors"][0]["code"], "window_was_worked");
    move_to("tomorrow").await.problem(422);
    let moved = move_to("2026-03-02T08:00:21Z").await.expect(200).json();
    assert_eq!(moved["next_window"], 2);
    append(&app, &plant.window(3, 2.0, 1.0)).await.expect(200);
    let told = events.until_window(2).await;
    assert_eq!(told.last().unwrap().2["status"], "estimated");
    app.shutdown().await;
}
