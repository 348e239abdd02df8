//! Linear equations of a row of candidates: a matrix as the product of triangular ones.

use greybox_numerics::lanes::Real;

/// The factors of a square matrix, a row of candidates in each entry. Rows of the matrix are
/// exchanged for the largest pivots, candidate by candidate.
#[derive(Clone, Debug)]
pub struct Factors<R> {
    n: usize,
    /// Row by row: 1 on the diagonal of the lower factor is left out.
    entries: Vec<R>,
    exchanges: Vec<RowExchange<R>>,
}

/// Two rows that change places, for the candidates where `is_done` is 1.
#[derive(Clone, Copy, Debug)]
struct RowExchange<R> {
    rows: [usize; 2],
    is_done: R,
}

impl<R: Real> Factors<R> {
    /// Room for matrices of `n` rows.
    pub fn new(n: usize) -> Factors<R> {
        Factors {
            n,
            entries: vec![R::splat(0.0); n * n],
            exchanges: Vec::new(),
        }
    }

    /// The matrix, row by row, to be written before [`Factors::factorise`].
    pub fn matrix_mut(&mut self) -> &mut [R] {
        &mut self.entries
    }

    /// Replaces the matrix by its factors. Where it is singular, solutions are not finite.
    #[inline(always)]
    pub fn factorise(&mut self) {
        let n = self.n;
        self.exchanges.clear();
        for column in 0..n {
            for row in column + 1..n {
                self.exchange_where_larger(column, row);
            }
            let inverse = R::splat(1.0) / self.entries[column * n + column];
            let (above, below) = self.entries.split_at_mut((column + 1) * n);
            let pivot_row = &above[column * n..];
            for entries in below.chunks_exact_mut(n) {
                eliminate(entries, pivot_row, column, inverse);
            }
        }
    }

    #[inline(always)]
    fn exchange_where_larger(&mut self, column: usize, row: usize) {
        let n = self.n;
        let (pivot, candidate) = (
            self.entries[column * n + column].abs(),
            self.entries[row * n + column].abs(),
        );
        // 0 where the pivot is the larger, or neither is a number.
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let is_done = pivot.select_ge(candidate, zero, one);
        let is_done = candidate.select_ge(zero, is_done, zero);
        if !is_done.any(|done| done > 0.0) {
            return;
        }
        for place in 0..n {
            exchange(
                &mut self.entries,
                [column * n + place, row * n + place],
                is_done,
            );
        }
        self.exchanges.push(RowExchange {
            rows: [column, row],
            is_done,
        });
    }

    /// Replaces the right-hand side by the solution.
    #[inline(always)]
    pub fn solve(&self, right: &mut [R]) {
        let n = self.n;
        for RowExchange { rows, is_done } in &self.exchanges {
            exchange(right, *rows, *is_done);
        }
        for row in 1..n {
            let mut value = right[row];
            for (entry, solved) in self.entries[row * n..][..row].iter().zip(&*right) {
                value -= *entry * *solved;
            }
            right[row] = value;
        }
        for row in (0..n).rev() {
            let entries = &self.entries[row * n..][..n];
            let mut value = right[row];
            for (entry, solved) in entries.iter().zip(&*right).skip(row + 1) {
                value -= *entry * *solved;
            }
            right[row] = value / entries[row];
        }
    }
}

/// Takes the pivot's row from another so that nothing is left below the pivot, and keeps the factor
/// there.
#[inline(always)]
fn eliminate<R: Real>(entries: &mut [R], pivot_row: &[R], column: usize, inverse: R) {
    let factor = entries[column] * inverse;
    entries[column] = factor;
    for (entry, pivot) in entries.iter_mut().zip(pivot_row).skip(column + 1) {
        *entry -= factor * *pivot;
    }
}

/// Exchanges two numbers for the candidates where `is_done` is 1.
#[inline(always)]
fn exchange<R: Real>(numbers: &mut [R], [first, second]: [usize; 2], is_done: R) {
    let half = R::splat(0.5);
    let (a, b) = (numbers[first], numbers[second]);
    numbers[first] = is_done.select_ge(half, b, a);
    numbers[second] = is_done.select_ge(half, a, b);
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::lanes::Lanes;
    use proptest::prelude::*;

    proptest! {
        /// A matrix times a vector, and back; each candidate with a matrix of its own.
        #[test]
        fn a_solution_gives_the_right_hand_side(
            entries in proptest::collection::vec(-3.0..3.0f64, 8 * 16),
            solution in proptest::collection::vec(-5.0..5.0f64, 4),
        ) {
            let n = 4;
            let mut factors: Factors<Lanes> = Factors::new(n);
            let of = |lane: usize, place: usize| entries[lane * 16 + place]
                + if place.is_multiple_of(5) && lane != 3 { 7.0 } else { 0.0 };
            for place in 0..16 {
                factors.matrix_mut()[place] = Lanes(std::array::from_fn(|lane| of(lane, place)));
            }
            let mut right: Vec<Lanes> = (0..n)
                .map(|row| Lanes(std::array::from_fn(|lane| {
                    (0..n).map(|column| of(lane, row * n + column) * solution[column]).sum()
                })))
                .collect();
            factors.factorise();
            factors.solve(&mut right);
            for lane in (0..8).filter(|lane| *lane != 3) {
                for (row, expected) in solution.iter().enumerate() {
                    prop_assert!((right[row].0[lane] - expected).abs() < 1e-9);
                }
            }
        }
    }

    #[test]
    fn rows_are_exchanged_for_the_candidates_that_need_it_alone() {
        let mut factors: Factors<Lanes<f64, 2>> = Factors::new(2);
        let rows = [[0.0, 4.0], [1.0, 1.0], [2.0, 1.0], [3.0, 3.0]];
        for (place, row) in rows.into_iter().enumerate() {
            factors.matrix_mut()[place] = Lanes(row);
        }
        let mut right = vec![Lanes([5.0, 9.0]), Lanes([19.0, 16.0])];
        factors.factorise();
        factors.solve(&mut right);
        assert_eq!(right, [Lanes([2.0, 1.0]), Lanes([5.0, 5.0])]);
    }

    #[test]
    fn a_singular_matrix_has_no_finite_solution() {
        let mut factors: Factors<f64> = Factors::new(2);
        factors.matrix_mut().copy_from_slice(&[1.0, 2.0, 2.0, 4.0]);
        let mut right = vec![1.0, 1.0];
        factors.factorise();
        factors.solve(&mut right);
        assert!(right.iter().any(|value| !value.is_finite()));
    }
}
