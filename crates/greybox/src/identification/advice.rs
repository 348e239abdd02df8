//! Next steps of a verdict, tried before they are offered.
//!
//! A step changes the specification. Where that changes the problem without the recordings being cut anew, the
//! changed problem is fitted from the estimate at hand and concluded as a job of its own would be, but for the search:
//! by the free run where its residuals are then white, else under the noise model at hand.

use super::JobSpec;
use super::assemble;
use super::tried::{TriedParameter, TriedStep};
use crate::estimation::problem::{Assumed, Coordinate, Problem};
use crate::estimation::process_noise::ProcessNoise;
use crate::estimation::refine;
use crate::estimation::report::Report;
use crate::estimation::sought_noise::{SoughtDisturbance, SoughtNumber};
use crate::uncertainty::{self, Conclusion, CoordinateUncertainty, Refits, Request, SoughtNoise};
use greybox_numerics::statistics::finite;
use greybox_simulation::Accuracy;
use std::sync::atomic::AtomicBool;

/// A job whose next steps are tried.
pub(super) struct Advised<'a> {
    /// The specification of the job.
    pub spec: &'a JobSpec,
    /// The problem of the specification.
    pub problem: &'a Problem,
    /// What the job came to.
    pub conclusion: &'a Conclusion,
}

impl Advised<'_> {
    /// What a changed specification comes to; the inner answer is none where it needs the recordings again, or
    /// cannot be fitted. Answers nothing when `stop` was raised.
    pub fn tried(&self, spec: &JobSpec, stop: &AtomicBool) -> Option<Option<TriedStep>> {
        let problem = match self.asks_the_same(spec) {
            true => assemble::changed(self.problem, self.spec, spec),
            false => None,
        };
        let Some(problem) = problem else {
            return Some(None);
        };
        let start = problem
            .coordinates
            .iter()
            .map(|unknown| self.start(unknown));
        let start: Vec<f64> = start.collect();
        let coarse = refine::descend(&problem, start, Accuracy::Screening, stop)?;
        let fitted = refine::descend(&problem, coarse.positions, Accuracy::Full, stop)?;
        if fitted.cost.is_none() {
            return Some(None);
        }
        let report = Report {
            values: problem.values(&fitted.positions),
            positions: fitted.positions,
            cost: fitted.cost,
            twins: Vec::new(),
            declared_positions: None,
            ..self.conclusion.report.clone()
        };
        let free_run = spec.request(problem.model.description()).of_free_run();
        let under = |noise| {
            let request = Request {
                noise,
                ..free_run.clone()
            };
            uncertainty::conclude(&problem, &report, &request, Refits::default(), stop)
        };
        let concluded = match self.noise() {
            // A listed noise model is fitted to white residuals too.
            SoughtNoise::Listed(listed) => {
                let concluded = under(SoughtNoise::None)?;
                let mut residuals = concluded.analysis.residuals.iter();
                match residuals.all(|output| output.white != Some(false)) {
                    true => concluded,
                    false => under(SoughtNoise::Listed(listed))?,
                }
            }
            noise => under(noise)?,
        };
        Some(Some(self.compared(&concluded)))
    }

    /// Whether a changed specification searches as the job at hand did, and asks the same of the estimate: a longer
    /// search, more time and another comparison of noise models take as long as a job of their own.
    fn asks_the_same(&self, spec: &JobSpec) -> bool {
        spec.method == self.spec.method
            && spec.limits == self.spec.limits
            && spec.uncertainty == self.spec.uncertainty
            && spec.process_noise == self.spec.process_noise
    }

    /// Where the fit of an unknown begins: at the estimate at hand, at what the residuals ask for, or where it is
    /// taken as known.
    fn start(&self, unknown: &Coordinate) -> f64 {
        let Conclusion {
            problem,
            report,
            analysis,
            ..
        } = self.conclusion;
        let mut estimated = problem.coordinates.iter().zip(&report.values);
        let estimated = estimated.find(|(at_hand, _)| at_hand.target == unknown.target);
        let mut lines = analysis.budget.lines.iter();
        let asked = lines.find(|line| line.assumption.target == Assumed::Model(unknown.target));
        let asked = asked.map(|line| {
            line.suggested
                .map_or(line.assumption.value, |(value, _)| value)
        });
        let Coordinate { lower, upper, .. } = *unknown;
        match estimated.map(|(_, value)| *value).or(asked) {
            Some(value) => unknown
                .scale
                .position(value.clamp(lower, upper), lower, upper),
            None => 0.5,
        }
    }

    /// The noise model at hand; where noise models were compared and the free run was taken, all of them again.
    fn noise(&self) -> SoughtNoise {
        let at_hand = self.conclusion.analysis.noise.as_ref();
        match at_hand.map(|noise| &noise.compared[noise.chosen].disturbances) {
            None => SoughtNoise::None,
            Some(disturbances) if disturbances.is_empty() => SoughtNoise::Auto,
            Some(disturbances) => SoughtNoise::Listed(disturbances.iter().map(stated).collect()),
        }
    }

    fn compared(&self, concluded: &Conclusion) -> TriedStep {
        let [after, at_hand] = [concluded, self.conclusion].map(|of| &of.analysis);
        let is_comparable = after.noise.is_some() == at_hand.noise.is_some();
        let criteria = after.criteria.bic.zip(at_hand.criteria.bic);
        let change = criteria.filter(|_| is_comparable);
        let estimates = concluded
            .problem
            .coordinates
            .iter()
            .zip(&concluded.report.values);
        let estimates = estimates.zip(&after.coordinates);
        let parameters = estimates.map(|((unknown, estimate), described)| {
            let tried = TriedParameter {
                estimate: *estimate,
                total_standard_error: described.total_error.and_then(finite),
                trust: described.trust,
                moved: self.moved(unknown, *estimate),
            };
            (unknown.name.clone(), tried)
        });
        TriedStep {
            bic_change: change.and_then(|(after, at_hand)| finite(after - at_hand)),
            trust: after.judgement.trust,
            parameters: parameters.collect(),
        }
    }

    /// How far an estimate moves from the one at hand, in total standard errors of the latter.
    fn moved(&self, unknown: &Coordinate, estimate: f64) -> Option<f64> {
        let Conclusion {
            problem,
            report,
            analysis,
            ..
        } = self.conclusion;
        let mut at_hand = problem.coordinates.iter();
        let place = at_hand.position(|at_hand| at_hand.target == unknown.target)?;
        let CoordinateUncertainty { total_error, .. } = &analysis.coordinates[place];
        finite((estimate - report.values[place]) / (*total_error)?)
    }
}

/// A disturbance whose numbers are looked for where they were looked for before.
fn stated(noise: &ProcessNoise) -> SoughtDisturbance {
    SoughtDisturbance {
        disturbance: noise.disturbance,
        strength: SoughtNumber::Stated(noise.strength),
        time_constant: noise
            .time_constant
            .map_or(SoughtNumber::Open, SoughtNumber::Stated),
    }
}
