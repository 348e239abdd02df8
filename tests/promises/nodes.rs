//! Several servers on one PostgreSQL, of which some are killed, stand still or are asked to end, while
//! clients go from one to the other.

use futures_util::future::join_all;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use tempfile::TempDir;

use super::follower::Follower;
use super::kill::{GENERATIONS, SAMPLES, check, follow_for, unbroken};
use super::server::{Options, PATIENCE, Server};
use super::{cluster, plant};

/// A node is dead after a second without a beat.
const OPTIONS: Options = Options {
    node_beat_s: 0.2,
    ..Options::new(1, 0.05)
};
const NODES: usize = 3;
/// Of a recording that is fitted hundreds of times.
const FEW_SAMPLES: usize = 200;
/// Of one of which a generation takes milliseconds.
const MANY_SAMPLES: usize = 20_000;
const ROUNDS: usize = 14;
const JOBS_PER_ROUND: usize = 2;
/// How long a node stands still: longer than it takes to find it dead, and than the database waits for one
/// that stands still in the middle of a transaction.
const STILL: Duration = Duration::from_millis(7500);

struct Cluster {
    database: String,
    nodes: Vec<Server>,
    dataset: String,
    followers: Vec<Follower>,
    random: ChaCha8Rng,
}

impl Cluster {
    async fn start(database: String) -> Self {
        let nodes: Vec<Server> = (0..NODES)
            .map(|_| Server::start_on(&database, OPTIONS))
            .collect();
        Self {
            dataset: nodes[0].store(&plant::recording(SAMPLES)).await,
            database,
            nodes,
            followers: Vec::new(),
            random: ChaCha8Rng::seed_from_u64(1),
        }
    }

    fn any(&mut self) -> usize {
        self.random.random_range(0..NODES)
    }

    /// Submits a job to one node after the other until one answers.
    async fn submit(&mut self) {
        let seed = self.followers.len();
        let job = plant::job(&self.dataset, GENERATIONS, seed as u64);
        let key = format!("job {seed}");
        let asked = Instant::now();
        loop {
            assert!(asked.elapsed() < PATIENCE, "no node takes a job");
            let node = self.nodes.choose(&mut self.random).expect("nodes");
            if let Ok(id) = node.submit(&job, &key).await {
                self.followers.push(Follower::new(&id));
                return;
            }
        }
    }

    /// Has every client follow its job at some node for a while.
    async fn follow(&mut self, while_: Duration) {
        let followers = std::mem::take(&mut self.followers);
        let following = followers.into_iter().map(|follower| {
            let node = self.nodes.choose(&mut self.random).expect("nodes");
            follow_for(follower, node, while_)
        });
        self.followers = join_all(following).await;
    }

    fn renew(&mut self, node: usize) -> Server {
        let new = Server::start_on(&self.database, OPTIONS);
        std::mem::replace(&mut self.nodes[node], new)
    }

