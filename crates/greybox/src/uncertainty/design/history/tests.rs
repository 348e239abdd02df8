//! Windows whose information is written down, held against all choices that there are.

use super::*;
use crate::uncertainty::covariance::NO_EFFECT;
use greybox_numerics::least_squares::RowGatherer;

/// Nobody raises it.
static NEVER: AtomicBool = AtomicBool::new(false);

/// Nothing is known of so many unknowns, all wanted, beside one number that is assumed within its tolerance.
fn nothing_known(unknowns: usize) -> Present {
    let mut rows = RowGatherer::new(unknowns + 1);
    for place in 0..=unknowns {
        let size = if place == unknowns { 1.0 } else { NO_EFFECT };
        rows.add(
            (0..=unknowns).map(|column| if column == place { size } else { 0.0 }),
            0.0,
        );
    }
    Present {
        points: vec![vec![0.5; unknowns]],
        known: rows.finish(),
        order: std::iter::once(unknowns).chain(0..unknowns).collect(),
        wanted: (0..unknowns).collect(),
        slopes: vec![1.0; unknowns],
    }
}

/// A window of 100 samples with these rows.
fn window(rows: &[Vec<f64>]) -> WindowInformation {
    let columns = rows[0].len();
    let mut gatherer = RowGatherer::new(columns);
    for row in rows {
        gatherer.add(row.iter().copied(), 0.0);
    }
    let factor = gatherer.finish().factor();
    let places = (0..columns).flat_map(|row| (row..columns).map(move |column| (row, column)));
    WindowInformation {
        samples: 100,
        triangle: places.map(|place| factor[place] as f32).collect(),
    }
}

/// Windows of which each sees a direction of its own, some far better than others.
fn uneven(seed: u64, count: usize, unknowns: usize) -> Vec<WindowInformation> {
    let mut rng = rng::stream(seed, 0, Purpose::Noise);
    let mut row = |size: f64| {
        (0..=unknowns)
            .map(|_| size * rng::normal(&mut rng))
            .collect()
    };
    (0..count)
        .map(|place| window(&[row(libm::pow(3.0, (place % 5) as f64)), row(1.0), row(0.3)]))
        .collect()
}

fn budget(unknowns: usize, windows: u64) -> WindowGoal {
    WindowGoal {
        targets: vec![None; unknowns],
        most_samples: 100 * windows,
        most_windows: 32,
    }
}

#[test]
fn no_choice_of_as_many_windows_is_much_better() {
    for seed in 0..20 {
        let (present, windows) = (nothing_known(3), uneven(seed, 14, 3));
        let windows: Vec<&WindowInformation> = windows.iter().collect();
        let history = History::new(&present, &windows).expect("one number of columns");
        let choice = history.choose(&budget(3, 4), &NEVER);
        assert!(choice.is_finished);
        let score = |windows: &[usize]| present.score(&history.sum(windows.iter().copied()));
        let fours = (0..1_usize << 14).filter(|choice| choice.count_ones() == 4);
        let fours = fours.map(|choice| (0..14).filter(|place| choice >> place & 1 == 1).collect());
        let best = fours.map(|four: Vec<usize>| score(&four));
        let best = best.fold(f64::NEG_INFINITY, f64::max);
        // Half a logarithm of the determinant of 3 unknowns: 5 % of a gain that is counted from 4 windows at random.
        let at_random = score(&[0, 1, 2, 3]);
        let reached = score(&choice.windows);
        assert_eq!(choice.windows.len(), 4);
        assert!(
            reached - at_random >= 0.95 * (best - at_random),
            "{reached} of {best}, from {at_random}"
        );
    }
}

#[test]
fn an_error_that_all_windows_share_does_not_average_out() {
    let present = nothing_known(1);
    // Each window reads the unknown plus the assumed number, with noise of 1.
    let windows: Vec<WindowInformation> = (0..400).map(|_| window(&[vec![1.0, 1.0]])).collect();
    let windows: Vec<&WindowInformation> = windows.iter().collect();
    let history = History::new(&present, &windows).expect("one number of columns");
    for count in [1, 4, 400] {
        let errors = history.known_with(0..count).expect("a regular sum");
        let noise = (1.0 / count as f64).sqrt();
        let near =
            |value: Option<f64>, expected: f64| (value.unwrap() / expected - 1.0).abs() < 1e-3;
        assert!(near(errors[0].noise, noise), "{errors:?}");
        assert!(
            near(errors[0].total, (1.0 + noise * noise).sqrt()),
            "{errors:?}"
        );
    }
}

#[test]
fn a_target_is_met_with_windows_none_of_which_can_be_left_out() {
    let present = nothing_known(2);
    let windows = uneven(7, 60, 2);
    let windows: Vec<&WindowInformation> = windows.iter().collect();
    let history = History::new(&present, &windows).expect("one number of columns");
    let all = history.known_with(0..60).expect("a regular sum");
    let target = |unknown: usize| all[unknown].total.map(|total| 1.5 * total);
    let goal = WindowGoal {
        targets: vec![target(0), None],
        most_samples: u64::MAX,
        most_windows: 32,
    };
    let chosen = history.choose(&goal, &NEVER).windows;
    let reaches = |windows: &[usize]| {
        let errors = history.known_with(windows.iter().copied());
        history.fulfils(errors.as_deref(), &goal)
    };
    assert!(reaches(&chosen));
    assert!(chosen.len() < 20, "{chosen:?}");
    for left_out in &chosen {
        let others: Vec<usize> = chosen
            .iter()
            .copied()
            .filter(|window| window != left_out)
            .collect();
        assert!(!reaches(&others), "{left_out} of {chosen:?}");
    }
    let at_random = history
        .known_at_random(chosen.len(), 0, 1)
        .expect("a regular sum");
    let with_chosen = history
        .known_with(chosen.iter().copied())
        .expect("a regular sum");
    assert!(at_random[0].total > with_chosen[0].total);
}

#[test]
fn a_choice_that_is_stopped_is_the_first_choice() {
    let present = nothing_known(3);
    let windows = uneven(3, 40, 3);
    let windows: Vec<&WindowInformation> = windows.iter().collect();
    let history = History::new(&present, &windows).expect("one number of columns");
    let stopped = history.choose(&budget(3, 5), &AtomicBool::new(true));
    assert!(!stopped.is_finished);
    assert_eq!(stopped.windows.len(), 5);
    let score = |windows: &[usize]| present.score(&history.sum(windows.iter().copied()));
    let finished = history.choose(&budget(3, 5), &NEVER);
    assert!(score(&finished.windows) >= score(&stopped.windows));
}
