//! The ICRA recursion: the paper's Eq. 10–15 in a form that cannot leave its range.
//!
//! In block s candidate k has the error e_k, and `g_k = exp(−(e_k − min_j e_j)/σ)` (Eq. 10; the
//! shift rescales the gain and keeps g from vanishing in a converged population). The paper's
//! Eq. 11, `p_k ← p_k·(1 + ν·(g_k − ḡ))` with `ḡ = Σ p_j·g_j`, keeps p positive only while
//! ν·(ḡ − g_k) < 1, and rounding in Σp grows by ν each step: with ν = 15 it has diverged by block
//! 16. Two safe forms, both in log credits l that are renormalised at every step:
//!
//! ```text
//! paper:  ν_s = min(ν, 0.999/(ḡ − min g));   l_k += ln(1 + ν_s·(g_k − ḡ))
//! hedge:  l_k += ν·g_k                       the flow of which Eq. 11 is the Euler step
//! H = ln Z − Σ p·l;   stop when H < ln K·(s + 1)/T                             Eq. 13–15
//! ```
//!
//! Promises: Σp = 1; 0 ≤ p ≤ 1; equal errors leave the credits as they are; a candidate that
//! failed (an error that is not finite) has g = 0 and harms no other.

/// How credits grow from block to block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Eq. 11 with its gain held inside the stability bound.
    Paper,
    /// The exact flow.
    Hedge,
}

/// The constants of the recursion.
#[derive(Clone, Copy, Debug)]
pub struct Network {
    /// How credits grow.
    pub form: Form,
    /// The credit gain ν.
    pub gain: f64,
    /// The error spread σ.
    pub spread: f64,
    /// Updates at the most (T).
    pub updates: usize,
}

/// The credits of one generation.
#[derive(Clone, Debug)]
pub struct Credits {
    /// The credit of each candidate; the credits sum to 1.
    pub credit: Vec<f64>,
    /// The entropy of the credits, 0 to ln K.
    pub entropy: f64,
    /// Blocks that were judged before the entropy criterion stopped.
    pub updates: usize,
}

/// Judges K candidates block after block. `errors(s)` answers the K errors of the s-th block.
pub fn assign<'a>(
    network: &Network,
    candidates: usize,
    errors: impl Fn(usize) -> &'a [f64],
) -> Credits {
    let mut state = State::uniform(candidates);
    let largest_entropy = libm::log(candidates as f64);
    let mut closeness = vec![0.0; candidates];
    for update in 0..network.updates {
        let threshold = largest_entropy * (update + 1) as f64 / network.updates as f64;
        evaluate_closeness(errors(update), network.spread, &mut closeness);
        state.grow(network, &closeness);
        if state.entropy < threshold || candidates == 1 {
            return state.into_credits(update + 1);
        }
    }
    state.into_credits(network.updates)
}

/// Eq. 10, shifted by the lowest error.
fn evaluate_closeness(errors: &[f64], spread: f64, closeness: &mut [f64]) {
    let sound = errors.iter().copied().filter(|error| error.is_finite());
    let lowest = sound.fold(f64::INFINITY, f64::min);
    for (g, error) in closeness.iter_mut().zip(errors) {
        *g = if error.is_finite() {
            libm::exp(-(error - lowest) / spread)
        } else {
            0.0
        };
    }
}

struct State {
    /// Log credits, the largest of them 0.
    log: Vec<f64>,
    credit: Vec<f64>,
    entropy: f64,
}

impl State {
    fn uniform(candidates: usize) -> State {
        State {
            log: vec![0.0; candidates],
            credit: vec![1.0 / candidates as f64; candidates],
            entropy: libm::log(candidates as f64),
        }
    }

    fn grow(&mut self, network: &Network, closeness: &[f64]) {
        match network.form {
            Form::Hedge => {
                for (log, g) in self.log.iter_mut().zip(closeness) {
                    *log += network.gain * g;
                }
            }
            Form::Paper => {
                let mean: f64 = self.credit.iter().zip(closeness).map(|(p, g)| p * g).sum();
                let lowest = closeness.iter().copied().fold(f64::INFINITY, f64::min);
                let gain = network
                    .gain
                    .min(0.999 / (mean - lowest).max(f64::MIN_POSITIVE));
                for (log, g) in self.log.iter_mut().zip(closeness) {
                    *log += libm::log1p(gain * (g - mean));
                }
            }
        }
        self.normalise();
    }

