//! Linear least squares within linear inequalities.
//!
//! The problem becomes that of the point nearest to the origin in a polyhedron, and that one of
//! non-negative least squares (C. L. Lawson, R. J. Hanson, *Solving Least Squares Problems*, 1974,
//! ch. 23).

use nalgebra::{DMatrix, DVector};

/// That `row · x` is at least `least`.
#[derive(Clone, Debug, PartialEq)]
pub struct Inequality {
    /// A factor for each unknown.
    pub row: Vec<f64>,
    /// The least value of the product.
    pub least: f64,
}

/// What counts as 0 beside 1.
const ROUNDING: f64 = 1e-13;
/// Changes of the active inequalities at the most, for each of them.
const MOST_CHANGES: usize = 10;

/// The x with the least `|R·x − right|²`, R upper triangular, that meets all inequalities; none
/// where R is singular or no x meets them.
#[must_use]
pub fn least_squares(
    factor: &DMatrix<f64>,
    right: &DVector<f64>,
    inequalities: &[Inequality],
) -> Option<DVector<f64>> {
    let free = factor.solve_upper_triangular(right)?;
    let transposed = factor.transpose();
    let mut rows: Vec<(DVector<f64>, f64)> = Vec::new();
    for Inequality { row, least } in inequalities {
        // In y = R·x − right, row·x ≥ least is (row·R⁻¹)·y ≥ least − row·x_free.
        let row = DVector::from_column_slice(row);
        let missing = least - row.dot(&free);
        let row = transposed.solve_lower_triangular(&row)?;
        let length = row.norm();
        if length > 0.0 {
            rows.push((row / length, missing / length));
        } else if missing > 0.0 {
            return None;
        }
    }
    let farthest = rows.iter().map(|(_, missing)| *missing).fold(0.0, f64::max);
    if farthest == 0.0 {
        return Some(free);
    }
    let rows: Vec<(DVector<f64>, f64)> = rows
        .into_iter()
        .map(|(row, missing)| (row, missing / farthest))
        .collect();
    let shift = nearest_to_origin(&rows)? * farthest;
    let solution = factor.solve_upper_triangular(&(right + shift))?;
    solution
        .iter()
        .all(|value| value.is_finite())
        .then_some(solution)
}

/// The shortest x, with `n` entries, that meets all inequalities; none where there is none.
#[must_use]
pub fn shortest(n: usize, inequalities: &[Inequality]) -> Option<Vec<f64>> {
    let point = least_squares(&DMatrix::identity(n, n), &DVector::zeros(n), inequalities)?;
    Some(point.iter().copied().collect())
}

/// The shortest y with `row · y ≥ least` for all.
fn nearest_to_origin(rows: &[(DVector<f64>, f64)]) -> Option<DVector<f64>> {
    let n = rows.first()?.0.len();
    let stacked = DMatrix::from_fn(n + 1, rows.len(), |entry, column| {
        let (row, least) = &rows[column];
        if entry < n { row[entry] } else { *least }
    });
    let mut target = DVector::zeros(n + 1);
    target[n] = 1.0;
    let weights = non_negative(&stacked, &target)?;
    let rest = stacked * weights - target;
    // Where the target is met nothing meets the inequalities.
    (rest[n] < -ROUNDING).then(|| rest.rows(0, n) / -rest[n])
}

/// The w ≥ 0 with the least `|A·w − target|²`.
fn non_negative(matrix: &DMatrix<f64>, target: &DVector<f64>) -> Option<DVector<f64>> {
    let n = matrix.ncols();
    let mut weights = DVector::zeros(n);
    let mut active: Vec<usize> = Vec::new();
    for _ in 0..MOST_CHANGES * n {
        let gain = matrix.transpose() * (target - matrix * &weights);
        let next = (0..n)
            .filter(|index| !active.contains(index) && gain[*index] > ROUNDING)
            .max_by(|a, b| gain[*a].total_cmp(&gain[*b]));
        let Some(next) = next else {
            return Some(weights);
        };
        active.push(next);
        loop {
            let solution = of_columns(matrix, &active, target)?;
            let pairs = active.iter().zip(solution.iter());
            let blocked = pairs.filter(|(_, value)| **value <= 0.0);
            // How far to go towards the solution before a weight is 0.
            let share = blocked
                .map(|(index, value)| weights[*index] / (weights[*index] - value))
                .fold(f64::INFINITY, f64::min);
            let is_free = share.is_infinite();
            let share = share.min(1.0);
            for (index, value) in active.iter().zip(solution.iter()) {
                weights[*index] += share * (value - weights[*index]);
            }
            if is_free {
                break;
            }
            let is_zero = |index: &usize| weights[*index] <= ROUNDING;
            let gone: Vec<usize> = active.iter().copied().filter(is_zero).collect();
            if gone.is_empty() {
                break;
            }
            gone.iter().for_each(|index| weights[*index] = 0.0);
            active.retain(|index| !gone.contains(index));
            if gone.contains(&next) {
                // Nothing is gained along it but rounding.
                return Some(weights);
            }
        }
    }
    Some(weights)
}

