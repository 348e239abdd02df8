//! Unknowns and assumptions together, linearised: what the assumptions do to the estimate.
//!
//! With S the derivatives of the residuals by the unknowns (those of priors among them), P those
//! by the assumptions, each per standard deviation of its tolerance, both in units of the noise:
//! the estimate holds the assumptions at what is given, so an assumption that is off by x moves
//! it by `K·x`, `K = −(SᵀS)⁻¹SᵀP` (S. F. Schmidt, 1966). What the residuals r say of the
//! assumptions beside the unknowns is `M = PᵀQP` and `g = −PᵀQr`, Q the projection beside S. With
//! the tolerances as priors the assumptions have the covariance `V = (I + M)⁻¹` about `V·g`, so
//! that the error of the estimate has the mean square
//!
//! `T = C + K·V·Kᵀ + (K·V·g)²`, C the covariance of noise alone.
//!
//! Where the estimate was made with values of the assumptions that lie d off the declared ones, the
//! tolerances pull back: `V·(g − d)` stands in the place of `V·g`, which is zero where data and
//! tolerances balance (`super::nuisances`).
//!
//! Where the residuals contradict an assumption the linear model is not to be relied on so far away.
//! Where the estimate was made with other values of the assumptions, its distance from the estimate with
//! all declared values is what the contradiction does to the unknowns, refitted and not extrapolated: the
//! square of that distance is added to the mean square. Where the estimate holds the declared values, the
//! error has at least the mean square `C + K·Kᵀ`.
//!
//! Where the data say nothing of an assumption this is the propagation of uncertainty of JCGM 100,
//! `C + K·Kᵀ`; where they say all, it is that of an estimate with all of them free. All of it is
//! read off the triangle of `[S | P | r]`.

use super::covariance::effective;
use greybox_numerics::least_squares::Triangle;
use nalgebra::{DMatrix, DVector};

/// An assumption of which less than this share of its effect stands beside those of the unknowns
/// is not seen apart from them.
const APART: f64 = 1e-6;

/// A score beyond this is no chance, among some twenty of them.
pub const LARGEST_SCORE: f64 = 4.0;

/// Standard deviations of what was declared of a number beyond which the data contradict it.
pub const LARGEST_SHIFT: f64 = 3.0;

/// The unknowns and the assumptions.
#[derive(Clone, Debug)]
pub struct Joint {
    /// For each unknown its row in K; none for one without effect.
    rows: Vec<Option<usize>>,
    /// K: how far each unknown moves by a standard deviation of each assumption; none where the
    /// data do not fix the unknowns.
    sensitivity: Option<DMatrix<f64>>,
    /// The upper triangle of M.
    apart: DMatrix<f64>,
    gradient: DVector<f64>,
    /// d: for each assumption how far off the declared value the estimate takes it.
    off: DVector<f64>,
    /// For each unknown how far the estimate lies from the one with all declared values, positions; none
    /// where the estimate is that one.
    moved: Option<Vec<f64>>,
    /// For each assumption whether the data see it apart from the unknowns.
    seen: Vec<bool>,
    /// V.
    posterior: DMatrix<f64>,
    /// V·(g − d): where the data and the tolerances put the assumptions, from the values that are
    /// taken.
    middle: DVector<f64>,
}

/// A step of the assumptions to where the data and the tolerances put them.
#[derive(Clone, Debug)]
pub struct JointStep {
    /// How far each assumption moves, in standard deviations of its tolerance.
    pub assumptions: Vec<f64>,
    /// How far each unknown moves along, as a position.
    pub unknowns: Vec<f64>,
    /// Twice the logarithm of how much likelier the step makes the data and the declared values.
    pub gain: f64,
    /// The gain that noise alone makes on average, where the values that are taken are right.
    pub expected_gain: f64,
}

/// What the data say of one assumption, in standard deviations of its tolerance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// How many standard deviations of noise the residuals pull at the declared value; standard
    /// normal where that is right.
    pub t: f64,
    /// The value to which the data pull the unknown, from the declared value, with its standard deviation.
    pub suggested: (f64, f64),
}

