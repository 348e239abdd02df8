//! Many candidates over one or more recordings, on all cores.
//!
//! Candidates are sorted by the work of a sample and grouped into blocks; each pair of block and
//! recording is one piece of work for the thread pool. What comes out says which candidates it
//! belongs to and stands in a fixed order, so that nothing depends on the number of threads.

use super::block;
use super::dynamics::Dynamics;
use super::lanes::{LANES, Lanes};
use super::{Accuracy, BlockSimulator, Candidate, Excitation, Failure};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Samples simulated between two looks at the stop flag; also bounds the buffer of outputs.
pub const WINDOW_SAMPLES: usize = 512;

/// A plant of any kind, behind one table of functions.
pub trait Plant: Send + Sync {
    /// How many outputs the plant has.
    fn n_outputs(&self) -> usize;
    /// The candidate's fastest rate that a step must resolve [1/s].
    fn resolved_rate(&self, parameters: &[f64]) -> f64;
    /// How many candidates a block may hold at this accuracy, ascending. A larger one takes less
    /// time for each candidate, a smaller one less for the whole block.
    fn block_sizes(&self, _accuracy: Accuracy) -> &'static [usize] {
        &[LANES]
    }
    /// Starts a block of candidates, at most as many as the largest holds.
    fn simulator<'a>(
        &'a self,
        excitation: Excitation<'a>,
        candidates: &[Candidate<'_>],
    ) -> Box<dyn BlockSimulator + 'a>;
}

/// Dynamics as a [`Plant`].
#[derive(Clone, Copy, Debug)]
pub struct PlantOf<D> {
    /// The equations.
    pub dynamics: D,
    /// How many outputs they have.
    pub n_outputs: usize,
}

impl<D: Dynamics> Plant for PlantOf<D> {
    fn n_outputs(&self) -> usize {
        self.n_outputs
    }

    fn resolved_rate(&self, parameters: &[f64]) -> f64 {
        self.dynamics
            .resolved_rate(&self.dynamics.constants(parameters))
    }

    fn block_sizes(&self, accuracy: Accuracy) -> &'static [usize] {
        block::sizes(accuracy)
    }

    fn simulator<'a>(
        &'a self,
        excitation: Excitation<'a>,
        candidates: &[Candidate<'_>],
    ) -> Box<dyn BlockSimulator + 'a> {
        block::simulator(&self.dynamics, excitation, candidates)
    }
}

/// Takes the outputs of up to [`LANES`] candidates as they are simulated.
pub trait Sink: Send {
    /// `outputs[sample · n_outputs + output]` from `first_sample` on.
    fn consume(&mut self, first_sample: usize, outputs: &[Lanes]);
}

/// One recording, and the candidates that go through it.
#[derive(Clone, Debug)]
pub struct Run<'a> {
    /// What drives the simulation.
    pub excitation: Excitation<'a>,
    /// The candidates; the same number for every recording of a batch.
    pub candidates: Vec<Candidate<'a>>,
}

/// What became of up to [`LANES`] candidates over one recording.
#[derive(Debug)]
pub struct Piece<S> {
    /// The recording, as an index.
    pub run: usize,
    /// The candidate of each lane in use, as indices.
    pub members: Vec<usize>,
    /// What became of the outputs.
    pub sink: S,
    /// How each lane has failed, if it has.
    pub failures: [Option<Failure>; LANES],
    /// Derivatives evaluated, one lane each; the first piece of a block has them all.
    pub derivative_evaluations: u64,
}