/// The least squares of some columns alone.
fn of_columns(
    matrix: &DMatrix<f64>,
    columns: &[usize],
    target: &DVector<f64>,
) -> Option<DVector<f64>> {
    let chosen: Vec<_> = columns.iter().map(|index| matrix.column(*index)).collect();
    let chosen = DMatrix::from_columns(&chosen);
    let (rows, n) = chosen.shape();
    if n > rows {
        return None;
    }
    let qr = chosen.qr();
    let projected = qr.q().transpose() * target;
    qr.r().solve_upper_triangular(&projected)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at_least(row: &[f64], least: f64) -> Inequality {
        let row = row.to_vec();
        Inequality { row, least }
    }

    #[test]
    fn the_nearest_point_of_a_half_plane_and_of_a_corner() {
        let factor = DMatrix::identity(2, 2);
        let right = DVector::from_column_slice(&[0.0, 0.0]);
        let line = [at_least(&[1.0, 1.0], 2.0)];
        let found = least_squares(&factor, &right, &line).unwrap();
        assert!((found - DVector::from_column_slice(&[1.0, 1.0])).norm() < 1e-14);
        let corner = [at_least(&[1.0, 0.0], 3.0), at_least(&[0.0, 2.0], 1.0)];
        let found = least_squares(&factor, &right, &corner).unwrap();
        assert!((found - DVector::from_column_slice(&[3.0, 0.5])).norm() < 1e-14);
    }

    #[test]
    fn inequalities_that_hold_change_nothing_and_contradictory_ones_have_no_answer() {
        let factor = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 0.0, 3.0]);
        let right = DVector::from_column_slice(&[1.0, 6.0]);
        let free = factor.solve_upper_triangular(&right).unwrap();
        let holds = [at_least(&[1.0, 1.0], -10.0)];
        assert_eq!(least_squares(&factor, &right, &holds), Some(free));
        let contradictory = [at_least(&[1.0, 0.0], 1.0), at_least(&[-1.0, 0.0], 0.0)];
        assert_eq!(least_squares(&factor, &right, &contradictory), None);
    }

    proptest! {
        /// No other point that meets the inequalities is nearer: what is asked of an optimum.
        #[test]
        fn no_allowed_direction_leads_lower(
            entries in prop::collection::vec(-2.0..2.0f64, 9),
            right in prop::collection::vec(-3.0..3.0f64, 3),
            rows in prop::collection::vec(prop::collection::vec(-1.0..1.0f64, 3), 1..6),
            others in prop::collection::vec(prop::collection::vec(-2.0..2.0f64, 3), 200),
        ) {
            let mut factor = DMatrix::from_row_slice(3, 3, &entries).upper_triangle();
            for index in 0..3 {
                factor[(index, index)] = 0.5 + factor[(index, index)].abs();
            }
            let right = DVector::from_column_slice(&right);
            // All of them hold at (0.1, −0.2, 0.3), some of them just so.
            let known = [0.1, -0.2, 0.3];
            let inequalities: Vec<Inequality> = rows
                .iter()
                .enumerate()
                .map(|(place, row)| {
                    let at: f64 = row.iter().zip(known).map(|(a, b)| a * b).sum();
                    at_least(row, at - 0.2 * (place % 3) as f64)
                })
                .collect();
            let found = least_squares(&factor, &right, &inequalities).unwrap();
            let missing = |x: &DVector<f64>| {
                let each = inequalities.iter().map(|own| {
                    own.least - own.row.iter().zip(x.iter()).map(|(a, b)| a * b).sum::<f64>()
                });
                each.fold(f64::NEG_INFINITY, f64::max)
            };
            prop_assert!(missing(&found) < 1e-9);
            let cost = |x: &DVector<f64>| (&factor * x - &right).norm_squared();
            for step in others {
                let other = &found + 0.3 * DVector::from_column_slice(&step);
                if missing(&other) <= 0.0 {
                    prop_assert!(cost(&other) >= cost(&found) - 1e-9);
                }
            }
        }
    }
}
