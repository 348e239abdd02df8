//! Bodies on disk: what is too large for memory while a client is slow to send or to read it.
//!
//! A spool is a file without a name beside the database, which is gone with the process. All of them
//! together take no more than their share of the disk.

use std::fs::File;
use std::io::{self, Read, Seek, Write};
use std::sync::Arc;

use axum::body::Body;
use futures_util::StreamExt;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_util::io::ReaderStream;

/// The bytes that one permit stands for.
const BLOCK: usize = 256 << 10;

/// The disk that all spools share.
#[derive(Clone)]
pub(super) struct SpoolRoom(Arc<Semaphore>);

impl SpoolRoom {
    /// Room for so many bytes.
    pub(super) fn new(bytes: u64) -> Self {
        let blocks = usize::try_from(bytes / BLOCK as u64).unwrap_or(usize::MAX);
        Self(Arc::new(Semaphore::new(blocks.min(Semaphore::MAX_PERMITS))))
    }

    /// A spool in a file.
    pub(super) fn spool(&self, file: File) -> Spool {
        Spool {
            file,
            room: self.clone(),
            held: None,
            left: 0,
        }
    }
}

/// A body on disk.
pub(super) struct Spool {
    file: File,
    room: SpoolRoom,
    held: Option<OwnedSemaphorePermit>,
    /// Bytes of the blocks held that are not written yet.
    left: usize,
}

impl Spool {
    /// How many bytes were written.
    pub(super) fn bytes(&self) -> usize {
        let held = self.held.as_ref();
        held.map_or(0, |blocks| blocks.num_permits() * BLOCK) - self.left
    }

    /// The bytes from the first on.
    pub(super) fn into_reader(mut self) -> io::Result<impl Read + Send> {
        self.file.rewind()?;
        Ok(SpoolReader {
            file: io::BufReader::with_capacity(BLOCK, self.file),
            _held: self.held,
        })
    }

    /// The bytes as the body of an answer, read as fast as its client takes them.
    pub(super) fn into_body(mut self) -> io::Result<Body> {
        self.file.rewind()?;
        let held = self.held;
        let file = tokio::fs::File::from_std(self.file);
        let chunks = ReaderStream::with_capacity(file, 64 << 10);
        Ok(Body::from_stream(chunks.map(move |chunk| {
            let _held = &held;
            chunk
        })))
    }

    fn hold_one_more(&mut self) -> io::Result<()> {
        let more = self.room.0.clone().try_acquire_owned();
        let more = more.map_err(|_| io::Error::from(io::ErrorKind::ResourceBusy))?;
        match &mut self.held {
            Some(held) => held.merge(more),
            none => *none = Some(more),
        }
        self.left += BLOCK;
        Ok(())
    }
}

impl Write for Spool {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.left == 0 {
            self.hold_one_more()?;
        }
        let written = self.file.write(&bytes[..bytes.len().min(self.left)])?;
        self.left -= written;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

struct SpoolReader {
    file: io::BufReader<File>,
    _held: Option<OwnedSemaphorePermit>,
}

impl Read for SpoolReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.file.read(buffer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spool(room: &SpoolRoom) -> Spool {
        room.spool(tempfile::tempfile().expect("a file"))
    }

    #[test]
    fn what_is_written_is_read_and_its_room_is_given_back() {
        let room = SpoolRoom::new(2 * BLOCK as u64);
        let mut first = spool(&room);
        let bytes = vec![7; BLOCK + 1];
        first.write_all(&bytes).expect("room for it");
        let refused = spool(&room).write_all(&[1]).expect_err("no room is left");
        assert_eq!(refused.kind(), io::ErrorKind::ResourceBusy);
        let mut read = Vec::new();
        let mut reader = first.into_reader().expect("a reader");
        reader.read_to_end(&mut read).expect("the bytes");
        assert_eq!(read, bytes);
        drop(reader);
        spool(&room).write_all(&bytes).expect("room again");
    }
}
