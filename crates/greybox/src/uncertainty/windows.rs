//! Whether the parts of a record agree about the unknowns.
//!
//! The record is cut into windows of equally many rows. With I_w the information and s_w the score of
//! window w at the estimate, whose scores sum up to nothing, `Σ s_wᵀ·I_w⁻¹·s_w` has the distribution of
//! χ² where the windows have one truth. What a window alone would make of an unknown differs from the
//! estimate by d_w, whose variance is that of the window less that of the whole record (J. A. Hausman,
//! *Econometrica* 46, 1978). Both hold where residuals are independent, as innovations are.

use crate::estimation::problem::{Problem, Target};
use crate::estimation::sensitivity::Neighbourhood;
use greybox_simulation::SimulationFailure;
use nalgebra::{Cholesky, DMatrix, DVector};

/// The windows of a record.
const WINDOWS: usize = 4;
/// A window that has less than this share of the information along a direction says nothing of it.
const LEAST_SHARE: f64 = 0.01;
/// A window fixes an unknown where the directions that the window sees make this share of the unknown's variance.
const LEAST_SEEN: f64 = 0.9;
/// A window that fixes an unknown nearly as well as the whole record cannot differ from it.
const LEAST_EXCESS: f64 = 0.05;

/// Standard deviations by which windows differ by chance one time in a thousand.
const CHANCE: f64 = 3.09;
/// The spread of the windows of an unknown, in units of what noise allows, from which they disagree about it.
const LARGE_SPREAD: f64 = 2.0;

/// How the windows of a record agree.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowAgreement {
    /// Standard deviations by which the windows together differ from one truth.
    pub score: f64,
    /// For each coordinate the root mean square of the windows' differences, in units of what noise
    /// allows: 1 where they agree; none for a start, which one window alone sees, for a number of the noise, and
    /// where the windows alone do not fix it.
    pub spreads: Vec<Option<f64>>,
    /// For each coordinate the standard deviation of its truth from window to window, as a position: what is
    /// left of the windows' differences without the noise (R. DerSimonian and N. Laird, *Controlled Clinical
    /// Trials* 7, 1986); none where `spreads` has none.
    pub scatters: Vec<Option<f64>>,
}

impl WindowAgreement {
    /// Whether the windows together differ by more than chance makes them.
    #[must_use]
    pub fn is_disagreement(&self) -> bool {
        self.score > CHANCE
    }

    /// Whether the windows disagree about a coordinate.
    #[must_use]
    pub fn disagree_about(&self, coordinate: usize) -> bool {
        let is_large = |spread: &Option<f64>| spread.is_some_and(|spread| spread > LARGE_SPREAD);
        self.is_disagreement() || self.spreads.get(coordinate).is_some_and(is_large)
    }
}

/// What one window says.
struct Window {
    information: DMatrix<f64>,
    score: DVector<f64>,
}

/// How the windows of the record that is estimated from agree; none where the whole record does not fix
/// the coordinates.
///
/// # Errors
/// How the estimate or a neighbour along an unknown failed.
pub fn of(
    problem: &Problem,
    neighbourhood: &Neighbourhood<'_>,
) -> Result<Option<WindowAgreement>, SimulationFailure> {
    let unknowns = problem.coordinates.len();
    // Noises may differ from window to window: the plant's constants are what windows have in common.
    let n_parameters = problem.model.description().parameters.len();
    let is_common = |index: &usize| match problem.coordinates[*index].target {
        Target::Parameter(parameter) => parameter < n_parameters,
        Target::ExperimentParameter { .. } => true,
        Target::InitialState { .. } => false,
    };
    let compared: Vec<usize> = (0..unknowns).filter(is_common).collect();
    let n = compared.len();
    let empty = || Window {
        information: DMatrix::zeros(n, n),
        score: DVector::zeros(n),
    };
    let mut windows: Vec<Window> = (0..WINDOWS).map(|_| empty()).collect();
    let (mut seen, total) = (0, problem.n_rows().max(1));
    neighbourhood.visit_along(unknowns, |row| {
        let window = &mut windows[(seen * WINDOWS / total).min(WINDOWS - 1)];
        let derivatives = compared.iter().map(|index| row.derivatives[*index]);
        let derivatives = DVector::from_iterator(n, derivatives);
        window.information.ger(1.0, &derivatives, &derivatives, 1.0);
        window.score.axpy(row.residual, &derivatives, 1.0);
        seen += 1;
    })?;
    let of_all = |of_compared: Vec<Option<f64>>| {
        let mut of_all = vec![None; unknowns];
        for (index, value) in compared.iter().zip(of_compared) {
            of_all[*index] = value;
        }
        of_all
    };
    Ok(agreement(&windows).map(|agreement| WindowAgreement {
        score: agreement.score,
        spreads: of_all(agreement.spreads),
        scatters: of_all(agreement.scatters),
    }))
}

