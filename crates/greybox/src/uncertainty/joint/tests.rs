//! The linear algebra of unknowns and assumptions against closed forms.

use super::*;

/// Two unknowns and two assumptions that act linearly on six samples of unit noise; the last
/// assumption does what the second unknown does.
const S: [[f64; 2]; 6] = [[1., 0.], [1., 1.], [1., 2.], [1., 3.], [1., 4.], [1., 5.]];
const P: [[f64; 2]; 6] = [
    [0.3, 0.],
    [-0.2, 2.],
    [0.5, 4.],
    [0.1, 6.],
    [-0.4, 8.],
    [0.7, 10.],
];
const R: [f64; 6] = [0.2, -0.5, 0.7, 0.1, -0.9, 0.4];

fn matrix<const N: usize>(rows: &[[f64; N]; 6]) -> DMatrix<f64> {
    DMatrix::from_fn(6, N, |row, column| rows[row][column])
}

fn joint(scale: f64) -> Joint {
    let mut triangle = Triangle::new(4);
    let (s, p) = (matrix(&S), matrix(&P) * scale);
    triangle.push(&DMatrix::from_fn(6, 5, |row, column| match column {
        0 | 1 => s[(row, column)],
        2 | 3 => p[(row, column - 2)],
        _ => R[row],
    }));
    Joint::new(&triangle, &triangle, &[0.0; 2]).unwrap()
}

/// By normal equations: the covariance of all four with the tolerances as priors, the two
/// unknowns' part; and the covariance of the unknowns alone.
fn closed_form(scale: f64) -> (DMatrix<f64>, DMatrix<f64>) {
    let (s, p) = (matrix(&S), matrix(&P) * scale);
    let mut information = DMatrix::identity(4, 4);
    information
        .view_mut((0, 0), (2, 2))
        .copy_from(&(s.transpose() * &s));
    information
        .view_mut((0, 2), (2, 2))
        .copy_from(&(s.transpose() * &p));
    information
        .view_mut((2, 0), (2, 2))
        .copy_from(&(p.transpose() * &s));
    let corner = p.transpose() * &p + DMatrix::identity(2, 2);
    information.view_mut((2, 2), (2, 2)).copy_from(&corner);
    let all = information.try_inverse().unwrap();
    let alone = (s.transpose() * &s).try_inverse().unwrap();
    (all.view((0, 0), (2, 2)).into_owned(), alone)
}

/// The part of the total that the pull of the residuals makes.
fn shift(joint: &Joint, unknown: usize) -> f64 {
    joint.moves(unknown).unwrap().dot(&joint.middle).powi(2)
}

#[test]
fn totals_are_those_of_the_joint_estimate_in_closed_form() {
    for scale in [1e-3, 0.1, 1.0, 30.0] {
        let (joint, (all, alone)) = (joint(scale), closed_form(scale));
        for unknown in 0..2 {
            let noise = alone[(unknown, unknown)];
            let total = joint.total(unknown, noise).unwrap() - shift(&joint, unknown);
            let expected = all[(unknown, unknown)];
            assert!((total / expected - 1.0).abs() < 1e-10, "{total} {expected}");
        }
    }
}

#[test]
fn without_tolerance_the_total_is_that_of_noise_and_with_all_of_it_that_of_a_free_parameter() {
    let (_, alone) = closed_form(1.0);
    let exact = joint(1e-9);
    assert!((exact.total(0, alone[(0, 0)]).unwrap() / alone[(0, 0)] - 1.0).abs() < 1e-10);
    // With the first assumption free: three unknowns. The second does what an unknown does,
    // so that the first unknown is what it is without it.
    let (s, p) = (matrix(&S), matrix(&P));
    let three = DMatrix::from_columns(&[s.column(0), s.column(1), p.column(0)]);
    let free = (three.transpose() * three).try_inverse().unwrap();
    let open = joint(1e7);
    let total = open.total(0, alone[(0, 0)]).unwrap() - shift(&open, 0);
    assert!((total / free[(0, 0)] - 1.0).abs() < 1e-10, "{total}");
}

#[test]
fn a_score_is_the_step_of_the_estimate_with_the_assumption_free() {
    let (s, p, r) = (matrix(&S), matrix(&P), DVector::from_row_slice(&R));
    let three = DMatrix::from_columns(&[s.column(0), s.column(1), p.column(0)]);
    let inverse = (three.transpose() * &three).try_inverse().unwrap();
    let step = -(&inverse * three.transpose() * r);
    let score = joint(1.0).score(0).unwrap();
    assert!((score.suggested.0 - step[2]).abs() < 1e-10);
    assert!((score.suggested.1 - inverse[(2, 2)].sqrt()).abs() < 1e-10);
    assert!((score.t - step[2] / inverse[(2, 2)].sqrt()).abs() < 1e-10);
    let unnoticed = joint(1.0).unnoticed(0, 4.0).unwrap();
    assert!((unnoticed - 4.0 * inverse[(2, 2)].sqrt()).abs() < 1e-10);
}

#[test]
fn what_does_the_same_as_an_unknown_has_no_score_and_moves_it_in_full() {
    let joint = joint(1.0);
    assert_eq!(joint.score(1), None);
    assert_eq!(joint.unnoticed(1, 4.0), None);
    // Twice the unknown's own effect.
    assert!((joint.move_by(1, 1).unwrap() + 2.0).abs() < 1e-12);
    let (deviation, variance) = joint.contribution(1, 1).unwrap();
    assert!((deviation - 2.0).abs() < 1e-12 && variance > 0.0);
}

