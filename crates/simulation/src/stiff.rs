//! A Rosenbrock method for candidates whose fastest rate lies far beyond what their accuracy
//! needs: a piston stalled against its load, friction at standstill, fast reactions.
//!
//! RODAS: six stages, order 4 with an embedded order 3, stiffly accurate and L-stable (E. Hairer,
//! G. Wanner, *Solving Ordinary Differential Equations II*, 1996, section IV.7 and the
//! coefficients of their code RODAS). It works in double precision on eight candidates at once.

pub mod exact;

use super::equations::Equations;
use super::factors::Factors;
use greybox_numerics::lanes::{Lanes, Real};
use greybox_numerics::width::Wide;

/// Stages of a step.
const STAGES: usize = 6;

/// The share of a step that stands on the diagonal.
const GAMMA: f64 = 0.25;

/// Where the stages evaluate the derivative, by the stages before.
const A: [[f64; 5]; STAGES] = [
    [0.0; 5],
    [1.544, 0.0, 0.0, 0.0, 0.0],
    [
        0.946_678_528_081_582_6,
        0.255_701_169_898_328_4,
        0.0,
        0.0,
        0.0,
    ],
    [
        3.314_825_187_068_521,
        2.896_124_015_972_201,
        0.998_641_913_997_781_7,
        0.0,
        0.0,
    ],
    [
        1.221_224_509_226_641,
        6.019_134_481_288_629,
        12.537_083_329_320_87,
        -0.687_886_036_105_895,
        0.0,
    ],
    [
        1.221_224_509_226_641,
        6.019_134_481_288_629,
        12.537_083_329_320_87,
        -0.687_886_036_105_895,
        1.0,
    ],
];

/// What the stages take over from those before.
const C: [[f64; 5]; STAGES] = [
    [0.0; 5],
    [-5.6688, 0.0, 0.0, 0.0, 0.0],
    [
        -2.430_093_356_833_875,
        -0.206_359_915_709_191_5,
        0.0,
        0.0,
        0.0,
    ],
    [
        -0.107_352_905_815_137_5,
        -9.594_562_251_023_355,
        -20.470_286_148_096_16,
        0.0,
        0.0,
    ],
    [
        7.496_443_313_967_647,
        -10.246_804_314_643_52,
        -33.999_903_528_199_05,
        11.708_908_932_061_6,
        0.0,
    ],
    [
        8.083_246_795_921_522,
        -7.981_132_988_064_893,
        -31.521_594_328_743_71,
        16.319_305_431_231_36,
        -6.058_818_238_834_054,
    ],
];

/// When the stages evaluate the derivative, as a share of the step.
const TIMES: [f64; STAGES] = [0.0, 0.386, 0.21, 0.63, 1.0, 1.0];

/// How the stages take part in what time does to the derivative.
const BY_TIME: [f64; STAGES] = [0.25, -0.1043, 0.1035, -0.036_200_000_000_000_23, 0.0, 0.0];

/// Derivatives that a step of a plant with so many states is counted for, its Jacobian included.
pub fn derivatives(n_states: usize) -> f64 {
    (STAGES + 2 * n_states) as f64
}

/// Room for the stages of a step.
#[derive(Clone, Debug)]
pub struct Rosenbrock {
    factors: Factors<Lanes>,
    stages: [Vec<Lanes>; STAGES],
    by_time: Vec<Lanes>,
    /// The direction in which the Jacobian stretches most, found by going on with it (power
    /// iteration).
    direction: Vec<Lanes>,
    /// Where the Jacobian takes it.
    image: Vec<Lanes>,
    /// By how much it stretched before.
    stretch_before: Lanes,
}

/// A step to be taken.
#[derive(Clone, Copy, Debug)]
pub struct StiffStep<'a, S> {
    /// The states where the step begins.
    pub states: &'a S,
    /// What an error of each state is multiplied by.
    pub weights: &'a S,
    /// The time since the held quantities began to act `[s]`.
    pub elapsed: Lanes,
    /// The length of the step `[s]`, not 0.
    pub length: Lanes,
}

/// What a step came to.
#[derive(Clone, Copy, Debug)]
pub struct StiffOutcome {
    /// The square of its estimated error: the mean over the states.
    pub squared_error: Lanes,
    /// The fastest rate of the plant times the step.
    pub rate_times_length: Lanes,
}

impl Rosenbrock {
    /// Room for a plant with so many states.
    pub fn new(n_states: usize) -> Rosenbrock {
        let zeros = || vec![Lanes::splat(0.0); n_states];
        let direction = (0..n_states).map(|state| Lanes::splat(first_direction(state)));
        Rosenbrock {
            factors: Factors::new(n_states),
            stages: std::array::from_fn(|_| zeros()),
            by_time: zeros(),
            direction: direction.collect(),
            image: zeros(),
            stretch_before: Lanes::splat(0.0),
        }
    }

    /// Forgets the direction of a candidate.
    pub fn begin(&mut self, lane: usize) {
        for (state, part) in self.direction.iter_mut().enumerate() {
            part.set_lane(lane, first_direction(state));
        }
        self.stretch_before.set_lane(lane, 0.0);
    }

