//! Candidates that go by themselves have the bits of candidates that wait at each sample.

use super::*;
use crate::block::SimulationBlock;
use crate::native::{Dynamics, Native};
use crate::{Accuracy, CandidateBlock};

/// Van der Pol's oscillator, of which a large first parameter makes a stiff one, beside a state that a
/// positive second parameter lets grow beyond all limits in a finite time.
struct Oscillator;

impl Dynamics for Oscillator {
    type State<R: Real> = [R; 3];
    type Held<R: Real> = [R; 0];
    type Constants<R: Real> = [R; 2];

    fn constants<R: Real>(&self, parameters: &[R]) -> [R; 2] {
        [parameters[0], parameters[1]]
    }
    fn initial_state<R: Real>(&self, _: &[R; 2]) -> [R; 3] {
        [R::splat(2.0), R::splat(0.0), R::splat(1.0)]
    }
    fn hold<R: Real>(&self, _: &[R; 2], _: &Sample<'_>, _: &[R; 3]) -> [R; 0] {
        []
    }
    #[inline(always)]
    fn derivative<R: Real>(&self, c: &[R; 2], _: &[R; 0], x: &[R; 3]) -> [R; 3] {
        let damping = c[0] * (R::splat(1.0) - x[0] * x[0]);
        [x[1], damping * x[1] - x[0], c[1] * x[2] * x[2]]
    }
    fn outputs<R: Real>(&self, _: &[R; 2], x: &[R; 3], outputs: &mut [R]) {
        outputs.copy_from_slice(&x[..2]);
    }
    fn sizes<R: Real>(&self, _: &[R; 2]) -> [R; 3] {
        [R::splat(1.0); 3]
    }
}

const OSCILLATOR: Native<Oscillator> = Native {
    dynamics: Oscillator,
    n_outputs: 2,
};

const SAMPLES: usize = 40;

fn excitation(instants: &[f64]) -> DrivingInputs<'_> {
    DrivingInputs {
        sample_time: f64::NAN,
        instants: Some(instants),
        samples: SAMPLES,
        input_set: 0,
        inputs: &[],
        accuracy: Accuracy::Screening,
    }
}

/// Instants that are nowhere equally far apart.
fn instants() -> Vec<f64> {
    let instant = |sample: usize| sample as f64 + 0.3 * (sample as f64).sin();
    (0..SAMPLES).map(instant).collect()
}

/// Parameters of smooth and of stiff candidates, of which one in five ends before the recording does.
fn parameters(candidates: usize) -> Vec<[f64; 2]> {
    let damping = |place: usize| 10f64.powf((place * 7 % 11) as f64 * 0.3 - 1.0);
    let growth = |place: usize| if place % 5 == 3 { 0.08 } else { -0.01 };
    let candidate = |place| [damping(place), growth(place)];
    (0..candidates).map(candidate).collect()
}

/// The outputs of a candidate, its failure, and its states at the end, to the bit.
type Fate = (Vec<u64>, Option<SimulationFailure>, Vec<u64>);

fn fates(block: &mut dyn BlockSimulator, candidates: usize) -> Vec<Fate> {
    let rows = 2 * SAMPLES;
    let mut outputs = vec![Lanes::splat(0.0); candidates.div_ceil(LANES) * rows];
    let never = AtomicBool::new(false);
    block.advance(SAMPLES, &mut outputs, &never).unwrap();
    let states = block.states();
    let bits = |rows: &[Lanes], lane: usize| rows.iter().map(|row| row.0[lane].to_bits()).collect();
    let fate = |candidate: usize| {
        let (group, lane) = (candidate / LANES, candidate % LANES);
        let failure = block.failures()[candidate];
        let end = match failure {
            None => bits(&states[3 * group..][..3], lane),
            Some(_) => Vec::new(),
        };
        (bits(&outputs[rows * group..][..rows], lane), failure, end)
    };
    (0..candidates).map(fate).collect()
}

fn members(parameters: &[[f64; 2]]) -> Vec<SimulatedCandidate<'_>> {
    let member = |(place, parameters)| SimulatedCandidate {
        parameters,
        initial_state: match place % 3 {
            0 => &[None, None, None],
            _ => &[Some(1.5), None, None],
        },
    };
    let parameters = parameters.iter().map(<[f64; 2]>::as_slice);
    parameters.enumerate().map(member).collect()
}

#[test]
fn candidates_by_themselves_have_the_bits_of_candidates_that_wait() {
    let instants = instants();
    let parameters = parameters(45);
    let members = members(&parameters);
    let waiting: Vec<Fate> = members
        .iter()
        .flat_map(|member| {
            let block = CandidateBlock {
                members: &[*member],
                in_step: false,
            };
            let width = Width::widest();
            let mut block = SimulationBlock::<_, f64, LANES>::new(
                &OSCILLATOR,
                excitation(&instants),
                block,
                width,
            );
            fates(&mut block, 1)
        })
        .collect();
    let failed = waiting.iter().filter(|(_, failure, _)| failure.is_some());
    assert_eq!(failed.count(), 9);
    for width in Width::available() {
        for size in [1, 5, 8, 17, 45] {
            for (place, chunk) in members.chunks(size).enumerate() {
                let mut block = FreeBlock::new(&OSCILLATOR, excitation(&instants), chunk, width);
                let expected = &waiting[place * size..][..chunk.len()];
                assert!(
                    fates(&mut block, chunk.len()) == expected,
                    "{width:?} {size}"
                );
            }
        }
    }
}

#[test]
fn the_work_of_a_block_is_that_of_its_candidates() {
    let instants = instants();
    let parameters = parameters(20);
    let members = members(&parameters);
    let work = |members: &[SimulatedCandidate<'_>]| {
        let width = Width::widest();
        let mut block = FreeBlock::new(&OSCILLATOR, excitation(&instants), members, width);
        fates(&mut block, members.len());
        block.derivative_evaluations()
    };
    let alone: u64 = members.chunks(1).map(work).sum();
    assert!(alone > 0);
    assert_eq!(work(&members), alone);
}

#[test]
fn a_raised_flag_ends_a_block() {
    let instants = instants();
    let parameters = [[1e3, -0.01]; 12];
    let members = members(&parameters);
    let width = Width::widest();
    let mut block = FreeBlock::new(&OSCILLATOR, excitation(&instants), &members, width);
    let mut outputs = vec![Lanes::splat(0.0); 2 * 2 * SAMPLES];
    let raised = AtomicBool::new(true);
    assert!(block.advance(SAMPLES, &mut outputs, &raised).is_none());
}
