//! P4 and P5 for draws from a posterior: a server that is killed while its chains move comes to the same draws,
//! and tells each look at the chains once.

use serde_json::{Value, json};

use super::follower::{Event, Follower};
use super::kill::{BROKEN, UNBROKEN};
use super::plant;
use super::server::{Server, file};

/// Kills, each after one more look at the chains.
const KILLS: usize = 3;

fn job(dataset: &str) -> Value {
    let mut job = plant::job(dataset, 5, 1);
    job["uncertainty"] = json!({"intervals": "posterior", "posterior_generations": 1500});
    // A prior that is looser than the data leaves the chains with far to go.
    job["parameters"]["coulomb_friction"]["prior"] = json!({"mean": 0.5, "std": 0.5});
    job
}

/// The looks at the chains, as they were told.
fn looks(events: &[Event]) -> Vec<&str> {
    let looks = events.iter().filter(|event| event.name == "posterior");
    looks.map(|event| &*event.data).collect()
}

/// What a job says of its parameters and of their posterior.
async fn drawn(server: &Server, job: &str) -> [Value; 2] {
    let result = server.show(&format!("/v1/jobs/{job}/result")).await;
    ["parameters", "posterior"].map(|part| result[part].clone())
}

#[tokio::test(flavor = "multi_thread")]
async fn p4_kills_while_chains_move_change_no_draw_and_no_look_is_told_twice() {
    let folder = tempfile::tempdir().expect("a folder");
    let server = Server::start(folder.path(), UNBROKEN);
    let dataset = server.store(&plant::recording(400)).await;
    let id = server.submit(&job(&dataset), "unbroken").await;
    let unbroken = Follower::new(&id.expect("an answer"));
    let unbroken = unbroken.follow(&server).await;
    assert!(looks(&unbroken.events).len() >= 2, "{:?}", unbroken.events);
    let expected = drawn(&server, &unbroken.job).await;
    assert!(
        expected[1]["rows"]
            .as_array()
            .is_some_and(|rows| rows.len() > 100)
    );

    let folder_of_broken = tempfile::tempdir().expect("a folder");
    let database = file(folder_of_broken.path());
    let mut server = Server::start_on(&database, BROKEN);
    let dataset = server.store(&plant::recording(400)).await;
    let id = server.submit(&job(&dataset), "broken").await;
    let mut follower = Follower::new(&id.expect("an answer"));
    for kill in 1..=KILLS {
        let is_enough = |events: &[Event]| looks(events).len() >= kill;
        follower = follower.follow_until(&server, is_enough).await;
        server.kill();
        server = Server::start_on(&database, BROKEN);
    }
    server.ended(&follower.job).await;
    if !follower.has_ended() {
        follower = follower.follow(&server).await;
    }
    assert_eq!(looks(&follower.events), looks(&unbroken.events));
    // The results are longer than a difference can be read.
    assert!(drawn(&server, &follower.job).await == expected);
}
