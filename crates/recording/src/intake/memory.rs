//! What a body may cause while it is read: the bytes that it unpacks to, and the memory that holds
//! what was read of it.
//!
//! Reading takes [`MEMORY_PER_BYTE`] times the size of a body and [`MEMORY_ALWAYS`] beside at the most.
//! A reader whose memory grows with something else than the size of its body asks [`Memory`] before it
//! holds more, and refuses the body where the answer is no.

use super::error::{ReadError, malformed};
use greybox_numerics::parsing::Fault;
use std::cell::Cell;
use std::io::{self, Read};
use std::rc::Rc;

/// Bytes of memory for each byte of a body, at the most.
pub const MEMORY_PER_BYTE: u64 = 4;
/// Bytes of memory for a body of any size, beside what its bytes allow.
pub const MEMORY_ALWAYS: u64 = 64 << 20;
/// The part of [`MEMORY_ALWAYS`] that buffers, the store and the answer take `[bytes]`.
const RESERVED: u64 = 24 << 20;

/// Bytes that each byte of a compressed body may unpack to, on the whole.
pub const MOST_RATIO: u64 = 250;
/// Bytes that a compressed body of any size may unpack to: short ones have large ratios.
const UNPACKED_ALWAYS: u64 = 1 << 20;

/// The longest row of a table and the longest line of a text `[bytes]`.
pub(super) const LONGEST_ROW: u64 = 1 << 20;

/// Whether so many compressed bytes may unpack to so many.
#[must_use]
pub fn may_unpack(packed: u64, unpacked: u64) -> bool {
    unpacked <= UNPACKED_ALWAYS || unpacked / MOST_RATIO <= packed
}

/// The memory that may hold what was read of a body.
#[derive(Clone)]
pub(super) struct Memory {
    /// Bytes of the body that were read.
    read: Rc<Cell<u64>>,
    /// Bytes of memory that are taken until the body is read.
    taken: Rc<Cell<u64>>,
}

impl Memory {
    /// The memory for a body that is counted while it is read.
    pub(super) fn counting<R: Read>(source: R) -> (Self, Counted<R>) {
        let memory = Self {
            read: Rc::default(),
            taken: Rc::default(),
        };
        let counted = Counted {
            source,
            read: Rc::clone(&memory.read),
        };
        (memory, counted)
    }

    /// The bytes of the body that were read by now.
    pub(super) fn read(&self) -> u64 {
        self.read.get()
    }

    /// The bytes that may be held by now, beside those that are taken.
    pub(super) fn left(&self) -> u64 {
        let all = MEMORY_ALWAYS - RESERVED + MEMORY_PER_BYTE.saturating_mul(self.read.get());
        all.saturating_sub(self.taken.get())
    }

    /// Takes bytes until the body is read.
    pub(super) fn take(&self, bytes: u64) {
        self.taken.set(self.taken.get().saturating_add(bytes));
    }

    /// Gives bytes back that were taken.
    pub(super) fn release(&self, bytes: u64) {
        self.taken.set(self.taken.get().saturating_sub(bytes));
    }

    /// A sentence where so many bytes are too many for what was read of the body. `what` would take
    /// the bytes, and `instead` is what the sender can do.
    pub(super) fn refusal(&self, bytes: u64, what: &str, instead: &str) -> Option<String> {
        let left = self.left();
        (bytes > left).then(|| {
            format!(
                "{what} would take {} MiB of memory, and a body of this size leaves {} MiB for \
                 it; {instead}",
                bytes.div_ceil(1 << 20),
                left >> 20
            )
        })
    }

    /// Refuses to hold so many bytes where a [`Memory::refusal`] says why.
    pub(super) fn hold(&self, bytes: u64, what: &str, instead: &str) -> Result<(), ReadError> {
        match self.refusal(bytes, what, instead) {
            Some(detail) => Err(malformed(Fault::of_whole("too_much_memory", detail))),
            None => Ok(()),
        }
    }
}

/// A source whose bytes are counted.
pub(super) struct Counted<R> {
    source: R,
    read: Rc<Cell<u64>>,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(target)?;
        self.read.set(self.read.get() + count as u64);
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_may_be_held_grows_with_what_was_read() {
        let (memory, mut source) = Memory::counting(&[0; 1000][..]);
        let before = memory.left();
        let held = memory.hold(before + 1, "a table", "send less");
        let told = held.expect_err("a byte too many").to_string();
        assert!(told.contains("a table would take 41 MiB"), "{told}");
        io::copy(&mut source, &mut io::sink()).expect("memory can be read");
        assert_eq!(memory.left(), before + 4 * 1000);
        memory.take(3000);
        assert_eq!(memory.left(), before + 1000);
        assert!(memory.hold(before + 1000, "a table", "send less").is_ok());
    }

    #[test]
    fn a_short_body_may_unpack_to_more_times_its_size_than_a_long_one() {
        assert!(may_unpack(1, 1 << 20));
        assert!(!may_unpack(1, (1 << 20) + 1));
        assert!(may_unpack(1 << 20, 250 << 20));
        assert!(!may_unpack(1 << 20, 251 << 20));
    }
}
