//! The header of a file: its key, sealed once for each recipient.

use std::io::{BufRead, Read, Write};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD_NO_PAD;
use ring::aead::NONCE_LEN;
use ring::hmac;
use x25519_dalek::{PublicKey, SharedSecret, StaticSecret};

use super::error::EncryptedFileError;
use super::keys::{Identities, KEY_BYTES, Recipients};
use super::seal::{FILE_KEY_BYTES, FileKey, SealingKey, TAG_BYTES, derive, random};

/// The first line.
pub(super) const VERSION: &str = "age-encryption.org/v1\n";
/// What the entry of a recipient begins with.
const ENTRY: &str = "-> ";
/// The kind of an entry whose recipient has a key of X25519.
const X25519: &str = "X25519";
/// What the last line begins with.
const END: &str = "---";
/// The characters of a line of an entry's body at the most; the last line has fewer.
const LINE: usize = 64;
/// The bytes of a header at the most: some hundred recipients of any kind.
const LARGEST: u64 = 64 << 10;
/// What a key between two sides is for.
const PURPOSE: &[u8] = b"age-encryption.org/v1/X25519";
/// Each key between two sides seals one thing.
const NONCE: [u8; NONCE_LEN] = [0; NONCE_LEN];

/// The key of a file for one recipient.
struct Entry {
    /// What the writer made for this entry alone.
    share: PublicKey,
    /// The key of the file, sealed.
    sealed: [u8; FILE_KEY_BYTES + TAG_BYTES],
}

/// The header of a file.
pub(super) struct FileHeader {
    entries: Vec<Entry>,
    /// The bytes that are authenticated: the first to the `---` of the last line.
    authenticated: Vec<u8>,
    /// What authenticates the bytes.
    mac: Vec<u8>,
}

impl FileHeader {
    /// The header of a file for some recipients.
    pub(super) fn new(
        file_key: &FileKey,
        recipients: &Recipients,
    ) -> Result<Self, EncryptedFileError> {
        let mut text = VERSION.to_owned();
        let mut entries = Vec::new();
        for recipient in &recipients.0 {
            let entry = Entry::seal(file_key, recipient)?;
            let share = STANDARD_NO_PAD.encode(entry.share.as_bytes());
            let sealed = STANDARD_NO_PAD.encode(entry.sealed);
            text += &format!("{ENTRY}{X25519} {share}\n{sealed}\n");
            entries.push(entry);
        }
        text += END;
        let authenticated = text.into_bytes();
        let mac = hmac::sign(&file_key.header_key(), &authenticated);
        Ok(Self {
            entries,
            authenticated,
            mac: mac.as_ref().to_vec(),
        })
    }

    pub(super) fn write(&self, into: &mut impl Write) -> Result<(), EncryptedFileError> {
        into.write_all(&self.authenticated)?;
        writeln!(into, " {}", STANDARD_NO_PAD.encode(&self.mac))?;
        Ok(())
    }

    /// Reads a header. Entries of other kinds are left out: they are for other programs.
    pub(super) fn read(source: &mut impl BufRead) -> Result<Self, EncryptedFileError> {
        let mut lines = Lines::new(source);
        if lines.next()? != VERSION.trim_end() {
            return Err(EncryptedFileError::NotEncrypted);
        }
        let mut entries = Vec::new();
        loop {
            let line = lines.next()?;
            if let Some(mac) = line.strip_prefix(END) {
                let mac = mac.strip_prefix(' ').and_then(decode);
                return Ok(Self {
                    entries,
                    authenticated: lines.up_to_the_end(),
                    mac: mac.ok_or(UNREADABLE)?,
                });
            }
            let words = line.strip_prefix(ENTRY).ok_or(UNREADABLE)?;
            let body = lines.body()?;
            let words: Vec<&str> = words.split(' ').collect();
            match words[..] {
                [X25519, share] => entries.push(Entry::read(share, body).ok_or(UNREADABLE)?),
                [X25519, ..] => return Err(UNREADABLE),
                _ => {}
            }
        }
    }

