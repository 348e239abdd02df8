//! What an experiment would bring.

use super::information::{Known, sum, triangle};
use super::present::Present;
use crate::estimation::problem::{Experiment, Problem};
use crate::estimation::sensitivity::SensitivityError;
use greybox_numerics::least_squares::Triangle;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// What an experiment would bring.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Assessment {
    /// Half the logarithm of the determinant of the wanted unknowns' information, averaged over the
    /// points; larger is better.
    pub score: f64,
    /// What would be known of each unknown at the first point; nothing where the experiment cannot
    /// be simulated there.
    pub known: Option<Vec<Known>>,
    /// Points at which it cannot be simulated.
    pub failed_points: usize,
}

impl Present {
    /// What an experiment would bring. Answers nothing when `stop` was raised.
    #[must_use]
    pub fn assess(
        &self,
        next: &Problem,
        experiment: Experiment,
        stop: &AtomicBool,
    ) -> Option<Assessment> {
        let mut problem = next.clone();
        problem.experiments = Arc::new(vec![experiment]);
        let weights = vec![1.0; problem.outputs.len()];
        let points = self.points.par_iter();
        let seen: Vec<_> = points
            .map(|positions| triangle(&problem, positions, &weights, stop))
            .collect();
        let mut sums = Vec::with_capacity(seen.len());
        for seen in seen {
            sums.push(match seen {
                Ok(rows) => Some(sum(&self.known, &rows)).filter(Triangle::is_usable),
                Err(SensitivityError::Interrupted) => return None,
                Err(SensitivityError::Failed(_)) => None,
            });
        }
        Some(self.assessment(&sums))
    }

    /// What follows from the information at each point; none where there is nothing new.
    pub(super) fn assessment(&self, sums: &[Option<Triangle>]) -> Assessment {
        let scores = sums.iter().map(|sum| match sum {
            Some(sum) => self.score(sum),
            None => self.score(&self.known),
        });
        Assessment {
            score: scores.sum::<f64>() / sums.len() as f64,
            known: sums[0].as_ref().and_then(|sum| self.known_by(sum)),
            failed_points: sums.iter().filter(|sum| sum.is_none()).count(),
        }
    }
}
