//! Linear least squares of a chain of members: each has unknowns of its own, which stand in its own rows
//! and in those by which it joins the member before and the one after, beside unknowns that all share.
//!
//! Minimised is |r + R·δ + S·σ|² over the rows of the members plus |h + X·δ + Y·σ − w·σ'|² over the rows
//! in which two meet: δ is a step of the shared unknowns, σ one of a member's own, σ' of the next one's.
//! Orthogonal triangles eliminate the own unknowns one member after the other; what is left are rows in
//! δ alone (G. H. Golub, C. F. Van Loan, *Matrix Computations*, 2013, ch. 5).

use super::least_squares::Triangle;
use nalgebra::{DMatrix, DVector};

/// What keeps an own unknown that nothing depends on where it is.
const HOLD: f64 = 1e-6;

/// The rows of a member.
#[derive(Clone, Debug)]
pub struct Member {
    /// How many unknowns the member has of its own.
    pub n_own: usize,
    /// The rows of the member, one after the other: columns of its own unknowns, of shared ones,
    /// right-hand side.
    pub rows: Vec<f64>,
    /// In the same columns those by which it joins the next one, one for each own unknown of that;
    /// none where the chain ends with it.
    pub joins: Vec<f64>,
    /// What the next one's unknowns are multiplied with there, with a minus.
    pub weight: f64,
}

/// The rows by which a member's own unknowns σ were eliminated, with those of the next member σ' and the
/// shared ones δ: `diagonal·σ + next·σ' + shared·δ + right = 0`.
#[derive(Clone, Debug)]
struct EliminatedRows {
    diagonal: DMatrix<f64>,
    next: DMatrix<f64>,
    shared: DMatrix<f64>,
    right: DVector<f64>,
}

/// One chain after the other, all with the same shared unknowns.
#[derive(Clone, Debug)]
pub struct Chains {
    shared: usize,
    triangle: Triangle,
    /// Rows that the members before have left: columns of the next one's own unknowns, the shared ones,
    /// right.
    left: DMatrix<f64>,
    /// For each chain, the last of which may not have ended, how own unknowns were eliminated.
    links: Vec<Vec<EliminatedRows>>,
}

impl Chains {
    /// No member yet, for so many shared unknowns.
    #[must_use]
    pub fn new(shared: usize) -> Chains {
        Chains {
            shared,
            triangle: Triangle::new(shared),
            left: DMatrix::zeros(0, shared + 1),
            links: vec![Vec::new()],
        }
    }

    /// The triangle of the shared unknowns, of the chains that have ended.
    #[must_use]
    pub fn triangle(&self) -> &Triangle {
        &self.triangle
    }

    /// Adds a row of the shared unknowns alone, its right-hand side last.
    pub fn add_shared(&mut self, row: &[f64]) {
        let row = DMatrix::from_row_slice(1, self.shared + 1, row);
        self.triangle.push(&row);
    }

    /// Adds the next member.
    pub fn add(&mut self, member: &Member) {
        let (n_own, n) = (member.n_own, self.shared);
        let width_of_rows = n_own + n + 1;
        let block =
            |rows: &[f64]| DMatrix::from_row_slice(rows.len() / width_of_rows, width_of_rows, rows);
        let blocks = [&self.left, &block(&member.rows), &block(&member.joins)];
        let next = blocks[2].nrows();
        let width = n_own + next + n + 1;
        let height = blocks.iter().map(|block| block.nrows()).sum::<usize>();
        let mut stacked = DMatrix::zeros(height + n_own, width);
        let mut first = 0;
        for block in blocks {
            let mut place = stacked.rows_mut(first, block.nrows());
            place
                .columns_mut(0, n_own)
                .copy_from(&block.columns(0, n_own));
            let rest = block.columns(n_own, n + 1);
            place.columns_mut(n_own + next, n + 1).copy_from(&rest);
            first += block.nrows();
        }
        for unknown in 0..next {
            stacked[(height - next + unknown, n_own + unknown)] = -member.weight;
        }
        for unknown in 0..n_own {
            stacked[(height + unknown, unknown)] = HOLD;
        }
        let triangle = stacked.qr().unpack_r();
        if n_own > 0 {
            let link = EliminatedRows {
                diagonal: triangle.view((0, 0), (n_own, n_own)).into_owned(),
                next: triangle.view((0, n_own), (n_own, next)).into_owned(),
                shared: triangle.view((0, n_own + next), (n_own, n)).into_owned(),
                right: triangle.column(width - 1).rows(0, n_own).into_owned(),
            };
            self.links.last_mut().expect("at least one").push(link);
        }
        let kept = triangle.nrows().min(width).saturating_sub(n_own);
        let rest = triangle.view((n_own, n_own), (kept, next + n + 1));
        let rest = rest.into_owned();
        if next > 0 {
            self.left = rest;
        } else {
            self.triangle.push(&rest);
            self.left = DMatrix::zeros(0, n + 1);
            self.links.push(Vec::new());
        }
    }

