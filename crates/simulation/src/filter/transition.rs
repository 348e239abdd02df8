//! How the covariance goes on over a step: the transition Φ and the covariance of what
//! disturbances add.
//!
//! dP/dt = AP + PAᵀ + Q over a step of length h has the solution ΦPΦᵀ + Qd. With A and Q at the
//! step's start, middle and end the solution is that of an A and a Q that stand still: Ah = Ω =
//! h/6·(A₀ + 4A½ + A₁) − h²/12·[A₀, A₁], Q = ⅙(Q₀ + 4Q½ + Q₁) − h/12·(A₀Q₁ + Q₁A₀ᵀ − A₁Q₀ − Q₀A₁ᵀ)
//! (the Magnus expansion to fourth order, A. Iserles et al., *Lie-group methods*, Acta Numerica 9,
//! 2000, of the equation with Q as one more direction). Φ = exp Ω and Qd are taken by their series
//! over a part of the step that is short enough, and doubled until the step is whole: exact where A
//! and Q stand still, and stable however fast the plant's modes are.

use greybox_numerics::lanes::{LANES, Lanes, Real};

/// The largest root of the norm of a power of Ω for which the series are taken.
const SERIES_REACH: f64 = 0.0625;

/// Doublings at the most: faster modes than this are not those of a plant.
const MOST_DOUBLINGS: u32 = 48;

/// Square matrices of one size, a number for each candidate. The states that stand still over a step, those
/// of a controller, are the last: A and Q have no rows for them, and Φ is the unit there.
pub type Matrix = Vec<Lanes>;

/// Φ and Qd of the step that was taken last.
pub struct StepCovariance {
    n: usize,
    /// How many states move over a step.
    moving: usize,
    /// Φ: `transition[row · n + column]`.
    transition: Matrix,
    /// Qd.
    added: Matrix,
    /// The step that both belong to; they stand as long as the steps are the same.
    step: CovarianceStep,
    is_taken: bool,
    scratch: [Matrix; 4],
}

/// What the covariance of a step follows from.
#[derive(Clone)]
pub struct CovarianceStep {
    /// A at the step's start, in its middle and at its end.
    pub jacobians: [Matrix; 3],
    /// Q, what disturbances add in a second, at the step's start, in its middle and at its end.
    pub diffusions: [Matrix; 3],
    /// The length of the step [s].
    pub length: Lanes,
}

impl CovarianceStep {
    /// A step of no length for so many states.
    pub fn new(n: usize) -> CovarianceStep {
        let zeros = || vec![Lanes::splat(0.0); n * n];
        CovarianceStep {
            jacobians: [zeros(), zeros(), zeros()],
            diffusions: [zeros(), zeros(), zeros()],
            length: Lanes::splat(0.0),
        }
    }

    fn is_same(&self, step: &CovarianceStep) -> bool {
        self.length == step.length
            && self.jacobians == step.jacobians
            && self.diffusions == step.diffusions
    }
}

impl StepCovariance {
    /// For so many states, of which so many move over a step.
    pub fn new(n: usize, moving: usize) -> StepCovariance {
        let zeros = || vec![Lanes::splat(0.0); n * n];
        StepCovariance {
            n,
            moving,
            transition: zeros(),
            added: zeros(),
            step: CovarianceStep::new(n),
            is_taken: false,
            scratch: std::array::from_fn(|_| zeros()),
        }
    }

    /// Takes the covariance over a step. With `follow` all candidates are doubled as often as the
    /// first.
    #[inline(always)]
    pub fn carry(&mut self, covariance: &mut Matrix, step: &CovarianceStep, follow: bool) {
        if !self.is_taken || !self.step.is_same(step) {
            self.take(step, follow);
            self.step.clone_from(step);
            self.is_taken = true;
        }
        let (n, moving) = (self.n, self.moving);
        let [first, ..] = &mut self.scratch;
        Product::of(n, [moving, n, n]).times(&self.transition, covariance, first);
        let square = Product::of(n, [moving, n, moving]);
        square.times_transposed(first, &self.transition, covariance);
        symmetrise(n, moving, covariance);
        for row in 0..moving {
            for column in moving..n {
                covariance[row * n + column] = first[row * n + column];
                covariance[column * n + row] = first[row * n + column];
            }
        }
        for (value, added) in covariance.iter_mut().zip(&self.added) {
            *value += *added;
        }
    }

    /// Lets the transition over several steps go on by the step that was taken last.
    #[inline(always)]
    pub fn extend(&mut self, transition: &mut Matrix) {
        let (n, moving) = (self.n, self.moving);
        let [product, ..] = &mut self.scratch;
        Product::of(n, [moving, n, n]).times(&self.transition, transition, product);
        transition[..moving * n].copy_from_slice(&product[..moving * n]);
    }

