//! What `greybox doctor` finds before a server is started.

use super::{printed, run};
use serde_json::Value;

/// What `doctor` finds of each matter with some arguments, and whether it succeeds.
fn findings_of(arguments: &[&str]) -> (Vec<String>, bool) {
    let output = run(&[&["doctor", "--json"], arguments].concat());
    let findings: Value = serde_json::from_slice(&output.stdout).expect("a document");
    let findings = findings.as_array().expect("findings").iter();
    let word = |finding: &Value, name: &str| finding[name].as_str().expect("a text").to_owned();
    let lines = findings.map(|finding| {
        let [about, condition, says] =
            ["about", "condition", "says"].map(|name| word(finding, name));
        format!("{about} {condition}: {says}")
    });
    (lines.collect(), output.status.success())
}

#[track_caller]
fn assert_found(findings: &[String], expected: &str) {
    let is_found = findings.iter().any(|finding| finding.starts_with(expected));
    assert!(is_found, "{expected}\n{findings:#?}");
}

#[test]
fn a_doctor_finds_what_keeps_a_server_from_starting_and_changes_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("greybox.db");
    let database = format!("--database=sqlite://{}", file.display());
    let (findings, is_fine) = findings_of(&[&database, "--listen=127.0.0.1:0"]);
    assert!(is_fine, "{findings:#?}");
    assert_found(
        &findings,
        &format!("database good: {} is new", file.display()),
    );
    assert_found(
        &findings,
        "callers good: nobody has to say who they are, and this machine alone",
    );
    assert!(!file.exists());

    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let listen = format!("--listen={}", taken.local_addr().expect("an address"));
    let (findings, is_fine) = findings_of(&[&database, &listen, "--slice-s=-1"]);
    assert!(!is_fine);
    assert_found(&findings, "settings bad: a slice of -1 s");
    assert_found(&findings, "address bad: 127.0.0.1:");

    let (findings, is_fine) = findings_of(&[&database, "--listen=0.0.0.0:0"]);
    assert!(!is_fine);
    assert_found(
        &findings,
        "callers bad: nobody would have to say who they are",
    );
    assert_found(
        &findings,
        "tls doubtful: the server speaks plain HTTP, where others can read it",
    );
    printed(&["token", "create", "--name=mes", "--scope=read", &database]);
    let (findings, is_fine) = findings_of(&[&database, "--listen=0.0.0.0:0"]);
    assert!(is_fine, "{findings:#?}");
    assert_found(
        &findings,
        "callers good: callers have to say who they are (tokens: 1)",
    );

    let key = folder.path().join("keys");
    std::fs::write(&key, "no key").expect("a file");
    let keys = format!("--secret-keys-file={}", key.display());
    let provider = [
        "--oidc-issuer=http://127.0.0.1:1",
        "--oidc-client-id=greybox",
    ];
    let page = "--public-url=http://127.0.0.1:8080";
    let (findings, is_fine) = findings_of(&[&database, &keys, provider[0], provider[1], page]);
    assert!(!is_fine);
    assert_found(&findings, "secrets bad: the file ");
    assert_found(
        &findings,
        "provider bad: http://127.0.0.1:1/.well-known/openid-configuration does not answer",
    );
}

#[test]
fn a_doctor_says_no_password() {
    let output = run(&[
        "doctor",
        "--database=postgres://greybox:s3cret@127.0.0.1:1/greybox",
    ]);
    assert_eq!(output.status.code(), Some(1));
    let printed = [output.stdout, output.stderr].concat();
    let text = String::from_utf8(printed).expect("text");
    assert!(
        text.contains("BAD       database    postgres://127.0.0.1:1/greybox: "),
        "{text}"
    );
    assert!(!text.contains("s3cret"), "{text}");
}
