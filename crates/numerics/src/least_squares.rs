//! Linear least squares by orthogonal triangles, fed a block of rows at a time.
//!
//! [`Triangle`] keeps the upper triangle R of `[J | r]` under Householder reflections, so that
//! neither the condition of J is squared (as normal equations would) nor the memory grows with
//! the number of rows (G. H. Golub, C. F. Van Loan, *Matrix Computations*, 2013, ch. 5 and 6.3).

use super::inequalities::{self, Inequality};
use super::singular_values::has_finite_squares;
use nalgebra::{DMatrix, DVector};

/// A column whose norm is smaller has no effect: its square is zero, or has lost its digits.
const NO_EFFECT: f64 = 1e-140;

/// R of the rows seen so far; the last column belongs to the right-hand side.
#[derive(Clone, Debug)]
pub struct Triangle {
    columns: usize,
    matrix: DMatrix<f64>,
    rows: usize,
}

impl Triangle {
    /// No rows yet, for `columns` unknowns.
    #[must_use]
    pub fn new(columns: usize) -> Triangle {
        Triangle {
            columns,
            matrix: DMatrix::zeros(0, columns + 1),
            rows: 0,
        }
    }

    /// Whether the triangle can be used: no entry of a row was so large that its square is not
    /// finite.
    #[must_use]
    pub fn is_usable(&self) -> bool {
        has_finite_squares(&self.matrix)
    }

    /// How many rows have been seen.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Adds rows: `block` holds the unknowns' columns and, last, the right-hand side.
    pub fn push(&mut self, block: &DMatrix<f64>) {
        self.rows += block.nrows();
        let kept = self.matrix.nrows();
        let mut stacked = DMatrix::zeros(kept + block.nrows(), self.columns + 1);
        stacked.rows_mut(0, kept).copy_from(&self.matrix);
        stacked.rows_mut(kept, block.nrows()).copy_from(block);
        self.matrix = stacked.qr().unpack_r();
    }

    /// The upper triangle of the unknowns, square.
    #[must_use]
    pub fn factor(&self) -> DMatrix<f64> {
        self.padded()
            .view((0, 0), (self.columns, self.columns))
            .into_owned()
    }

    /// The triangle of some of the unknowns alone, in the order in which they are named.
    #[must_use]
    pub fn of_columns(&self, columns: &[usize]) -> Triangle {
        let padded = self.padded();
        let right = std::iter::once(&self.columns);
        let chosen: Vec<_> = columns
            .iter()
            .chain(right)
            .map(|column| padded.column(*column))
            .collect();
        let mut triangle = Triangle::new(columns.len());
        triangle.push(&DMatrix::from_columns(&chosen));
        triangle.rows = self.rows;
        triangle
    }

    /// Qᵀ times the right-hand side, as long as there are unknowns.
    #[must_use]
    pub fn projected(&self) -> DVector<f64> {
        self.padded()
            .view((0, self.columns), (self.columns, 1))
            .column(0)
            .into_owned()
    }

    /// The gradient Jᵀr.
    #[must_use]
    pub fn gradient(&self) -> DVector<f64> {
        let factor = self.factor();
        let projected = self.projected();
        DVector::from_fn(self.columns, |column, _| {
            (0..=column)
                .map(|row| factor[(row, column)] * projected[row])
                .sum()
        })
    }

    /// The sum of squares of the right-hand side that no solution can remove.
    #[must_use]
    pub fn residual_sum_of_squares(&self) -> f64 {
        let padded = self.padded();
        let last = padded[(self.columns, self.columns)];
        last * last
    }

    /// How much smaller |J·d + r|² is after a step than |r|², by the linear model.
    #[must_use]
    pub fn reduction(&self, step: &DVector<f64>) -> f64 {
        let projected = self.projected();
        projected.norm_squared() - (self.factor() * step + projected).norm_squared()
    }

    /// |J·d|²: how much a step moves the right-hand side, by the linear model.
    #[must_use]
    pub fn movement(&self, step: &[f64]) -> f64 {
        (self.factor() * DVector::from_column_slice(step)).norm_squared()
    }

    fn padded(&self) -> DMatrix<f64> {
        let mut padded = DMatrix::zeros(self.columns + 1, self.columns + 1);
        let rows = self.matrix.nrows().min(self.columns + 1);
        padded
            .rows_mut(0, rows)
            .copy_from(&self.matrix.rows(0, rows));
        padded
    }