    /// Φ and Qd of a step.
    #[inline(always)]
    fn take(&mut self, step: &CovarianceStep, follow: bool) {
        let (n, moving) = (self.n, self.moving);
        let [omega, squared, cubed, scratch] = &mut self.scratch;
        let powers = Product::of(n, [moving, moving, n]);
        mean_jacobian(powers, step, omega, squared, scratch);
        mean_diffusion(powers, step, &mut self.added, scratch);
        powers.times(omega, omega, squared);
        powers.times(squared, omega, cubed);
        let (doublings, most) = doublings(&squared[..moving * n], &cubed[..moving * n], n, follow);
        let part = Lanes(std::array::from_fn(|lane| power_of_half(doublings[lane])));
        for ((omega, squared), cubed) in omega.iter_mut().zip(&mut *squared).zip(&mut *cubed) {
            *omega *= part;
            *squared = *squared * part * part;
            *cubed = *cubed * part * part * part;
        }
        // exp Ω = I + Ω + Ω²/2 + Ω³·(I/6 + Ω/24 + Ω²/120 + Ω³/720).
        for (index, value) in scratch.iter_mut().enumerate() {
            let of_unit = Lanes::splat(if index % (n + 1) == 0 { 1.0 / 6.0 } else { 0.0 });
            *value = match index < moving * n {
                true => {
                    of_unit
                        + omega[index] * Lanes::splat(1.0 / 24.0)
                        + squared[index] * Lanes::splat(1.0 / 120.0)
                        + cubed[index] * Lanes::splat(1.0 / 720.0)
                }
                false => of_unit,
            };
        }
        Product::of(n, [moving, n, n]).times(cubed, scratch, &mut self.transition);
        for (index, value) in self.transition.iter_mut().enumerate() {
            let of_unit = Lanes::splat(if index % (n + 1) == 0 { 1.0 } else { 0.0 });
            if index < moving * n {
                *value += of_unit + omega[index] + squared[index] * Lanes::splat(0.5);
            } else {
                *value = of_unit;
            }
        }
        self.take_added(step.length * part);
        self.double(&doublings, most);
    }

    /// Qd of a part of a step of this length, from Q: Σ Lʲ(Q·h)/(j + 1)! with L(X) = ΩX + XΩᵀ.
    #[inline(always)]
    fn take_added(&mut self, length: Lanes) {
        let square = Product::of(self.n, [self.moving; 3]);
        let [omega, term, product, _] = &mut self.scratch;
        for (added, term) in self.added.iter_mut().zip(&mut *term) {
            *added *= length;
            *term = *added;
        }
        for order in 1..=6_u32 {
            square.times(omega, term, product);
            term.fill(Lanes::splat(0.0));
            square.add_with_transposed(product, 1.0 / f64::from(order + 1), term);
            for (added, term) in self.added.iter_mut().zip(&*term) {
                *added += *term;
            }
        }
    }

    /// From a part of the step to the whole of it.
    #[inline(always)]
    fn double(&mut self, doublings: &[u32; LANES], most: u32) {
        let (n, moving) = (self.n, self.moving);
        let square = Product::of(n, [moving; 3]);
        let [first, second, ..] = &mut self.scratch;
        let (zero, one) = (Lanes::splat(0.0), Lanes::splat(1.0));
        for doubling in 0..most {
            let is_due = |lane: usize| if doubling < doublings[lane] { 1.0 } else { 0.0 };
            let due = Lanes(std::array::from_fn(is_due));
            square.times(&self.transition, &self.added, first);
            square.times_transposed(first, &self.transition, second);
            for index in (0..moving * moving).map(|place| place / moving * n + place % moving) {
                self.added[index] += due.select_ge(one, second[index], zero);
            }
            Product::of(n, [moving, n, n]).times(&self.transition, &self.transition, first);
            let moving = self.transition[..moving * n].iter_mut();
            for (value, squared) in moving.zip(&*first) {
                *value = due.select_ge(one, *squared, *value);
            }
        }
        symmetrise(n, moving, &mut self.added);
    }
}

/// Ω of a step; `left` and `right` are overwritten.
#[inline(always)]
fn mean_jacobian(
    powers: Product,
    step: &CovarianceStep,
    omega: &mut Matrix,
    left: &mut Matrix,
    right: &mut Matrix,
) {
    let [start, middle, end] = &step.jacobians;
    let sixth = step.length * Lanes::splat(1.0 / 6.0);
    for (index, value) in omega.iter_mut().enumerate() {
        *value = (start[index] + middle[index] * Lanes::splat(4.0) + end[index]) * sixth;
    }
    if start == end {
        return;
    }
    powers.times(start, end, left);
    powers.times(end, start, right);
    let twelfth = step.length * step.length * Lanes::splat(1.0 / 12.0);
    let commutator = left.iter().zip(&*right).take(powers.rows * powers.n);
    for (value, (left, right)) in omega.iter_mut().zip(commutator) {
        *value -= (*left - *right) * twelfth;
    }
}

