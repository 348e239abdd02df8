//! The chain of the audit log: it goes on when the oldest entries go, and shows what was changed.

use super::*;
use crate::store::audit::chain::{self, CheckedChain};
use crate::store::{AuditEntry, Retention};

on_both! {
    the_chain_of_the_log_goes_on_when_the_oldest_entries_go,
    an_entry_that_is_changed_or_removed_is_found,
}

async fn add(fixture: &Fixture, entries: u32) {
    for number in 0..entries {
        let entry = AuditEntry {
            who: "token mes".to_owned(),
            project: Some(Project::default()),
            address: "10.0.0.1".to_owned(),
            method: "DELETE".to_owned(),
            path: format!("/v1/jobs/{number} \"é\""),
            status: 404,
            request_id: format!("r-{number}"),
            left_out: 0,
        };
        fixture.store.audit().add(entry).await.expect("a write");
    }
}

async fn checked(fixture: &Fixture) -> CheckedChain {
    let pool = &fixture.store.database().writer_pool;
    let mut tx = pool.begin_read().await.expect("a transaction");
    chain::check(&mut tx).await.expect("a check")
}

async fn the_chain_of_the_log_goes_on_when_the_oldest_entries_go(fixture: Fixture) {
    assert_eq!(checked(&fixture).await.head, None);
    let shorter = Retention {
        most_audit: Some(20),
        ..Retention::default()
    };
    for _ in 0..3 {
        add(&fixture, 30).await;
        let before = checked(&fixture).await;
        assert_eq!(before.findings, Vec::<String>::new());
        let tidied = fixture.store.tidy(shorter).await.expect("a write");
        assert!(tidied.audit > 0);
        let after = checked(&fixture).await;
        assert_eq!(after.findings, Vec::<String>::new());
        // The entry of the loss is the head now.
        let [before, after] = [before, after].map(|checked| checked.head.expect("a head"));
        assert_eq!(after.entry, before.entry + 1);
        let figures = fixture.store.figures().await.expect("figures");
        assert_eq!(figures.audit_head, Some(after));
    }
    // Without the digest of the last entry that went, the chain hangs in the air.
    let pool = &fixture.store.database().writer_pool;
    let removal = database::query("delete from audit_anchor");
    removal.execute(pool).await.expect("a write");
    assert_eq!(checked(&fixture).await.findings.len(), 1);
}

async fn an_entry_that_is_changed_or_removed_is_found(fixture: Fixture) {
    add(&fixture, 10).await;
    let pool = &fixture.store.database().writer_pool;
    let off = pool.kind().either(
        "drop trigger audit_never_changes; drop trigger audit_is_kept",
        "alter table audit disable trigger user",
    );
    for statement in off.split("; ") {
        let mut query = database::QueryBuilder::new("");
        query.push(statement);
        query.build().execute(pool).await.expect("a change");
    }
    for (change, findings) in [
        ("update audit set who = 'nobody' where id = 3", 1),
        ("delete from audit where id = 5", 2),
        ("update audit set chain = null where id = 7", 4),
    ] {
        database::query(change)
            .execute(pool)
            .await
            .expect("a change");
        let checked = checked(&fixture).await;
        assert_eq!(checked.findings.len(), findings, "{:?}", checked.findings);
        assert!(checked.findings[0].contains("entry 3 "));
    }
}
