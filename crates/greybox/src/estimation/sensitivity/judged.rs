//! What the candidates of a neighbourhood cost, and how likely they make the data.

use super::Neighbourhood;

impl Neighbourhood<'_> {
    /// The cost of one of the others; infinite where it failed.
    #[must_use]
    pub fn cost(&self, other: usize) -> f64 {
        self.cost_of(self.first_other + other)
    }

    /// The lowest cost of one of the others with all its innovations' deviations larger by one factor, and the
    /// factor; infinite where it failed.
    #[must_use]
    pub fn concentrated_cost(&self, other: usize) -> (f64, f64) {
        let member = self.first_other + other;
        let Some(innovations) = self.problem.innovations.as_deref() else {
            return (f64::INFINITY, 1.0);
        };
        if self.failure(member).is_some() {
            return (f64::INFINITY, 1.0);
        }
        let (mut squares, mut logarithms, mut count) = (0.0, 0.0, 0.0);
        for place in super::places(self.problem) {
            if let Some(residual) = self.residual(member, place) {
                let variance = self.scale_of(member, place).powi(2);
                let ratio = variance / innovations.least_variances[place.output];
                squares += residual * residual;
                logarithms += libm::log(ratio);
                count += 1.0;
            }
        }
        let factor: f64 = squares / count;
        let (priors, n_priors) = self.problem.prior_sum(&self.candidates[member]);
        let sum = priors + logarithms + count * (1.0 + libm::log(factor));
        let cost = sum / (n_priors as f64 + 2.0 * count);
        match cost.is_finite() {
            true => (cost, factor.sqrt()),
            false => (f64::INFINITY, 1.0),
        }
    }

    /// The cost of the candidate itself where innovations are compared.
    #[must_use]
    pub fn likelihood_cost(&self) -> Option<f64> {
        self.problem.innovations.as_ref().map(|_| self.cost_of(0))
    }

    /// The natural logarithm of the likelihood of the data at one of the others, where innovations are
    /// compared and their simulation does not fail.
    #[must_use]
    pub fn log_likelihood(&self, other: usize) -> Option<f64> {
        let member = self.first_other + other;
        if self.problem.innovations.is_none() || self.failure(member).is_some() {
            return None;
        }
        let terms = super::places(self.problem).filter_map(|place| {
            let residual = self.residual(member, place)?;
            let variance = self.scale_of(member, place).powi(2);
            let scale = libm::log(2.0 * std::f64::consts::PI * variance);
            Some(-0.5 * (scale + residual * residual))
        });
        let sum: f64 = terms.sum();
        sum.is_finite().then_some(sum)
    }

    /// The mean over all samples of the variance of each compared output at one of the others, where
    /// innovations are compared.
    #[must_use]
    pub fn mean_variances(&self, other: usize) -> Vec<f64> {
        let member = self.first_other + other;
        let n_outputs = self.problem.outputs.len();
        let mut sums = vec![0.0; n_outputs];
        let mut samples = 0_usize;
        for place in super::places(self.problem) {
            sums[place.output] += self.scale_of(member, place).powi(2);
            samples += usize::from(place.output == 0);
        }
        sums.iter_mut().for_each(|sum| *sum /= samples as f64);
        sums
    }

    fn cost_of(&self, member: usize) -> f64 {
        if self.failure(member).is_some() {
            return f64::INFINITY;
        }
        let priors = self.problem.prior_sum(&self.candidates[member]);
        let innovations = self.problem.innovations.as_deref();
        let (sum, count) = super::places(self.problem).fold(priors, |(sum, count), place| {
            let Some(residual) = self.residual(member, place) else {
                return (sum, count);
            };
            let residual = self.problem.loss.bent(residual);
            let sum = sum + residual * residual;
            let Some(innovations) = innovations else {
                return (sum, count + 1);
            };
            let variance = self.scale_of(member, place).powi(2);
            let ratio = variance / innovations.least_variances[place.output];
            (sum + libm::log(ratio), count + 2)
        });
        let cost = sum / count as f64;
        if cost.is_finite() {
            cost
        } else {
            f64::INFINITY
        }
    }
}
