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
    assert!(access.roles.of(&["operators"]).is_some());
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

#[test]
fn an_identity_provider_is_read_and_what_cannot_be_one_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("secret");
    let secret = format!("--oidc-client-secret-file={}", file.display());
    let flags = |issuer: &'static str| {
        [
            issuer,
            "--oidc-client-id=greybox",
            "--public-url=https://greybox.plant.example",
            "--oidc-scope=profile, roles",
        ]
    };
    let with = |issuer| parse(&[&flags(issuer)[..], &[&*secret]].concat());
    let settings = with("--oidc-issuer=https://login.plant.example/realms/plant");
    let refused = settings.oidc.provider().expect_err("there is no file");
    assert!(
        refused.to_string().contains(&*file.to_string_lossy()),
        "{refused}"
    );
    std::fs::write(&file, "s3cret\n").expect("a file");
    let provider = settings.oidc.provider().expect("settings");
    let provider = provider.expect("a provider");
    assert_eq!(provider.issuer, "https://login.plant.example/realms/plant");
    assert_eq!(provider.client_secret.as_deref(), Some("s3cret"));
    assert_eq!(provider.scopes, ["profile", "roles"]);
    let callback = "https://greybox.plant.example/v1/session/callback";
    assert_eq!(provider.callback.as_str(), callback);
    assert_eq!(settings.names(), Names::new(["greybox.plant.example"]));

    let settings = with("--oidc-issuer=http://login.plant.example");
    let refused = settings.oidc.provider().expect_err("it is in the clear");
    assert!(matches!(refused, SettingsError::Provider(_)), "{refused}");
    let alone = ["greybox", "--oidc-issuer=https://login.plant.example"];
    assert!(Command::try_parse_from(alone).is_err());
    assert!(parse(&[]).oidc.provider().expect("settings").is_none());
}