    /// Minimises `|J·d + r|² + damping·|D·d|²` over the unknowns that are `free`, the others kept
    /// at zero; D holds the norms of J's columns. An unknown on which nothing depends has a step
    /// of zero and does not keep the others from theirs. None where the system of the others is
    /// singular.
    #[must_use]
    pub fn damped_step(&self, damping: f64, free: &[bool]) -> Option<DVector<f64>> {
        self.damped(damping, free, &[])
    }

    /// Minimises `|J·d + r|² + damping·|D·d|²` over all unknowns, with a step that meets the
    /// inequalities; none where no step does.
    #[must_use]
    pub fn damped_step_within(
        &self,
        damping: f64,
        inequalities: &[Inequality],
    ) -> Option<DVector<f64>> {
        self.damped(damping, &vec![true; self.columns], inequalities)
    }

    fn damped(
        &self,
        damping: f64,
        free: &[bool],
        inequalities: &[Inequality],
    ) -> Option<DVector<f64>> {
        let factor = self.factor();
        let projected = self.projected();
        let norms: Vec<f64> = factor.column_iter().map(|column| column.norm()).collect();
        let chosen: Vec<usize> = (0..self.columns)
            .filter(|&column| free[column] && norms[column] > NO_EFFECT)
            .collect();
        let n = chosen.len();
        let mut stacked = DMatrix::zeros(self.columns + n, n + 1);
        for (place, &column) in chosen.iter().enumerate() {
            stacked
                .view_mut((0, place), (self.columns, 1))
                .copy_from(&factor.column(column));
            stacked[(self.columns + place, place)] = damping.sqrt() * norms[column];
        }
        for row in 0..self.columns {
            stacked[(row, n)] = -projected[row];
        }
        let triangle = stacked.qr().unpack_r();
        let upper = triangle.view((0, 0), (n, n)).into_owned();
        let right = triangle.view((0, n), (n, 1)).column(0).into_owned();
        let among_chosen = |inequality: &Inequality| Inequality {
            row: chosen
                .iter()
                .map(|column| inequality.row[*column])
                .collect(),
            least: inequality.least,
        };
        let inequalities: Vec<Inequality> = inequalities.iter().map(among_chosen).collect();
        let solution = inequalities::least_squares(&upper, &right, &inequalities)?;
        let mut step = DVector::zeros(self.columns);
        for (place, &column) in chosen.iter().enumerate() {
            step[column] = solution[place];
        }
        step.iter().all(|value| value.is_finite()).then_some(step)
    }
}

/// Single rows on their way into a [`Triangle`].
#[derive(Debug)]
pub struct RowGatherer {
    triangle: Triangle,
    gathered: Vec<f64>,
}

/// Rows that are gathered before they go into the triangle.
const GATHERED_ROWS: usize = 1024;

impl RowGatherer {
    /// No rows yet, for `columns` unknowns.
    #[must_use]
    pub fn new(columns: usize) -> RowGatherer {
        RowGatherer {
            triangle: Triangle::new(columns),
            gathered: Vec::with_capacity(GATHERED_ROWS * (columns + 1)),
        }
    }

    /// Adds a row and its right-hand side.
    pub fn add(&mut self, row: impl IntoIterator<Item = f64>, right: f64) {
        self.gathered.extend(row);
        self.gathered.push(right);
        if self.gathered.len() == GATHERED_ROWS * (self.triangle.columns + 1) {
            self.flush();
        }
    }

    /// The triangle of all rows.
    #[must_use]
    pub fn finish(mut self) -> Triangle {
        if !self.gathered.is_empty() {
            self.flush();
        }
        self.triangle
    }

