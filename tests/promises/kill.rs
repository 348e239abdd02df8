//! P1 to P5 and P8: a server that is killed fifty times at random moments, and what it promised.

use std::path::Path;
use std::time::Duration;

use futures_util::future::join_all;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde_json::Value;

use super::follower::Follower;
use super::server::{Options, Server, file, text};
use super::{cluster, plant};

const KILLS: usize = 50;
/// Lives of the server at the most: where jobs go fast, more of the kills meet none.
const MOST_LIVES: usize = 4 * KILLS;
/// A job is submitted every so many lives, and when all have ended.
const LIVES_PER_JOB: usize = 5;
pub const SAMPLES: usize = 1000;
pub const GENERATIONS: u32 = 150;

/// Fast slices, many threads: as unlike the unbroken run as can be.
pub const BROKEN: Options = Options {
    node_beat_s: 0.02,
    ..Options::new(2, 0.01)
};

/// One slice, one thread.
pub const UNBROKEN: Options = Options::new(1, 3600.0);

/// What a job comes to.
#[derive(Debug, PartialEq)]
pub struct Found {
    parameters: Value,
    /// The rows of its history.
    generations: Value,
}

impl Found {
    async fn of(server: &Server, job: &str) -> Self {
        let result = server.show(&format!("/v1/jobs/{job}/result")).await;
        let path = format!("/v1/jobs/{job}/generations?limit=1000");
        Self {
            parameters: result["parameters"].clone(),
            generations: server.show(&path).await["items"].clone(),
        }
    }
}

/// What so many jobs come to on a server that nothing happens to.
pub async fn unbroken(folder: &Path, n_jobs: usize) -> Vec<Found> {
    let server = Server::start(folder, UNBROKEN);
    let dataset = server.store(&plant::recording(SAMPLES)).await;
    let mut jobs = Vec::new();
    for seed in 0..n_jobs {
        let job = plant::job(&dataset, GENERATIONS, seed as u64);
        jobs.push(
            server
                .submit(&job, &format!("job {seed}"))
                .await
                .expect("an answer"),
        );
    }
    let mut found = Vec::new();
    for job in jobs {
        server.ended(&job).await;
        found.push(Found::of(&server, &job).await);
    }
    found
}

/// What the clients know of the jobs.
struct Clients {
    dataset: String,
    /// By seed, those that were answered 202.
    followers: Vec<Follower>,
    random: ChaCha8Rng,
    /// How often a kill met a job that had begun and not ended.
    n_interruptions: usize,
}

impl Clients {
    /// One life of the server: a submission every few lives, followers all along, then the kill.
    async fn live(&mut self, server: Server, life: usize) {
        let is_due = self.followers.len() <= life / LIVES_PER_JOB
            || self.followers.iter().all(Follower::has_ended);
        let submission = async {
            let seed = self.followers.len();
            let job = plant::job(&self.dataset, GENERATIONS, seed as u64);
            server.submit(&job, &format!("job {seed}")).await.ok()
        };
        let moment = Duration::from_millis(self.random.random_range(0..250));
        let following = self
            .followers
            .iter()
            .map(|follower| follow_for(follower.clone(), &server, moment));
        let submission = async {
            match is_due {
                true => tokio::time::timeout(moment, submission)
                    .await
                    .ok()
                    .flatten(),
                false => None,
            }
        };
        let (followers, accepted, ()) =
            tokio::join!(join_all(following), submission, tokio::time::sleep(moment));
        server.kill();
        let was_at_work = |follower: &&Follower| follower.events.len() > 1 && !follower.has_ended();
        self.n_interruptions += followers.iter().filter(was_at_work).count();
        self.followers = followers;
        self.followers
            .extend(accepted.as_deref().map(Follower::new));
    }
}

/// Follows until the moment of the kill, and keeps what was received.
pub async fn follow_for(follower: Follower, server: &Server, moment: Duration) -> Follower {
    if follower.has_ended() {
        return follower;
    }
    follower.follow_for(server, moment).await
}

