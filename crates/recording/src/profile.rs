//! What is counted of a signal, for its summary and its quality report.

use super::columns::SampleSeries;
use std::collections::HashSet;
use std::io;

/// A signal of no more levels than this is a sequence of steps and holds its extremes on purpose.
pub(super) const STEPPED_LEVELS: usize = 10;

/// A run is kept for the report from this length on, in samples.
pub(super) const LONG_RUN: usize = 50;

/// Long runs and spikes that are kept, each.
const MOST_KEPT: usize = 1000;

/// Lengths of runs that are counted one by one.
const COUNTED_LENGTHS: usize = 64;

/// A sample is a spike when it differs from both neighbours, in the same direction, by more than
/// so many mean steps from sample to sample…
const SPIKE_STEPS: f64 = 20.0;
/// …while the two differ from each other by less than this share of it.
const SPIKE_RETURN: f64 = 0.2;

/// What is counted of a signal.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SignalProfile {
    /// How many samples there are.
    pub(super) samples: usize,
    /// How many samples are missing.
    pub(super) missing: usize,
    /// What the samples that are not missing are like; none where all are missing.
    pub(super) values: Option<Values>,
    /// Stretches of one value; each missing sample is one of its own.
    pub(super) runs: usize,
    /// The longest run.
    pub(super) longest: ConstantRun,
    /// The first runs of [`LONG_RUN`] samples and more.
    pub(super) long_runs: Vec<ConstantRun>,
    /// The length that most runs have, and how many have it; of lengths up to 64.
    pub(super) commonest_length: (usize, usize),
    /// Single samples far from both neighbours, the first of them by index.
    pub(super) spikes: Vec<usize>,
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
    /// The value that comes next to it.
    next: f64,
    /// How many samples have that one.
    pub(super) next_samples: usize,
}

/// A stretch of samples with one value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct ConstantRun {
    /// The index of its first sample.
    pub(super) start: usize,
    pub(super) samples: usize,
    pub(super) value: f64,
}

impl SignalProfile {
    /// Counts, in two passes.
    ///
    /// # Errors
    /// When the samples cannot be read.
    pub(super) fn of(series: &mut dyn SampleSeries) -> io::Result<SignalProfile> {
        let mut tally = Tally::default();
        series.visit(&mut |piece| {
            piece.iter().for_each(|sample| tally.take(*sample));
            Ok(())
        })?;
        tally.end_run();
        let present = tally.samples - tally.missing;
        let is_stepped = tally.levels.len() <= STEPPED_LEVELS;
        let mut spikes = Spikes::new(tally.steps / tally.n_steps.max(1) as f64, is_stepped);
        let values = match tally.range {
            None => None,
            Some((min, max)) => {
                let mean = mean(series, present, &mut spikes)?;
                Some(Values {
                    mean,
                    min: min.mirrored(),
                    max,
                    is_stepped,
                })
            }
        };
        let lengths = tally.lengths.iter().enumerate();
        let commonest = lengths.max_by_key(|(length, runs)| (**runs, usize::MAX - length));
        Ok(SignalProfile {
            samples: tally.samples,
            missing: tally.missing,
            values,
            runs: tally.runs,
            longest: tally.longest,
            long_runs: tally.long_runs,
            commonest_length: commonest.map_or((0, 0), |(length, runs)| (length, *runs)),
            spikes: spikes.indices,
        })
    }
}

/// The second pass: the mean of the samples that are present, each looked at for a spike too.
fn mean(series: &mut dyn SampleSeries, present: usize, spikes: &mut Spikes) -> io::Result<f64> {
    let mut mean = 0.0;
    series.visit(&mut |piece| {
        for sample in piece {
            spikes.take(*sample);
            // Each term is divided first: the sum of large finite values need not be finite.
            let term = sample / present as f64;
            mean += if sample.is_nan() { 0.0 } else { term };
        }
        Ok(())
    })?;
    Ok(mean)
}

impl Values {
    /// Whether all samples are equal.
    pub(super) fn is_constant(&self) -> bool {
        self.min.value == self.max.value
    }
}

impl Extreme {
    /// The largest value so far.
    fn new(value: f64) -> Self {
        Self {
            value,
            samples: 0,
            next: f64::NEG_INFINITY,
            next_samples: 0,
        }
    }

    fn take(&mut self, value: f64) {
        if value == self.value {
            self.samples += 1;
        } else if value > self.value {
            *self = Self {
                value,
                samples: 1,
                next: self.value,
                next_samples: self.samples,
            };
        } else if value == self.next {
            self.next_samples += 1;
        } else if value > self.next {
            (self.next, self.next_samples) = (value, 1);
        }
    }

