//! Numbers that loggers write where they have no value.

use crate::intake::options::{Options, ReadingPurpose};
use crate::shown;

/// What loggers write where they have no value. A value is told as a likely one when it is far
/// from all others.
const SENTINELS: [f64; 27] = [
    -7999.0,
    7999.0,
    -6999.0,
    -9999.0,
    9999.0,
    -999.0,
    999.0,
    -99.125,
    -999.25,
    -99999.0,
    99999.0,
    -32768.0,
    32767.0,
    65535.0,
    -2147483648.0,
    2147483647.0,
    1e30,
    -1e30,
    1e38,
    -1e38,
    1e35,
    9.9e37,
    -9.9e37,
    9.91e37,
    9.969_209_968_386_869e36,
    999_999.0,
    -999_999.0,
];

/// Sentinels that are missing samples of a whole recording where they are far from the others: -9999 of Uniformance PHD
/// at a confidence of -1, of ASCII grids and of meteorologists; -999.25 of the Log ASCII Standard (`NULL. -999.25`);
/// -7999 of Campbell Scientific's loggers; -32768 and 65535 of registers of 16 bits that are not there (SunSpec, Siemens
/// S7); 999999 of loggers and databases whose numbers have six digits.
const STAND_INS: [f64; 6] = [-9_999.0, -999.25, -7_999.0, -32_768.0, 65_535.0, 999_999.0];

/// Numbers of the list that are larger stand for no value of any plant.
const SURELY_NONE: f64 = 1e29;

/// Below this, a number is none of them.
const SMALLEST_SENTINEL: f64 = 99.0;

/// How far from the others a likely one is, in ranges of the others.
const FAR: f64 = 2.0;

/// Whether a number stands for no value wherever it is met.
pub(super) fn is_surely_none(number: f64) -> bool {
    number.abs() > SURELY_NONE && SENTINELS.contains(&number)
}

/// The sentinels among the numbers of a column.
#[derive(Debug)]
pub(super) struct Sentinels {
    /// Each with how often it was met.
    counts: Vec<(f64, usize)>,
    /// Smallest and largest of the numbers that are no sentinels.
    range: (f64, f64),
    purpose: ReadingPurpose,
    /// An option says that all of them are values.
    are_values: bool,
}

impl Sentinels {
    /// No numbers yet.
    pub(super) fn new(options: &Options) -> Self {
        Self {
            counts: Vec::new(),
            range: (f64::INFINITY, f64::NEG_INFINITY),
            purpose: options.purpose,
            are_values: options.missing.keeps_sentinels,
        }
    }

    /// Counts a number as it was recorded.
    pub(super) fn take(&mut self, number: f64) {
        if number.abs() < SMALLEST_SENTINEL || !SENTINELS.contains(&number) {
            self.range = (self.range.0.min(number), self.range.1.max(number));
            return;
        }
        let mut counts = self.counts.iter_mut();
        match counts.find(|(sentinel, _)| *sentinel == number) {
            Some((_, count)) => *count += 1,
            None => self.counts.push((number, 1)),
        }
    }

    /// The sentinels among so many numbers that stand for missing samples: far from others that vary, and fewer than
    /// these. A batch of a stream cannot be judged.
    pub(super) fn stand_ins(&self, numbers: usize) -> impl Iterator<Item = f64> {
        let vary = self.range.0 < self.range.1;
        let are_judged = vary && !self.are_values && self.purpose == ReadingPurpose::Recording;
        let met: usize = self.counts.iter().map(|(_, count)| count).sum();
        let values = numbers.saturating_sub(met);
        let likely = self.likely().filter(move |(value, count)| {
            are_judged && *count < values && STAND_INS.contains(value)
        });
        likely.map(|(value, _)| value)
    }

    /// The sentinels that are far from the other numbers, each with how often it was met.
    fn likely(&self) -> impl Iterator<Item = (f64, usize)> {
        let (low, high) = self.range;
        let far = FAR * (high - low).max(f64::MIN_POSITIVE);
        let is_far = move |value: f64| value < low - far || value > high + far;
        let counts = self.counts.iter().copied();
        counts.filter(move |(value, _)| low <= high && is_far(*value))
    }

    /// A sentence on each likely sentinel among so many numbers.
    pub(super) fn told(&self, numbers: usize) -> Vec<String> {
        let exactly = |value: f64, count: usize| {
            format!("{count} samples are exactly {} as recorded", shown(value))
        };
        let kept = |value: f64| {
            let value = shown(value);
            format!("they were kept. If they stand for missing ones, say missing={value}")
        };
        if self.range.0 > self.range.1 && self.purpose == ReadingPurpose::Stream {
            // A batch may hold a single sample, which cannot be far from others.
            let counts = self.counts.iter();
            let told = counts.map(|(value, count)| {
                let (exactly, kept) = (exactly(*value, *count), kept(*value));
                format!("{exactly}, which loggers write where they have no value; {kept}")
            });
            return told.collect();
        }
        let (low, high) = (shown(self.range.0), shown(self.range.1));
        let told = self.likely().map(|(value, count)| {
            let ending = match self.stand_ins(numbers).any(|stand_in| stand_in == value) {
                true => "they were taken as missing; missing=none keeps them".to_owned(),
                false => kept(value),
            };
            let exactly = exactly(value, count);
            format!("{exactly}, far from the others ({low} to {high}); {ending}")
        });
        told.collect()
    }
}
