//! Files of every length, files of the program `age`, and files that are not what was written.

use std::fs;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use x25519_dalek::PublicKey;

use super::*;

/// The example of age-encryption.org/v1: an identity, and the recipient whose it is.
const IDENTITY: &str = "AGE-SECRET-KEY-1GFPYYSJZGFPYYSJZGFPYYSJZGFPYYSJZGFPYYSJZGFPYYSJZGFPQ4EGAEX";
const RECIPIENT: &str = "age1zvkyg2lqzraa2lnjvqej32nkuu0ues2s82hzrye869xeexvn73equnujwj";
/// What `age` 1.1.1 made of `pressure 12.5 bar` for that recipient and another.
const OF_AGE: &str = "YWdlLWVuY3J5cHRpb24ub3JnL3YxCi0+IFgyNTUxOSByeFNXTjRGZ1UrVi9xc3pVOENsTEhZSmU3Umxwd0psOVQwdm\
    56UEVlQkJZCm1zQnRpNGdXMnNRaGxLLzlFWitFbTlFUDlOYWt5b2wya3NxbGhjNkxucjAKLT4gWDI1NTE5IDN1bzBQZDZQdmZ4cnU4WGFjZHF6a21Q\
    N1MxUDA5Yjd0b2Y5WkVBM2RtVVUKL1Q3T0RRRU1LTE9pbnE1RCtDRkpscGU0RHZER3Yxb0hEV0tsSzRhMUJlQQotLS0ga29hYkVmaEk0ZGF4VzBxck\
    NUeHNhK2JVSU01MlNEY09zTVQrZ3BEZHRZMAqvy3Po5GtIDktG7SVJ893W5jlTSWxdgT0aMD+TP6ObsYFvVV+eT4DETaA9ZmNRLknG";
const CONTENT: &[u8] = b"pressure 12.5 bar";

fn recipients() -> Recipients {
    let read = Recipients::read(&[RECIPIENT.to_owned()], &[]);
    read.expect("a key").expect("one")
}

/// The identities of the lines of a file.
fn identities(lines: &str) -> Result<Identities, InvalidKeys> {
    let mut file = tempfile::NamedTempFile::new().expect("a file");
    file.write_all(lines.as_bytes()).expect("a file");
    Identities::of_file(file.path())
}

fn identity() -> Identities {
    identities(IDENTITY).expect("a key")
}

fn encrypted(content: &[u8]) -> Vec<u8> {
    let mut file = Vec::new();
    encrypt(&recipients(), &mut &content[..], &mut file).expect("a file");
    file
}

fn decrypted(identities: &Identities, mut file: &[u8]) -> Result<Vec<u8>, EncryptedFileError> {
    let mut content = Vec::new();
    decrypt(identities, &mut file, &mut content).map(|()| content)
}

#[test]
fn the_example_of_the_format_has_its_recipient() {
    let identity = &identity().0[0];
    assert_eq!(recipients().0, [PublicKey::from(identity)]);
}

#[test]
fn files_of_every_length_open_again() {
    let chunk = 64 << 10;
    for length in [0, 1, chunk - 1, chunk, chunk + 1, 2 * chunk, 3 * chunk + 17] {
        let content: Vec<u8> = (0..length).map(|k| (k % 251) as u8).collect();
        let file = encrypted(&content);
        assert!(is_encrypted(&mut &file[..]).expect("bytes"));
        assert_eq!(decrypted(&identity(), &file).expect("opens"), content);
    }
}

#[test]
fn a_file_of_age_opens() {
    let file = STANDARD.decode(OF_AGE).expect("bytes");
    assert_eq!(decrypted(&identity(), &file).expect("opens"), CONTENT);
}

#[test]
fn no_changed_byte_and_no_cut_opens() {
    let file = encrypted(CONTENT);
    for place in 0..file.len() {
        for bit in 0..8 {
            let mut changed = file.clone();
            changed[place] ^= 1 << bit;
            assert!(
                decrypted(&identity(), &changed).is_err(),
                "bit {bit} of byte {place}"
            );
        }
        assert!(
            decrypted(&identity(), &file[..place]).is_err(),
            "{place} bytes"
        );
    }
}

