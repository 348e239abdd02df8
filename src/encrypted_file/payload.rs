//! What comes after the header: a nonce, and chunks of 64 KiB, each sealed with its number and whether it is the last.

use std::io::{self, Read, Write};

use ring::aead::NONCE_LEN;

use super::error::EncryptedFileError;
use super::seal::{FileKey, SealingKey, TAG_BYTES, random};

/// The bytes that a chunk holds; the last may hold fewer.
const CHUNK: usize = 64 << 10;
/// The bytes of the nonce before the chunks.
const FILE_NONCE_BYTES: usize = 16;

pub(super) fn encrypt(
    file_key: &FileKey,
    source: &mut impl Read,
    into: &mut impl Write,
) -> Result<(), EncryptedFileError> {
    let nonce: [u8; FILE_NONCE_BYTES] = random()?;
    into.write_all(&nonce)?;
    let key = file_key.payload_key(&nonce);
    for_each_chunk(source, CHUNK, |number, is_last, mut chunk| {
        key.seal(chunk_nonce(number, is_last), &mut chunk);
        Ok(into.write_all(&chunk)?)
    })
}

pub(super) fn decrypt(
    file_key: &FileKey,
    source: &mut impl Read,
    into: &mut impl Write,
) -> Result<(), EncryptedFileError> {
    let mut nonce = [0; FILE_NONCE_BYTES];
    source
        .read_exact(&mut nonce)
        .map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => EncryptedFileError::Damaged("it ends after its header"),
            _ => error.into(),
        })?;
    let key: SealingKey = file_key.payload_key(&nonce);
    for_each_chunk(source, CHUNK + TAG_BYTES, |number, is_last, mut chunk| {
        key.open(chunk_nonce(number, is_last), &mut chunk)
            .ok_or(EncryptedFileError::Damaged("it was changed or cut off"))?;
        // Only a file that holds nothing has an empty chunk.
        match chunk.is_empty() && number > 0 {
            true => Err(EncryptedFileError::Damaged("its last chunk is empty")),
            false => Ok(into.write_all(&chunk)?),
        }
    })
}

/// Hands over the chunks of a source, each with its number and whether it is the last. There is at least one.
fn for_each_chunk(
    source: &mut impl Read,
    length: usize,
    mut hand_over: impl FnMut(u64, bool, Vec<u8>) -> Result<(), EncryptedFileError>,
) -> Result<(), EncryptedFileError> {
    let mut chunk = read_chunk(source, length)?;
    let mut number = 0;
    loop {
        let next = match chunk.len() == length {
            true => read_chunk(source, length)?,
            false => Vec::new(),
        };
        let is_last = next.is_empty();
        hand_over(number, is_last, std::mem::replace(&mut chunk, next))?;
        if is_last {
            return Ok(());
        }
        number += 1;
    }
}

/// The next bytes of a source: as many as `length`, or all that are left.
fn read_chunk(source: &mut impl Read, length: usize) -> io::Result<Vec<u8>> {
    let mut chunk = Vec::with_capacity(length + TAG_BYTES);
    source.take(length as u64).read_to_end(&mut chunk)?;
    Ok(chunk)
}

/// The nonce of a chunk: its number in eleven bytes, the most significant first, and a byte that is 1 for the last.
fn chunk_nonce(number: u64, is_last: bool) -> [u8; NONCE_LEN] {
    let mut nonce = [0; NONCE_LEN];
    nonce[NONCE_LEN - 9..NONCE_LEN - 1].copy_from_slice(&number.to_be_bytes());
    nonce[NONCE_LEN - 1] = u8::from(is_last);
    nonce
}