    /// The key of the file, where one of the identities is a recipient's.
    pub(super) fn file_key(&self, identities: &Identities) -> Result<FileKey, EncryptedFileError> {
        let pairs = identities.0.iter();
        let mut pairs =
            pairs.flat_map(|identity| self.entries.iter().map(move |entry| (identity, entry)));
        let file_key = pairs.find_map(|(identity, entry)| entry.open(identity));
        let file_key = file_key.ok_or(EncryptedFileError::NoKey)?;
        hmac::verify(&file_key.header_key(), &self.authenticated, &self.mac)
            .map_err(|_| EncryptedFileError::Damaged("its header was changed"))?;
        Ok(file_key)
    }
}

const UNREADABLE: EncryptedFileError = EncryptedFileError::Damaged("its header does not read");

impl Entry {
    fn seal(file_key: &FileKey, recipient: &PublicKey) -> Result<Self, EncryptedFileError> {
        let secret = StaticSecret::from(random::<KEY_BYTES>()?);
        let share = PublicKey::from(&secret);
        let key = sealing_key(&secret.diffie_hellman(recipient), &share, recipient);
        let mut sealed = file_key.bytes().to_vec();
        key.seal(NONCE, &mut sealed);
        let sealed = sealed.try_into().expect("a key and its tag");
        Ok(Self { share, sealed })
    }

    fn read(share: &str, body: Vec<u8>) -> Option<Self> {
        let share: [u8; KEY_BYTES] = decode(share)?.try_into().ok()?;
        Some(Self {
            share: share.into(),
            sealed: body.try_into().ok()?,
        })
    }

    /// The key of the file, where the identity is the recipient's.
    fn open(&self, identity: &StaticSecret) -> Option<FileKey> {
        let shared = identity.diffie_hellman(&self.share);
        // Points of small order have the same secret with everybody.
        if !shared.was_contributory() {
            return None;
        }
        let key = sealing_key(&shared, &self.share, &PublicKey::from(identity));
        let mut opened = self.sealed.to_vec();
        key.open(NONCE, &mut opened)?;
        opened.try_into().ok().map(FileKey::of)
    }
}

/// The key between the writer of an entry and its recipient.
fn sealing_key(shared: &SharedSecret, share: &PublicKey, recipient: &PublicKey) -> SealingKey {
    let salt = [&share.as_bytes()[..], recipient.as_bytes()].concat();
    SealingKey::expanded(&derive(&salt, shared.as_bytes()), PURPOSE)
}

fn decode(text: &str) -> Option<Vec<u8>> {
    STANDARD_NO_PAD.decode(text).ok()
}

/// The lines of a header, and all bytes that were read.
struct Lines<'a, R> {
    source: &'a mut R,
    bytes: Vec<u8>,
}

impl<'a, R: BufRead> Lines<'a, R> {
    fn new(source: &'a mut R) -> Self {
        Self {
            source,
            bytes: Vec::new(),
        }
    }

    /// The next line, without its end.
    fn next(&mut self) -> Result<String, EncryptedFileError> {
        let begin = self.bytes.len();
        let left = LARGEST.saturating_sub(begin as u64);
        let mut source = self.source.by_ref().take(left);
        source.read_until(b'\n', &mut self.bytes)?;
        let line = std::str::from_utf8(&self.bytes[begin..]).ok();
        let line = line.and_then(|line| line.strip_suffix('\n'));
        // What does not even begin as an encrypted file is something else.
        let missing = if begin == 0 {
            EncryptedFileError::NotEncrypted
        } else {
            UNREADABLE
        };
        line.map(str::to_owned).ok_or(missing)
    }

    /// The body of an entry.
    fn body(&mut self) -> Result<Vec<u8>, EncryptedFileError> {
        let mut text = String::new();
        loop {
            let line = self.next()?;
            text += &line;
            match line.len() {
                LINE => {}
                0..LINE => return decode(&text).ok_or(UNREADABLE),
                _ => return Err(UNREADABLE),
            }
        }
    }

    /// The bytes that are authenticated, after the last line was read.
    fn up_to_the_end(mut self) -> Vec<u8> {
        let begin = self.bytes[..self.bytes.len() - 1]
            .iter()
            .rposition(|byte| *byte == b'\n');
        self.bytes
            .truncate(begin.map_or(0, |end| end + 1) + END.len());
        self.bytes
    }
}