/// Simulates every candidate over every recording. Answers nothing when `stop` was raised.
pub fn simulate<S: Sink>(
    plant: &dyn Plant,
    runs: &[Run<'_>],
    stop: &AtomicBool,
    new_sink: impl Fn(usize) -> S + Sync,
) -> Option<Vec<Piece<S>>> {
    let Some(first) = runs.first() else {
        return Some(Vec::new());
    };
    let at_work = AtWork::begin();
    let mut order: Vec<usize> = (0..first.candidates.len()).collect();
    let rate = |&index: &usize| {
        let candidate = &first.candidates[index];
        candidate
            .resolved_rate
            .unwrap_or_else(|| plant.resolved_rate(candidate.parameters))
    };
    let rates: Vec<f64> = order.iter().map(rate).collect();
    order.sort_by(|&a, &b| rates[a].total_cmp(&rates[b]));
    let blocks: Vec<(usize, &[usize])> = runs
        .iter()
        .enumerate()
        .flat_map(|(run, Run { excitation, .. })| {
            let sizes = plant.block_sizes(excitation.accuracy);
            let size = at_work.block_size(sizes, order.len(), runs.len());
            order.chunks(size).map(move |members| (run, members))
        })
        .collect();
    let of_blocks: Option<Vec<Vec<Piece<S>>>> = blocks
        .into_par_iter()
        .map(|(run, members)| {
            let block = Block {
                plant,
                run,
                excitation: runs[run].excitation,
                members,
            };
            let candidates = members.iter().map(|&index| runs[run].candidates[index]);
            let candidates: Vec<_> = candidates.collect();
            block.simulate(&candidates, stop, &new_sink)
        })
        .collect();
    Some(of_blocks?.into_iter().flatten().collect())
}

/// Batches at work, which share the threads.
static AT_WORK: AtomicUsize = AtomicUsize::new(0);

/// A batch at work.
struct AtWork {
    /// Threads for each of the batches at work when it began.
    threads: usize,
}

impl AtWork {
    fn begin() -> AtWork {
        let batches = 1 + AT_WORK.fetch_add(1, Ordering::Relaxed);
        AtWork {
            threads: rayon::current_num_threads() / batches,
        }
    }

    /// The smallest blocks of which there is still a thread for each, or else the largest. No bit
    /// of a result depends on it.
    fn block_size(&self, sizes: &[usize], candidates: usize, runs: usize) -> usize {
        let has_threads = |size: &&usize| runs * candidates.div_ceil(**size) <= self.threads;
        let chosen = sizes.iter().find(has_threads).or(sizes.last());
        chosen.copied().unwrap_or(LANES)
    }
}

impl Drop for AtWork {
    fn drop(&mut self) {
        AT_WORK.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Candidates that go through a recording side by side.
struct Block<'a> {
    plant: &'a dyn Plant,
    /// The recording, as an index.
    run: usize,
    excitation: Excitation<'a>,
    /// The candidates, as indices.
    members: &'a [usize],
}

impl Block<'_> {
    /// A piece for each group of lanes.
    fn simulate<S: Sink>(
        &self,
        candidates: &[Candidate<'_>],
        stop: &AtomicBool,
        new_sink: impl Fn(usize) -> S,
    ) -> Option<Vec<Piece<S>>> {
        let mut simulator = self.plant.simulator(self.excitation, candidates);
        let groups = self.members.chunks(LANES);
        let mut sinks: Vec<S> = groups.clone().map(|_| new_sink(self.run)).collect();
        self.drive(simulator.as_mut(), stop, &mut sinks)?;
        let failures = simulator.failures().chunks(LANES);
        let failure = |failures: &[Option<Failure>], lane| failures.get(lane).copied().flatten();
        let mut derivative_evaluations = simulator.derivative_evaluations();
        let pieces = groups.zip(sinks).zip(failures);
        let pieces = pieces.map(|((members, sink), failures)| Piece {
            run: self.run,
            members: members.to_vec(),
            sink,
            failures: std::array::from_fn(|lane| failure(failures, lane)),
            derivative_evaluations: std::mem::take(&mut derivative_evaluations),
        });
        Some(pieces.collect())
    }

    /// Window after window until the recording ends, every lane has failed, or `stop` is raised.
    fn drive(
        &self,
        simulator: &mut dyn BlockSimulator,
        stop: &AtomicBool,
        sinks: &mut [impl Sink],
    ) -> Option<()> {
        let samples = self.excitation.samples;
        let n_outputs = self.plant.n_outputs();
        let row = sinks.len() * n_outputs;
        let mut outputs = vec![Lanes([f64::NAN; LANES]); WINDOW_SAMPLES.min(samples) * row];
        let mut sample = 0;
        while sample < samples {
            if stop.load(Ordering::Relaxed) {
                return None;
            }
            let count = WINDOW_SAMPLES.min(samples - sample);
            let window = &mut outputs[..count * row];
            if simulator.failures().iter().all(Option::is_some) {
                window.fill(Lanes([f64::NAN; LANES]));
            } else {
                simulator.advance(count, window);
            }
            for (sink, outputs) in sinks.iter_mut().zip(window.chunks(count * n_outputs)) {
                sink.consume(sample, outputs);
            }
            sample += count;
        }
        Some(())
    }
}
