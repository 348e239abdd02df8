//! Bodies that are packed with gzip, which their first bytes tell.

use super::error::broken;
use super::memory::{MOST_RATIO, Memory, may_unpack};
use flate2::bufread::MultiGzDecoder;
use greybox_numerics::parsing::Fault;
use std::io::{self, BufRead, ErrorKind, Read};

/// The first bytes of what gzip packs.
pub(super) const MAGIC: &[u8] = b"\x1f\x8b";

/// A body that is unpacked while it is read, up to what its size allows.
pub(super) struct Unpacked<R> {
    bytes: MultiGzDecoder<R>,
    unpacked: u64,
    memory: Memory,
}

impl<R: BufRead> Unpacked<R> {
    /// The bytes in a packed source, whose own bytes the memory counts.
    pub(super) fn of(source: R, memory: &Memory) -> Self {
        Self {
            bytes: MultiGzDecoder::new(source),
            unpacked: 0,
            memory: memory.clone(),
        }
    }
}

impl<R: BufRead> Read for Unpacked<R> {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        let count = self
            .bytes
            .read(target)
            .map_err(|error| match error.kind() {
                ErrorKind::InvalidInput | ErrorKind::InvalidData | ErrorKind::UnexpectedEof => {
                    let detail = format!("what gzip packed is damaged or cut off: {error}");
                    broken(Fault::of_whole("damaged", detail))
                }
                _ => error,
            })?;
        self.unpacked += count as u64;
        if !may_unpack(self.memory.read(), self.unpacked) {
            let detail = format!("it unpacks to more than {MOST_RATIO} times its size");
            return Err(broken(Fault::of_whole("too_large", detail)));
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use crate::intake::{self, MediaKind, Options, ReadError};
    use flate2::Compression;
    use flate2::read::GzEncoder;
    use std::io::Read;

    fn packed(text: impl Read) -> Vec<u8> {
        let mut packed = Vec::new();
        let mut encoder = GzEncoder::new(text, Compression::best());
        encoder.read_to_end(&mut packed).unwrap();
        packed
    }

    fn read(bytes: &[u8], kind: MediaKind) -> Result<crate::Recording, ReadError> {
        intake::read(bytes, kind, &Options::default())
    }

    #[test]
    fn what_gzip_packed_is_told_by_its_first_bytes() {
        let text = "time [s],a\n0,1\n1,2\n2,3\n";
        let bytes = packed(text.as_bytes());
        for kind in [MediaKind::Csv, MediaKind::Text, MediaKind::Binary] {
            let recording = read(&bytes, kind).unwrap();
            assert_eq!(recording.signals[0].values, [1.0, 2.0, 3.0]);
        }
        let half = packed("0,1\n".repeat(1000).as_bytes());
        let halves = [packed("time [s],a\n".as_bytes()), half].concat();
        assert!(read(&halves, MediaKind::Csv).is_err(), "the times repeat");
        let json =
            packed(r#"{"sample_time_s": 1, "signals": {"a": {"values": [1, 2]}}}"#.as_bytes());
        assert_eq!(read(&json, MediaKind::Json).unwrap().signals.len(), 1);
    }

    #[test]
    fn what_is_damaged_cut_off_or_unpacks_to_too_much_is_refused() {
        let numbers: String = (0..2000)
            .map(|k| format!("{k},{}\n", k * k % 977))
            .collect();
        let bytes = packed(format!("time [s],a\n{numbers}").as_bytes());
        let cut = read(&bytes[..bytes.len() / 2], MediaKind::Csv).unwrap_err();
        assert_eq!(cut.faults()[0].code, "damaged", "{cut}");
        let mut flipped = bytes.clone();
        flipped[bytes.len() - 6] ^= 1;
        assert_eq!(
            read(&flipped, MediaKind::Csv).unwrap_err().faults()[0].code,
            "damaged"
        );
        let blanks = ",\n".repeat(8 << 20);
        let bomb = packed("time [s],a\n0,1\n".as_bytes().chain(blanks.as_bytes()));
        let bomb = read(&bomb, MediaKind::Csv).unwrap_err();
        assert_eq!(bomb.faults()[0].code, "too_large", "{bomb}");
    }
}
