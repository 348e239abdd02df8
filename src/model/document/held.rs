//! What is held over a sample, and its way to the plant through the delay.

use crate::simulation::Excitation;
use crate::simulation::explicit::Steps;
use crate::simulation::lanes::{LANES, Lanes};
use std::collections::VecDeque;

/// Inputs and sampled quantities at the start of a stretch; `slopes` are those of the inputs,
/// empty where they do not move.
#[derive(Clone, Debug)]
pub struct Held<R> {
    pub inputs: Vec<R>,
    pub slopes: Vec<R>,
    pub sampled: Vec<R>,
}

/// A stretch of a sample over which nothing jumps.
#[derive(Clone, Debug)]
pub struct Segment {
    pub held: Held<Lanes>,
    pub steps: Steps,
}

impl Held<Lanes> {
    /// One candidate's quantities.
    pub fn of_lane(&self, lane: usize) -> Held<f64> {
        let pick = |rows: &[Lanes]| rows.iter().map(|row| row.0[lane]).collect();
        Held {
            inputs: pick(&self.inputs),
            slopes: pick(&self.slopes),
            sampled: pick(&self.sampled),
        }
    }

    /// Takes over one candidate's quantities.
    pub fn set_lane_from(&mut self, lane: usize, other: &Held<Lanes>) {
        for (own, other) in [
            (&mut self.inputs, &other.inputs),
            (&mut self.slopes, &other.slopes),
            (&mut self.sampled, &other.sampled),
        ] {
            for (row, other) in own.iter_mut().zip(other) {
                row.0[lane] = other.0[lane];
            }
        }
    }

    /// The inputs of a lane as they stand `seconds` later.
    fn move_lane(&mut self, lane: usize, seconds: f64) {
        for (input, slope) in self.inputs.iter_mut().zip(&self.slopes) {
            input.0[lane] += slope.0[lane] * seconds;
        }
    }

    /// The same, with inputs that stand still.
    fn standing(mut self) -> Self {
        self.slopes
            .iter_mut()
            .for_each(|slope| *slope = Lanes([0.0; LANES]));
        self
    }
}

/// Held quantities on their way to the plant. With a delay of `whole` samples and `part` of one,
/// the plant sees at first what was held `whole` + 1 samples ago, and for the rest of the sample
/// what was held `whole` samples ago.
pub struct Delay {
    whole: [usize; LANES],
    part: Lanes,
    before: Steps,
    after: Steps,
    /// The latest held quantities, newest last.
    history: VecDeque<Held<Lanes>>,
}

/// No delay is longer than so many samples.
const LONGEST: usize = 100_000;

impl Delay {
    /// A delay of each lane [s].
    pub fn new(delay: Lanes, excitation: &Excitation<'_>, rate: &Lanes) -> Self {
        let sample_time = excitation.sample_time;
        let longest = LONGEST.min(excitation.samples);
        let whole = delay
            .0
            .map(|seconds| ((seconds / sample_time).floor().max(0.0) as usize).min(longest));
        let part = Lanes(std::array::from_fn(|lane| {
            (delay.0[lane] - whole[lane] as f64 * sample_time).clamp(0.0, sample_time)
        }));
        let rest = Lanes(part.0.map(|part| sample_time - part));
        Delay {
            whole,
            part,
            before: Steps::resolving(rate, &part, excitation.accuracy),
            after: Steps::resolving(rate, &rest, excitation.accuracy),
            history: VecDeque::new(),
        }
    }

    /// What acts on the plant over the sample at which `held` is new. Before the record began the
    /// plant saw the first quantities, standing still.
    pub fn segments(&mut self, held: Held<Lanes>, sample_time: f64) -> Vec<Segment> {
        let longest = self.whole.iter().copied().max().unwrap_or(0) + 2;
        if self.history.is_empty() {
            let still = held.clone().standing();
            self.history.extend(std::iter::repeat_n(still, longest - 1));
        } else {
            self.history.pop_front();
        }
        self.history.push_back(held);
        let seen = |extra: usize| {
            let mut seen = self.history[longest - 1].clone();
            for lane in 0..LANES {
                let age = self.whole[lane] + extra;
                seen.set_lane_from(lane, &self.history[longest - 1 - age]);
                seen.move_lane(lane, extra as f64 * (sample_time - self.part.0[lane]));
            }
            seen
        };
        vec![
            Segment {
                held: seen(1),
                steps: self.before,
            },
            Segment {
                held: seen(0),
                steps: self.after,
            },
        ]
    }
}
