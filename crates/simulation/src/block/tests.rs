//! Blocks on a small plant: bits, neighbours, a closed form, delays.

use super::*;
use crate::SimulatedCandidate;
use crate::native::{Dynamics, Native};

/// x'' = −ω²·x + u − friction, whose parameters are ω² and a dry friction; stiff where the
/// friction is strong.
struct Pendulum;

impl Dynamics for Pendulum {
    type State<R: Real> = [R; 2];
    type Held<R: Real> = [R; 1];
    type Constants<R: Real> = [R; 3];

    fn constants<R: Real>(&self, parameters: &[R]) -> [R; 3] {
        [parameters[0], parameters[1], parameters[2]]
    }
    fn initial_state<R: Real>(&self, _: &[R; 3]) -> [R; 2] {
        [R::splat(1.0), R::splat(0.0)]
    }
    fn hold<R: Real>(&self, _: &[R; 3], sample: &Sample<'_>, _: &[R; 2]) -> [R; 1] {
        [R::splat(sample.input(0))]
    }
    #[inline(always)]
    fn derivative<R: Real>(&self, c: &[R; 3], held: &[R; 1], x: &[R; 2]) -> [R; 2] {
        [
            x[1],
            held[0] - c[0] * x[0] - c[1] * (x[1] * R::splat(100.0)).tanh(),
        ]
    }
    fn outputs<R: Real>(&self, _: &[R; 3], x: &[R; 2], outputs: &mut [R]) {
        outputs.copy_from_slice(x);
    }
    fn input_delay<R: Real>(&self, c: &[R; 3]) -> Option<R> {
        Some(c[2])
    }
    fn sizes<R: Real>(&self, _: &[R; 3]) -> [R; 2] {
        [R::splat(1.0); 2]
    }
    fn validity<R: Real>(&self, _: &[R; 3], x: &[R; 2]) -> R {
        R::splat(1e6) - x[0].abs()
    }
}

const PENDULUM: Native<Pendulum> = Native {
    dynamics: Pendulum,
    n_outputs: 2,
};

/// Nobody raises it.
static NEVER: AtomicBool = AtomicBool::new(false);

fn simulate(parameters: &[[f64; 3]], inputs: &[Vec<f64>], width: Width) -> Vec<Lanes> {
    outputs::<f64, LANES>(Accuracy::Full, parameters, (inputs, width))
}

/// The positions of each candidate, in single precision.
fn rank(parameters: &[[f64; 3]], inputs: &[Vec<f64>], width: Width) -> Vec<Vec<f64>> {
    let accuracy = Accuracy::Ranking;
    let outputs = outputs::<f32, SINGLE_LANES>(accuracy, parameters, (inputs, width));
    let groups = outputs.chunks(2 * inputs[0].len());
    let of_group = |group: &[Lanes]| {
        let lane = |lane| group.iter().step_by(2).map(|row| row.0[lane]).collect();
        std::array::from_fn::<Vec<f64>, LANES, _>(lane)
    };
    let positions = groups.flat_map(of_group);
    positions.take(parameters.len()).collect()
}

fn excitation(accuracy: Accuracy, inputs: &[Vec<f64>]) -> DrivingInputs<'_> {
    DrivingInputs {
        sample_time: 0.1,
        instants: None,
        samples: inputs[0].len(),
        input_set: 0,
        inputs,
        accuracy,
    }
}

fn candidates(parameters: &[[f64; 3]]) -> Vec<SimulatedCandidate<'_>> {
    let candidate = |parameters| SimulatedCandidate {
        parameters,
        initial_state: &[None, None],
    };
    parameters.iter().map(|p| candidate(p.as_slice())).collect()
}

/// Of blocks of `N` or, in narrow registers, of half as many.
fn outputs<T: Scalar, const N: usize>(
    accuracy: Accuracy,
    parameters: &[[f64; 3]],
    (inputs, width): (&[Vec<f64>], Width),
) -> Vec<Lanes> {
    if width != Width::BASELINE {
        return of_block::<T, N>(accuracy, parameters, (inputs, width));
    }
    const SINGLE_HALF: usize = SINGLE_LANES / 2;
    const HALF: usize = LANES / 2;
    let rows = 2 * inputs[0].len();
    let mut all = vec![Lanes([f64::NAN; LANES]); rows * (N / LANES)];
    for (block, parameters) in parameters.chunks(N / 2).enumerate() {
        let of_block = match N {
            SINGLE_LANES => of_block::<T, SINGLE_HALF>(accuracy, parameters, (inputs, width)),
            _ => of_block::<T, HALF>(accuracy, parameters, (inputs, width)),
        };
        for (row, outputs) in of_block.iter().enumerate() {
            for lane in 0..N / 2 {
                let place = block * (N / 2) + lane;
                all[place / LANES * rows + row].0[place % LANES] = outputs.0[lane];
            }
        }
    }
    all
}