fn agreement(windows: &[Window]) -> Option<WindowAgreement> {
    let n = windows.first()?.score.len();
    let all = windows.iter().fold(DMatrix::zeros(n, n), |sum, window| {
        sum + &window.information
    });
    let whole = Cholesky::new(all)?;
    let whitened = whole.l().solve_lower_triangular(&DMatrix::identity(n, n))?;
    let of_whole = whole.inverse();
    let (mut statistic, mut freedom) = (0.0, -(n as f64));
    let mut squares = vec![0.0; n];
    let mut excesses = vec![0.0; n];
    let mut counts = vec![0_usize; n];
    for window in windows {
        let share = &whitened * &window.information * whitened.transpose();
        let score = &whitened * &window.score;
        let eigen = share.symmetric_eigen();
        let mut inverse = DMatrix::zeros(n, n);
        let mut seen = DMatrix::zeros(n, n);
        let mut rank = 0;
        let pairs = eigen
            .eigenvalues
            .iter()
            .zip(eigen.eigenvectors.column_iter());
        for (value, vector) in pairs.filter(|(value, _)| **value > LEAST_SHARE) {
            statistic += vector.dot(&score).powi(2) / value;
            let direction = vector * vector.transpose();
            inverse += &direction / *value;
            seen += direction;
            rank += 1;
        }
        freedom += f64::from(rank);
        let seen = whitened.transpose() * &seen * &whitened;
        let covariance = whitened.transpose() * &inverse * &whitened;
        let moved = whitened.transpose() * (&inverse * &score);
        for index in 0..n {
            let (variance, of_whole_record) =
                (covariance[(index, index)], of_whole[(index, index)]);
            let is_fixed = seen[(index, index)] > LEAST_SEEN * of_whole_record;
            if is_fixed && variance > (1.0 + LEAST_EXCESS) * of_whole_record {
                let square = moved[index].powi(2);
                squares[index] += square / (variance - of_whole_record);
                excesses[index] += square - (variance - of_whole_record);
                counts[index] += 1;
            }
        }
    }
    let mean = |sums: &[f64], index: usize| {
        let count = counts[index];
        (count > 1).then(|| (sums[index].max(0.0) / count as f64).sqrt())
    };
    Some(WindowAgreement {
        score: normal_score(statistic, freedom),
        spreads: (0..n).map(|index| mean(&squares, index)).collect(),
        scatters: (0..n).map(|index| mean(&excesses, index)).collect(),
    })
}

/// The standard normal deviate that is as unlikely as a value of χ² (E. B. Wilson and M. M. Hilferty,
/// *Proceedings of the National Academy of Sciences* 17, 1931).
fn normal_score(statistic: f64, freedom: f64) -> f64 {
    if freedom < 1.0 {
        return 0.0;
    }
    let spread = 2.0 / (9.0 * freedom);
    (libm::cbrt(statistic / freedom) - (1.0 - spread)) / spread.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::rng::{Purpose, normal, stream};

    /// A level and a slope fitted to noise of unit size, to which a step is added in the last quarter.
    fn fitted(seed: u64, step: f64) -> WindowAgreement {
        const SAMPLES: usize = 400;
        let mut rng = stream(seed, 0, Purpose::Noise);
        let columns = DMatrix::from_fn(SAMPLES, 2, |row, column| match column {
            0 => 1.0,
            _ => row as f64 / SAMPLES as f64,
        });
        let data = DVector::from_fn(SAMPLES, |row, _| {
            let added = if 4 * row >= 3 * SAMPLES { step } else { 0.0 };
            normal(&mut rng) + added
        });
        let inverse = (columns.transpose() * &columns).try_inverse().unwrap();
        let residuals = &data - &columns * (inverse * columns.transpose() * &data);
        let window = |place: usize| {
            let rows = SAMPLES / WINDOWS;
            let part = columns.rows(place * rows, rows);
            Window {
                information: part.transpose() * part,
                score: part.transpose() * residuals.rows(place * rows, rows),
            }
        };
        let windows: Vec<Window> = (0..WINDOWS).map(window).collect();
        agreement(&windows).unwrap()
    }

    #[test]
    fn windows_of_one_truth_agree_as_often_as_chance_has_it() {
        let seeds = 2000;
        let agreements: Vec<_> = (0..seeds).map(|seed| fitted(seed, 0.0)).collect();
        let beyond = agreements.iter().filter(|own| own.score > 2.326).count();
        // One in a hundred, within five standard deviations.
        assert!((2..=42).contains(&beyond), "{beyond} of {seeds}");
        for index in 0..2 {
            let squares = agreements
                .iter()
                .map(|own| own.spreads[index].unwrap().powi(2));
            let mean = squares.sum::<f64>() / seeds as f64;
            assert!((mean - 1.0).abs() < 0.1, "{mean}");
        }
    }

    #[test]
    fn a_level_that_jumps_in_one_window_is_told() {
        let told = (0..100)
            .filter(|seed| fitted(*seed, 1.5).score > 3.09)
            .count();
        assert!(told > 95, "{told} of 100");
    }
}
