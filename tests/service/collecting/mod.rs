//! `greybox collect`: samples that historians hold come into streams, whole and once, whatever fails on the way.

mod historian;
mod reports;
mod tables;

use std::path::Path;

use greybox_service::access::Scope;
use greybox_service::collect::{Cursors, ReadStretch, SourcesFile, Until, collect};
use jiff::{SignedDuration, Timestamp};
use reqwest::Method;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::app::TestApp;
use historian::{Historian, event};

/// A collector beside a server, with its sources file and its cursors in a folder.
pub struct Collector {
    folder: TempDir,
    text: String,
}

impl Collector {
    /// A collector of the sources that a text names, for a server.
    pub fn of(app: &TestApp, sources: &str) -> Self {
        Self::with_server(&format!("url = \"http://{}\"", app.address()), sources)
    }

    fn with_server(server: &str, sources: &str) -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
            text: format!("[server]\n{server}\n{sources}"),
        }
    }

    fn file(&self) -> SourcesFile {
        SourcesFile::read(&self.text, self.folder.path()).expect("a sources file")
    }

    /// Brings what there is up to now, and says how many series failed.
    pub async fn once(&self) -> usize {
        let file = self.file();
        let cursors = Cursors::open(&file.cursors).await.unwrap();
        collect(file.sources, &cursors, &file.server, Until::CaughtUp).await
    }

    /// Forgets how far the series were brought, as a collector does that dies before it writes that down.
    fn forget(&self) {
        for end in ["", "-wal", "-shm"] {
            let file = format!("cursors.sqlite{end}");
            _ = std::fs::remove_file(self.folder.path().join(file));
        }
    }

    /// The error of the first series of the first source, as `--check` would show it.
    async fn refusal(&self) -> String {
        let source = self.file().sources.remove(0);
        let stretch = ReadStretch {
            between: source.from..Timestamp::now(),
            rows: 10,
        };
        let read = source.connection.read(&source.series[0], &stretch);
        read.await.expect_err("it is refused").to_string()
    }
}

/// Seconds of the samples of a signal after 08:15, and their values in SI.
pub async fn samples(app: &TestApp, stream: &str, signal: &str) -> Vec<(f64, Value)> {
    let path = format!("/v1/streams/{stream}?from=2026-03-02T08:15:00Z&max_points=100000");
    let shown = app.get(&path).await.expect(200).json();
    let window = &shown["window"];
    let start: Timestamp = window["start"].as_str().unwrap().parse().unwrap();
    let origin: Timestamp = "2026-03-02T08:15:00Z".parse().unwrap();
    let first = start.duration_since(origin).as_secs_f64();
    let samples = &window["samples"];
    let values = samples["signals"][signal]["values"].as_array().unwrap();
    let time = samples["time_s"].as_array().or(samples["time"].as_array());
    let times: Vec<f64> = match time {
        Some(times) => times.iter().map(|time| time.as_f64().unwrap()).collect(),
        None => {
            let step = samples["sample_time_s"].as_f64().unwrap();
            (0..values.len()).map(|place| place as f64 * step).collect()
        }
    };
    times
        .into_iter()
        .map(|time| first + time)
        .zip(values.iter().cloned())
        .collect()
}

/// Events at seconds after 08:15, each of which has its second as its value.
fn seconds(range: std::ops::Range<u32>) -> Vec<historian::Event> {
    let stamp = |second: u32| format!("2026-03-02T08:{:02}:{:02}Z", 15 + second / 60, second % 60);
    range
        .map(|second| event(&stamp(second), f64::from(second)))
        .collect()
}

/// A source that is a PI Web API, with series that follow.
fn pi(address: &str, series: &str) -> String {
    format!(
        "[[source]]\nname = \"pi\"\nkind = \"pi_web_api\"\nurl = \"{address}\"\n\
         from = 2026-03-01T00:00:00Z\n{series}"
    )
}

