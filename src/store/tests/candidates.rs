//! The record of candidates: its form on disk, its parts and its fence.

use super::*;

on_both! {
    candidates_come_back_as_they_were_in_parts_of_whole_generations,
    a_slice_that_lost_its_job_keeps_no_candidates_and_a_deleted_job_has_none,
}
use crate::job::candidate::SimulationFailure;
use crate::job::{Candidate, CandidateColumn};

fn column(name: &str) -> CandidateColumn {
    CandidateColumn {
        name: name.to_owned(),
        unit: "kg".to_owned(),
        experiment: None,
        state: None,
    }
}

pub(super) fn candidate(generation: u32, place: u32) -> Candidate {
    Candidate {
        generation,
        place,
        cost: Some(1.0 / f64::from(generation + place)),
        failure: None,
        values: vec![0.1 + 0.2, f64::from(place)],
    }
}

fn failed(generation: u32, place: u32, failure: SimulationFailure) -> Candidate {
    Candidate {
        cost: None,
        failure: Some(failure),
        ..candidate(generation, place)
    }
}

pub(super) fn record(
    candidates: Vec<Candidate>,
    kept: u64,
    cut_in_generation: Option<u32>,
) -> Record {
    Record {
        candidates: Some(NewCandidates {
            columns: [column("mass"), column("damping")].into(),
            candidates,
            kept,
            cut_in_generation,
        }),
        ..Record::default()
    }
}

async fn candidates_come_back_as_they_were_in_parts_of_whole_generations(fixture: Fixture) {
    let id = fixture.submit().await.id;
    let part = async |after, generations, enough| {
        let part = fixture
            .store
            .candidates()
            .page(id, after, generations, enough);
        part.await.expect("a read")
    };
    assert_eq!(part(0, 10, 10).await, CandidatePage::default());
    let slice = fixture.begin(id).await;
    let all = vec![
        candidate(1, 0),
        failed(1, 1, SimulationFailure::Diverged),
        failed(1, 7, SimulationFailure::OutOfRange),
        failed(2, 3, SimulationFailure::StepBudget),
        candidate(5, 2),
    ];
    let (first, second) = all.split_at(3);
    for (candidates, kept, cut) in [(first, 3, None), (second, 5, Some(6))] {
        let record = record(candidates.to_vec(), kept, cut);
        let hold = fixture.store.slices().record(slice.lease, record).await;
        assert_eq!(hold.expect("a write"), Hold::Kept);
    }
    let whole = part(0, 10, 100).await;
    assert_eq!(whole.candidates, all);
    assert_eq!(whole.columns, [column("mass"), column("damping")]);
    assert_eq!((whole.kept, whole.cut_in_generation), (5, Some(6)));
    assert_eq!(whole.more_after, None);
    let by_generations = part(0, 2, 100).await;
    assert_eq!(by_generations.candidates, all[..4]);
    assert_eq!(by_generations.more_after, Some(2));
    let by_number = part(0, 10, 1).await;
    assert_eq!(by_number.candidates, first);
    assert_eq!(by_number.more_after, Some(1));
    assert_eq!(part(2, 10, 100).await.candidates, all[4..]);
    assert_eq!(part(5, 10, 100).await.candidates, []);
    let bytes: i64 = database::query_scalar("select sum(length(candidates)) from candidates")
        .fetch_one(fixture.store.readers())
        .await
        .expect("a sum");
    assert_eq!(bytes, 5 * (13 + 2 * 8), "what the setting promises");
}

async fn a_slice_that_lost_its_job_keeps_no_candidates_and_a_deleted_job_has_none(
    fixture: Fixture,
) {
    let id = fixture.submit().await.id;
    let old = fixture.begin(id).await;
    let new = fixture.begin(id).await;
    let late = record(vec![candidate(1, 0)], 1, None);
    let hold = fixture.store.slices().record(old.lease, late.clone()).await;
    assert_eq!(hold.expect("a write"), Hold::Lost);
    let kept = fixture.store.candidates().page(id, 0, 10, 10).await;
    assert_eq!(kept.expect("a read"), CandidatePage::default());
    let hold = fixture.store.slices().record(new.lease, late).await;
    assert_eq!(hold.expect("a write"), Hold::Kept);
    assert_eq!(fixture.finish(&new, Status::Succeeded).await, Hold::Kept);
    let removed = fixture.store.jobs().delete(id).await.expect("a write");
    assert!(matches!(removed, JobRemoval::Removed));
    let left: i64 = database::query_scalar(
        "select (select count(*) from candidates) + (select count(*) from candidate_records)",
    )
    .fetch_one(fixture.store.readers())
    .await
    .expect("a count");
    assert_eq!(left, 0);
}
