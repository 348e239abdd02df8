//! Lines that an agent writes. A line is a point of [`spread`](crate::intake::spread).

use super::point::{LineFault, ProtocolLine, field_value};
use super::reader::LineReader;
use crate::intake::error::ReadError;
use crate::intake::memory::Memory;
use crate::intake::spread::{
    Mapping, PointFault, PointField, RefusedPoints, Spreading, WrittenSamples, shown,
};
use std::io::{BufReader, Read};

/// The unit of the stamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Precision {
    /// How long the unit is `[ns]`.
    nanoseconds: i64,
}

impl Precision {
    /// Nanoseconds, which stamps are in where nothing says otherwise.
    pub const NANOSECONDS: Self = Self { nanoseconds: 1 };

    /// The unit that InfluxDB calls so: `n`, `ns`, `u`, `us`, `µ`, `ms`, `s`, `m` or `h`.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let nanoseconds = match name {
            "n" | "ns" => 1,
            "u" | "us" | "µ" => 1_000,
            "ms" => 1_000_000,
            "s" => 1_000_000_000,
            "m" => 60 * 1_000_000_000,
            "h" => 3600 * 1_000_000_000,
            _ => return None,
        };
        Some(Self { nanoseconds })
    }

    /// The instant of a stamp, nanoseconds since 1970.
    fn instant(self, stamp: &str) -> Result<i64, LineFault> {
        if stamp.is_empty() {
            return Err(LineFault::MissingStamp);
        }
        let whole: i64 = stamp.parse().map_err(|_| LineFault::BadStamp)?;
        let instant = whole.checked_mul(self.nanoseconds);
        instant.ok_or(LineFault::StampOutOfRange)
    }
}

/// Why a line is not taken.
#[derive(Debug, thiserror::Error)]
enum Refusal {
    #[error("{0}")]
    Unparsed(#[from] LineFault),
    #[error("{0}")]
    Unfit(#[from] PointFault),
}

impl Refusal {
    /// The sentence of InfluxDB on a line.
    fn sentence(&self, line: &str) -> String {
        match self {
            Self::Unparsed(fault) => format!("unable to parse '{}': {fault}", shown(line)),
            Self::Unfit(fault @ PointFault::Ahead) => format!("point {}: {fault}", shown(line)),
            Self::Unfit(fault) => fault.to_string(),
        }
    }
}

/// Reads lines and spreads their samples over streams. `latest_ns` is the latest instant that a sample may
/// have, nanoseconds since 1970.
///
/// # Errors
/// The source fails, or its samples would take too much memory.
pub fn written(
    source: impl Read,
    mapping: &Mapping,
    precision: Precision,
    latest_ns: i64,
) -> Result<WrittenSamples, ReadError> {
    let (memory, source) = Memory::counting(source);
    let mut lines = LineReader::new(BufReader::new(source));
    let mut spreading = Spreading::new(mapping, latest_ns, &memory);
    let mut refused = RefusedPoints::default();
    while let Some(line) = lines.next()? {
        match line.text {
            Ok(text) => {
                if let Err(refusal) = take(&mut spreading, precision, text) {
                    refused.add(|| refusal.sentence(text));
                }
            }
            Err(fault) => {
                let number = format!("line {}", line.number);
                refused.add(|| Refusal::from(fault).sentence(&number));
            }
        }
        spreading.check_memory()?;
    }
    spreading.finish(refused)
}

/// Takes a line, all of it or nothing.
fn take(spreading: &mut Spreading<'_>, precision: Precision, text: &str) -> Result<(), Refusal> {
    let point = ProtocolLine::parse(text)?;
    let instant = precision.instant(point.stamp)?;
    let route = spreading.route(point.series, || {
        let tags = point.tags()?.into_iter();
        let tags = tags.map(|(key, value)| (key.into_owned(), value.into_owned()));
        Ok::<_, LineFault>((point.measurement().into_owned(), tags.collect()))
    })?;
    let fields = point.fields().map(|field| {
        let (name, written) = field?;
        Ok(PointField {
            name,
            value: field_value(written)?,
        })
    });
    spreading.take::<Refusal>(&route, instant, fields)
}

#[cfg(test)]
mod tests;