/// Every job that was accepted has ended once, told so without gap or repeat, and found the bits.
pub async fn check(server: &Server, follower: Follower, expected: &Found) {
    let job = follower.job.clone();
    let shown = server.ended(&job).await;
    assert_eq!(shown["status"], "succeeded", "{shown}");
    let follower = match follower.has_ended() {
        true => follower,
        false => follower.follow(server).await,
    };
    let ids: Vec<u64> = follower.events.iter().map(|event| event.id).collect();
    assert!(
        ids.iter().copied().eq(1..=ids.len() as u64),
        "{job}: {ids:?}"
    );
    let ends = follower.events.iter().filter(|event| event.name == "end");
    assert_eq!(ends.count(), 1);
    assert!(follower.has_ended());
    let again = Follower::new(&job).follow(server).await;
    assert_eq!(
        again.events, follower.events,
        "what is told again is what was told"
    );
    let found = Found::of(server, &job).await;
    assert_eq!(&found, expected, "{job}");
    let generations = found.generations.as_array().expect("rows").iter();
    let numbers: Vec<u64> = generations
        .filter_map(|row| row["generation"].as_u64())
        .collect();
    // A search may be followed by a further one.
    assert!(numbers.len() >= GENERATIONS as usize, "{job}: {numbers:?}");
    assert!(
        numbers.iter().copied().eq(1..=numbers.len() as u64),
        "{job}: {numbers:?}"
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn p1_to_p5_accepted_jobs_survive_fifty_kills_and_come_to_the_same_bits() {
    let folder = tempfile::tempdir().expect("a folder");
    survive(&file(folder.path())).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn p1_to_p5_hold_on_postgresql_and_its_bits_are_those_of_sqlite() {
    if let Some(database) = cluster::new_database() {
        survive(&database).await;
    }
}

/// Kills servers of a database; what their jobs find is compared with an unbroken server on SQLite.
async fn survive(database: &str) {
    let server = Server::start_on(database, BROKEN);
    let mut clients = Clients {
        dataset: server.store(&plant::recording(SAMPLES)).await,
        followers: Vec::new(),
        random: ChaCha8Rng::seed_from_u64(1),
        n_interruptions: 0,
    };
    clients.live(server, 0).await;
    for life in 1..MOST_LIVES {
        if life >= KILLS && clients.n_interruptions >= KILLS {
            break;
        }
        clients.live(Server::start_on(database, BROKEN), life).await;
    }
    let server = Server::start_on(database, BROKEN);
    assert!(!clients.followers.is_empty());
    // Otherwise the kills came when nothing was at stake, and the rest proves nothing.
    assert!(
        clients.n_interruptions >= KILLS,
        "{}",
        clients.n_interruptions
    );
    let n_accepted = clients.followers.len();
    let calm = tempfile::tempdir().expect("a folder");
    let expected = unbroken(calm.path(), n_accepted).await;
    for (seed, follower) in clients.followers.into_iter().enumerate() {
        // P8: the same key finds the job that was accepted.
        let job = plant::job(&clients.dataset, GENERATIONS, seed as u64);
        let again = server
            .submit(&job, &format!("job {seed}"))
            .await
            .expect("an answer");
        assert_eq!(again, follower.job);
        check(&server, follower, &expected[seed]).await;
    }
    // A submission whose answer the kill cut off may have made one more job, never two.
    let listed = server.show("/v1/jobs?limit=100").await;
    let listed = listed["items"].as_array().expect("a list");
    assert!(listed.len() <= n_accepted + 1, "{}", listed.len());
    let mut ids: Vec<String> = listed.iter().map(|job| text(&job["id"])).collect();
    ids.dedup();
    assert_eq!(ids.len(), listed.len());
}

/// Samples of the recording whose units of work are cut off.
const MANY_SAMPLES: usize = 20_000;
/// Kills within one unit of work.
const CUT_OFF: u64 = 5;
/// Candidates of a unit: the first number of them that takes longer than five kills is taken.
const POPULATIONS: [u32; 5] = [8, 32, 128, 1000, 8000];

/// A job whose unit of work is cut off.
struct CutOff<'a> {
    folder: &'a Path,
    job: String,
}

impl CutOff<'_> {
    /// Kills servers within one unit of work of the job; nothing where the units were too short for
    /// that, and the server that goes on with the job where not.
    async fn within_one_unit(&self, mut server: Server) -> Result<Server, Server> {
        let mut cut_off = 0;
        loop {
            let shown = server.show(&format!("/v1/jobs/{}", self.job)).await;
            assert_ne!(shown["status"], "failed", "{shown}");
            if shown["status"] == "succeeded" {
                return Err(server);
            }
            // Slices that began since the last checkpoint. A unit that was done sets it back.
            let begun = shown["attempt"].as_u64().expect("a number of slices");
            cut_off = cut_off.min(begun);
            if cut_off == CUT_OFF {
                return Ok(server);
            }
            if begun > cut_off {
                server.kill();
                cut_off += 1;
                server = Server::start(self.folder, UNBROKEN);
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn p3_five_kills_within_one_long_unit_of_work_do_not_fail_its_job() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut server = Server::start(folder.path(), UNBROKEN);
    let dataset = server.store(&plant::recording(MANY_SAMPLES)).await;
    for population in POPULATIONS {
        let mut job = plant::job(&dataset, 1, 1);
        job["method"]["population"] = population.into();
        let key = format!("{population} candidates");
        let job = server.submit(&job, &key).await.expect("an answer");
        let folder = folder.path();
        let cut_off = CutOff { folder, job };
        server = match cut_off.within_one_unit(server).await {
            Ok(server) => {
                assert_eq!(server.ended(&cut_off.job).await["status"], "succeeded");
                return;
            }
            Err(server) => server,
        };
    }
    panic!(
        "a unit of {} candidates was done within five kills",
        POPULATIONS[4]
    );
}
