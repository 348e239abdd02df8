//! Whether residuals pass for white noise.
//!
//! The autocorrelation of white noise at each of the lags 1 to 25 stays within ±2.58/√n in 99 of 100
//! cases (L. Ljung, *System Identification*, 1999, ch. 16). With many thousand samples that finds
//! colour too faint to matter, so correlations below [`NEGLIGIBLE_CORRELATION`] do not count. One
//! lag may lie outside by chance, but not far outside: a single lag beyond 1.5 times the limit is
//! colour. Colour that is spread over many lags shows in the statistic of G. M. Ljung and G. E. P.
//! Box ("On a measure of lack of fit in time series models", Biometrika 65, 1978).
//!
//! Of 20 000 records of white noise 2.8 % were called coloured at n = 101, 3.0 % at 400 and 0.01 % at
//! 2000; of 4000 records none at 20 000 (the test `white_noise_is_seldom_called_coloured` takes fewer).

/// Lags that are looked at.
pub(super) const LAGS: usize = 25;
/// The 99 % point of the normal distribution, two-sided.
pub(super) const NORMAL_99: f64 = 2.576;
/// Correlations below this change an interval by less than its own uncertainty.
pub(super) const NEGLIGIBLE_CORRELATION: f64 = 0.1;
/// No lag of white noise lies beyond so many times its limit: at the smallest record that is tested
/// that is 3.9 standard deviations, which one lag of 10 000 exceeds.
const FAR_OUTSIDE: f64 = 1.5;
/// Lags that may lie outside their limits by chance.
const OUTSIDE_BY_CHANCE: usize = 1;
/// The probability below which the statistic of Ljung and Box speaks.
const LJUNG_BOX_LEVEL: f64 = 1e-3;

/// The autocorrelation of residuals.
pub(super) struct Whiteness {
    /// Residuals that are there.
    count: usize,
    /// One for each lag from 1 on at which there are pairs of residuals.
    lags: Vec<Lag>,
}

/// The correlation of residuals that stand some samples apart.
struct Lag {
    correlation: f64,
    /// Pairs of residuals so far apart.
    pairs: usize,
}

impl Lag {
    /// The correlation that counts from here on.
    fn limit(&self) -> f64 {
        (NORMAL_99 / (self.pairs as f64).sqrt()).max(NEGLIGIBLE_CORRELATION)
    }

    fn is_beyond(&self, limits: f64) -> bool {
        self.correlation.abs() > limits * self.limit()
    }
}

impl Whiteness {
    /// Correlates the residuals of an output, a series for each experiment.
    pub(super) fn of(series: &[Vec<f64>]) -> Whiteness {
        let (sum, count) = products(series, 0);
        let mean_square = sum / count.max(1) as f64;
        let lag = |lag: usize| {
            let (sum, pairs) = products(series, lag);
            (pairs > 0 && mean_square > 0.0).then(|| Lag {
                correlation: sum / pairs as f64 / mean_square,
                pairs,
            })
        };
        Whiteness {
            count,
            lags: (1..=LAGS).filter_map(lag).collect(),
        }
    }

    /// Whether there are enough residuals to say anything.
    fn is_enough(&self) -> bool {
        self.count > 4 * LAGS && self.lags.len() == LAGS
    }

    /// Whether the residuals pass for white noise; none where they are too few.
    pub(super) fn is_white(&self) -> Option<bool> {
        let p = self.ljung_box_p()?;
        let outside = self.lags.iter().filter(|lag| lag.is_beyond(1.0)).count();
        let mut lags = self.lags.iter();
        let is_far_outside = lags.any(|lag| lag.is_beyond(FAR_OUTSIDE));
        let mut lags = self.lags.iter();
        let matters = lags.any(|lag| lag.correlation.abs() > NEGLIGIBLE_CORRELATION);
        let is_unlikely = matters && p < LJUNG_BOX_LEVEL;
        Some(outside <= OUTSIDE_BY_CHANCE && !is_far_outside && !is_unlikely)
    }

    /// The correlation of neighbouring residuals.
    pub(super) fn lag_1(&self) -> Option<f64> {
        self.lags.first().map(|lag| lag.correlation)
    }

