//! Tables of a PostgreSQL, and the history of an Ignition gateway in one.

use serde_json::Value;
use sqlx::{Connection as _, PgConnection};

use super::super::app::TestApp;
use super::super::cluster;
use super::{Collector, samples};

/// The address of a PostgreSQL in which statements were run; nothing where none is installed.
async fn holding(statements: &str) -> Option<String> {
    let address = cluster::new_database()?;
    let mut connection = PgConnection::connect(&address).await.unwrap();
    let statements = sqlx::AssertSqlSafe(statements.to_owned());
    sqlx::raw_sql(statements)
        .execute(&mut connection)
        .await
        .unwrap();
    Some(address)
}

fn source(kind: &str, address: &str, series: &str) -> String {
    format!(
        "[[source]]\nname = \"tables\"\nkind = \"{kind}\"\naddress = \"{address}\"\n\
         from = 2026-03-01T00:00:00Z\npage_rows = 10\n[[source.series]]\nstream = \"rig-4\"\n{series}"
    )
}

fn numbers(samples: &[(f64, Value)]) -> Vec<(f64, f64)> {
    let present = samples.iter().filter(|(_, value)| !value.is_null());
    present
        .map(|(time, value)| (*time, value.as_f64().unwrap()))
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn columns_of_a_table_come_with_every_digit_and_rows_of_one_instant_together() {
    let Some(address) = holding(
        "CREATE SCHEMA plant; CREATE TABLE plant.\"Press 4\" (taken timestamptz, pos double precision, \
         \"valve open\" boolean, note text); \
         INSERT INTO plant.\"Press 4\" SELECT '2026-03-02T08:15:00Z'::timestamptz + n * interval '1 ms', \
         0.1 + n * 1e-9, n % 2 = 1, 'x' FROM generate_series(0, 24) n; \
         INSERT INTO plant.\"Press 4\" SELECT '2026-03-02T08:15:01Z', 7, NULL, '' FROM generate_series(1, 15)",
    )
    .await
    else {
        return;
    };
    let app = TestApp::start().await;
    let series = "table = \"plant.Press 4\"\ntime = \"taken\"\n[source.series.signals]\n\
                  position = { column = \"pos\", unit = \"mm\" }\n\
                  valve = { column = \"valve open\", interpolation = \"hold\" }\n";
    let collector = Collector::of(&app, &source("postgresql", &address, series));
    assert_eq!(collector.once().await, 0);
    let stored = numbers(&samples(&app, "rig-4", "position").await);
    let last = (1.0, 7.0 / 1000.0);
    let value = |n: u32| (0.1 + f64::from(n) * 1e-9) / 1000.0;
    let expected = (0..25).map(|n| (f64::from(n) / 1000.0, value(n)));
    let expected: Vec<_> = expected.chain([last]).collect();
    assert_eq!(stored.len(), expected.len());
    for (stored, expected) in stored.iter().zip(&expected) {
        assert!(
            (stored.0 - expected.0).abs() < 1e-9,
            "{stored:?} {expected:?}"
        );
        assert!(
            (stored.1 / expected.1 - 1.0).abs() < 1e-14,
            "{stored:?} {expected:?}"
        );
    }
    let valve = numbers(&samples(&app, "rig-4", "valve").await);
    assert_eq!(
        valve
            .iter()
            .map(|sample| sample.1)
            .take(3)
            .collect::<Vec<_>>(),
        [0.0, 1.0, 0.0]
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tag_of_a_long_table_keeps_the_quality_of_its_values() {
    let Some(address) = holding(
        "CREATE TABLE history (tag text, ms bigint, val real, quality int); \
         INSERT INTO history SELECT tag, 1772439300000 + 1000 * n, n, CASE n WHEN 7 THEN 0 ELSE 192 END \
         FROM generate_series(0, 24) n, (VALUES ('PT-101'), ('PT-''102')) tags (tag)",
    )
    .await
    else {
        return;
    };
    let app = TestApp::start().await;
    let series = "table = \"history\"\ntime = \"ms\"\ntime_unit = \"ms\"\nquality_scheme = \"opc_da\"\n\
                  where = { tag = \"PT-'102\" }\n\
                  signals = { pressure = { column = \"val\", unit = \"bar\", quality = \"quality\" } }\n";
    let collector = Collector::of(&app, &source("postgresql", &address, series));
    assert_eq!(collector.once().await, 0);
    let stored = numbers(&samples(&app, "rig-4", "pressure").await);
    let good = (0..25).filter(|n| *n != 7);
    let expected: Vec<_> = good.map(|n| (f64::from(n), 1e5 * f64::from(n))).collect();
    assert_eq!(stored, expected);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_time_that_says_too_little_is_asked_for() {
    let Some(address) = holding(
        "CREATE TABLE clocks (local timestamp, counted bigint, x real); \
         INSERT INTO clocks SELECT '2026-03-02 09:15:00'::timestamp + n * interval '1 s', 1772439300 + n, n \
         FROM generate_series(0, 4) n",
    )
    .await
    else {
        return;
    };
    let app = TestApp::start().await;
    let of = |time: &str| {
        let series = format!("table = \"clocks\"\n{time}\nsignals = {{ x = {{}} }}\n");
        Collector::of(&app, &source("postgresql", &address, &series))
    };
    let refusal = of("time = \"local\"").refusal().await;
    assert!(refusal.contains("zone = "), "{refusal}");
    let refusal = of("time = \"counted\"").refusal().await;
    assert!(refusal.contains("time_unit = "), "{refusal}");
    for said in [
        "time = \"local\"\nzone = \"Europe/Berlin\"",
        "time = \"counted\"\ntime_unit = \"s\"",
    ] {
        assert_eq!(of(said).once().await, 0);
        let stored = numbers(&samples(&app, "rig-4", "x").await);
        let expected: Vec<_> = (0..5).map(|n| (f64::from(n), f64::from(n))).collect();
        assert_eq!(stored, expected, "{said}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_tag_of_ignition_goes_on_over_partitions_and_new_numbers() {
    let columns = "(tagid int, intvalue bigint, floatvalue double precision, stringvalue text, \
                   datevalue timestamp, dataintegrity int, t_stamp bigint)";
    let insert = |table: &str, tag: u8, from: u8, to: u8| {
        format!(
            "INSERT INTO {table} SELECT {tag}, NULL, n * 0.5, NULL, NULL, CASE n WHEN 3 THEN 24 ELSE 192 END, \
             1772439300000 + 1000 * n FROM generate_series({from}, {to}) n;"
        )
    };
    let statements = [
        "CREATE TABLE sqlth_te (id int, tagpath text, scid int, datatype int, querymode int, created bigint, retired bigint);"
            .to_owned(),
        "INSERT INTO sqlth_te VALUES (1, 'hall 2/pressure', 1, 1, 0, 0, 1772439310000), \
         (9, 'hall 2/pressure', 1, 1, 0, 1772439310000, NULL), (2, 'hall 2/flow', 1, 1, 0, 0, NULL);"
            .to_owned(),
        "CREATE TABLE sqlth_partitions (pname text, drvid int, start_time bigint, end_time bigint);".to_owned(),
        "INSERT INTO sqlth_partitions VALUES ('sqlt_data_1_a', 1, 1772430000000, 1772439320000), \
         ('sqlt_data_1_b', 1, 1772439320000, 1772530000000);"
            .to_owned(),
        format!("CREATE TABLE sqlt_data_1_a {columns}; CREATE TABLE sqlt_data_1_b {columns};"),
        insert("sqlt_data_1_a", 1, 0, 9),
        insert("sqlt_data_1_a", 9, 10, 19),
        insert("sqlt_data_1_a", 2, 0, 19),
        insert("sqlt_data_1_b", 9, 20, 29),
    ];
    let Some(address) = holding(&statements.concat()).await else {
        return;
    };
    let app = TestApp::start().await;
    let series = |tag: &str| format!("tag = \"{tag}\"\nsignal = \"pressure\"\nunit = \"bar\"\n");
    let collector = Collector::of(
        &app,
        &source("ignition", &address, &series("Hall 2/Pressure")),
    );
    assert_eq!(collector.once().await, 0);
    let stored = numbers(&samples(&app, "rig-4", "pressure").await);
    let good = (0..30).filter(|n| *n != 3);
    let expected: Vec<_> = good.map(|n| (f64::from(n), 5e4 * f64::from(n))).collect();
    assert_eq!(stored, expected);
    let absent = Collector::of(
        &app,
        &source("ignition", &address, &series("hall 3/pressure")),
    );
    let refusal = absent.refusal().await;
    assert!(refusal.contains("`hall 3/pressure`"), "{refusal}");
}
