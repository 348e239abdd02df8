//! How much a residual counts.
//!
//! Squared residuals let a few wild samples (a spike, a dropped telegram) pull the estimate away.
//! Huber's loss counts a residual beyond the threshold k linearly (P. J. Huber, "Robust estimation
//! of a location parameter", Annals of Mathematical Statistics 35, 1964): `ρ(r) = r²` for
//! `|r| ≤ k`, `2k|r| − k²` beyond. Residuals are in units of their output's scale.

/// The loss of a residual.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loss {
    /// The square.
    #[default]
    Squared,
    /// The square up to this threshold, a line beyond.
    Huber(f64),
}

impl Loss {
    /// The residual bent so that its square is the loss.
    #[must_use]
    pub fn bent(self, residual: f64) -> f64 {
        match self {
            Loss::Huber(threshold) if residual.abs() > threshold => {
                let loss = 2.0 * threshold * residual.abs() - threshold * threshold;
                loss.sqrt().copysign(residual)
            }
            _ => residual,
        }
    }

    /// How fast the bent residual grows with the residual.
    #[must_use]
    pub fn slope(self, residual: f64) -> f64 {
        match self {
            Loss::Huber(threshold) if residual.abs() > threshold => {
                threshold / self.bent(residual).abs()
            }
            _ => 1.0,
        }
    }

    /// Half the derivative of the loss: the residual, held within the threshold.
    #[must_use]
    pub fn score(self, residual: f64) -> f64 {
        match self {
            Loss::Huber(threshold) => residual.clamp(-threshold, threshold),
            Loss::Squared => residual,
        }
    }

    /// Whether the residual counts less than its square.
    #[must_use]
    pub fn is_outlier(self, residual: f64) -> bool {
        matches!(self, Loss::Huber(threshold) if residual.abs() > threshold)
    }

    /// The mean square of the scores of normal residuals of unit variance.
    #[must_use]
    pub fn normal_mean_square_score(self) -> f64 {
        match self {
            Loss::Squared => 1.0,
            Loss::Huber(k) => {
                let density = (-0.5 * k * k).exp() / (2.0 * std::f64::consts::PI).sqrt();
                let beyond = libm::erfc(k / std::f64::consts::SQRT_2);
                (1.0 - beyond) - 2.0 * k * density + k * k * beyond
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::rng::{Purpose, normal, stream};

    const HUBER: Loss = Loss::Huber(1.5);

    #[test]
    fn the_loss_is_the_square_inside_and_a_line_that_goes_on_smoothly_outside() {
        let loss = |residual: f64| HUBER.bent(residual).powi(2);
        assert_eq!(loss(-1.2), 1.44);
        assert!((loss(4.0) - (2.0 * 1.5 * 4.0 - 2.25)).abs() < 1e-12);
        assert!((loss(5.0) - loss(4.0) - 3.0).abs() < 1e-12);
        assert!((loss(1.5 + 1e-9) - 2.25).abs() < 1e-8);
        assert_eq!(Loss::Squared.bent(1e3), 1e3);
    }

    #[test]
    fn slope_and_score_are_the_derivatives() {
        for residual in [-9.0, -1.6, -0.3, 1.0, 1.7, 40.0] {
            let h = 1e-6;
            let quotient = (HUBER.bent(residual + h) - HUBER.bent(residual - h)) / (2.0 * h);
            assert!((HUBER.slope(residual) - quotient).abs() < 1e-6);
            let loss = |residual: f64| HUBER.bent(residual).powi(2);
            let quotient = (loss(residual + h) - loss(residual - h)) / (4.0 * h);
            assert!((HUBER.score(residual) - quotient).abs() < 1e-6);
        }
    }

    #[test]
    fn the_mean_square_score_is_that_of_a_sample_of_normal_numbers() {
        let mut rng = stream(3, 0, Purpose::Noise);
        let n = 200_000;
        let squares = (0..n).map(|_| HUBER.score(normal(&mut rng)).powi(2));
        let mean = squares.sum::<f64>() / f64::from(n);
        // Six standard errors of the mean of squares between 0 and 2.25.
        assert!((mean - HUBER.normal_mean_square_score()).abs() < 0.01);
    }
}
