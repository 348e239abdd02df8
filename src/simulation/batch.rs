//! Many candidates over one or more recordings, on all cores.
//!
//! Candidates are sorted by the work of a sample and grouped into blocks; each pair of block and
//! recording is one piece of work for the thread pool. What comes out says which candidates it
//! belongs to and stands in a fixed order, so that nothing depends on the number of threads.

use super::block;
use super::dynamics::Dynamics;
use super::lanes::{LANES, Lanes};
use super::{BlockSimulator, Candidate, Excitation, Failure};
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Samples simulated between two looks at the stop flag; also bounds the buffer of outputs.
pub const WINDOW_SAMPLES: usize = 512;

/// A plant of any kind, behind one table of functions.
pub trait Plant: Send + Sync {
    /// How many outputs the plant has.
    fn n_outputs(&self) -> usize;
    /// The candidate's fastest rate that a step must resolve [1/s].
    fn resolved_rate(&self, parameters: &[f64]) -> f64;
    /// Starts a block of up to [`LANES`] candidates.
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

    fn simulator<'a>(
        &'a self,
        excitation: Excitation<'a>,
        candidates: &[Candidate<'_>],
    ) -> Box<dyn BlockSimulator + 'a> {
        block::simulator(&self.dynamics, excitation, candidates)
    }
}

/// Takes the outputs of one block as they are simulated.
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

/// One finished piece of work.
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
    /// Derivatives evaluated, one lane each.
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
    let mut order: Vec<usize> = (0..first.candidates.len()).collect();
    let rate = |&index: &usize| plant.resolved_rate(first.candidates[index].parameters);
    let rates: Vec<f64> = order.iter().map(rate).collect();
    order.sort_by(|&a, &b| rates[a].total_cmp(&rates[b]));
    let pieces: Vec<(usize, &[usize])> = (0..runs.len())
        .flat_map(|run| order.chunks(LANES).map(move |members| (run, members)))
        .collect();
    pieces
        .into_par_iter()
        .map(|(run, members)| {
            let candidates: Vec<_> = members
                .iter()
                .map(|&index| runs[run].candidates[index])
                .collect();
            let mut simulator = plant.simulator(runs[run].excitation, &candidates);
            let mut sink = new_sink(run);
            let samples = runs[run].excitation.samples;
            drive(
                simulator.as_mut(),
                samples,
                plant.n_outputs(),
                stop,
                &mut sink,
            )?;
            Some(Piece {
                run,
                members: members.to_vec(),
                sink,
                failures: *simulator.failures(),
                derivative_evaluations: simulator.derivative_evaluations(),
            })
        })
        .collect()
}

/// Window after window until the recording ends, every lane has failed, or `stop` is raised.
fn drive(
    simulator: &mut dyn BlockSimulator,
    samples: usize,
    n_outputs: usize,
    stop: &AtomicBool,
    sink: &mut impl Sink,
) -> Option<()> {
    let mut outputs = vec![Lanes([f64::NAN; LANES]); WINDOW_SAMPLES.min(samples) * n_outputs];
    let mut sample = 0;
    while sample < samples {
        if stop.load(Ordering::Relaxed) {
            return None;
        }
        let count = WINDOW_SAMPLES.min(samples - sample);
        let window = &mut outputs[..count * n_outputs];
        if simulator.failures().iter().all(Option::is_some) {
            window.fill(Lanes([f64::NAN; LANES]));
        } else {
            simulator.advance(count, window);
        }
        sink.consume(sample, window);
        sample += count;
    }
    Some(())
}