    fn flush(&mut self) {
        let width = self.triangle.columns + 1;
        let rows = self.gathered.len() / width;
        let block = DMatrix::from_row_slice(rows, width, &self.gathered);
        self.triangle.push(&block);
        self.gathered.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y = 2 + 3·t with residuals 0.1·(1, −1, −1, 1), which are orthogonal to 1 and t.
    fn line() -> DMatrix<f64> {
        let rows = [0.0, 1.0, 2.0, 3.0].iter().zip([0.1, -0.1, -0.1, 0.1]);
        DMatrix::from_row_iterator(
            4,
            3,
            rows.flat_map(|(&t, noise)| [1.0, t, -(2.0 + 3.0 * t + noise)]),
        )
    }

    #[test]
    fn an_undamped_step_solves_a_line_however_the_rows_arrive() {
        for cut in 1..4 {
            let rows = line();
            let mut triangle = Triangle::new(2);
            triangle.push(&rows.rows(0, cut).into_owned());
            triangle.push(&rows.rows(cut, 4 - cut).into_owned());
            let step = triangle.damped_step(0.0, &[true, true]).unwrap();
            assert!((step[0] - 2.0).abs() < 1e-12 && (step[1] - 3.0).abs() < 1e-12);
            assert!((triangle.residual_sum_of_squares() - 0.04).abs() < 1e-12);
        }
    }

    #[test]
    fn a_fixed_unknown_stays_and_the_other_makes_the_best_of_it() {
        let mut triangle = Triangle::new(2);
        triangle.push(&line());
        let step = triangle.damped_step(0.0, &[true, false]).unwrap();
        assert_eq!(step[1], 0.0);
        // The mean of 2, 5, 8, 11.
        assert!((step[0] - 6.5).abs() < 1e-12);
    }

    #[test]
    fn what_a_step_gains_and_moves_is_predicted() {
        let mut triangle = Triangle::new(2);
        triangle.push(&line());
        let step = triangle.damped_step(0.0, &[true, true]).unwrap();
        // |r|² is the sum of squares of 2.1, 4.9, 7.9, 11.1; 0.04 of it stays.
        let before = 2.1 * 2.1 + 4.9 * 4.9 + 7.9 * 7.9 + 11.1 * 11.1;
        assert!((triangle.reduction(&step) - (before - 0.04)).abs() < 1e-9);
        // J·d is 2, 5, 8, 11.
        assert!((triangle.movement(step.as_slice()) - 214.0).abs() < 1e-9);
    }

    #[test]
    fn an_unknown_without_effect_does_not_stop_the_others() {
        // The line again with a third unknown between the two, on which nothing depends.
        let rows = line();
        let widened = DMatrix::from_fn(4, 4, |row, column| match column {
            0 => rows[(row, 0)],
            1 => 0.0,
            _ => rows[(row, column - 1)],
        });
        let mut triangle = Triangle::new(3);
        triangle.push(&widened);
        for damping in [0.0, 1e-14] {
            let step = triangle.damped_step(damping, &[true; 3]).unwrap();
            assert_eq!(step[1], 0.0);
            // 2 + 3·t, which a damping of 1e-14 moves by no more than rounding does.
            assert!((step[0] - 2.0).abs() < 1e-12 && (step[2] - 3.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_triangle_of_some_columns_is_that_of_their_rows() {
        let mut triangle = Triangle::new(2);
        triangle.push(&line());
        let alone = triangle.of_columns(&[0]);
        let step = alone.damped_step(0.0, &[true]).unwrap();
        // The mean of 2.1, 4.9, 7.9, 11.1.
        assert!((step[0] - 6.5).abs() < 1e-12);
        assert_eq!(alone.rows(), 4);
        let swapped = triangle.of_columns(&[1, 0]);
        let step = swapped.damped_step(0.0, &[true, true]).unwrap();
        assert!((step[0] - 3.0).abs() < 1e-12 && (step[1] - 2.0).abs() < 1e-12);
    }

    #[test]
    fn rows_that_overflow_are_not_usable() {
        for wild in [1e214, f64::INFINITY, f64::NAN] {
            let mut triangle = Triangle::new(2);
            triangle.push(&line());
            assert!(triangle.is_usable());
            triangle.push(&DMatrix::from_row_slice(
                2,
                3,
                &[1.0, wild, 0.0, 1.0, 1.0, 1.0],
            ));
            assert!(!triangle.is_usable(), "{wild}");
        }
    }

    #[test]
    fn damping_shortens_the_step() {
        let mut triangle = Triangle::new(2);
        triangle.push(&line());
        let free = [true, true];
        let short = triangle.damped_step(10.0, &free).unwrap().norm();
        assert!(short < 0.5 * triangle.damped_step(0.0, &free).unwrap().norm());
    }
}