impl Joint {
    /// From the triangle of `[S | P | r]` with a column of P for each entry of `off`, and the same of
    /// white rows; `off` is how far off its declared value each assumption is taken. None where the numbers cannot be used.
    #[must_use]
    pub fn new(plain: &Triangle, white: &Triangle, off: &[f64]) -> Option<Joint> {
        if !plain.is_usable() || !white.is_usable() {
            return None;
        }
        let columns = plain.factor().ncols();
        let unknowns = columns - off.len();
        let fixed = effective(&plain.factor().columns(0, unknowns).into_owned());
        let rows = (0..unknowns).map(|unknown| fixed.iter().position(|index| *index == unknown));
        let rows: Vec<Option<usize>> = rows.collect();
        let kept: Vec<usize> = fixed.iter().copied().chain(unknowns..columns).collect();
        let (plain, white) = (plain.of_columns(&kept), white.of_columns(&kept));
        let (factor, whitened) = (plain.factor(), white.factor());
        let (unknowns, assumed) = (fixed.len(), columns - unknowns);
        let corner = |factor: &DMatrix<f64>| {
            let apart = factor.view((unknowns, unknowns), (assumed, assumed));
            apart.into_owned()
        };
        let (mut apart, mut rest) = (corner(&whitened), white.projected());
        rest = rest.rows(unknowns, assumed).into_owned();
        let seen: Vec<bool> = (0..assumed)
            .map(|index| {
                let whole = whitened.column(unknowns + index).norm();
                apart.column(index).norm() > APART * whole
            })
            .collect();
        for (index, _) in seen.iter().enumerate().filter(|(_, seen)| !**seen) {
            apart.column_mut(index).fill(0.0);
        }
        let gradient = -(apart.transpose() * &rest);
        let off = DVector::from_column_slice(off);
        let pull = &gradient - &off;
        let (posterior, middle) = posterior(&apart, &pull, &vec![1.0; assumed])?;
        let above = factor.view((0, 0), (unknowns, unknowns)).into_owned();
        let beside = factor.view((0, unknowns), (unknowns, assumed));
        Some(Joint {
            rows,
            sensitivity: above
                .solve_upper_triangular(&beside.into_owned())
                .map(|moved| -moved)
                .filter(|moved| moved.iter().all(|entry| entry.is_finite())),
            apart,
            gradient,
            off,
            moved: None,
            seen,
            posterior,
            middle,
        })
    }

    /// Notes how far, in positions, the estimate lies from the one with all declared values.
    #[must_use]
    pub fn moved(self, moved: Option<Vec<f64>>) -> Joint {
        Joint { moved, ..self }
    }

    /// Replaces the residuals by noise alone, so that every assumption is expected where it was declared.
    #[must_use]
    pub fn of_noise_alone(mut self) -> Joint {
        for pull in [&mut self.gradient, &mut self.off, &mut self.middle] {
            pull.fill(0.0);
        }
        self
    }

    /// How far an unknown moves by a standard deviation of an assumption.
    #[must_use]
    pub fn move_by(&self, unknown: usize, assumption: usize) -> Option<f64> {
        Some(self.moves(unknown)?[assumption])
    }

    /// What the residuals say of an assumption with all others as given; none where they cannot
    /// see it apart from the unknowns.
    #[must_use]
    pub fn score(&self, assumption: usize) -> Option<Score> {
        let root = self.apart.column(assumption).norm();
        self.seen[assumption].then(|| Score {
            t: self.gradient[assumption] / root + self.off[assumption] * root,
            suggested: (
                self.gradient[assumption] / (root * root) + self.off[assumption],
                1.0 / root,
            ),
        })
    }

    /// Where the data and the tolerances together put an assumption, in standard deviations of its
    /// tolerance from its declared value, with the standard deviation that they leave of it.
    #[must_use]
    pub fn posterior(&self, assumption: usize) -> (f64, f64) {
        (
            self.off[assumption] + self.middle[assumption],
            self.posterior[(assumption, assumption)].sqrt(),
        )
    }

