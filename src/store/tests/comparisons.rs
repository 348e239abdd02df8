//! Comparisons: whole or not at all, and under one key once.

use super::*;

on_both! {
    a_comparison_is_stored_whole_or_not_at_all,
    a_key_makes_one_comparison_or_one_job_and_nothing_with_another_body,
    whoever_brings_the_most_models_makes_room_for_others,
}
use crate::job::ComparisonId;

pub(super) fn comparison(key: Option<(&str, &str)>) -> NewComparison {
    NewComparison {
        project: Default::default(),
        id: ComparisonId::new(),
        jobs: vec![job(None); 3],
        model: None,
        idempotency: job(key).idempotency,
    }
}

async fn n_jobs(fixture: &Fixture) -> i64 {
    database::query_scalar("select count(*) from jobs")
        .fetch_one(fixture.store.readers())
        .await
        .expect("a count")
}

async fn a_comparison_is_stored_whole_or_not_at_all(fixture: Fixture) {
    let mut new = comparison(None);
    new.jobs[2].datasets = vec![DatasetId::new()];
    let id = new.id;
    let refused = fixture.store.comparisons().submit(new).await;
    assert!(
        matches!(refused, Ok(Submitted::NoDataset(_))),
        "{refused:?}"
    );
    assert_eq!(n_jobs(&fixture).await, 0);
    assert_eq!(
        fixture.store.comparisons().find(id).await.expect("a read"),
        None
    );

    let new = comparison(None);
    let id = new.id;
    let stored = fixture.store.comparisons().submit(new).await;
    let Ok(Submitted::Created(stored)) = stored else {
        panic!("not created: {stored:?}");
    };
    assert_eq!(
        fixture.store.comparisons().find(id).await.expect("a read"),
        Some(stored)
    );
    let page = fixture
        .store
        .comparisons()
        .list(&Default::default(), None, 10)
        .await
        .expect("a page");
    let listed: Vec<_> = page
        .rows
        .iter()
        .map(|row| (row.id, row.runs, row.ended))
        .collect();
    assert_eq!(listed, [(id, 3, 0)]);
}

async fn a_key_makes_one_comparison_or_one_job_and_nothing_with_another_body(fixture: Fixture) {
    let first = fixture
        .store
        .comparisons()
        .submit(comparison(Some(("k", "sha256:1"))))
        .await;
    let Ok(Submitted::Created(first)) = first else {
        panic!("not created: {first:?}");
    };
    fixture
        .store
        .jobs()
        .cancel(first.jobs[0].id)
        .await
        .expect("a wish");
    let again = fixture
        .store
        .comparisons()
        .submit(comparison(Some(("k", "sha256:1"))))
        .await;
    let Ok(Submitted::Replayed(again)) = again else {
        panic!("not replayed: {again:?}");
    };
    assert_eq!(again, first, "as it was when it was made");
    let with_other_body = comparison(Some(("k", "sha256:2")));
    let other = fixture.store.comparisons().submit(with_other_body).await;
    assert!(matches!(other, Ok(Submitted::KeyReused)), "{other:?}");
    let as_job = fixture
        .store
        .submissions()
        .submit(job(Some(("k", "sha256:1"))))
        .await;
    assert!(matches!(as_job, Ok(Submitted::KeyReused)), "{as_job:?}");
    assert_eq!(n_jobs(&fixture).await, 3);
    fixture
        .store
        .submissions()
        .submit(job(Some(("j", "sha256:1"))))
        .await
        .expect("a job");
    let as_comparison = fixture
        .store
        .comparisons()
        .submit(comparison(Some(("j", "sha256:1"))))
        .await;
    assert!(
        matches!(as_comparison, Ok(Submitted::KeyReused)),
        "{as_comparison:?}"
    );
}

async fn whoever_brings_the_most_models_makes_room_for_others(fixture: Fixture) {
    let model = |name: String, client: &str| NewModel {
        project: Default::default(),
        reference: format!("{name}@0"),
        digest: name.clone(),
        name,
        document: serde_json::json!({}),
        client: client.to_owned(),
    };
    let own = model("own".to_owned(), "neighbour");
    fixture
        .store
        .models()
        .insert(own.clone())
        .await
        .expect("room");
    let used = model("used".to_owned(), "greedy");
    fixture
        .store
        .models()
        .insert(used.clone())
        .await
        .expect("room");
    let mut with_it = job(None);
    with_it.model.clone_from(&used.reference);
    fixture
        .store
        .submissions()
        .submit(with_it)
        .await
        .expect("a job");
    for number in 0..MAX_UNUSED_MODELS + 20 {
        let one = model(format!("m{number}"), "greedy");
        let stored = fixture.store.models().insert(one).await.expect("room");
        assert!(matches!(stored, ModelStored::Created(_)));
    }
    let models = fixture
        .store
        .models()
        .list(&Default::default())
        .await
        .expect("a list");
    assert_eq!(models.len() as i64, MAX_UNUSED_MODELS + 1);
    for kept in [&own, &used] {
        assert!(
            models.iter().any(|row| row.reference == kept.reference),
            "{kept:?}"
        );
    }
}