    /// Has a node stand still until the others have its jobs; it ends when it goes on.
    async fn freeze(&mut self, node: usize) {
        self.nodes[node].stand_still(true);
        // Those who follow jobs that have ended do not follow for so long.
        tokio::join!(self.follow(STILL), tokio::time::sleep(STILL));
        self.nodes[node].stand_still(false);
        let mut thawed = self.renew(node);
        let asked = Instant::now();
        while !thawed.has_ended() {
            assert!(asked.elapsed() < PATIENCE, "a dead node goes on");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_survive_the_death_of_nodes_and_come_to_the_same_bits_wherever_they_are_worked() {
    let Some(database) = cluster::new_database() else {
        return;
    };
    let mut cluster = Cluster::start(database).await;
    for round in 0..ROUNDS {
        for _ in 0..JOBS_PER_ROUND {
            cluster.submit().await;
        }
        let moment = Duration::from_millis(cluster.random.random_range(0..600));
        cluster.follow(moment).await;
        let node = cluster.any();
        match round % 4 {
            0 | 1 => cluster.renew(node).kill(),
            2 => cluster.freeze(node).await,
            _ => {
                let (status, _) = cluster.renew(node).terminate();
                assert!(status.success(), "{status}");
            }
        }
    }
    let calm = tempfile::tempdir().expect("a folder");
    let expected = unbroken(calm.path(), ROUNDS * JOBS_PER_ROUND).await;
    for (seed, follower) in cluster.followers.into_iter().enumerate() {
        check(&cluster.nodes[seed % NODES], follower, &expected[seed]).await;
    }
    let listed = cluster.nodes[0].show("/v1/jobs?limit=100").await;
    let n_listed = listed["items"].as_array().expect("a list").len();
    assert_eq!(n_listed, ROUNDS * JOBS_PER_ROUND);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_is_paused_resumed_and_cancelled_through_any_node() {
    let Some(database) = cluster::new_database() else {
        return;
    };
    let cluster = Cluster::start(database).await;
    let endless = plant::job(&cluster.dataset, 1_000_000, 1);
    let [first, second, third] = &cluster.nodes[..] else {
        panic!("there are {NODES} nodes");
    };
    let id = first.submit(&endless, "endless").await.expect("an answer");
    for _ in 0..5 {
        second.in_state(&id, "running").await;
        let asked = second.post(&format!("/v1/jobs/{id}/pause")).send().await;
        assert!(asked.expect("an answer").status().is_success());
        third.in_state(&id, "paused").await;
        let asked = third.post(&format!("/v1/jobs/{id}/resume")).send().await;
        assert!(asked.expect("an answer").status().is_success());
    }
    let asked = third.post(&format!("/v1/jobs/{id}/cancel")).send().await;
    assert!(asked.expect("an answer").status().is_success());
    first.in_state(&id, "cancelled").await;
}

/// How much the nodes did for each other.
async fn done_for_others(nodes: &[Server], what: &str) -> f64 {
    let mut done = 0.0;
    for node in nodes {
        let metrics = node.get("/metrics").send().await.expect("an answer");
        let metrics = metrics.text().await.expect("a text");
        let own = metrics.lines().find_map(|line| {
            let (name, count) = line.split_once(' ')?;
            (name == format!("greybox_{what}_for_others_total")).then_some(count)
        });
        done += own.map_or(0.0, |count| count.parse().expect("a number"));
    }
    done
}

/// Works a job on three nodes, of which one dies when others have done something of it, and on one server
/// alone.
async fn together_and_alone(
    job: impl Fn(&str) -> Value,
    samples: usize,
    what: &str,
) -> Option<[EndedJob; 2]> {
    let cluster = Cluster::start(cluster::new_database()?).await;
    let first = &cluster.nodes[0];
    let recording = plant::recording(samples);
    let dataset = first.store(&recording).await;
    let id = first.submit(&job(&dataset), "together").await;
    let together = id.expect("an answer");
    // Whoever works it, the job goes on while one of its nodes dies.
    let asked = Instant::now();
    while done_for_others(&cluster.nodes, what).await == 0.0 {
        assert!(asked.elapsed() < PATIENCE, "nobody helped");
    }
    let mut nodes = cluster.nodes;
    nodes.pop().expect("a node").kill();
    let node = nodes.pop().expect("a node");
    node.ended(&together).await;

    let calm = tempfile::tempdir().expect("a folder");
    let server = Server::start(calm.path(), Options::new(2, 3600.0));
    let dataset = server.store(&recording).await;
    let alone = server.submit(&job(&dataset), "alone").await;
    let alone = alone.expect("an answer");
    server.ended(&alone).await;
    let together = EndedJob {
        server: node,
        id: together,
        _folder: None,
    };
    let alone = EndedJob {
        server,
        id: alone,
        _folder: Some(calm),
    };
    Some([together, alone])
}

/// A job that has ended, on a server that answers for it.
struct EndedJob {
    server: Server,
    id: String,
    /// The folder of the server's database, which stays as long as the server is asked: a new connection opens the
    /// file again.
    _folder: Option<TempDir>,
}

#[tokio::test(flavor = "multi_thread")]
async fn an_analysis_that_nodes_do_together_comes_to_the_bits_of_one_alone() {
    let thorough = |dataset: &str| {
        let mut job = plant::job(dataset, 20, 1);
        job["uncertainty"] =
            json!({"intervals": "bootstrap", "bootstrap_samples": 100, "monte_carlo_samples": 100});
        job
    };
    let Some(both) = together_and_alone(thorough, FEW_SAMPLES, "refits").await else {
        return;
    };
    let mut results = Vec::new();
    for job in &both {
        let path = format!("/v1/jobs/{}/result", job.id);
        results.push(job.server.show(&path).await);
    }
    let [together, alone] = &results[..] else {
        panic!("two results");
    };
    assert!(alone.to_string().contains("bootstrap"), "{alone}");
    assert_eq!(together["parameters"], alone["parameters"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn searches_that_nodes_do_together_come_to_the_bits_and_the_history_of_one_alone() {
    let thorough = |dataset: &str| {
        let mut job = plant::job(dataset, 150, 1);
        job["method"]["restarts"] = json!(6);
        job
    };
    let Some(both) = together_and_alone(thorough, MANY_SAMPLES, "generations").await else {
        return;
    };
    let mut seen: Vec<[Value; 3]> = Vec::new();
    for EndedJob { server, id, .. } in &both {
        let result = server.show(&format!("/v1/jobs/{id}/result")).await;
        let history = format!("/v1/jobs/{id}/generations?limit=1000");
        let history = server.show(&history).await["items"].clone();
        let rows = history.as_array().expect("rows").len();
        assert!(rows >= 6 * 150, "{rows} generations");
        seen.push([&result["parameters"], &result["searches"], &history].map(Value::clone));
    }
    assert!(
        seen[0] == seen[1],
        "{:?}",
        seen.iter().map(|[found, ..]| found).collect::<Vec<_>>()
    );
}