    /// The covariance that the data and the tolerances leave of the assumptions, in standard
    /// deviations of their tolerances.
    #[must_use]
    pub fn posterior_covariance(&self) -> &DMatrix<f64> {
        &self.posterior
    }

    /// Whether the residuals contradict the declared value of an assumption: they pull beyond chance
    /// at the value that is taken, or at the declared one, which lies beyond the tolerances of all
    /// assumptions. Under right tolerances where the data put an assumption has the variance `1 − V`.
    #[must_use]
    pub fn contradicts(&self, assumption: usize) -> bool {
        let Some(score) = self.score(assumption) else {
            return false;
        };
        let left = self.gradient[assumption] / self.apart.column(assumption).norm();
        let (shift, deviation) = self.posterior(assumption);
        let expected = (1.0 - deviation * deviation).max(f64::EPSILON).sqrt();
        left.abs() > LARGEST_SCORE
            || score.t.abs() > LARGEST_SCORE && shift.abs() > LARGEST_SHIFT * expected
    }

    /// The step of the assumptions that are not held to where the data and the tolerances put them.
    #[must_use]
    pub fn step(&self, is_held: &[bool]) -> Option<JointStep> {
        let free: Vec<usize> = (0..is_held.len())
            .filter(|index| !is_held[*index])
            .collect();
        if free.is_empty() {
            return None;
        }
        let pull = (&self.gradient - &self.off).select_rows(&free);
        let apart = self.apart.select_columns(&free);
        let (covariance, moved) = posterior(&apart, &pull, &vec![1.0; free.len()])?;
        let mut assumptions = DVector::zeros(is_held.len());
        for (place, index) in free.iter().enumerate() {
            assumptions[*index] = moved[place];
        }
        let along = |unknown: usize| self.moves(unknown).map_or(0.0, |by| by.dot(&assumptions));
        Some(JointStep {
            unknowns: (0..self.rows.len()).map(along).collect(),
            gain: pull.dot(&moved),
            expected_gain: free.len() as f64 - covariance.trace(),
            assumptions: assumptions.iter().copied().collect(),
        })
    }

    /// What the residuals would not show of an assumption: so many standard deviations of noise.
    #[must_use]
    pub fn unnoticed(&self, assumption: usize, deviations: f64) -> Option<f64> {
        let root = self.apart.column(assumption).norm();
        self.seen[assumption].then(|| deviations / root)
    }

    /// The mean square of an unknown's error, with the variance that noise alone gives it.
    #[must_use]
    pub fn total(&self, unknown: usize, noise: f64) -> Option<f64> {
        Some(noise + self.added(unknown)?.sum())
    }

    /// What each assumption adds to the mean square of an unknown's error: below zero where it makes up for others.
    /// Where the residuals would have the assumptions elsewhere than they were taken, that counts too.
    fn added(&self, unknown: usize) -> Option<DVector<f64>> {
        let moves = self.moves(unknown)?;
        if self.holds_contradicted(&moves) {
            return Some(moves.component_mul(&moves));
        }
        let told = self.told(&moves);
        let Some(moved) = self.moved.as_ref().filter(|_| self.is_contradicted()) else {
            return Some(told);
        };
        // Each assumption has the part of the distance that it makes in the linear model.
        let parts = moves.component_mul(&self.off).abs();
        let whole = parts.sum().max(f64::MIN_POSITIVE);
        Some(told + parts * (moved[unknown].powi(2) / whole))
    }

    /// What each assumption adds to the mean square of an error by what data and tolerances leave of it, and by where
    /// they put it.
    fn told(&self, moves: &DVector<f64>) -> DVector<f64> {
        let spread = &self.posterior * moves;
        let shift = moves.dot(&self.middle);
        moves.component_mul(&(spread + &self.middle * shift))
    }

    /// Whether the estimate holds declared values that the residuals contradict, and whole tolerances make its error
    /// larger than data and tolerances together.
    fn holds_contradicted(&self, moves: &DVector<f64>) -> bool {
        self.moved.is_none()
            && self.is_contradicted()
            && moves.norm_squared() > self.told(moves).sum()
    }