    /// The smallest value is the largest of the negative ones.
    fn mirrored(self) -> Self {
        Self {
            value: -self.value,
            next: -self.next,
            ..self
        }
    }
}

/// The first pass.
struct Tally {
    samples: usize,
    missing: usize,
    /// The smallest value, mirrored, and the largest.
    range: Option<(Extreme, Extreme)>,
    /// The bits of the values met first, one more than a stepped signal has at the most.
    levels: HashSet<u64>,
    runs: usize,
    run: ConstantRun,
    longest: ConstantRun,
    long_runs: Vec<ConstantRun>,
    lengths: [usize; COUNTED_LENGTHS + 1],
    /// The sum of all steps from a sample to the next, without sign.
    steps: f64,
    n_steps: usize,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            samples: 0,
            missing: 0,
            range: None,
            levels: HashSet::new(),
            runs: 0,
            run: ConstantRun::default(),
            longest: ConstantRun::default(),
            long_runs: Vec::new(),
            lengths: [0; COUNTED_LENGTHS + 1],
            steps: 0.0,
            n_steps: 0,
        }
    }
}

impl Tally {
    fn take(&mut self, sample: f64) {
        // What is missing equals nothing, not even itself.
        if self.run.samples == 0 || sample != self.run.value {
            let step = (sample - self.run.value).abs();
            if self.run.samples > 0 && step.is_finite() {
                self.steps += step;
                self.n_steps += 1;
            }
            self.end_run();
            self.run = ConstantRun {
                start: self.samples,
                samples: 0,
                value: sample,
            };
        } else {
            self.n_steps += 1;
        }
        self.run.samples += 1;
        self.samples += 1;
        if sample.is_nan() {
            self.missing += 1;
            return;
        }
        let (min, max) = self
            .range
            .get_or_insert_with(|| (Extreme::new(-sample), Extreme::new(sample)));
        min.take(-sample);
        max.take(sample);
        if self.levels.len() <= STEPPED_LEVELS {
            self.levels.insert(sample.to_bits());
        }
    }

    fn end_run(&mut self) {
        let run = self.run;
        if run.samples == 0 {
            return;
        }
        self.runs += 1;
        if run.samples > self.longest.samples {
            self.longest = run;
        }
        if run.samples >= LONG_RUN && self.long_runs.len() < MOST_KEPT {
            self.long_runs.push(run);
        }
        if let Some(length) = self.lengths.get_mut(run.samples)
            && !run.value.is_nan()
        {
            *length += 1;
        }
    }
}

/// Looks at each sample and its two neighbours.
struct Spikes {
    /// From this distance on a sample may be one.
    distance: f64,
    /// The last two samples.
    before: [f64; 2],
    index: usize,
    indices: Vec<usize>,
}

impl Spikes {
    fn new(mean_step: f64, is_stepped: bool) -> Self {
        let distance = match is_stepped {
            true => f64::INFINITY,
            false => SPIKE_STEPS * mean_step,
        };
        Self {
            distance,
            before: [f64::NAN; 2],
            index: 0,
            indices: Vec::new(),
        }
    }

    fn take(&mut self, sample: f64) {
        let [first, middle] = self.before;
        let (up, down) = (middle - first, middle - sample);
        let height = up.abs().min(down.abs());
        let is_spike = height > self.distance
            && up.signum() == down.signum()
            && (sample - first).abs() < SPIKE_RETURN * height;
        if is_spike && self.indices.len() < MOST_KEPT {
            self.indices.push(self.index - 1);
        }
        self.before = [middle, sample];
        self.index += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A signal that comes in pieces.
    struct Pieces<'a>(Vec<&'a [f64]>);

    impl SampleSeries for Pieces<'_> {
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
            let whole = SignalProfile::of(&mut samples.as_slice()).unwrap();
            let mut pieces = Pieces(samples.chunks(length).collect());
            // Compared as text, in which a missing sample equals another.
            let pieces = format!("{:?}", SignalProfile::of(&mut pieces).unwrap());
            prop_assert_eq!(pieces, format!("{whole:?}"));
        }
    }

    #[test]
    fn the_longest_run_is_the_first_of_its_length_and_missing_samples_make_none() {
        let nan = f64::NAN;
        let samples = [1.0, 2.0, 2.0, nan, nan, nan, 3.0, 3.0];
        let profile = SignalProfile::of(&mut samples.as_slice()).unwrap();
        let expected = ConstantRun {
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