const PRESSURE: &str = r#"
[[source.series]]
stream = "rig-4"
tag = '\\pi.plant.example\PT-101'
signal = "pressure"
"#;

#[tokio::test(flavor = "multi_thread")]
async fn a_tag_comes_whole_though_pi_cuts_its_answers() {
    let app = TestApp::start().await;
    let mut events = seconds(0..10);
    events[4].value = json!({"Name": "I/O Timeout", "Value": 246, "IsSystem": true});
    events[6].good = false;
    let pi_server = Historian::holding(events, 3);
    let collector = Collector::of(&app, &pi(&pi_server.as_pi().await, PRESSURE));
    assert_eq!(collector.once().await, 0);
    let stored = samples(&app, "rig-4", "pressure").await;
    let good = [0, 1, 2, 3, 5, 7, 8, 9].map(|second| (f64::from(second), 1e5 * f64::from(second)));
    let stored = stored.into_iter().filter(|(_, value)| !value.is_null());
    let stored: Vec<_> = stored
        .map(|(time, value)| (time, value.as_f64().unwrap()))
        .collect();
    assert_eq!(
        stored, good,
        "bar are pascals, and what is bad is no sample"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_state_is_its_number_and_is_held_until_the_next_event() {
    let app = TestApp::start().await;
    let state = |name: &str, number: u8| json!({"Name": name, "Value": number, "IsSystem": false});
    let events = [
        event("2026-03-02T08:15:00Z", state("CLOSED", 0)),
        event("2026-03-02T08:15:07Z", state("OPEN", 1)),
    ];
    let pi_server = Historian::holding(events, 100);
    let valve = PRESSURE
        .replace("PT-101", "XV-7")
        .replace("pressure", "valve");
    let collector = Collector::of(&app, &pi(&pi_server.as_pi().await, &valve));
    assert_eq!(collector.once().await, 0);
    let stream = app.get("/v1/streams/rig-4").await.expect(200).json();
    assert_eq!(stream["signals"][0]["interpolation"], "hold");
    let stored = samples(&app, "rig-4", "valve").await;
    assert_eq!(stored, [(0.0, json!(0.0)), (7.0, json!(1.0))]);
}

#[tokio::test(flavor = "multi_thread")]
async fn late_and_corrected_samples_come_and_nothing_comes_twice() {
    let app = TestApp::start().await;
    let mut events = seconds(0..120);
    let late = events.remove(90);
    let pi_server = Historian::holding(events, 50);
    let collector = Collector::of(&app, &pi(&pi_server.as_pi().await, PRESSURE));
    assert_eq!(collector.once().await, 0);
    assert_eq!(samples(&app, "rig-4", "pressure").await.len(), 119);
    pi_server.change(|held| {
        held.events.push(late);
        held.events[80].value = json!(800.0);
    });
    let before = pi_server.change(|held| held.requests);
    assert_eq!(collector.once().await, 0);
    let stored = samples(&app, "rig-4", "pressure").await;
    assert_eq!(stored.len(), 120);
    assert_eq!(stored[80], (80.0, json!(8e7)));
    assert_eq!(stored[90], (90.0, json!(9e6)));
    let asked = pi_server.change(|held| held.requests) - before;
    assert!(
        asked <= 3,
        "the whole history was read again: {asked} requests"
    );
    collector.forget();
    assert_eq!(collector.once().await, 0);
    assert_eq!(samples(&app, "rig-4", "pressure").await, stored);
}

#[tokio::test(flavor = "multi_thread")]
async fn samples_ahead_of_the_clock_wait_in_the_source_and_hold_nothing_up() {
    let app = TestApp::start().await;
    let now = Timestamp::now();
    let at = |seconds: i64| now.checked_add(SignedDuration::from_secs(seconds)).unwrap();
    let of = |seconds: i64| event(&at(seconds).to_string(), 1.0);
    let pi_server = Historian::holding([of(-120), of(-60), of(7200), of(200_000)], 100);
    let collector = Collector::of(&app, &pi(&pi_server.as_pi().await, PRESSURE));
    assert_eq!(collector.once().await, 0);
    let count = async || app.get("/v1/streams/rig-4").await.expect(200).json()["samples"].clone();
    assert_eq!(count().await, 2);
    pi_server.change(|held| held.events.push(of(-30)));
    assert_eq!(collector.once().await, 0);
    assert_eq!(count().await, 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_source_that_is_away_keeps_no_other_back_and_goes_on_where_it_was() {
    let app = TestApp::start().await;
    let away = Historian::holding(seconds(0..20), 5);
    let there = Historian::holding(seconds(0..20), 5);
    away.change(|held| held.refusals = 1);
    let sources = pi(&away.as_pi().await, PRESSURE)
        + &pi(&there.as_pi().await, &PRESSURE.replace("rig-4", "rig-5"))
            .replace("name = \"pi\"", "name = \"another\"");
    let collector = Collector::of(&app, &sources);
    assert_eq!(collector.once().await, 1);
    app.get("/v1/streams/rig-4").await.problem(404);
    assert_eq!(samples(&app, "rig-5", "pressure").await.len(), 20);
    assert_eq!(collector.once().await, 0);
    assert_eq!(samples(&app, "rig-4", "pressure").await.len(), 20);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_token_that_appends_to_the_stream_is_enough_and_another_moves_no_cursor() {
    let (app, [_]) = TestApp::with_tokens([("someone", Scope::Read, "default")], |_| ()).await;
    let secret = app.append_token("collector", "rig-4").await;
    let pi_server = Historian::holding(seconds(0..20), 100);
    let server = format!(
        "url = \"http://{}\"\ntoken = {{ file = \"token\" }}",
        app.address()
    );
    let sources = pi(&pi_server.as_pi().await, PRESSURE);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(
        folder.path().join("token"),
        format!("{}x\n", &secret[..secret.len() - 1]),
    )
    .unwrap();
    let text = format!("[server]\n{server}\n{sources}");
    let collector = Collector { folder, text };
    assert_eq!(collector.once().await, 1);
    std::fs::write(collector.folder.path().join("token"), format!("{secret}\n")).unwrap();
    assert_eq!(collector.once().await, 0);
    let file = collector.file();
    file.server
        .check("rig-4")
        .await
        .expect("the token is known");
    let shown = format!("{file:?}");
    assert!(!shown.contains(&secret), "{shown}");
}

#[tokio::test(flavor = "multi_thread")]
async fn rows_of_influx_come_in_pages_and_two_plants_are_never_mixed() {
    let app = TestApp::start().await;
    let mut events = seconds(0..25);
    events.extend(seconds(0..25).into_iter().map(|event| historian::Event {
        hall: "3",
        value: json!(-1.0),
        ..event
    }));
    let influx = Historian::holding(events, 1000).as_influx().await;
    let sources = |filter: &str| {
        format!(
            "[[source]]\nname = \"influx\"\nkind = \"influxdb\"\nurl = \"{influx}\"\ndatabase = \"plant\"\n\
             from = 2026-03-01T00:00:00Z\npage_rows = 10\n[[source.series]]\nstream = \"rig-4\"\n\
             measurement = \"rig\"\n{filter}signals = {{ position = {{ unit = \"m\" }} }}\n"
        )
    };
    let mixed = Collector::of(&app, &sources(""));
    assert_eq!(mixed.once().await, 1);
    let refusal = mixed.refusal().await;
    assert!(
        refusal.contains("`where`") && refusal.contains("\"hall\": \"3\""),
        "{refusal}"
    );
    app.get("/v1/streams/rig-4").await.problem(404);
    let collector = Collector::of(&app, &sources("where = { hall = \"2\" }\n"));
    assert_eq!(collector.once().await, 0);
    let stored = samples(&app, "rig-4", "position").await;
    let expected = (0..25).map(|second| (f64::from(second), json!(f64::from(second))));
    assert_eq!(stored, expected.collect::<Vec<_>>());
}

#[tokio::test(flavor = "multi_thread")]
async fn rows_of_a_bucket_come_in_pages_and_two_plants_are_never_mixed() {
    let app = TestApp::start().await;
    let mut events = seconds(0..25);
    events[7].value = json!(true);
    events.extend(
        seconds(3..5)
            .into_iter()
            .map(|event| historian::Event { hall: "3", ..event }),
    );
    let influx = Historian::holding(events, 1000);
    let address = influx.as_flux().await;
    let sources = |filter: &str, entries: &str| {
        format!(
            "[[source]]\nname = \"influx\"\nkind = \"influxdb\"\nurl = \"{address}\"\n{entries}\
             from = 2026-03-01T00:00:00Z\npage_rows = 10\n[[source.series]]\nstream = \"rig-4\"\n\
             measurement = \"rig\"\n{filter}signals = {{ position = {{ unit = \"m\" }} }}\n"
        )
    };
    let bucket = "organization = \"works\"\nbucket = \"plant\"\ntoken = { file = \"token\" }\n";
    let collector = |text: &str| {
        let collector = Collector::of(&app, text);
        std::fs::write(collector.folder.path().join("token"), "secret\n").unwrap();
        collector
    };
    let mixed = collector(&sources("", bucket));
    assert_eq!(mixed.once().await, 1);
    let refusal = mixed.refusal().await;
    assert!(refusal.contains("hall=2 and hall=3"), "{refusal}");
    let of_one = collector(&sources("where = { hall = \"2\" }\n", bucket));
    assert_eq!(of_one.once().await, 0);
    let stored = samples(&app, "rig-4", "position").await;
    let value = |second: u32| if second == 7 { 1.0 } else { f64::from(second) };
    let expected = (0..25).map(|second| (f64::from(second), json!(value(second))));
    assert_eq!(stored, expected.collect::<Vec<_>>());
    influx.change(|held| held.events[0].value = json!("broken"));
    assert!(of_one.refusal().await.contains("is a text"));
    let unnamed = sources("", "bucket = \"plant\"\n");
    let faults = SourcesFile::read(
        &format!("[server]\nurl = \"{address}\"\n{unnamed}"),
        ".".as_ref(),
    );
    let told = faults.expect_err("an organization is missing")[0].to_string();
    assert!(told.contains("belongs to an `organization`"), "{told}");
}

#[tokio::test(flavor = "multi_thread")]
async fn files_come_in_their_order_again_when_they_change_and_a_bad_one_keeps_none_back() {
    let app = TestApp::start().await;
    let layout = json!({"options": {"decimal": ",", "tz": "Europe/Berlin", "units": "p:bar"}});
    let request = app.request(Method::PUT, "/v1/layouts/weekly").json(&layout);
    app.send(request).await.expect(201);
    let exports = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(exports.path().join(name), text).unwrap();
    let rows = |hour: u8, value: &str| {
        format!("Zeit;p\n2026-03-02 {hour:02}:15:00;{value}\n2026-03-02 {hour:02}:15:01;2,5\n")
    };
    write("a.csv", &rows(9, "1,5"));
    write("b.csv", "Zeit;p\nyesterday;1,5\n");
    let large = std::fs::File::create(exports.path().join("b2.csv")).unwrap();
    large.set_len((1 << 30) + 1).unwrap();
    write("c.csv", &rows(10, "3,5"));
    write("d.csv.part", &rows(11, "4,5"));
    let sources = format!(
        "[[source]]\nname = \"exports\"\nkind = \"files\"\nfolder = \"{}\"\nrest_s = 0\n\
         from = 2026-03-01T00:00:00Z\n[[source.series]]\nstream = \"rig-4\"\npattern = \"*.csv\"\n\
         options = {{ layout = \"weekly\" }}\n",
        exports.path().display()
    );
    let collector = Collector::of(&app, &sources);
    assert_eq!(collector.once().await, 1, "b.csv and b2.csv are refused");
    let stored = samples(&app, "rig-4", "p").await;
    let expected = [(0.0, 1.5e5), (1.0, 2.5e5), (3600.0, 3.5e5), (3601.0, 2.5e5)];
    let expected = expected.map(|(time, value)| (time, json!(value)));
    assert_eq!(stored, expected);
    std::fs::remove_file(exports.path().join("b2.csv")).unwrap();
    write("b.csv", &rows(12, "6,5"));
    assert_eq!(collector.once().await, 0);
    let stored = samples(&app, "rig-4", "p").await;
    assert_eq!(
        stored[4..],
        [(10800.0, json!(6.5e5)), (10801.0, json!(2.5e5))]
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_of_a_declared_shape_come_in_pages_and_newest_first_is_refused() {
    let app = TestApp::start().await;
    let historian = Historian::holding(seconds(0..25), 7);
    let address = historian.as_json().await;
    let sources = |order: &str| {
        format!(
            "[[source]]\nname = \"scada\"\nkind = \"json\"\nurl = \"{address}\"\n\
             from = 2026-03-02T08:15:00Z\n[[source.series]]\nstream = \"rig-4\"\n\
             request = \"history?from={{from_ms}}&to={{to}}&most={{rows}}&order={order}\"\nrows = \"/data/rows\"\n\
             time = \"/at\"\ntime_unit = \"ms\"\nquality_scheme = \"words\"\n\
             signals = {{ pressure = {{ value = \"/pressure/value\", unit = \"bar\", quality = \"/pressure/is\" }} }}\n"
        )
    };
    historian.change(|held| held.events[4].good = false);
    let collector = Collector::of(&app, &sources("oldest"));
    assert_eq!(collector.once().await, 0);
    let stored = samples(&app, "rig-4", "pressure").await;
    let stored: Vec<f64> = stored
        .iter()
        .filter_map(|(_, value)| value.as_f64())
        .collect();
    let good = (0..25).filter(|second| *second != 4);
    assert_eq!(
        stored,
        good.map(|second| 1e5 * f64::from(second))
            .collect::<Vec<_>>()
    );
    let refusal = Collector::of(&app, &sources("newest")).refusal().await;
    assert!(refusal.contains("oldest row first"), "{refusal}");
}

#[test]
fn every_fault_of_a_sources_file_is_told_with_its_line() {
    let text = r#"
[server]
url = "ftp://greybox.plant.example"
token = "gbx_0123"

[[source]]
name = "press"
kind = "postgresql"
address = "postgres://reader:geheim@db.plant.example/history"
from = 2026-01-01
evry_s = 5

[[source.series]]
stream = "press 4"
table = "press"
signals = { position = { units = "mm" } }

[[source]]
name = "pi"
kind = "pi"
from = 2026-01-01T00:00:00Z
"#;
    let faults = SourcesFile::read(text, Path::new("/")).expect_err("it is refused");
    let lines: Vec<usize> = faults.iter().map(|fault| fault.line).collect();
    let told: Vec<String> = faults.iter().map(ToString::to_string).collect();
    let told = told.join("\n");
    assert_eq!(lines, [3, 4, 9, 10, 11, 13, 14, 16, 20], "{told}");
    for words in [
        "http://",
        "does not belong into this file",
        "no password in it",
        "is `every_s` meant?",
        "has no `time`",
        "is `unit` meant?",
        "pi_web_api",
    ] {
        assert!(told.contains(words), "{words} is not in\n{told}");
    }
    assert!(
        !told.contains("geheim") && !told.contains("gbx_0123"),
        "{told}"
    );
}