fn of_block<T: Scalar, const N: usize>(
    accuracy: Accuracy,
    parameters: &[[f64; 3]],
    (inputs, width): (&[Vec<f64>], Width),
) -> Vec<Lanes> {
    let excitation = excitation(accuracy, inputs);
    let candidates = candidates(parameters);
    let candidates = CandidateBlock {
        members: &candidates,
        in_step: false,
    };
    let mut block = SimulationBlock::<_, T, N>::new(&PENDULUM, excitation, candidates, width);
    let mut outputs = vec![Lanes([0.0; LANES]); 2 * inputs[0].len() * N.div_ceil(LANES)];
    let ended = block.advance(inputs[0].len(), &mut outputs, &NEVER);
    assert!(ended.is_some(), "nobody stops it");
    outputs
}

/// Slow and fast, smooth and stiff, with and without delay, and one that explodes.
const MIXED: [[f64; 3]; 8] = [
    [4.0, 0.0, 0.0],
    [90.0, 0.3, 0.0],
    [4.0, 2.0, 0.03],
    [25.0, 5.0, 0.25],
    [1.0, 0.1, 0.1],
    [-1e4, 0.0, 0.0],
    [9.0, 0.02, 0.0],
    [16.0, 1.0, 1.0],
];

fn square_wave() -> [Vec<f64>; 1] {
    [(0..120)
        .map(|k| if k / 20 % 2 == 0 { 1.0 } else { -0.5 })
        .collect()]
}

fn bits(outputs: &[Lanes], lane: usize) -> Vec<u64> {
    outputs.iter().map(|row| row.0[lane].to_bits()).collect()
}

#[test]
fn every_vector_width_gives_the_same_bits() {
    let narrow = simulate(&MIXED, &square_wave(), Width::BASELINE);
    for width in Width::available().skip(1) {
        let wide = simulate(&MIXED, &square_wave(), width);
        for lane in (0..LANES).filter(|lane| *lane != 5) {
            assert_eq!(bits(&narrow, lane), bits(&wide, lane), "{width:?} {lane}");
        }
    }
}

#[test]
fn a_candidate_does_not_see_its_neighbours_not_even_one_that_explodes() {
    let together = simulate(&MIXED, &square_wave(), Width::widest());
    assert!(
        together.last().unwrap().0[5].is_nan(),
        "the unstable candidate has failed"
    );
    for lane in (0..LANES).filter(|lane| *lane != 5) {
        let alone = simulate(&MIXED[lane..=lane], &square_wave(), Width::widest());
        assert_eq!(bits(&together, lane), bits(&alone, 0), "lane {lane}");
    }
}

/// The mixed candidates twice over, in another order.
fn sixteen() -> Vec<[f64; 3]> {
    MIXED.into_iter().chain(MIXED.into_iter().rev()).collect()
}

#[test]
fn ranking_gives_the_same_bits_in_every_width_and_beside_any_neighbour() {
    let bits = |position: &[f64]| -> Vec<u64> { position.iter().map(|x| x.to_bits()).collect() };
    let candidates = sixteen();
    let narrow = rank(&candidates, &square_wave(), Width::BASELINE);
    for width in Width::available() {
        println!("on this machine: {width:?}");
        let wide = rank(&candidates, &square_wave(), width);
        for (index, candidate) in candidates.iter().enumerate() {
            if candidate[0] < 0.0 {
                assert!(wide[index].last().unwrap().is_nan(), "it has failed");
                continue;
            }
            let alone = &rank(&[*candidate], &square_wave(), width)[0];
            let place = format!("{width:?}, candidate {index}");
            assert_eq!(bits(&narrow[index]), bits(&wide[index]), "{place}");
            assert_eq!(bits(alone), bits(&wide[index]), "{place}");
        }
    }
}