    /// What a step of the shared unknowns makes best for those of each member that has any, chain by
    /// chain. Nothing where they are not fixed.
    #[must_use]
    pub fn own_steps(&self, step: &[f64]) -> Option<Vec<Vec<Vec<f64>>>> {
        let step = DVector::from_column_slice(step);
        let chains = self.links[..self.links.len() - 1].iter();
        chains.map(|links| back(links, &step)).collect()
    }
}

/// From the last member of a chain to the first.
fn back(links: &[EliminatedRows], step: &DVector<f64>) -> Option<Vec<Vec<f64>>> {
    let mut steps: Vec<DVector<f64>> = Vec::with_capacity(links.len());
    for link in links.iter().rev() {
        let mut right = &link.shared * step + &link.right;
        if let Some(after) = steps.last() {
            right += &link.next * after;
        }
        steps.push(-link.diagonal.solve_upper_triangular(&right)?);
    }
    let steps = steps.iter().rev();
    Some(steps.map(|step| step.as_slice().to_vec()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::{self, Purpose, stream};

    /// A random chain of three members, the first without unknowns of its own, and the same problem
    /// written down whole: columns of all own unknowns, the shared ones, right.
    fn chain() -> (Chains, DMatrix<f64>) {
        let (shared, own, weight) = (2, 3, 1.7);
        let mut rng = stream(4, 0, Purpose::Noise);
        let mut numbers =
            |count: usize| -> Vec<f64> { (0..count).map(|_| rng::normal(&mut rng)).collect() };
        let mut chains = Chains::new(shared);
        let mut whole: Vec<Vec<f64>> = Vec::new();
        let width = 2 * own + shared + 1;
        for place in 0..3 {
            let own_here = if place == 0 { 0 } else { own };
            let width_here = own_here + shared + 1;
            let member = Member {
                n_own: own_here,
                rows: numbers(5 * width_here),
                joins: numbers(if place == 2 { 0 } else { own * width_here }),
                weight,
            };
            let mut write = |row: &[f64], next: Option<usize>| {
                let mut written = vec![0.0; width];
                let first = [0, 0, own][place];
                written[first..first + own_here].copy_from_slice(&row[..own_here]);
                written[2 * own..].copy_from_slice(&row[own_here..]);
                let next = next.into_iter();
                next.for_each(|next| written[place * own + next] -= weight);
                whole.push(written);
            };
            member
                .rows
                .chunks(width_here)
                .for_each(|row| write(row, None));
            let joins = member.joins.chunks(width_here).enumerate();
            joins.for_each(|(next, row)| write(row, Some(next)));
            chains.add(&member);
        }
        let rows: Vec<f64> = whole.into_iter().flatten().collect();
        (
            chains,
            DMatrix::from_row_slice(rows.len() / width, width, &rows),
        )
    }

    #[test]
    fn what_is_eliminated_comes_out_as_in_the_whole_problem() {
        let (chains, whole) = chain();
        let unknowns = whole.columns(0, 8).into_owned();
        let right = whole.column(8).into_owned();
        let solution = -unknowns
            .clone()
            .svd(true, true)
            .solve(&right, 1e-12)
            .unwrap();
        let step = chains.triangle().damped_step(0.0, &[true; 2]).unwrap();
        for (own, expected) in step.iter().zip(solution.rows(6, 2).iter()) {
            assert!((own - expected).abs() < 1e-9, "{own} {expected}");
        }
        let own = chains.own_steps(step.as_slice()).unwrap();
        assert_eq!((own.len(), own[0].len()), (1, 2));
        for (own, expected) in own[0].iter().flatten().zip(solution.rows(0, 6).iter()) {
            assert!((own - expected).abs() < 1e-9, "{own} {expected}");
        }
        let left = (unknowns * solution + right).norm_squared();
        let sum = chains.triangle().residual_sum_of_squares();
        assert!((sum / left - 1.0).abs() < 1e-9, "{sum} {left}");
    }
}
