//! What goes when it is older than it is kept for, and what stays.

use std::time::Duration;

use super::*;

on_both! {
    jobs_go_with_age_or_number_and_never_before_their_end,
    the_audit_log_never_changes_and_goes_with_age_alone,
}
use crate::job::Status;
use crate::store::{AuditEntry, Retention, Tidied};

async fn ended(fixture: &Fixture) -> JobId {
    let id = fixture.submit().await.id;
    fixture.store.jobs().cancel(id).await.expect("a write");
    id
}

async fn is_there(fixture: &Fixture, id: JobId) -> bool {
    fixture
        .store
        .jobs()
        .find(id)
        .await
        .expect("a read")
        .is_some()
}

async fn jobs_go_with_age_or_number_and_never_before_their_end(fixture: Fixture) {
    let first = ended(&fixture).await;
    let unfinished = fixture.submit().await.id;
    let second = ended(&fixture).await;
    let third = ended(&fixture).await;
    let day = Some(Duration::from_hours(24));
    let keep = |jobs, most_jobs| Retention {
        jobs,
        most_jobs,
        ..Retention::default()
    };
    let young = fixture
        .store
        .tidy(keep(day, Some(3)))
        .await
        .expect("a write");
    assert_eq!(young, Tidied::default());
    let tidied = fixture
        .store
        .tidy(keep(None, Some(2)))
        .await
        .expect("a write");
    assert_eq!(tidied.jobs, 1);
    assert!(!is_there(&fixture, first).await);
    assert!(is_there(&fixture, second).await && is_there(&fixture, third).await);
    let tidied = fixture
        .store
        .tidy(keep(Some(Duration::ZERO), None))
        .await
        .expect("a write");
    assert_eq!(tidied.jobs, 2);
    assert!(is_there(&fixture, unfinished).await);
    let row = fixture
        .store
        .jobs()
        .find(unfinished)
        .await
        .expect("a read")
        .expect("the job");
    assert_eq!(row.status, Status::Queued);
}

async fn the_audit_log_never_changes_and_goes_with_age_alone(fixture: Fixture) {
    let entry = AuditEntry {
        who: "token mes".to_owned(),
        project: Some(Default::default()),
        address: "10.0.0.1".to_owned(),
        method: "POST".to_owned(),
        path: "/v1/jobs".to_owned(),
        status: 202,
        request_id: "r-1".to_owned(),
        left_out: 0,
    };
    fixture
        .store
        .audit()
        .add(entry.clone())
        .await
        .expect("a write");
    let read = async || {
        let page = fixture
            .store
            .audit()
            .list(&Default::default(), true, None, 10)
            .await;
        page.expect("a page").rows
    };
    assert_eq!(read().await[0].entry, entry);
    let pool = &fixture.store.database().writer_pool;
    let mut changes = vec!["update audit set who = 'nobody'", "delete from audit"];
    changes.push(pool.kind().either(
        "insert or replace into audit (id, at, who, address, method, path, status, request_id) \
         select id, at, 'nobody', address, method, path, status, request_id from audit",
        "truncate audit",
    ));
    for change in changes {
        let refused = database::query(change).execute(pool).await;
        assert!(refused.is_err(), "{change}");
    }
    let all = Retention {
        audit: Some(Duration::ZERO),
        ..Retention::default()
    };
    // Nothing younger than 30 days goes, whatever is asked.
    let tidied = fixture.store.tidy(all).await.expect("a write");
    assert_eq!(tidied.audit, 0);
    assert_eq!(read().await.len(), 1);
}
