//! The default parameters of covariance matrix adaptation (table 1 of the tutorial that
//! [`super`] cites).

/// What depends on the numbers of unknowns and of candidates only.
#[derive(Clone, Debug)]
pub struct Rates {
    /// w, for the best candidate first.
    pub weights: Vec<f64>,
    /// μ_eff: how many candidates the mean is in effect made of.
    pub effective: f64,
    /// c_σ.
    pub step_path: f64,
    /// d_σ.
    pub step_damping: f64,
    /// c_c.
    pub path: f64,
    /// c_1.
    pub rank_one: f64,
    /// c_μ.
    pub rank_many: f64,
    /// How long a standard normal vector is on average.
    pub usual_length: f64,
}

impl Rates {
    /// For so many unknowns and so many candidates, at least two.
    #[must_use]
    pub fn of(unknowns: usize, candidates: usize) -> Rates {
        let n = unknowns as f64;
        let middle = libm::log((candidates as f64 + 1.0) / 2.0);
        let raw = (1..=candidates).map(|rank| middle - libm::log(rank as f64));
        let (better, worse): (Vec<f64>, Vec<f64>) = raw.partition(|weight| *weight > 0.0);
        let (effective, against) = (effective(&better), effective(&worse));
        let step_path = (effective + 2.0) / (n + effective + 5.0);
        let rank_one = 2.0 / ((n + 1.3) * (n + 1.3) + effective);
        let rank_many =
            2.0 * (0.25 + effective + 1.0 / effective - 2.0) / ((n + 2.0) * (n + 2.0) + effective);
        let rank_many = rank_many.min(1.0 - rank_one);
        let most_against = (1.0 + rank_one / rank_many)
            .min(1.0 + 2.0 * against / (effective + 2.0))
            .min((1.0 - rank_one - rank_many) / (n * rank_many));
        let spread = (((effective - 1.0) / (n + 1.0)).sqrt() - 1.0).max(0.0);
        Rates {
            weights: share(&better, 1.0)
                .chain(share(&worse, most_against))
                .collect(),
            effective,
            step_path,
            step_damping: 1.0 + 2.0 * spread + step_path,
            path: (4.0 + effective / n) / (n + 4.0 + 2.0 * effective / n),
            rank_one,
            rank_many,
            usual_length: n.sqrt() * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n)),
        }
    }
}

fn effective(weights: &[f64]) -> f64 {
    let sum: f64 = weights.iter().sum();
    sum * sum / weights.iter().map(|weight| weight * weight).sum::<f64>()
}

/// The weights so that their sizes add up to a total.
fn share(weights: &[f64], total: f64) -> impl Iterator<Item = f64> {
    let sum: f64 = weights.iter().map(|weight| weight.abs()).sum();
    weights.iter().map(move |weight| weight * total / sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the reference implementation prints when it begins, for its default numbers of
    /// candidates: the effective number of parents to a tenth, the first weight in whole
    /// per cent.
    #[test]
    fn the_weights_are_those_of_the_reference_implementation() {
        for (unknowns, candidates, effective, first) in [
            (2, 6, 2.0, 63.0),
            (3, 7, 2.3, 58.0),
            (4, 8, 2.6, 52.0),
            (10, 10, 3.2, 45.0),
        ] {
            let rates = Rates::of(unknowns, candidates);
            assert_eq!((rates.effective * 10.0).round() / 10.0, effective);
            assert_eq!((rates.weights[0] * 100.0).floor(), first);
        }
    }

    #[test]
    fn whatever_the_numbers_the_covariance_keeps_a_part_of_itself_and_of_its_size() {
        for unknowns in 1..=40 {
            for candidates in (2..100).chain([1000, 10_000]) {
                let rates = Rates::of(unknowns, candidates);
                let better = rates.weights.iter().filter(|weight| **weight > 0.0);
                assert!((better.sum::<f64>() - 1.0).abs() < 1e-9);
                assert!(rates.weights.is_sorted_by(|a, b| a >= b));
                // At the worst all bad moves go one way, each as long as a move is on average.
                let against: f64 = rates
                    .weights
                    .iter()
                    .map(|weight| weight.min(0.0).abs())
                    .sum();
                let kept = 1.0 - rates.rank_one - rates.rank_many * (1.0 - against);
                let lost = rates.rank_many * against * f64::from(unknowns as u32);
                assert!(kept - lost > -1e-12, "{unknowns}, {candidates}: {rates:?}");
                let shares = [rates.step_path, rates.path, rates.rank_one, rates.rank_many];
                let are_shares = shares.iter().all(|share| (0.0..=1.0).contains(share));
                assert!(are_shares, "{unknowns}, {candidates}: {rates:?}");
                assert!(rates.step_damping.is_finite() && rates.step_damping >= 1.0);
            }
        }
    }
}