#[test]
fn an_unknown_without_effect_has_no_total_and_takes_none_from_the_others() {
    let mut triangle = Triangle::new(4);
    let (s, p) = (matrix(&S), matrix(&P));
    triangle.push(&DMatrix::from_fn(6, 5, |row, column| match column {
        0 => s[(row, 0)],
        1 => 0.0,
        2 | 3 => p[(row, column - 2)],
        _ => R[row],
    }));
    let joint = Joint::new(&triangle, &triangle, &[0.0; 2]).unwrap();
    assert_eq!(joint.total(1, 1.0), None);
    let moved = joint.move_by(0, 1).unwrap();
    // A level beside 0, 2, 4, 6, 8, 10: their mean.
    assert!((moved + 5.0).abs() < 1e-12, "{moved}");
}

#[test]
fn contributions_sum_up_to_what_the_assumptions_add() {
    for size in [0.01, 1.0, 100.0] {
        let joint = joint(size);
        for unknown in 0..2 {
            let parts = (0..2).map(|index| joint.contribution(unknown, index).unwrap().1);
            let added = joint.total(unknown, 0.0).unwrap();
            assert!((parts.sum::<f64>() / added - 1.0).abs() < 1e-10);
        }
    }
}

#[test]
fn a_contradicted_estimate_that_was_moved_errs_by_its_distance_from_the_declared_one() {
    // Residuals that no value within the tolerances explains.
    let (s, p) = (matrix(&S), matrix(&P));
    let mut triangle = Triangle::new(4);
    triangle.push(&DMatrix::from_fn(6, 5, |row, column| match column {
        0 | 1 => s[(row, column)],
        2 | 3 => p[(row, column - 2)],
        _ => 50.0 * R[row],
    }));
    let taken = |off: [f64; 2]| Joint::new(&triangle, &triangle, &off).unwrap();
    let off = [6.0, 1.0];
    let still = taken(off).moved(Some(vec![0.0; 2]));
    let moved = taken(off).moved(Some(vec![0.3, -0.7]));
    assert!(still.is_contradicted());
    for (unknown, distance) in [0.3, 0.7].into_iter().enumerate() {
        let (without, with) = (still.total(unknown, 1.0), moved.total(unknown, 1.0));
        let further = with.unwrap() - without.unwrap();
        assert!((further - distance * distance).abs() < 1e-10, "{further}");
        // Another tolerance does not take the distance away.
        let better = moved.total_with(unknown, 1.0, 0, 0.2).unwrap();
        assert!(better > distance * distance && better <= with.unwrap());
    }
}

#[test]
fn a_contradicted_estimate_that_holds_declared_values_errs_by_whole_tolerances() {
    // The data see the first assumption far better than its tolerance, and contradict it.
    let (s, p) = (matrix(&S), matrix(&P) * 20.0);
    let mut triangle = Triangle::new(4);
    triangle.push(&DMatrix::from_fn(6, 5, |row, column| match column {
        0 | 1 => s[(row, column)],
        2 | 3 => p[(row, column - 2)],
        _ => R[row] + 0.3 * p[(row, 0)],
    }));
    let held = Joint::new(&triangle, &triangle, &[0.0; 2]).unwrap();
    assert!(held.contradicts(0));
    for unknown in 0..2 {
        let by = [0, 1].map(|assumption| held.move_by(unknown, assumption).unwrap().powi(2));
        let total = held.total(unknown, 1.0).unwrap();
        assert!(
            (total / (1.0 + by[0] + by[1]) - 1.0).abs() < 1e-10,
            "{total} {by:?}"
        );
        let better = held.total_with(unknown, 1.0, 0, 0.2).unwrap();
        assert!((total - better - 0.96 * by[0]).abs() < 1e-10 * total);
    }
}

#[test]
fn a_tolerance_of_nothing_takes_its_assumption_out_of_the_total() {
    let (joint, (_, alone)) = (joint(1.0), closed_form(1.0));
    let noise = alone[(1, 1)];
    let without = joint.total_if(1, noise, 1, 1e-9).unwrap();
    let (all, _) = closed_form(1.0);
    // The second assumption adds its 2² to what the first leaves.
    assert!((without - (all[(1, 1)] - 4.0)).abs() < 1e-8, "{without}");
}

#[test]
fn a_step_ends_where_data_and_tolerances_balance() {
    let declared = joint(1.0);
    let step = declared.step(&[false; 2]).unwrap();
    let (s, p) = (matrix(&S), matrix(&P));
    let moved = DVector::from_vec(step.assumptions.clone());
    let along = DVector::from_vec(step.unknowns.clone());
    let left = DVector::from_row_slice(&R) + s * along + p * &moved;
    let mut triangle = Triangle::new(4);
    triangle.push(&DMatrix::from_fn(6, 5, |row, column| match column {
        0 | 1 => S[row][column],
        2 | 3 => P[row][column - 2],
        _ => left[row],
    }));
    let taken = Joint::new(&triangle, &triangle, &step.assumptions).unwrap();
    let further = taken.step(&[false; 2]).unwrap();
    assert!(step.gain > 0.0 && further.gain < 1e-20 * step.gain);
    for assumption in 0..2 {
        let ((a, spread), (b, same)) =
            (declared.posterior(assumption), taken.posterior(assumption));
        assert!((a - b).abs() < 1e-12 && (spread - same).abs() < 1e-12);
    }
    assert!(shift(&taken, 0) < 1e-20);
}
