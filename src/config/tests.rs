//! Flags into settings.

use std::net::IpAddr;

use clap::Parser;

use super::*;

#[derive(Parser)]
struct Command {
    #[command(flatten)]
    settings: Settings,
}

fn parse(flags: &[&str]) -> Settings {
    let command = std::iter::once("greybox").chain(flags.iter().copied());
    Command::try_parse_from(command).expect("flags").settings
}

#[test]
fn flags_say_how_the_server_runs() {
    let settings = parse(&[
        "--listen=127.0.0.1:0",
        "--database=sqlite:///var/lib/greybox/jobs.db",
        "--threads=3",
        "--slice-s=0.005",
        "--max-body-mib=1",
        "--max-candidates=7",
    ]);
    let database = settings.database().expect("a path");
    assert_eq!(database.place.to_string(), "/var/lib/greybox/jobs.db");
    let worker = settings.worker().expect("a slice");
    assert_eq!(worker.slice_length, Duration::from_millis(5));
    assert_eq!(worker.jobs_at_once, 3);
    assert_eq!(worker.max_candidates, 7);
    assert_eq!(settings.limits().dataset_bytes, 1 << 20);
}

#[test]
fn the_defaults_of_the_flags_are_those_of_the_program() {
    let (flags, program) = (parse(&[]), Settings::default());
    assert_eq!(format!("{flags:?}"), format!("{program:?}"));
    assert_eq!(program.listen.to_string(), "127.0.0.1:8080");
}

#[test]
fn what_is_no_database_file_is_refused() {
    for url in [
        "postgres://localhost:port/greybox",
        "sqlite::memory:",
        "sqlite://:memory:",
        "sqlite://",
        "sqlite:///var/lib/",
        "jobs.db",
    ] {
        let settings = parse(&[&format!("--database={url}")]);
        let refused = settings.database().err();
        assert_eq!(refused, Some(SettingsError::Database));
    }
}

#[test]
fn the_address_of_the_database_may_stand_in_a_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("database");
    let flag = format!("--database-file={}", file.display());
    let missing = parse(&[&flag]).database().expect_err("there is no file");
    assert!(
        missing.to_string().contains(&*file.to_string_lossy()),
        "{missing}"
    );
    std::fs::write(
        &file,
        "postgres://greybox:secret@db.plant.example/greybox\n",
    )
    .expect("a file");
    let settings = parse(&[&flag]).database().expect("an address");
    let place = settings.place.to_string();
    assert_eq!(place, "postgres://db.plant.example:5432/greybox");
    std::fs::write(&file, "greybox:secret").expect("a file");
    let refused = parse(&[&flag]).database().expect_err("no address");
    let text = refused.to_string();
    assert!(
        text.contains(&*file.to_string_lossy()) && !text.contains("secret"),
        "{text}"
    );
    let both = parse(&[&flag, "--database=sqlite:///var/lib/greybox/jobs.db"]);
    assert_eq!(both.database().err(), Some(SettingsError::TwoDatabases));
    let unverified = parse(&["--database=postgres://h/d?sslmode=verify-ca"]);
    assert!(matches!(
        unverified.database(),
        Err(SettingsError::Address(_))
    ));
}

#[test]
fn proxies_and_roles_are_read() {
    let settings = parse(&[
        "--trusted-proxy=10.0.0.7,fd00::/8",
        "--role=plant it=admin",
        "--role=operators=read:hall-2",
        "--proxy-user-header=Remote-User",
    ]);
    let access = settings.access().expect("settings");
    assert_eq!(access.proxies.len(), 2);
    assert!(access.proxies[0].contains(&IpAddr::from([10, 0, 0, 7])));
    assert_eq!(access.user_header, "remote-user");
    assert!(access.roles.of("operators").is_some());
    let settings = parse(&["--trusted-proxy=gateway"]);
    let refused = settings.access().expect_err("a name is no address");
    assert_eq!(refused, SettingsError::Network("gateway".to_owned()));
}

#[test]
fn a_beat_that_is_no_time_is_refused() {
    for node_beat_s in [-1.0, 0.0, f64::NAN, 1e9] {
        let settings = Settings {
            node_beat_s,
            ..Settings::default()
        };
        assert!(matches!(
            settings.database(),
            Err(SettingsError::NodeBeat(_))
        ));
    }
}

#[test]
fn a_slice_that_is_no_time_is_refused() {
    for slice_s in [-1.0, f64::NAN, 1e9] {
        let settings = Settings {
            slice_s,
            ..Settings::default()
        };
        assert!(matches!(settings.worker(), Err(SettingsError::Slice(_))));
    }
}
