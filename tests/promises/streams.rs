//! A stream whose server is killed while batches come, in their order, late, again, corrected and with
//! stamps of the future: what was sent is there, at its instants, and nothing else is.

use std::collections::BTreeMap;
use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use reqwest::StatusCode;
use serde_json::{Value, json};

use super::server::{Options, Server, answer};

/// Kills where `GREYBOX_TESTS_KILLS` does not say how many.
const KILLS: usize = 40;
const OPTIONS: Options = Options::new(1, 10.0);
const MS: i64 = 1_000_000;
/// Samples of a batch at the most.
const LONGEST: i64 = 40;
const SIGNALS: [&str; 2] = ["command", "position"];

/// A batch: for each sample its signal, its instant in ms after the first, and its value.
#[derive(Clone, Debug)]
struct Sent {
    samples: Vec<(usize, i64, f64)>,
    key: Option<String>,
}

impl Sent {
    fn long_csv(&self, start: jiff::Timestamp) -> String {
        let rows = self.samples.iter().map(|(signal, ms, value)| {
            let instant = start + jiff::SignedDuration::from_millis(*ms);
            format!("{instant},{},{value}\n", SIGNALS[*signal])
        });
        rows.fold("timestamp,tag,value\n".to_owned(), |text, row| text + &row)
    }

    /// The instants that it speaks of.
    fn instants(&self) -> usize {
        let mut instants: Vec<i64> = self.samples.iter().map(|(_, ms, _)| *ms).collect();
        instants.sort_unstable();
        instants.dedup();
        instants.len()
    }
}

/// A gateway, and what it has said so far.
struct Gateway {
    start: jiff::Timestamp,
    random: ChaCha8Rng,
    /// Values by signal and instant [ms].
    said: BTreeMap<(usize, i64), f64>,
    sent: Vec<Sent>,
    /// When the next batch in order begins [ms].
    next: i64,
    /// A batch that was not answered: it is sent again before any other.
    unanswered: Option<Sent>,
}

impl Gateway {
    fn new() -> Self {
        Self {
            start: "2026-03-02T08:00:00Z".parse().expect("an instant"),
            random: ChaCha8Rng::seed_from_u64(23),
            said: BTreeMap::new(),
            sent: Vec::new(),
            next: 0,
            unanswered: None,
        }
    }

    /// Samples at odd instants from one on.
    fn samples(&mut self, from: i64) -> Vec<(usize, i64, f64)> {
        let mut ms = from;
        let count = self.random.random_range(1..=LONGEST);
        let sample = |_| {
            ms += self.random.random_range(1..2000);
            let value = (self.random.random::<f64>() * 1e4).round() / 1e4;
            (self.random.random_range(0..SIGNALS.len()), ms, value)
        };
        (0..count).map(sample).collect()
    }

    fn next_batch(&mut self) -> Sent {
        if let Some(unanswered) = self.unanswered.clone() {
            return unanswered;
        }
        let kind = self.random.random_range(0..10);
        let samples = if kind < 5 || self.sent.is_empty() {
            let samples = self.samples(self.next);
            // A hole is left now and then, for late batches.
            self.next += LONGEST * 2000 * self.random.random_range(1..3);
            samples
        } else if kind < 7 {
            let from = self.random.random_range(0..self.next);
            self.samples(from)
        } else {
            let place = self.random.random_range(0..self.sent.len());
            let mut samples = self.sent[place].samples.clone();
            if kind == 9 {
                samples.iter_mut().for_each(|(_, _, value)| *value += 1.0);
            }
            samples
        };
        let number = self.sent.len();
        let has_key = self.random.random_bool(0.5);
        Sent {
            samples,
            key: has_key.then(|| format!("batch {number}")),
        }
    }