    /// What an assumption contributes to an unknown: the root mean square of its own error, and what it adds to the
    /// mean square of all.
    #[must_use]
    pub fn contribution(&self, unknown: usize, assumption: usize) -> Option<(f64, f64)> {
        let mean_square =
            self.posterior[(assumption, assumption)] + self.middle[assumption].powi(2);
        let deviation = self.moves(unknown)?[assumption].abs() * mean_square.sqrt();
        Some((deviation, self.added(unknown)?[assumption]))
    }

    /// What the mean square of an unknown's error would be, were the tolerance of an assumption `factor` times as
    /// large, with its present residuals: what else they say of the assumptions stays as it is.
    #[must_use]
    pub fn total_with(
        &self,
        unknown: usize,
        noise: f64,
        assumption: usize,
        factor: f64,
    ) -> Option<f64> {
        let total = self.total(unknown, noise)?;
        let moves = self.moves(unknown)?;
        if self.holds_contradicted(&moves) {
            return Some(total - (1.0 - factor * factor) * moves[assumption].powi(2));
        }
        let now = self.total_if(unknown, noise, assumption, 1.0)?;
        let then = self.total_if(unknown, noise, assumption, factor)?;
        Some((total - (now - then)).max(then))
    }

    /// What the mean square of an unknown's error would be, were the tolerance of an assumption
    /// `factor` times as large, by the linear model and without its present residuals.
    #[must_use]
    pub fn total_if(
        &self,
        unknown: usize,
        noise: f64,
        assumption: usize,
        factor: f64,
    ) -> Option<f64> {
        let moves = self.moves(unknown)?;
        let mut deviations = vec![1.0; moves.len()];
        deviations[assumption] = factor;
        let (changed, _) = posterior(&self.apart, &self.gradient, &deviations)?;
        Some(noise + moves.dot(&(changed * &moves)))
    }

    /// The covariance that noise alone gives the unknowns by way of the assumptions, where these are
    /// fitted: `K·V·M·V·Kᵀ`, in which `V·M·V = V − V²`. None where the data do not fix the unknowns.
    #[must_use]
    pub fn noise_by_assumptions(&self) -> Option<DMatrix<f64>> {
        let n = self.rows.len();
        let sensitivity = self.sensitivity.as_ref()?;
        let by_noise = &self.posterior - &self.posterior * &self.posterior;
        let among = sensitivity * by_noise * sensitivity.transpose();
        Some(DMatrix::from_fn(n, n, |a, b| {
            match (self.rows[a], self.rows[b]) {
                (Some(a), Some(b)) => among[(a, b)],
                _ => 0.0,
            }
        }))
    }

    /// Whether the residuals contradict an assumption.
    fn is_contradicted(&self) -> bool {
        (0..self.seen.len()).any(|place| self.contradicts(place))
    }

    fn moves(&self, unknown: usize) -> Option<DVector<f64>> {
        let row = self.rows[unknown]?;
        Some(self.sensitivity.as_ref()?.row(row).transpose())
    }
}

/// V and V·g where the tolerances are multiplied by these: by the triangle of `[R; D⁻¹]`, R that
/// of M, so that nothing is squared.
fn posterior(
    apart: &DMatrix<f64>,
    gradient: &DVector<f64>,
    deviations: &[f64],
) -> Option<(DMatrix<f64>, DVector<f64>)> {
    let (rows, n) = (apart.nrows(), deviations.len());
    let mut stacked = DMatrix::zeros(rows + n, n);
    stacked.rows_mut(0, rows).copy_from(apart);
    for (index, deviation) in deviations.iter().enumerate() {
        stacked[(rows + index, index)] = 1.0 / deviation;
    }
    let triangle = stacked.qr().unpack_r();
    let inverse = triangle.solve_upper_triangular(&DMatrix::identity(n, n))?;
    let covariance = &inverse * inverse.transpose();
    let middle = &covariance * gradient;
    let sound = covariance
        .iter()
        .chain(middle.iter())
        .all(|entry| entry.is_finite());
    sound.then_some((covariance, middle))
}

#[cfg(test)]
mod tests;
