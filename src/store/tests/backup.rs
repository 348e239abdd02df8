//! Copies of a database at work, and files that are damaged.

use std::fs;
use std::path::PathBuf;

use super::*;
use crate::encrypted_file::{Identities, Recipients};
use crate::store::backup::{self as file, Restoring};

/// The example of age-encryption.org/v1: an identity, and the recipient whose it is.
const IDENTITY: &str = "AGE-SECRET-KEY-1GFPYYSJZGFPYYSJZGFPYYSJZGFPYYSJZGFPYYSJZGFPYYSJZGFPQ4EGAEX";
const RECIPIENT: &str = "age1zvkyg2lqzraa2lnjvqej32nkuu0ues2s82hzrye869xeexvn73equnujwj";

fn replacing() -> Restoring {
    Restoring {
        replace: true,
        ..Restoring::default()
    }
}

impl Fixture {
    fn beside(&self, name: &str) -> PathBuf {
        self.file().with_file_name(name)
    }
}

/// A database that was restored has these jobs.
async fn assert_has(fixture: &Fixture, restored: PathBuf, jobs: &[JobRow]) {
    let settings = DatabaseSettings {
        place: DatabasePlace::File(restored),
        ..fixture.settings.clone()
    };
    let store = open(&settings, &fixture.changes).await;
    for row in jobs {
        let restored_row = store.jobs().find(row.id).await.expect("a read");
        assert_eq!(restored_row.as_deref(), Some(row));
    }
    store.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_of_a_database_at_work_has_every_job_that_was_acknowledged_before() {
    let fixture = Fixture::new().await;
    let copy = fixture.beside("copy.db");
    let mut before = Vec::new();
    for _ in 0..50 {
        before.push(fixture.submit().await);
    }
    let submitting = async {
        for _ in 0..50 {
            fixture.submit().await;
        }
    };
    let (copied, ()) = tokio::join!(file::backup(fixture.file(), &copy, None), submitting);
    copied.expect("a copy");
    let checked = file::check(&copy).await.expect("a readable file");
    assert_eq!(checked.findings, Vec::<String>::new());
    assert_eq!(checked.unsealed, 0);
    let again = file::backup(fixture.file(), &copy, None).await;
    assert!(matches!(again, Err(StoreError::File { .. })), "it is there");

    let restored = fixture.beside("restored.db");
    file::restore(&copy, &restored, Restoring::default())
        .await
        .expect("a database");
    assert_has(&fixture, restored, &before).await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_backup_takes_the_place_of_a_database_only_when_that_is_meant_and_nobody_has_it() {
    let fixture = Fixture::new().await;
    let first = fixture.submit().await.id;
    let copy = fixture.beside("copy.db");
    let database = fixture.file().to_owned();
    file::backup(&database, &copy, None).await.expect("a copy");
    let later = fixture.submit().await.id;
    let in_use = file::restore(&copy, &database, replacing()).await;
    assert!(
        matches!(in_use, Err(StoreError::Locked { .. })),
        "{in_use:?}"
    );
    let Fixture {
        store,
        changes,
        settings,
        _folder,
    } = fixture;
    store.close().await;
    drop(store);
    let there = file::restore(&copy, &database, Restoring::default()).await;
    assert!(matches!(there, Err(StoreError::File { .. })), "{there:?}");
    file::restore(&copy, &database, replacing())
        .await
        .expect("a database");
    let store = open(&settings, &changes).await;
    assert!(store.jobs().find(first).await.expect("a read").is_some());
    assert!(store.jobs().find(later).await.expect("a read").is_none());
    store.close().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn tokens_that_were_revoked_after_a_backup_stay_revoked_and_the_log_says_where_all_comes_from()
 {
    let fixture = Fixture::new().await;
    let (copy, database) = (fixture.beside("copy.db"), fixture.file().to_owned());
    let place = DatabasePlace::File(database.clone());
    for name in ["mes", "lost"] {
        let new = tokens::NewToken {
            name: name.to_owned(),
            digest: crate::access::Secret::new().expect("random bytes").digest(),
            scope: crate::access::Scope::Read,
            streams: None,
            project: Project::default(),
            expires_at: None,
        };
        assert!(tokens::create(&place, new).await.expect("a token"));
    }
    file::backup(&database, &copy, None).await.expect("a copy");
    assert!(tokens::revoke(&place, "lost").await.expect("a token"));
    let Fixture {
        store,
        changes,
        settings,
        _folder,
    } = fixture;
    store.close().await;
    drop(store);
    let restored = file::restore(&copy, &database, replacing()).await;
    let revoked = restored.expect("a database").revoked;
    assert_eq!(revoked, Some(vec!["lost".to_owned()]));
    let tokens = tokens::list(&place).await.expect("tokens").into_iter();
    let counting: Vec<String> = tokens
        .filter(|token| token.is_valid_at(jiff::Timestamp::now()))
        .map(|token| token.name)
        .collect();
    assert_eq!(counting, ["mes"]);
    let store = open(&settings, &changes).await;
    let project = Project::default();
    let log = store.audit().list(&project, true, None, 10);
    let log = log.await.expect("a page").rows;
    let commands: Vec<&str> = log.iter().map(|row| row.entry.path.as_str()).collect();
    let expected = [
        "token revoke lost".to_owned(),
        format!("restore {}", copy.display()),
        format!("backup {}", copy.display()),
        "token create --name lost --scope read --project default".to_owned(),
        "token create --name mes --scope read --project default".to_owned(),
    ];
    assert_eq!(commands, expected);
    store.close().await;
    let checked = file::check(&database).await.expect("a readable file");
    assert_eq!(checked.findings, Vec::<String>::new());
    assert_eq!(checked.audit_head.map(|head| head.entry), Some(5));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_file_is_found_and_never_restored() {
    let fixture = Fixture::new().await;
    for _ in 0..200 {
        fixture.submit().await;
    }
    let copy = fixture.beside("copy.db");
    file::backup(fixture.file(), &copy, None)
        .await
        .expect("a copy");
    let sound = fs::read(&copy).expect("a file");
    // SQLite's pages of the smallest database have 4096 bytes; each is hit once, in its header.
    for page in 1..sound.len() / 4096 {
        let mut damaged = sound.clone();
        damaged[page * 4096..page * 4096 + 100].fill(0xa5);
        fs::write(&copy, damaged).expect("a file");
        let sound = file::check(&copy)
            .await
            .is_ok_and(|findings| findings.findings.is_empty());
        assert!(!sound, "page {page}");
        let restored =
            file::restore(&copy, &fixture.beside("restored.db"), Restoring::default()).await;
        assert!(restored.is_err(), "page {page}");
    }
    assert!(!fixture.beside("restored.db").exists());
}

#[tokio::test]
async fn a_table_that_is_gone_is_found_by_check_and_at_the_start() {
    for (table, removal) in [
        ("tokens", "drop table tokens"),
        ("generations", "drop table generations"),
        ("river_job", "drop table river_job"),
    ] {
        let fixture = Fixture::new().await;
        fixture.submit().await;
        let pool = &fixture.store.database().writer_pool;
        let removed = database::query(removal).execute(pool).await;
        removed.expect("a table less");
        let findings = file::check(fixture.file()).await;
        let findings = findings.expect("a readable file").findings;
        let told = format!("the table {table} is missing");
        assert!(findings.contains(&told), "{findings:?}");
        let Fixture {
            store,
            settings,
            _folder,
            ..
        } = fixture;
        store.close().await;
        drop(store);
        let opened = Store::open(&settings, Arc::new(|_| ())).await;
        let refused = opened.err().expect("no server");
        assert!(refused.to_string().contains("is missing"), "{refused}");
    }
}

#[tokio::test]
async fn a_newer_database_is_refused() {
    let fixture = Fixture::new().await;
    fixture.submit().await;
    let newer = "insert into _sqlx_migrations \
                 select version + 1000, description, installed_on, success, checksum, execution_time \
                 from _sqlx_migrations order by version desc limit 1";
    let write = fixture.store.database().writer.write(move |tx| {
        Box::pin(async move {
            database::query(newer).execute(&mut **tx).await?;
            Ok(())
        })
    });
    write.await.expect("a newer schema");
    let findings = file::check(fixture.file())
        .await
        .expect("a readable file")
        .findings;
    assert!(findings[0].contains("is newer than"), "{findings:?}");
    let Fixture {
        store, settings, ..
    } = &fixture;
    store.close().await;
    let settings = settings.clone();
    let Fixture { store, _folder, .. } = fixture;
    drop(store);
    let opened = Store::open(&settings, Arc::new(|_| ())).await.err();
    assert!(
        matches!(opened, Some(StoreError::Migration(_))),
        "{opened:?}"
    );
}

#[cfg(unix)]
#[tokio::test(flavor = "multi_thread")]
async fn a_database_its_log_and_its_copies_are_for_their_owner_alone() {
    use std::os::unix::fs::PermissionsExt;
    let fixture = Fixture::new().await;
    fixture.submit().await;
    let (copy, restored) = (fixture.beside("copy.db"), fixture.beside("restored.db"));
    file::backup(fixture.file(), &copy, None)
        .await
        .expect("a copy");
    // A backup that others may read does not make a database that others may read.
    fs::set_permissions(&copy, fs::Permissions::from_mode(0o644)).expect("a change");
    let done = file::restore(&copy, &restored, Restoring::default()).await;
    done.expect("a database");
    let second = fixture.beside("second.db");
    file::backup(fixture.file(), &second, None)
        .await
        .expect("a copy");
    let mode = |path: &Path| {
        let metadata = fs::metadata(path).expect("a file");
        metadata.permissions().mode() & 0o777
    };
    let beside = |end: &str| crate::store::private_file::beside(fixture.file(), end);
    let files = [fixture.file().to_owned(), beside("-wal"), beside("-shm")];
    for path in files.iter().chain([&restored, &second]) {
        assert_eq!(mode(path), 0o600, "{}", path.display());
    }
    // The files of an older program are mended at the next start.
    let database = fixture.file().to_owned();
    fs::set_permissions(&database, fs::Permissions::from_mode(0o664)).expect("a change");
    let fixture = fixture.reopen().await;
    assert_eq!(mode(fixture.file()), 0o600);
    fixture.store.close().await;
}

#[tokio::test]
async fn an_encrypted_backup_is_restored_by_its_recipient_alone() {
    let fixture = Fixture::new().await;
    let row = fixture.submit().await;
    let (copy, restored) = (fixture.beside("copy.age"), fixture.beside("restored.db"));
    let recipients = Recipients::read(&[RECIPIENT.to_owned()], &[]).expect("a key");
    file::backup(fixture.file(), &copy, recipients.as_ref())
        .await
        .expect("a copy");
    let bytes = fs::read(&copy).expect("a file");
    assert!(!bytes.windows(6).any(|bytes| bytes == b"SQLite"));
    assert!(
        !bytes
            .windows(row.id.to_string().len())
            .any(|bytes| bytes == row.id.to_string().as_bytes())
    );
    let folder = fixture.file().parent().expect("a folder");
    let names = fs::read_dir(folder).expect("a folder");
    let names = names.map(|entry| entry.expect("a file").file_name());
    let left: Vec<_> = names
        .filter(|name| name.to_string_lossy().starts_with(".greybox-copy"))
        .collect();
    assert!(left.is_empty(), "{left:?}");

    let without_key = file::restore(&copy, &restored, Restoring::default()).await;
    let error = without_key.expect_err("no key");
    assert!(
        error
            .to_string()
            .contains("the key of one of its recipients"),
        "{error}"
    );
    assert!(!restored.exists());
    let file = fixture.beside("identity.txt");
    fs::write(&file, format!("# an example\n{IDENTITY}\n")).expect("a file");
    let how = Restoring {
        identities: Some(Identities::of_file(&file).expect("a key")),
        ..Restoring::default()
    };
    file::restore(&copy, &restored, how)
        .await
        .expect("a database");
    assert_has(&fixture, restored, &[row]).await;
}