    /// Takes a step, and writes where it leads.
    #[inline(always)]
    pub fn step<E: Equations<Lanes>>(
        &mut self,
        equations: &mut E,
        step: StiffStep<'_, E::States>,
        next: &mut E::States,
    ) -> StiffOutcome {
        let StiffStep {
            states,
            weights,
            elapsed,
            length,
        } = step;
        let n = states.as_ref().len();
        let inverse = Lanes::splat(1.0) / length;
        let mut rates = states.clone();
        equations.rates(states, elapsed, &mut rates);
        let matrix = self.factors.matrix_mut();
        equations.jacobian(states, elapsed, &rates, matrix);
        let moves = equations.rates_by_time(&mut self.by_time);
        let (direction, image) = (&mut self.direction[..], &mut self.image[..]);
        let rate = stretch(matrix, direction, image, weights.as_ref());
        for (place, entry) in matrix.iter_mut().enumerate() {
            *entry = -*entry;
            if place % (n + 1) == 0 {
                *entry += inverse * Lanes::splat(1.0 / GAMMA);
            }
        }
        self.factors.factorise();
        for stage in 0..STAGES {
            let (before, now) = self.stages.split_at_mut(stage);
            let right = &mut now[0];
            if stage > 0 {
                next.as_mut().copy_from_slice(states.as_ref());
                let shares = A[stage].iter().zip(&*before);
                shares.for_each(|(a, stage)| add(next.as_mut(), Lanes::splat(*a), stage));
                let at = elapsed + length * Lanes::splat(TIMES[stage]);
                equations.rates(next, at, &mut rates);
            }
            right.copy_from_slice(rates.as_ref());
            for (c, stage) in C[stage].iter().zip(&*before) {
                add(right, inverse * Lanes::splat(*c), stage);
            }
            if moves {
                add(right, length * Lanes::splat(BY_TIME[stage]), &self.by_time);
            }
            self.factors.solve(right);
        }
        // The last stage was evaluated at the solution of third order; it is the difference of
        // the two as well.
        let error = &self.stages[STAGES - 1];
        add(next.as_mut(), Lanes::splat(1.0), error);
        let mut squared_error = Lanes::splat(0.0);
        for (error, weight) in error.iter().zip(weights.as_ref()) {
            let weighted = *error * *weight;
            squared_error += weighted * weighted;
        }
        let fastest = rate.max(self.stretch_before);
        self.stretch_before = rate;
        StiffOutcome {
            squared_error: squared_error * Lanes::splat(1.0 / n as f64),
            rate_times_length: fastest * length,
        }
    }
}

/// A state's part of the direction that is followed at first: no direction of a plant is at right angles
/// to it.
fn first_direction(state: usize) -> f64 {
    1.0 + 0.1 * state as f64
}

/// By how much a matrix stretches a direction, which is replaced by where the matrix takes it, in
/// the norm of the weights.
#[inline(always)]
fn stretch(
    matrix: &[Lanes],
    direction: &mut [Lanes],
    image: &mut [Lanes],
    weights: &[Lanes],
) -> Lanes {
    let n = direction.len();
    for (image, row) in image.iter_mut().zip(matrix.chunks_exact(n)) {
        let mut sum = Lanes::splat(0.0);
        for (entry, part) in row.iter().zip(&*direction) {
            sum += *entry * *part;
        }
        *image = sum;
    }
    let size = |vector: &[Lanes]| {
        let mut sum = Lanes::splat(0.0);
        for (part, weight) in vector.iter().zip(weights) {
            let weighted = *part * *weight;
            sum += weighted * weighted;
        }
        sum.sqrt()
    };
    let (before, after) = (size(direction), size(image));
    let (zero, least) = (Lanes::splat(0.0), Lanes::splat(f64::MIN_POSITIVE));
    let rate = before.select_ge(least, after / before, zero);
    for (part, image) in direction.iter_mut().zip(&*image) {
        // Where there is nothing to follow, the direction stays.
        *part = after.select_ge(least, *image / after, *part);
    }
    rate
}

#[inline(always)]
fn add(to: &mut [Lanes], share: Lanes, change: &[Lanes]) {
    for (to, change) in to.iter_mut().zip(change) {
        *to += share * *change;
    }
}

/// A step as work that is compiled for each width of registers.
pub struct WideStep<'a, E: Equations<Lanes>> {
    /// Room for the stages of the step.
    pub rosenbrock: &'a mut Rosenbrock,
    /// The equations of the plant.
    pub equations: &'a mut E,
    /// The step to be taken.
    pub step: StiffStep<'a, E::States>,
    /// The states where the step leads.
    pub next: &'a mut E::States,
    /// The rates of change at the end of the step.
    pub end: &'a mut E::States,
}

impl<E: Equations<Lanes>> Wide for WideStep<'_, E> {
    type Output = StiffOutcome;

    #[inline(always)]
    fn work(self) -> StiffOutcome {
        let at = self.step.elapsed + self.step.length;
        let taken = self.rosenbrock.step(self.equations, self.step, self.next);
        self.equations.rates(self.next, at, self.end);
        taken
    }
}