    /// Sends batches until the server dies.
    async fn send(&mut self, server: &Server) {
        loop {
            if self.random.random_range(0..12) == 0 && !self.is_refused(server).await {
                return;
            }
            let batch = self.next_batch();
            let is_again = self.unanswered.replace(batch.clone()).is_some();
            let is_new = |ms: &i64| {
                let mut signals = 0..SIGNALS.len();
                !signals.any(|signal| self.said.contains_key(&(signal, *ms)))
            };
            let instants = batch.samples.iter().map(|(_, ms, _)| *ms);
            let mut added: Vec<i64> = instants.filter(is_new).collect();
            added.sort_unstable();
            added.dedup();
            for (signal, ms, value) in &batch.samples {
                self.said.insert((*signal, *ms), *value);
            }
            let body = batch.long_csv(self.start);
            let request = server.post("/v1/streams/rig").body(body);
            let mut request = request.header("content-type", "text/csv");
            if let Some(key) = &batch.key {
                request = request.header("idempotency-key", key);
            }
            let Ok((status, told)) = answer(request).await else {
                return;
            };
            assert!(status.is_success(), "{told}");
            let count = |name: &str| told[name].as_u64().expect("a count");
            let all = count("added") + count("changed") + count("repeated");
            assert_eq!(all, batch.instants() as u64, "{told}");
            if !is_again {
                assert_eq!(count("added"), added.len() as u64, "{told}");
            }
            self.sent.push(batch);
            self.unanswered = None;
        }
    }

    /// Sends a batch with a stamp of the future; says whether the server lived to refuse it.
    async fn is_refused(&mut self, server: &Server) -> bool {
        let mut samples = self.samples(0);
        samples.push((0, 40 * 366 * 86_400_000, 1.0));
        let batch = Sent { samples, key: None };
        let request = server
            .post("/v1/streams/rig")
            .body(batch.long_csv(self.start));
        let Ok((status, told)) = answer(request.header("content-type", "text/csv")).await else {
            return false;
        };
        assert_eq!(status, StatusCode::UNPROCESSABLE_ENTITY, "{told}");
        assert_eq!(told["errors"][0]["code"], "stamp_in_future");
        true
    }

    /// What the stream holds, as the gateway counts.
    async fn stored(&self, server: &Server) -> BTreeMap<(usize, i64), f64> {
        let path = "/v1/streams/rig?from=2026-03-02T00:00:00Z&max_points=100000";
        let shown = server.show(path).await;
        let window = &shown["window"];
        let begin: jiff::Timestamp = window["start"]
            .as_str()
            .expect("a start")
            .parse()
            .expect("one");
        let begin_ns = begin.duration_since(self.start).as_nanos();
        let times = window["samples"]["time_s"].as_array().expect("times");
        assert_eq!(
            json!(times.len()),
            shown["samples"],
            "no sample is decimated"
        );
        let mut stored = BTreeMap::new();
        for (signal, name) in SIGNALS.iter().enumerate() {
            let values = window["samples"]["signals"][name]["values"].as_array();
            let samples = times.iter().zip(values.into_iter().flatten());
            stored.extend(samples.filter_map(|(time, value)| {
                let after = (time.as_f64()? * 1e9).round() as i64;
                let ns = i64::try_from(begin_ns).expect("this year") + after;
                assert_eq!(ns % MS, 0, "stamps have milliseconds: {ns} ns");
                Some(((signal, ns / MS), value.as_f64()?))
            }));
        }
        stored
    }
}

fn kills() -> usize {
    let wanted = std::env::var("GREYBOX_TESTS_KILLS").ok();
    wanted.map_or(KILLS, |text| text.parse().expect("a number of kills"))
}

#[tokio::test(flavor = "multi_thread")]
async fn no_sample_is_lost_moved_or_made_up_while_a_server_is_killed() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut gateway = Gateway::new();
    for life in 0..kills() {
        let server = Server::start(folder.path(), OPTIONS);
        let moment = Duration::from_millis(gateway.random.random_range(1..120));
        // The server is killed under whatever batch is on its way then.
        let sending = tokio::time::timeout(moment, gateway.send(&server)).await;
        server.kill();
        assert!(sending.is_err(), "the server died by itself in life {life}");
    }
    let server = Server::start(folder.path(), OPTIONS);
    if let Some(last) = gateway.unanswered.clone() {
        let request = server
            .post("/v1/streams/rig")
            .body(last.long_csv(gateway.start));
        let sent: Result<(StatusCode, Value), _> =
            answer(request.header("content-type", "text/csv")).await;
        assert!(sent.expect("an answer").0.is_success());
    }
    let stored = gateway.stored(&server).await;
    let lost = gateway
        .said
        .iter()
        .filter(|said| stored.get(said.0) != Some(said.1));
    let lost: Vec<_> = lost.collect();
    assert!(
        lost.is_empty(),
        "{} samples differ: {:?}",
        lost.len(),
        &lost[..lost.len().min(5)]
    );
    assert_eq!(stored.len(), gateway.said.len(), "nothing was made up");
    assert!(!gateway.sent.is_empty(), "batches were answered");
}
