//! Residuals without their memory.
//!
//! `e_t = r_t − Σ a_k·r_{t−k}`, with the coefficients from the residuals' own autocorrelations
//! (Yule–Walker, solved by Levinson's recursion; L. Ljung, *System Identification*, 1999, ch. 10.1).
//! The same filter goes over the derivatives, so that sums over filtered rows are what a generalised
//! least squares would see.

/// How many samples back the filter looks at the most, and which share of the record.
const LONGEST: usize = 25;
const SHARE: usize = 20;

/// A filter that makes residuals white, and as large as unit noise.
#[derive(Clone, Debug)]
pub struct Whitening {
    coefficients: Vec<f64>,
    /// One over the standard deviation of what comes out.
    gain: f64,
}

impl Whitening {
    /// The filter of series of residuals with gaps (no numbers) in them, which are as they are of
    /// unit noise. None where they are too few.
    #[must_use]
    pub fn of(series: &[Vec<f64>]) -> Option<Whitening> {
        let (power, count) = products(series, 0);
        let order = LONGEST.min(count / SHARE);
        if order == 0 || power <= 0.0 {
            return None;
        }
        let correlation = |lag: usize| {
            let (sum, pairs) = products(series, lag);
            // Divided by all, not by the pairs, so that the filter is stable.
            let missing = count.saturating_sub(lag).max(1) as f64 / pairs.max(1) as f64;
            sum * missing / power
        };
        let correlations: Vec<f64> = (0..=order).map(correlation).collect();
        let (coefficients, remaining) = levinson(&correlations);
        let deviation = (power / count as f64 * remaining).sqrt();
        (deviation.is_finite() && deviation > 0.0).then(|| Whitening {
            coefficients,
            gain: 1.0 / deviation,
        })
    }
}

impl Whitening {
    /// A row without what the rows before, the last one first, say of it.
    fn filtered<'a>(&self, row: &[f64], past: impl IntoIterator<Item = &'a Vec<f64>>) -> Vec<f64> {
        let mut filtered = row.to_vec();
        for (coefficient, before) in self.coefficients.iter().zip(past) {
            let pairs = filtered.iter_mut().zip(before);
            pairs.for_each(|(value, before)| *value -= coefficient * before);
        }
        filtered.iter_mut().for_each(|value| *value *= self.gain);
        filtered
    }
}

/// The coefficients that predict a series from its past, and the share of its power that is left.
fn levinson(correlations: &[f64]) -> (Vec<f64>, f64) {
    let mut coefficients: Vec<f64> = Vec::new();
    let mut remaining = 1.0;
    for order in 1..correlations.len() {
        let predictors = coefficients.iter().enumerate();
        let predicted: f64 = predictors
            .map(|(k, a)| a * correlations[order - 1 - k])
            .sum();
        let reflection = (correlations[order] - predicted) / remaining;
        if !reflection.is_finite() || reflection.abs() >= 1.0 {
            break;
        }
        let reversed: Vec<f64> = coefficients.iter().rev().copied().collect();
        for (coefficient, mirrored) in coefficients.iter_mut().zip(reversed) {
            *coefficient -= reflection * mirrored;
        }
        coefficients.push(reflection);
        remaining *= 1.0 - reflection * reflection;
    }
    (coefficients, remaining)
}

fn products(series: &[Vec<f64>], lag: usize) -> (f64, usize) {
    let pairs = series
        .iter()
        .flat_map(|values| values.iter().zip(values.iter().skip(lag)));
    let terms = pairs.map(|(a, b)| a * b).filter(|term| !term.is_nan());
    terms.fold((0.0, 0), |(sum, count), term| (sum + term, count + 1))
}

/// The rows of one output on their way through its filter.
#[derive(Clone, Debug)]
pub struct Filter {
    whitening: Whitening,
    /// The rows before, the last one first.
    past: std::collections::VecDeque<Vec<f64>>,
    /// The experiment and the sample of the last row.
    last: Option<(usize, usize)>,
}

impl Filter {
    /// Nothing seen yet.
    #[must_use]
    pub fn new(whitening: Whitening) -> Filter {
        Filter {
            whitening,
            past: std::collections::VecDeque::new(),
            last: None,
        }
    }

    /// Takes a row and answers it without what its past said of it; none where the past is not
    /// long enough yet, or broken off by a gap.
    pub fn take(&mut self, experiment: usize, sample: usize, row: Vec<f64>) -> Option<Vec<f64>> {
        let goes_on = self
            .last
            .is_some_and(|(of, before)| of == experiment && before + 1 == sample);
        if !goes_on {
            self.past.clear();
        }
        self.last = Some((experiment, sample));
        let order = self.whitening.coefficients.len();
        let filtered =
            (self.past.len() >= order).then(|| self.whitening.filtered(&row, &self.past));
        self.past.push_front(row);
        self.past.truncate(order);
        filtered
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::rng::{Purpose, normal, stream};

    #[test]
    fn levinson_finds_the_coefficients_of_a_second_order_process() {
        // r_t = 1.2·r_{t−1} − 0.5·r_{t−2} + e: rho_1 = 1.2/1.5, rho_2 = 1.2·rho_1 − 0.5.
        let first = 1.2 / 1.5;
        let second = 1.2 * first - 0.5;
        let third = 1.2 * second - 0.5 * first;
        let (coefficients, remaining) = levinson(&[1.0, first, second, third]);
        for (found, expected) in coefficients.iter().zip([1.2, -0.5, 0.0]) {
            assert!((found - expected).abs() < 1e-12, "{coefficients:?}");
        }
        assert!((remaining - (1.0 - 1.2 * first + 0.5 * second)).abs() < 1e-12);
    }

    #[test]
    fn a_coloured_series_comes_out_white_and_of_unit_size() {
        let mut rng = stream(5, 0, Purpose::Noise);
        let mut last = 0.0;
        let series: Vec<f64> = (0..20_000)
            .map(|_| {
                last = 0.9 * last + 0.3 * normal(&mut rng);
                last
            })
            .collect();
        let mut filter = Filter::new(Whitening::of(std::slice::from_ref(&series)).unwrap());
        let rows = series.iter().enumerate();
        let white: Vec<f64> = rows
            .filter_map(|(sample, value)| filter.take(0, sample, vec![*value]))
            .map(|row| row[0])
            .collect();
        let (power, count) = products(std::slice::from_ref(&white), 0);
        // Five standard errors of a mean of squares and of a correlation of 20 000.
        assert!((power / count as f64 - 1.0).abs() < 0.05);
        assert!((products(&[white], 1).0 / power).abs() < 0.036);
    }

    #[test]
    fn a_gap_breaks_the_past_off() {
        let whitening = Whitening {
            coefficients: vec![0.5],
            gain: 1.0,
        };
        let mut filter = Filter::new(whitening);
        assert_eq!(filter.take(0, 0, vec![2.0]), None);
        assert_eq!(filter.take(0, 1, vec![2.0]), Some(vec![1.0]));
        assert_eq!(filter.take(0, 3, vec![2.0]), None);
        assert_eq!(filter.take(1, 4, vec![2.0]), None);
    }
}
