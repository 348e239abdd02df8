//! Secrets as they stand in the database: as they are without keys, encrypted with them, under a new key after a
//! change of keys.

use jiff::Timestamp;

use super::*;
use crate::job::WebhookId;
use crate::store::database;
use crate::store::secret_keys::tests::keys;

const URL: &str = "https://mes.plant.example/hook?token=of-the-receiver";
const SECRET: &str = "whsec_of-this-webhook";

on_both! {
    secrets_are_encrypted_once_there_are_keys_and_anew_under_another_key,
    a_secret_that_was_copied_to_another_webhook_is_damaged,
}

fn webhook() -> WebhookRow {
    WebhookRow {
        id: WebhookId::new(),
        project: Project::default(),
        url: URL.to_owned(),
        events: vec!["job.ended".to_owned()],
        secret: SECRET.to_owned(),
        created_at: Timestamp::now(),
    }
}

/// The server after it was started again with the keys of these lines.
async fn with_keys(mut fixture: Fixture, lines: &str) -> Fixture {
    fixture.settings.keys = keys(lines, 0o600).expect("keys");
    fixture.reopen().await
}

/// Address and secret of a webhook as they stand in the database.
async fn stored(fixture: &Fixture, id: WebhookId) -> [String; 2] {
    let (url, secret): (String, String) =
        database::query_as("select url, secret from webhooks where id = $1")
            .bind(id.to_string())
            .fetch_one(fixture.store.readers())
            .await
            .expect("a row");
    [url, secret]
}

async fn assert_is_read(fixture: &Fixture, expected: &WebhookRow) {
    let webhook = fixture.store.webhooks().find(expected.id).await;
    assert_eq!(webhook.expect("a read").as_ref(), Some(expected));
}

async fn secrets_are_encrypted_once_there_are_keys_and_anew_under_another_key(fixture: Fixture) {
    let (old_key, new_key) = ("a".repeat(64), "b".repeat(64));
    let early = webhook();
    assert!(
        fixture
            .store
            .webhooks()
            .insert(early.clone())
            .await
            .expect("a write")
    );
    assert_eq!(stored(&fixture, early.id).await, [URL, SECRET]);

    let fixture = with_keys(fixture, &old_key).await;
    let late = webhook();
    assert!(
        fixture
            .store
            .webhooks()
            .insert(late.clone())
            .await
            .expect("a write")
    );
    let under_the_old_key = stored(&fixture, early.id).await;
    for row in [&early, &late] {
        let [url, secret] = stored(&fixture, row.id).await;
        assert!(
            !url.contains("receiver") && !secret.contains("whsec_"),
            "{url} {secret}"
        );
        assert_is_read(&fixture, row).await;
    }
    let fixture = fixture.reopen().await;
    assert_eq!(stored(&fixture, early.id).await, under_the_old_key);

    let fixture = with_keys(fixture, &format!("{new_key}\n{old_key}\n")).await;
    assert_ne!(stored(&fixture, early.id).await, under_the_old_key);
    let mut fixture = with_keys(fixture, &new_key).await;
    assert_is_read(&fixture, &early).await;
    assert_is_read(&fixture, &late).await;

    fixture.settings.keys = keys(&old_key, 0o600).expect("keys");
    let refused = fixture.try_to_reopen().await.err();
    assert!(
        matches!(refused, Some(StoreError::SecretKey { .. })),
        "{refused:?}"
    );
}

async fn a_secret_that_was_copied_to_another_webhook_is_damaged(fixture: Fixture) {
    let fixture = with_keys(fixture, &"a".repeat(64)).await;
    let (one, two) = (webhook(), webhook());
    for row in [&one, &two] {
        assert!(
            fixture
                .store
                .webhooks()
                .insert(row.clone())
                .await
                .expect("a write")
        );
    }
    let [_url, secret] = stored(&fixture, one.id).await;
    let pool = &fixture.store.database().writer_pool;
    let mut tx = pool.begin_write_in_turn().await.expect("a transaction");
    database::query("update webhooks set secret = $1 where id = $2")
        .bind(secret)
        .bind(two.id.to_string())
        .execute(&mut tx)
        .await
        .expect("a write");
    tx.commit().await.expect("a write");
    let read = fixture.store.webhooks().find(two.id).await;
    assert!(matches!(read, Err(StoreError::Corrupt { .. })), "{read:?}");
    assert_is_read(&fixture, &one).await;
}

#[tokio::test]
async fn the_file_of_a_database_holds_no_secret_once_there_are_keys() {
    let fixture = Fixture::new().await;
    assert!(
        fixture
            .store
            .webhooks()
            .insert(webhook())
            .await
            .expect("a write")
    );
    let holds_a_secret = |fixture: &Fixture| {
        let bytes = std::fs::read(fixture.file()).expect("the file");
        let holds = |text: &str| {
            bytes
                .windows(text.len())
                .any(|part| part == text.as_bytes())
        };
        holds(SECRET) || holds("of-the-receiver")
    };
    let fixture = fixture.reopen().await;
    assert!(holds_a_secret(&fixture));
    let fixture = with_keys(fixture, &"a".repeat(64)).await;
    fixture.store.close().await;
    assert!(!holds_a_secret(&fixture));
}