/// Q of a step; `product` is overwritten.
#[inline(always)]
fn mean_diffusion(powers: Product, step: &CovarianceStep, mean: &mut Matrix, product: &mut Matrix) {
    let [start, middle, end] = &step.diffusions;
    let sixth = Lanes::splat(1.0 / 6.0);
    for (index, value) in mean.iter_mut().enumerate() {
        *value = (start[index] + middle[index] * Lanes::splat(4.0) + end[index]) * sixth;
    }
    let [first, _, last] = &step.jacobians;
    if first == last && start == end {
        return;
    }
    let square = Product::of(powers.n, [powers.rows; 3]);
    let twelfth = step.length * Lanes::splat(1.0 / 12.0);
    for (jacobian, diffusion, sign) in [(first, end, -1.0), (last, start, 1.0)] {
        square.times(jacobian, diffusion, product);
        product.iter_mut().for_each(|value| *value *= twelfth);
        square.add_with_transposed(product, sign, mean);
    }
}

/// How often the parts of a step are doubled, for each candidate, and the most of that: from the rows of the
/// square and of the cube of Ω, of so many columns.
#[inline(always)]
fn doublings(squared: &[Lanes], cubed: &[Lanes], n: usize, follow: bool) -> ([u32; LANES], u32) {
    let (of_square, of_cube) = (norm(n, squared), norm(n, cubed));
    let mut doublings = [0; LANES];
    for (lane, doublings) in doublings.iter_mut().enumerate() {
        let (mut square, mut cube) = (of_square.lane(lane), of_cube.lane(lane));
        let [square_reach, cube_reach] = [SERIES_REACH.powi(2), SERIES_REACH.powi(3)];
        while (square > square_reach || cube > cube_reach) && *doublings < MOST_DOUBLINGS {
            square *= 0.25;
            cube *= 0.125;
            *doublings += 1;
        }
    }
    if follow {
        doublings = [doublings[0]; LANES];
    }
    (doublings, doublings.into_iter().max().unwrap_or(0))
}

/// The largest sum of magnitudes in a row.
#[inline(always)]
fn norm(n: usize, matrix: &[Lanes]) -> Lanes {
    let mut largest = Lanes::splat(0.0);
    for row in matrix.chunks_exact(n) {
        let mut sum = Lanes::splat(0.0);
        for value in row {
            sum += value.abs();
        }
        largest = Real::max(sum, largest);
    }
    largest
}

fn power_of_half(exponent: u32) -> f64 {
    f64::from_bits((1023 - u64::from(exponent)) << 52)
}

/// A product of parts of square matrices: of so many rows of the left one with so many columns of the right
/// one, summed over the first of both.
#[derive(Clone, Copy)]
struct Product {
    /// The size of the matrices.
    n: usize,
    rows: usize,
    inner: usize,
    columns: usize,
}

impl Product {
    #[inline(always)]
    fn of(n: usize, [rows, inner, columns]: [usize; 3]) -> Product {
        Product {
            n,
            rows,
            inner,
            columns,
        }
    }

    /// The rows and columns of the product.
    #[inline(always)]
    fn places(self) -> impl Iterator<Item = (usize, usize)> {
        (0..self.rows).flat_map(move |row| (0..self.columns).map(move |column| (row, column)))
    }

    /// `product = left · right`.
    #[inline(always)]
    fn times(self, left: &Matrix, right: &Matrix, product: &mut Matrix) {
        let n = self.n;
        for (row, column) in self.places() {
            let mut sum = left[row * n] * right[column];
            for inner in 1..self.inner {
                sum += left[row * n + inner] * right[inner * n + column];
            }
            product[row * n + column] = sum;
        }
    }

    /// `product = left · rightᵀ`.
    #[inline(always)]
    fn times_transposed(self, left: &Matrix, right: &Matrix, product: &mut Matrix) {
        let n = self.n;
        for (row, column) in self.places() {
            let mut sum = left[row * n] * right[column * n];
            for inner in 1..self.inner {
                sum += left[row * n + inner] * right[column * n + inner];
            }
            product[row * n + column] = sum;
        }
    }

    /// Adds a share of a matrix and its transpose.
    #[inline(always)]
    fn add_with_transposed(self, matrix: &Matrix, share: f64, sum: &mut Matrix) {
        let n = self.n;
        for (row, column) in self.places() {
            let value = matrix[row * n + column] + matrix[column * n + row];
            sum[row * n + column] += value * Lanes::splat(share);
        }
    }
}

/// The mean of the first rows and columns of a matrix and their transpose.
#[inline(always)]
fn symmetrise(n: usize, rows: usize, matrix: &mut Matrix) {
    let half = Lanes::splat(0.5);
    for row in 0..rows {
        for column in row + 1..rows {
            let mean = (matrix[row * n + column] + matrix[column * n + row]) * half;
            matrix[row * n + column] = mean;
            matrix[column * n + row] = mean;
        }
    }
}