    /// The probability that white noise has a larger statistic of Ljung and Box,
    /// `Σ ρ²·m·(n + 2)/n` with m pairs of a lag; none where the residuals are too few.
    pub(super) fn ljung_box_p(&self) -> Option<f64> {
        let n = self.count as f64;
        let terms = self.lags.iter().map(|lag| {
            let Lag { correlation, pairs } = *lag;
            correlation * correlation * pairs as f64 * (n + 2.0) / n
        });
        self.is_enough().then(|| chi_square_tail(terms.sum()))
    }

    /// How many independent residuals the residuals are worth: `n/(1 + 2·Σρ)` over the lags up to
    /// the first correlation within its limit; none where the residuals are too few.
    pub(super) fn effective_samples(&self) -> Option<f64> {
        let lags = self.lags.iter().take_while(|lag| lag.is_beyond(1.0));
        let memory: f64 = lags.map(|lag| lag.correlation).sum();
        let samples = self.count as f64 / (1.0 + 2.0 * memory).max(1.0);
        self.is_enough().then_some(samples)
    }
}

/// The sum of the products of residuals that stand `lag` samples apart, and how many there are.
pub(super) fn products(series: &[Vec<f64>], lag: usize) -> (f64, usize) {
    let mut total = (0.0, 0);
    for values in series {
        let pairs = values.iter().zip(values.iter().skip(lag));
        for product in pairs
            .map(|(a, b)| a * b)
            .filter(|product| !product.is_nan())
        {
            total.0 += product;
            total.1 += 1;
        }
    }
    total
}

/// The probability that the sum of the squares of [`LAGS`] standard normal numbers is larger:
/// `erfc(√(x/2)) + √(2/π)·e^(−x/2)·Σ x^(k − ½)/(1·3·…·(2k − 1))`, k from 1 to 12, for 25 of them
/// (M. Abramowitz and I. A. Stegun, *Handbook of Mathematical Functions*, 1964, 26.4.4).
fn chi_square_tail(x: f64) -> f64 {
    let root = x.sqrt();
    let mut term = root;
    let mut sum = 0.0;
    for k in 1..=LAGS / 2 {
        sum += term;
        term *= x / (2 * k + 1) as f64;
    }
    let density = (2.0 / std::f64::consts::PI).sqrt() * libm::exp(-0.5 * x);
    let tail = libm::erfc(root / std::f64::consts::SQRT_2);
    // An infinite sum of squares is 0 times infinity above.
    if sum.is_finite() {
        tail + density * sum
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::rng::{Purpose, normal, stream};

    fn white(seed: u64, count: usize) -> Vec<f64> {
        let mut rng = stream(seed, 0, Purpose::Noise);
        (0..count).map(|_| normal(&mut rng)).collect()
    }

    #[test]
    fn the_tail_of_chi_square_is_that_of_the_tables() {
        // The 95 % and the 99 % point of 25 degrees of freedom (Abramowitz and Stegun, table 26.8).
        assert!((chi_square_tail(37.6525) - 0.05).abs() < 1e-5);
        assert!((chi_square_tail(44.3141) - 0.01).abs() < 1e-5);
        assert_eq!(chi_square_tail(0.0), 1.0);
        assert_eq!(chi_square_tail(f64::INFINITY), 0.0);
    }

    #[test]
    fn white_noise_is_seldom_called_coloured() {
        let share = |count: usize, records: u64| {
            let is_coloured = |seed: &u64| {
                let whiteness = Whiteness::of(&[white(*seed, count)]);
                whiteness.is_white() == Some(false)
            };
            (0..records).filter(is_coloured).count() as f64 / records as f64
        };
        for (count, records) in [(101, 1000), (400, 1000), (2000, 200), (20_000, 20)] {
            let share = share(count, records);
            println!("{count}: {:.2} %", 100.0 * share);
            // 3 % and three standard deviations of 1000 records.
            assert!(share < 0.046, "{count}: {share}");
        }
    }

    #[test]
    fn one_lag_far_outside_is_colour_whatever_the_others_are() {
        // A moving average of 0.4 has a correlation of 0.345 at lag 1 and none beyond.
        let noise = white(3, 2001);
        let pairs = noise.windows(2);
        let values: Vec<f64> = pairs.map(|pair| pair[1] + 0.4 * pair[0]).collect();
        let whiteness = Whiteness::of(&[values]);
        assert!((whiteness.lag_1().unwrap() - 0.345).abs() < 0.06);
        assert_eq!(whiteness.is_white(), Some(false));
    }
}