#[test]
fn chunks_that_are_left_out_turned_round_or_added_do_not_open() {
    let sealed = (64 << 10) + seal::TAG_BYTES;
    let file = encrypted(&vec![7; 3 * (64 << 10)]);
    let (begin, chunks) = file.split_at(file.len() - 3 * sealed);
    let chunks: Vec<&[u8]> = chunks.chunks(sealed).collect();
    let made_of = |order: &[usize]| {
        let chunks = order.iter().flat_map(|place| chunks[*place]);
        begin.iter().chain(chunks).copied().collect::<Vec<u8>>()
    };
    assert!(decrypted(&identity(), &made_of(&[0, 1, 2])).is_ok());
    for order in [&[0, 1][..], &[1, 0, 2], &[0, 2], &[0, 1, 2, 2], &[2]] {
        let opened = decrypted(&identity(), &made_of(order));
        assert!(
            matches!(opened, Err(EncryptedFileError::Damaged(_))),
            "{order:?}"
        );
    }
}

#[test]
fn a_file_for_others_and_a_file_of_another_kind_are_told_apart() {
    let stranger =
        identities("AGE-SECRET-KEY-1QYQSZQGPQYQSZQGPQYQSZQGPQYQSZQGPQYQSZQGPQYQSZQGPQYQSQD2EUZ");
    assert!(stranger.is_err(), "its digits do not add up");
    let others = Recipients(vec![PublicKey::from([9; 32])]);
    let mut file = Vec::new();
    let mut content = CONTENT;
    encrypt(&others, &mut content, &mut file).expect("a file");
    let opened = decrypted(&identity(), &file);
    assert!(
        matches!(opened, Err(EncryptedFileError::NoKey)),
        "{opened:?}"
    );
    let database = b"SQLite format 3\0 and what comes after it";
    assert!(!is_encrypted(&mut &database[..]).expect("bytes"));
    let opened = decrypted(&identity(), database);
    assert!(
        matches!(opened, Err(EncryptedFileError::NotEncrypted)),
        "{opened:?}"
    );
}

#[test]
fn keys_that_are_none_are_refused_by_their_line_without_the_secret() {
    let error = identities(&format!("# mine\n\n{IDENTITY}x\n")).expect_err("a digit too many");
    assert!(error.to_string().contains("line 3"), "{error}");
    assert!(!error.to_string().contains("GFPYY"), "{error}");
    assert!(identities("# none\n").is_err());
    // The key of a recipient is no identity, and the other way round.
    assert!(identities(RECIPIENT).is_err());
    assert!(Recipients::read(&[IDENTITY.to_owned()], &[]).is_err());
    let missing = Recipients::read(&[], &[PathBuf::from("no such file")]);
    assert!(missing.is_err());
    assert!(
        Recipients::read(&[], &[])
            .expect("no key is no fault")
            .is_none()
    );
}

#[test]
fn age_opens_a_file_of_ours_and_we_open_one_of_its() {
    let Ok(age) = Command::new("age").arg("--version").output() else {
        eprintln!("SKIPPED: `age` is not installed");
        return;
    };
    assert!(age.status.success());
    let folder = tempfile::tempdir().expect("a folder");
    let content: Vec<u8> = (0..200_000_u32).flat_map(u32::to_le_bytes).collect();
    let place = |name: &str| folder.path().join(name);
    fs::write(place("identity"), IDENTITY).expect("a file");
    fs::write(place("ours.age"), encrypted(&content)).expect("a file");
    let opened = Command::new("age")
        .args(["--decrypt", "--identity"])
        .args([place("identity"), place("ours.age")])
        .stderr(Stdio::inherit())
        .output()
        .expect("age runs");
    assert!(opened.status.success() && opened.stdout == content);
    fs::write(place("content"), &content).expect("a file");
    let made = Command::new("age")
        .args(["--encrypt", "--recipient", RECIPIENT])
        .arg(place("content"))
        .output()
        .expect("age runs");
    assert_eq!(
        decrypted(&identity(), &made.stdout).expect("opens"),
        content
    );
}
