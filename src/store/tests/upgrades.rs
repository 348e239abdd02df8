//! Servers of different schemas on one PostgreSQL.

use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::postgres::PgConnectOptions;
use sqlx::{PgPool, SqlSafeStr as _};

use super::*;
use crate::store::database::postgres;
use crate::store::opening::Shared;

/// The address of a new database, and settings of a server there; nothing where PostgreSQL is not installed.
fn nowhere() -> Option<(PgConnectOptions, DatabaseSettings)> {
    let options: PgConnectOptions = cluster::new_database()?.parse().expect("an address");
    let place = DatabasePlace::Postgres(Box::new(options.clone()));
    let beat = Duration::from_millis(50);
    let settings = DatabaseSettings {
        beat,
        ..DatabaseSettings::of_a_command(&place)
    };
    Some((options, settings))
}

/// Brings a database to the schema that these programs have.
async fn migrate(options: &PgConnectOptions, migrations: Vec<Migration>) {
    let pool = PgPool::connect_with(options.clone()).await.expect("a pool");
    let own = Migrator::with_migrations(migrations);
    own.run(&pool).await.expect("a schema");
    pool.close().await;
}

fn own() -> Vec<Migration> {
    postgres::SCHEMA.iter().cloned().collect()
}

async fn refused(settings: &DatabaseSettings) -> StoreError {
    let opened = Store::open(settings, Arc::new(|_| ())).await;
    opened.err().expect("it is refused")
}

#[tokio::test]
async fn servers_go_on_and_begin_while_one_that_is_newer_adds_to_the_schema() {
    let Some((options, settings)) = nowhere() else {
        return;
    };
    let changes = Arc::default();
    let before = open(&settings, &changes).await;
    let newest = own().iter().map(|own| own.version).max().expect("some") + 1;
    let adds = "alter table jobs add column mark text";
    let mut next = own();
    next.push(Migration::new(
        newest,
        "marks".into(),
        MigrationType::Simple,
        adds.into_sql_str(),
        false,
    ));
    migrate(&options, next).await;
    let after = open(&settings, &changes).await;
    for store in [&before, &after] {
        let submitted = store
            .submissions()
            .submit(job(None))
            .await
            .expect("a submission");
        assert!(matches!(submitted, Submitted::Created(_)), "{submitted:?}");
    }
    after.close().await;

    let pool = PgPool::connect_with(options).await.expect("a pool");
    sqlx::query("update schema_support set oldest = $1")
        .bind(newest)
        .execute(&pool)
        .await
        .expect("an update");
    let refused = refused(&settings).await;
    assert!(
        matches!(refused, StoreError::TooNew { oldest, .. } if oldest == newest),
        "{refused}"
    );
    before.close().await;
}

#[tokio::test]
async fn a_schema_that_servers_at_work_are_too_old_for_waits_until_they_have_stopped() {
    let Some((options, settings)) = nowhere() else {
        return;
    };
    let mut older = own();
    older.retain(|own| own.version < 44);
    migrate(&options, older).await;
    let shared = Shared::of(options.clone());
    let at_work = shared.connect().await.expect("a server of that time");
    let refused = refused(&settings).await;
    assert!(
        matches!(refused, StoreError::InTheWay { schema: 43, .. }),
        "{refused}"
    );
    drop(at_work);
    open(&settings, &Arc::default()).await.close().await;

    let pool = PgPool::connect_with(options).await.expect("a pool");
    let oldest: i64 = sqlx::query_scalar("select oldest from schema_support")
        .fetch_one(&pool)
        .await
        .expect("what the database says");
    assert_eq!(oldest, postgres::OLDEST_AT_WORK);
}