/// The positions of each candidate in the block that they are given.
fn in_a_block(accuracy: Accuracy, parameters: &[[f64; 3]]) -> Vec<Vec<f64>> {
    let inputs = square_wave();
    let excitation = excitation(accuracy, &inputs);
    let candidates = candidates(parameters);
    let groups = parameters.len().div_ceil(LANES);
    let mut outputs = vec![Lanes([0.0; LANES]); 2 * excitation.samples * groups];
    let candidates = CandidateBlock {
        members: &candidates,
        in_step: false,
    };
    let ended = simulator(&PENDULUM, excitation, candidates).advance(
        excitation.samples,
        &mut outputs,
        &NEVER,
    );
    assert!(ended.is_some(), "nobody stops it");
    let of_candidate = |index: usize| {
        let group = outputs.chunks(2 * excitation.samples).nth(index / LANES);
        let rows = group.unwrap_or_default().iter().step_by(2);
        rows.map(|row| row.0[index % LANES]).collect()
    };
    (0..parameters.len()).map(of_candidate).collect()
}

#[test]
fn a_block_of_any_size_gives_the_same_bits() {
    let bits = |position: &[f64]| -> Vec<u64> { position.iter().map(|x| x.to_bits()).collect() };
    // Without the candidate that fails, whose outputs are not numbers.
    let candidates: Vec<_> = sixteen().into_iter().filter(|c| c[0] > 0.0).collect();
    for accuracy in [Accuracy::Ranking, Accuracy::Full] {
        let largest = *sizes(accuracy).last().unwrap();
        let all = in_a_block(accuracy, &candidates[..largest.min(candidates.len())]);
        for count in [1, 3, 4, 5, 8] {
            let some = in_a_block(accuracy, &candidates[..count]);
            for (index, (some, all)) in some.iter().zip(&all).enumerate() {
                assert_eq!(bits(some), bits(all), "candidate {index} of {count}");
            }
        }
    }
}

#[test]
fn ranking_in_single_precision_errs_no_more_than_its_steps_may_in_double() {
    let ranked = rank(&MIXED, &square_wave(), Width::widest());
    let inputs: &[Vec<f64>] = &square_wave();
    let screened = outputs::<f64, LANES>(Accuracy::Screening, &MIXED, (inputs, Width::widest()));
    for (lane, ranked) in ranked.iter().enumerate().filter(|(lane, _)| *lane != 5) {
        for (x, row) in ranked.iter().zip(screened.iter().step_by(2)) {
            // Both err by 5e-6 a step at the most; friction that changes its sign makes some tens
            // of steps err as much.
            assert!((x - row.0[lane]).abs() < 2e-4, "{x} {}", row.0[lane]);
        }
    }
}

/// A push of 1e-8 moves the mass from 1 by half a ten-millionth in 10 s, hardly more than the
/// last of 24 bits, in steps of which none would reach it.
#[test]
fn a_state_that_creeps_by_less_than_its_last_digit_moves_on_in_single_precision() {
    let creep = &rank(&[[0.0; 3]], &[vec![1e-8; 240]], Width::widest())[0];
    for (sample, x) in creep.iter().enumerate() {
        let exact = 1.0 + 0.5e-8 * (0.1 * sample as f64).powi(2);
        assert!((x - exact).abs() <= f64::from(f32::EPSILON), "{x} {exact}");
    }
}

#[test]
fn an_undamped_swing_is_the_cosine() {
    let outputs = simulate(&[[4.0, 0.0, 0.0]], &[vec![0.0; 100]], Width::widest());
    for (sample, row) in outputs.chunks_exact(2).enumerate() {
        let expected = (2.0 * 0.1 * sample as f64).cos();
        assert!((row[0].0[0] - expected).abs() < 1e-4, "at {sample}");
    }
}

#[test]
fn a_delay_shifts_the_response_by_its_length() {
    let steps = |delay| simulate(&[[4.0, 0.0, delay]], &square_wave(), Width::widest());
    // The square wave holds its first value for 20 samples, so a delay of 5 samples acts like
    // a wave that changes 5 samples later.
    let later: Vec<f64> = (0..120i32)
        .map(|k| {
            if (k - 5).max(0) / 20 % 2 == 0 {
                1.0
            } else {
                -0.5
            }
        })
        .collect();
    let shifted = simulate(&[[4.0, 0.0, 0.0]], &[later], Width::widest());
    for (a, b) in steps(0.5).iter().zip(&shifted) {
        assert!((a.0[0] - b.0[0]).abs() < 1e-9);
    }
    // Half a sample more lies between the neighbours.
    let (before, half, after) = (steps(0.5), steps(0.55), steps(0.6));
    let row = 2 * 30;
    let between = (half[row].0[0] - before[row].0[0]) * (half[row].0[0] - after[row].0[0]);
    assert!(between < 0.0);
}
