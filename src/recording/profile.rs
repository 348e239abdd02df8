//! What is counted of a signal, for its summary and its quality report.

use super::columns::Series;
use std::collections::HashSet;
use std::io;

/// A signal of no more levels than this is a sequence of steps and holds its extremes on purpose.
pub(super) const STEPPED_LEVELS: usize = 10;

/// What is counted of a signal.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Profile {
    /// How many samples there are.
    pub(super) samples: usize,
    /// How many of them are missing.
    pub(super) missing: usize,
    /// What the others are like; nothing where all are missing.
    pub(super) values: Option<Values>,
    /// Stretches of one value; each missing sample is one of its own.
    pub(super) runs: usize,
    /// The longest of them.
    pub(super) longest: Run,
}

/// The samples that are not missing.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Values {
    pub(super) mean: f64,
    pub(super) min: Extreme,
    pub(super) max: Extreme,
    /// Whether there are only a few levels.
    pub(super) is_stepped: bool,
}

/// The smallest or the largest value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extreme {
    pub(super) value: f64,
    /// How many samples are there exactly.
    pub(super) samples: usize,
}

/// A stretch of samples with one value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Run {
    /// The index of its first sample.
    pub(super) start: usize,
    pub(super) samples: usize,
    pub(super) value: f64,
}

impl Profile {
    /// Counts, in two passes.
    ///
    /// # Errors
    /// When the samples cannot be read.
    pub(super) fn of(series: &mut dyn Series) -> io::Result<Profile> {
        let mut tally = Tally::default();
        series.visit(&mut |piece| {
            piece.iter().for_each(|sample| tally.take(*sample));
            Ok(())
        })?;
        tally.end_run();
        let present = tally.samples - tally.missing;
        let values = match tally.range {
            None => None,
            Some((min, max)) => {
                let mut values = Values {
                    mean: 0.0,
                    min: Extreme::of(min),
                    max: Extreme::of(max),
                    is_stepped: tally.levels.len() <= STEPPED_LEVELS,
                };
                series.visit(&mut |piece| {
                    let present_ones = piece.iter().filter(|sample| !sample.is_nan());
                    present_ones.for_each(|sample| values.take(*sample, present as f64));
                    Ok(())
                })?;
                Some(values)
            }
        };
        Ok(Profile {
            samples: tally.samples,
            missing: tally.missing,
            values,
            runs: tally.runs,
            longest: tally.longest,
        })
    }
}

impl Values {
    /// Whether all samples are equal.
    pub(super) fn is_constant(&self) -> bool {
        self.min.value == self.max.value
    }

    fn take(&mut self, sample: f64, count: f64) {
        // Each term is divided first: the sum of large finite values need not be finite.
        self.mean += sample / count;
        self.min.samples += usize::from(sample == self.min.value);
        self.max.samples += usize::from(sample == self.max.value);
    }
}

impl Extreme {
    fn of(value: f64) -> Self {
        Self { value, samples: 0 }
    }
}

/// The first pass.
#[derive(Default)]
struct Tally {
    samples: usize,
    missing: usize,
    range: Option<(f64, f64)>,
    /// The bits of the values met first, one more than a stepped signal has at the most.
    levels: HashSet<u64>,
    runs: usize,
    run: Run,
    longest: Run,
}

impl Tally {
    fn take(&mut self, sample: f64) {
        // What is missing equals nothing, not even itself.
        if self.run.samples == 0 || sample != self.run.value {
            self.end_run();
            self.run = Run {
                start: self.samples,
                samples: 0,
                value: sample,
            };
        }
        self.run.samples += 1;
        self.samples += 1;
        if sample.is_nan() {
            self.missing += 1;
            return;
        }
        let (min, max) = self.range.unwrap_or((sample, sample));
        self.range = Some((min.min(sample), max.max(sample)));
        if self.levels.len() <= STEPPED_LEVELS {
            self.levels.insert(sample.to_bits());
        }
    }

    fn end_run(&mut self) {
        self.runs += usize::from(self.run.samples > 0);
        if self.run.samples > self.longest.samples {
            self.longest = self.run;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A signal that comes in pieces.
    struct Pieces<'a>(Vec<&'a [f64]>);

    impl Series for Pieces<'_> {
        fn visit(&mut self, take: &mut dyn FnMut(&[f64]) -> io::Result<()>) -> io::Result<()> {
            self.0.iter().try_for_each(|piece| take(piece))
        }
    }

    fn sample() -> impl Strategy<Value = f64> {
        prop_oneof![4 => (0_u8..3).prop_map(f64::from), 1 => Just(f64::NAN), 1 => -1e3..1e3]
    }

    proptest! {
        #[test]
        fn pieces_count_as_the_whole(
            samples in prop::collection::vec(sample(), 1..200),
            length in 1_usize..20,
        ) {
            let whole = Profile::of(&mut samples.as_slice()).unwrap();
            let mut pieces = Pieces(samples.chunks(length).collect());
            // Compared as text, in which a missing sample equals another.
            let pieces = format!("{:?}", Profile::of(&mut pieces).unwrap());
            prop_assert_eq!(pieces, format!("{whole:?}"));
        }
    }

    #[test]
    fn the_longest_run_is_the_first_of_its_length_and_missing_samples_make_none() {
        let nan = f64::NAN;
        let samples = [1.0, 2.0, 2.0, nan, nan, nan, 3.0, 3.0];
        let profile = Profile::of(&mut samples.as_slice()).unwrap();
        let expected = Run {
            start: 1,
            samples: 2,
            value: 2.0,
        };
        assert_eq!((profile.longest, profile.runs), (expected, 6));
        assert_eq!((profile.samples, profile.missing), (8, 3));
        let values = profile.values.unwrap();
        assert_eq!((values.min.samples, values.max.samples), (1, 2));
        assert!((values.mean - 11.0 / 5.0).abs() < 1e-15);
    }
}