    fn normalise(&mut self) {
        let largest = self.log.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut sum = 0.0;
        for (log, credit) in self.log.iter_mut().zip(&mut self.credit) {
            *log -= largest;
            *credit = libm::exp(*log);
            sum += *credit;
        }
        let mut weighted = 0.0;
        for (log, credit) in self.log.iter().zip(&mut self.credit) {
            *credit /= sum;
            weighted += *credit * log;
        }
        self.entropy = (libm::log(sum) - weighted).max(0.0);
    }

    fn into_credits(self, updates: usize) -> Credits {
        Credits {
            credit: self.credit,
            entropy: self.entropy,
            updates,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FORMS: [Form; 2] = [Form::Paper, Form::Hedge];

    /// Errors of up to 8 candidates in 12 blocks.
    fn blocks() -> impl Strategy<Value = Vec<Vec<f64>>> {
        (2usize..8).prop_flat_map(|candidates| {
            prop::collection::vec(prop::collection::vec(0.0..10.0f64, candidates), 12)
        })
    }

    fn run(form: Form, gain: f64, blocks: &[Vec<f64>]) -> Credits {
        let network = Network {
            form,
            gain,
            spread: 3.0,
            updates: blocks.len(),
        };
        assign(&network, blocks[0].len(), |s| &blocks[s])
    }

    /// One update from the given credits.
    fn grown(form: Form, gain: f64, prior: &[f64], closeness: &[f64]) -> Vec<f64> {
        let mut state = State::uniform(prior.len());
        state.log = prior.iter().map(|p| p.ln()).collect();
        state.normalise();
        let network = Network {
            form,
            gain,
            spread: 1.0,
            updates: 1,
        };
        state.grow(&network, closeness);
        state.credit
    }

    fn normalised(weights: &[f64]) -> Vec<f64> {
        let sum: f64 = weights.iter().sum();
        weights.iter().map(|w| w / sum).collect()
    }

    proptest! {
        #[test]
        fn credits_stay_a_distribution_for_any_gain(blocks in blocks(), exponent in -2.0..2.5f64) {
            for form in FORMS {
                let credits = run(form, 10f64.powf(exponent), &blocks);
                let sum: f64 = credits.credit.iter().sum();
                prop_assert!((sum - 1.0).abs() < 1e-12);
                prop_assert!(credits.credit.iter().all(|p| (0.0..=1.0).contains(p)));
                let largest = (blocks[0].len() as f64).ln();
                prop_assert!(credits.entropy >= 0.0 && credits.entropy <= largest + 1e-12);
                prop_assert!((1..=blocks.len()).contains(&credits.updates));
            }
        }

        #[test]
        fn the_closer_candidate_grows_more_and_the_mean_closeness_never_falls(
            weights in prop::collection::vec(0.01..1.0f64, 6),
            closeness in prop::collection::vec(0.0..1.0f64, 6),
            gain in 0.01..300.0f64,
        ) {
            let prior = normalised(&weights);
            for form in FORMS {
                let after = grown(form, gain, &prior, &closeness);
                for i in 0..6 {
                    for j in 0..6 {
                        if closeness[i] >= closeness[j] {
                            let (a, b) = (after[i] / prior[i], after[j] / prior[j]);
                            prop_assert!(a >= b * (1.0 - 1e-9));
                        }
                    }
                }
                let mean = |p: &[f64]| p.iter().zip(&closeness).map(|(p, g)| p * g).sum::<f64>();
                prop_assert!(mean(&after) >= mean(&prior) - 1e-12);
            }
        }

        #[test]
        fn permuting_the_candidates_permutes_their_credits(blocks in blocks()) {
            let turned: Vec<Vec<f64>> = blocks
                .iter()
                .map(|block| block.iter().rev().copied().collect())
                .collect();
            for form in FORMS {
                let (a, b) = (run(form, 15.0, &blocks), run(form, 15.0, &turned));
                for (x, y) in a.credit.iter().zip(b.credit.iter().rev()) {
                    prop_assert!((x - y).abs() < 1e-12);
                }
            }
        }

        #[test]
        fn splitting_a_candidate_leaves_the_others_unchanged(
            weights in prop::collection::vec(0.01..1.0f64, 4),
            closeness in prop::collection::vec(0.0..1.0f64, 4),
            share in 0.1..0.9f64,
        ) {
            let prior = normalised(&weights);
            let (mut split, mut split_closeness) = (prior.clone(), closeness.clone());
            split[0] = prior[0] * share;
            split.push(prior[0] * (1.0 - share));
            split_closeness.push(closeness[0]);
            for form in FORMS {
                let whole = grown(form, 15.0, &prior, &closeness);
                let parts = grown(form, 15.0, &split, &split_closeness);
                for k in 1..4 {
                    prop_assert!((whole[k] - parts[k]).abs() < 1e-12);
                }
                prop_assert!((whole[0] - parts[0] - parts[4]).abs() < 1e-12);
            }
        }

        #[test]
        fn equal_closeness_is_a_fixed_point(
            weights in prop::collection::vec(0.01..1.0f64, 5),
            g in 0.0..1.0f64,
        ) {
            let prior = normalised(&weights);
            for form in FORMS {
                for (before, after) in prior.iter().zip(grown(form, 15.0, &prior, &[g; 5])) {
                    prop_assert!((before - after).abs() < 1e-12);
                }
            }
        }

        #[test]
        fn hedge_does_not_see_a_constant_added_to_the_closeness(
            closeness in prop::collection::vec(0.0..1.0f64, 5),
            constant in -3.0..3.0f64,
        ) {
            let lifted: Vec<f64> = closeness.iter().map(|g| g + constant).collect();
            let plain = grown(Form::Hedge, 15.0, &[0.2; 5], &closeness);
            for (a, b) in plain.iter().zip(grown(Form::Hedge, 15.0, &[0.2; 5], &lifted)) {
                prop_assert!((a - b).abs() < 1e-12);
            }
        }

        #[test]
        fn scaling_the_errors_and_the_spread_together_changes_nothing(
            blocks in blocks(),
            scale in 0.01..100.0f64,
        ) {
            let scaled: Vec<Vec<f64>> =
                blocks.iter().map(|block| block.iter().map(|e| e * scale).collect()).collect();
            let network = Network { form: Form::Hedge, gain: 15.0, spread: 3.0, updates: 12 };
            let wide = Network { spread: 3.0 * scale, ..network };
            let a = assign(&network, blocks[0].len(), |s| &blocks[s]);
            let b = assign(&wide, blocks[0].len(), |s| &scaled[s]);
            prop_assert_eq!(a.updates, b.updates);
            for (x, y) in a.credit.iter().zip(&b.credit) {
                prop_assert!((x - y).abs() < 1e-9);
            }
        }

        #[test]
        fn the_two_forms_differ_by_the_square_of_the_gain(
            closeness in prop::collection::vec(0.0..1.0f64, 5),
        ) {
            let gap = |gain: f64| {
                let paper = grown(Form::Paper, gain, &[0.2; 5], &closeness);
                let hedge = grown(Form::Hedge, gain, &[0.2; 5], &closeness);
                paper.iter().zip(hedge).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
            };
            // Halving ν quarters the gap, up to terms of third order.
            prop_assert!(gap(0.01) <= 0.3 * gap(0.02) + 1e-12);
        }

        #[test]
        fn a_failed_candidate_harms_no_other(blocks in blocks()) {
            for form in FORMS {
                for bad in [f64::NAN, f64::INFINITY] {
                    let mut poisoned = blocks.clone();
                    poisoned.iter_mut().for_each(|block| block.push(bad));
                    let credits = run(form, 15.0, &poisoned);
                    prop_assert!(credits.credit.iter().all(|p| p.is_finite()));
                    let last = *credits.credit.last().unwrap();
                    prop_assert!(credits.credit.iter().all(|p| *p >= last - 1e-12));
                }
            }
        }
    }

    #[test]
    fn equal_errors_keep_uniform_credits_to_the_last_block() {
        let blocks = vec![vec![0.5; 4]; 9];
        for form in FORMS {
            let credits = run(form, 15.0, &blocks);
            assert!(credits.credit.iter().all(|p| (p - 0.25).abs() < 1e-12));
        }
    }

    #[test]
    fn a_single_candidate_has_all_credit_and_stops_at_once() {
        let credits = run(Form::Hedge, 15.0, &vec![vec![1.0]; 9]);
        assert_eq!(credits.credit, [1.0]);
        assert_eq!(credits.updates, 1);
    }
}
