//! What is known of the unknowns beside the data. A prior is one more residual of unit noise for
//! each number that it knows, so that the estimate is the maximum a posteriori.

use greybox_numerics::symmetric;
use greybox_simulation::model::Scale;

/// A normal distribution of a value, or of its logarithm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prior {
    /// The mean of the distribution.
    pub middle: f64,
    /// The standard deviation of the distribution.
    pub deviation: f64,
    /// Whether the distribution is that of the value or of its logarithm.
    pub scale: Scale,
}

impl Prior {
    /// How many standard deviations a value is off: one more residual of unit noise.
    #[must_use]
    pub fn residual(self, value: f64) -> f64 {
        let value = match self.scale {
            Scale::Linear => value,
            Scale::Log => libm::log(value),
        };
        (value - self.middle) / self.deviation
    }

    /// The derivative of the residual by the value.
    #[must_use]
    pub fn slope(self, value: f64) -> f64 {
        match self.scale {
            Scale::Linear => 1.0 / self.deviation,
            Scale::Log => 1.0 / (self.deviation * value),
        }
    }
}

/// A residual of a prior.
#[derive(Clone, Debug, PartialEq)]
pub struct PriorRow {
    /// How many standard deviations it is off.
    pub residual: f64,
    /// The places of the coordinates that it depends on, each with the derivative by its position.
    pub slopes: Vec<(usize, f64)>,
}

impl PriorRow {
    /// The derivative by the position of a coordinate.
    #[must_use]
    pub fn slope(&self, coordinate: usize) -> f64 {
        let mut slopes = self.slopes.iter();
        let slope = slopes.find(|(index, _)| *index == coordinate);
        slope.map_or(0.0, |(_, slope)| *slope)
    }
}

/// A normal distribution of several parameters that all experiments share, or of their logarithms.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPrior {
    /// The parameters, by their places in the model's description.
    pub parameters: Vec<usize>,
    scale: Scale,
    /// For each parameter its mean and its standard deviation, along the scale.
    marginals: Vec<(f64, f64)>,
    /// What makes the deviations from the means independent and of unit size: W with WᵀW the
    /// inverse of the covariance.
    whitening: Vec<Vec<f64>>,
}

impl JointPrior {
    /// From the means and the covariance of the values; on a log scale those of the log-normal
    /// distribution that has them. None where the covariance is not positive definite.
    #[must_use]
    pub fn new(
        parameters: Vec<usize>,
        scale: Scale,
        means: &[f64],
        covariance: &[Vec<f64>],
    ) -> Option<JointPrior> {
        let n = parameters.len();
        let entry = |row: usize, column: usize| match scale {
            Scale::Linear => covariance[row][column],
            Scale::Log => libm::log1p(covariance[row][column] / (means[row] * means[column])),
        };
        let covariance: Vec<Vec<f64>> = (0..n)
            .map(|row| (0..n).map(|column| entry(row, column)).collect())
            .collect();
        let middle = |index: usize| match scale {
            Scale::Linear => means[index],
            Scale::Log => libm::log(means[index]) - 0.5 * covariance[index][index],
        };
        let marginal = |index: usize| (middle(index), covariance[index][index].sqrt());
        let whitening = symmetric::whitening(&covariance)?;
        Some(JointPrior {
            parameters,
            scale,
            marginals: (0..n).map(marginal).collect(),
            whitening,
        })
    }

    /// What the prior knows of one parameter alone.
    #[must_use]
    pub fn marginal(&self, parameter: usize) -> Option<Prior> {
        let index = self
            .parameters
            .iter()
            .position(|index| *index == parameter)?;
        let (middle, deviation) = self.marginals[index];
        Some(Prior {
            middle,
            deviation,
            scale: self.scale,
        })
    }

    /// Draws the means of the prior anew about these values, with numbers of unit noise.
    pub fn draw_about(&mut self, values: &[f64], mut noise: Vec<f64>) {
        // The inverse of a lower triangle, row by row.
        for row in 0..noise.len() {
            let above: f64 = (0..row).map(|k| self.whitening[row][k] * noise[k]).sum();
            noise[row] = (noise[row] - above) / self.whitening[row][row];
        }
        let drawn = values.iter().zip(noise);
        for ((middle, _), (value, off)) in self.marginals.iter_mut().zip(drawn) {
            *middle = off
                + match self.scale {
                    Scale::Linear => *value,
                    Scale::Log => libm::log(*value),
                };
        }
    }

    /// Returns the residuals of the prior where its parameters have these values, with these
    /// derivatives by the positions of the coordinates at these places.
    #[must_use]
    pub fn rows(&self, values: &[(f64, f64)], places: &[Option<usize>]) -> Vec<PriorRow> {
        let members = values.iter().zip(&self.marginals);
        let deviations: Vec<(f64, f64)> = members
            .map(|((value, slope), (middle, _))| match self.scale {
                Scale::Linear => (value - middle, *slope),
                Scale::Log => (libm::log(*value) - middle, slope / value),
            })
            .collect();
        let row = |weights: &Vec<f64>| {
            let terms = weights.iter().zip(&deviations).zip(places);
            PriorRow {
                residual: terms
                    .clone()
                    .map(|((weight, (off, _)), _)| weight * off)
                    .sum(),
                slopes: terms
                    .filter_map(|((weight, (_, slope)), place)| Some(((*place)?, weight * slope)))
                    .collect(),
            }
        };
        self.whitening.iter().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_of_squares_is_the_mahalanobis_distance() {
        // Deviations 2 and 3 with correlation 0.5; (1, −1) away:
        // [a b]·C⁻¹·[a b] with C = [[4, 3], [3, 9]], det 27: (9·1 + 2·3·1 + 4·1)/27.
        let joint = JointPrior::new(
            vec![4, 1],
            Scale::Linear,
            &[10.0, 20.0],
            &[vec![4.0, 3.0], vec![3.0, 9.0]],
        );
        let joint = joint.unwrap();
        let rows = joint.rows(&[(11.0, 1.0), (19.0, 1.0)], &[Some(0), None]);
        let sum: f64 = rows.iter().map(|row| row.residual.powi(2)).sum();
        assert!((sum - 19.0 / 27.0).abs() < 1e-14);
        assert!(rows.iter().all(|row| row.slopes.len() == 1));
        let marginal = joint.marginal(1).unwrap();
        assert_eq!((marginal.middle, marginal.deviation), (20.0, 3.0));
        assert_eq!(joint.marginal(0), None);
    }

    #[test]
    fn a_covariance_that_is_none_is_refused() {
        let of = |covariance: &[Vec<f64>]| {
            JointPrior::new(vec![0, 1], Scale::Linear, &[1.0, 1.0], covariance)
        };
        assert!(of(&[vec![1.0, 1.1], vec![1.1, 1.0]]).is_none());
        assert!(of(&[vec![1.0, 1.0], vec![1.0, 1.0]]).is_none());
        assert!(of(&[vec![1.0, 0.9], vec![0.9, 1.0]]).is_some());
    }
}
