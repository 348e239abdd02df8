//! Many candidates over one or more recordings, on all cores.
//!
//! Candidates are sorted by their work and grouped into blocks; each pair of block and recording
//! is one piece of work for the thread pool. What comes out says which candidates it
//! belongs to and stands in a fixed order, so that nothing depends on the number of threads.

use super::{
    BlockSimulator, CandidateBlock, DrivingInputs, Plant, SimulatedCandidate, SimulationFailure,
};
use greybox_numerics::lanes::{LANES, Lanes};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Samples whose outputs are handed on together.
pub const WINDOW_SAMPLES: usize = 512;

/// Takes the outputs of up to [`LANES`] candidates as they are simulated.
pub trait Sink: Send {
    /// `outputs[sample · n_outputs + output]` from `first_sample` on.
    fn consume(&mut self, first_sample: usize, outputs: &[Lanes]);

    /// The states at the last sample.
    fn finish(&mut self, _states: &[Lanes]) {}
}

/// One recording, and the candidates that go through it.
#[derive(Clone, Debug)]
pub struct BatchRun<'a> {
    /// What drives the simulation.
    pub excitation: DrivingInputs<'a>,
    /// The candidates; the same number for every recording of a batch.
    pub candidates: Vec<SimulatedCandidate<'a>>,
    /// How many of them, from the first on, take the steps that the first needs, so that they can
    /// be compared to the last digits; 0: each takes its own.
    pub in_step: usize,
}

/// What became of up to [`LANES`] candidates over one recording.
#[derive(Debug)]
pub struct Piece<S> {
    /// The recording, as an index.
    pub run: usize,
    /// The candidate of each lane in use, as indices. The first of those in step stands in several
    /// pieces, with the same outputs.
    pub members: Vec<usize>,
    /// What became of the outputs.
    pub sink: S,
    /// How each lane has failed, if it has.
    pub failures: [Option<SimulationFailure>; LANES],
    /// Derivatives evaluated, one lane each; the first piece of a block has them all.
    pub derivative_evaluations: u64,
}

/// Simulates every candidate over every recording. Answers nothing when `stop` was raised.
pub fn simulate<S: Sink>(
    plant: &dyn Plant,
    runs: &[BatchRun<'_>],
    stop: &AtomicBool,
    new_sink: impl Fn(usize) -> S + Sync,
) -> Option<Vec<Piece<S>>> {
    let Some(first) = runs.first() else {
        return Some(Vec::new());
    };
    let at_work = AtWork::begin();
    let order = BlockLayout::of(plant, first);
    let blocks: Vec<BlockTask<'_>> = runs
        .iter()
        .enumerate()
        .flat_map(|(run, BatchRun { excitation, .. })| {
            let sizes = plant.block_sizes(excitation.accuracy);
            let size = if plant.runs_freely(excitation.samples) && first.in_step == 0 {
                at_work.queue(first.candidates.len(), runs.len())
            } else {
                at_work.block_size(sizes, first.candidates.len(), runs.len())
            };
            let excitation = *excitation;
            order.blocks(size).map(move |(members, in_step)| BlockTask {
                plant,
                run,
                excitation,
                members,
                in_step,
            })
        })
        .collect();
    let of_blocks: Option<Vec<Vec<Piece<S>>>> = blocks
        .into_par_iter()
        .map(|block| block.simulate(&runs[block.run].candidates, stop, &new_sink))
        .collect();
    Some(of_blocks?.into_iter().flatten().collect())
}

/// In which order candidates are put into blocks.
struct BlockLayout {
    /// How many candidates, from the first on, take the steps of the first.
    in_step: usize,
    /// Candidates that choose their own steps; candidates of like work stand side by side.
    by_work: Vec<usize>,
}

impl BlockLayout {
    fn of(plant: &dyn Plant, run: &BatchRun<'_>) -> BlockLayout {
        let rate = |index: usize| plant.work_rate(run.candidates[index].parameters);
        let free = run.in_step..run.candidates.len();
        let mut rated: Vec<(f64, usize)> = free.map(|index| (rate(index), index)).collect();
        rated.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        BlockLayout {
            in_step: run.in_step,
            by_work: rated.into_iter().map(|(_, index)| index).collect(),
        }
    }

    /// Blocks of at most `size` candidates, and whether they are in step: the first of those
    /// leads in each of their blocks.
    fn blocks(&self, size: usize) -> impl Iterator<Item = (Vec<usize>, bool)> {
        let led: Vec<usize> = (1..self.in_step).collect();
        let led_blocks = led.chunks(size - 1).map(|chunk| {
            let members = std::iter::once(0).chain(chunk.iter().copied());
            (members.collect(), true)
        });
        let alone = (self.in_step == 1).then(|| (vec![0], true));
        let led_blocks: Vec<(Vec<usize>, bool)> = led_blocks.chain(alone).collect();
        let by_work = self.by_work.chunks(size);
        let by_work = by_work.map(|chunk| (chunk.to_vec(), false));
        led_blocks.into_iter().chain(by_work)
    }
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

    /// The size of a block of candidates that run by themselves, so that there is one block for each thread.
    /// No bit of a result depends on the size.
    fn queue(&self, candidates: usize, runs: usize) -> usize {
        let of_run = self.threads.div_ceil(runs).max(1);
        candidates
            .div_ceil(of_run)
            .next_multiple_of(LANES)
            .max(LANES)
    }
}

impl Drop for AtWork {
    fn drop(&mut self) {
        AT_WORK.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Candidates that go through a recording side by side.
struct BlockTask<'a> {
    plant: &'a dyn Plant,
    /// The recording, as an index.
    run: usize,
    excitation: DrivingInputs<'a>,
    /// The candidates, as indices.
    members: Vec<usize>,
    /// Whether all take the steps of the first.
    in_step: bool,
}

impl BlockTask<'_> {
    /// A piece for each group of lanes.
    fn simulate<S: Sink>(
        &self,
        candidates: &[SimulatedCandidate<'_>],
        stop: &AtomicBool,
        new_sink: impl Fn(usize) -> S,
    ) -> Option<Vec<Piece<S>>> {
        let members: Vec<SimulatedCandidate<'_>> = self
            .members
            .iter()
            .map(|&index| candidates[index])
            .collect();
        let block = CandidateBlock {
            members: &members,
            in_step: self.in_step,
        };
        let mut simulator = self.plant.simulator(self.excitation, block);
        let groups = self.members.chunks(LANES);
        let mut sinks: Vec<S> = groups.clone().map(|_| new_sink(self.run)).collect();
        self.drive(simulator.as_mut(), stop, &mut sinks)?;
        let states = simulator.states();
        let n_states = states.len() / simulator.failures().len().div_ceil(LANES).max(1);
        for (sink, states) in sinks.iter_mut().zip(states.chunks(n_states.max(1))) {
            sink.finish(states);
        }
        let failures = simulator.failures().chunks(LANES);
        let failure =
            |failures: &[Option<SimulationFailure>], lane| failures.get(lane).copied().flatten();
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
                simulator.advance(count, window, stop)?;
            }
            for (sink, outputs) in sinks.iter_mut().zip(window.chunks(count * n_outputs)) {
                sink.consume(sample, outputs);
            }
            sample += count;
        }
        Some(())
    }
}
