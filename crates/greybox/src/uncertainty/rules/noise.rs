//! What the residuals say against a result: their size against the declared noise, their memory,
//! and whether they follow an input.

use super::Case;
use crate::uncertainty::fit::OutputFit;
use crate::uncertainty::residuals::{InputCorrelation, ResidualReport};
use crate::uncertainty::verdict::{Doubt, Rule, Subject, Trust};

/// chi²/n above which the model is wrong.
const MISFIT: f64 = 1.5;
/// chi²/n above which something is left over.
const SLIGHT_MISFIT: f64 = 1.15;
/// A correlation of simulated and measured samples below which the two go opposite ways.
const OPPOSITE: f64 = -0.5;
/// A correlation of errors of prediction with an input beyond which the trust is low.
const GRAVE_CORRELATION: f64 = 0.25;
/// A fit below which a noise level would have to be declared to tell noise from misfit [%].
const PLAIN_FIT: f64 = 90.0;

impl Case<'_> {
    /// Outputs that go the wrong way, and residuals that no noise explains.
    pub(super) fn noise(&self) -> Vec<Doubt> {
        let residuals = self.analysis.residuals.iter();
        let pairs = residuals.zip(&self.analysis.estimation_fit).enumerate();
        pairs
            .flat_map(|(output, (residual, fit))| {
                let name = &self.problem.outputs[output].name;
                let left = self.left_over(output, residual, fit);
                let doubts = [opposite(name, fit), left];
                let doubts = doubts.into_iter().flatten();
                doubts.map(move |doubt| doubt.about(Subject::Output(output)))
            })
            .collect()
    }

    /// Residuals that no noise explains. Where noise models were compared, the total intervals cover what each of
    /// them says, so that a model that explains the output does not lose all trust.
    fn left_over(
        &self,
        output: usize,
        residual: &ResidualReport,
        fit: &OutputFit,
    ) -> Option<Doubt> {
        let compared = &self.problem.outputs[output];
        let Some(noise) = &self.analysis.noise else {
            return unexplained(&compared.name, residual, fit);
        };
        let is_declared = compared.noise_std.is_some();
        if !is_declared && !noise.disturbances.is_empty() {
            return None;
        }
        let mut residual = residual.clone();
        if !is_declared {
            // The noise model's own estimate of a sensor's noise declares nothing.
            residual.chi_square_per_sample = None;
            residual.is_noise_overstated = false;
        }
        let doubt = unexplained(&compared.name, &residual, fit)?;
        let is_explained = fit.fit_percent.is_some_and(|percent| percent >= PLAIN_FIT);
        Some(match is_explained {
            true => doubt.at_least(Trust::Moderate),
            false => doubt,
        })
    }

    /// Residuals with a memory.
    pub(super) fn colour(&self) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        for (output, residual) in self.analysis.residuals.iter().enumerate() {
            if residual.white == Some(false) {
                let detail = format!(
                    "the residuals of `{}` are not white (correlation {:.2} with the next sample): \
                     the model misses dynamics; the intervals are widened for it",
                    self.problem.outputs[output].name,
                    residual.lag_1_autocorrelation.unwrap_or_default()
                );
                let doubt = Doubt::new(Rule::ResidualsNotWhite, Trust::Moderate, detail);
                doubts.push(doubt.about(Subject::Output(output)));
            }
        }
        doubts
    }

    /// Residuals that are correlated with an input.
    pub(super) fn inputs(&self) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        for (output, residual) in self.analysis.residuals.iter().enumerate() {
            let inputs = self.problem.model.description().inputs.iter();
            let followed = inputs.filter_map(|input| residual.inputs.get_key_value(&*input.name));
            for (input, correlation) in followed.filter(|(_, correlation)| correlation.significant)
            {
                let detail = format!(
                    "the residuals of `{}` follow the input `{}` (correlation {:.2} with what it \
                     was {} samples before): the model misses a part of its effect, such as a \
                     gain, an offset or a delay",
                    self.problem.outputs[output].name,
                    input,
                    correlation.correlation.unwrap_or_default(),
                    correlation.lag
                );
                let doubt = Doubt::new(
                    Rule::ResidualsFollowInput,
                    self.trust_beside(correlation),
                    detail,
                );
                doubts.push(doubt.about(Subject::Output(output)));
            }
        }
        doubts
    }

    /// The trust beside residuals that follow an input. A right noise model leaves errors of prediction that follow
    /// nothing: where they follow an input closely, the filter has excused a part of the model.
    fn trust_beside(&self, correlation: &InputCorrelation) -> Trust {
        let closely = correlation.correlation.unwrap_or_default().abs() > GRAVE_CORRELATION;
        match closely && self.analysis.noise.is_some() {
            true => Trust::Low,
            false => Trust::Moderate,
        }
    }
}

/// An output that is simulated against what was measured.
fn opposite(name: &str, fit: &OutputFit) -> Option<Doubt> {
    let rho = fit.correlation.filter(|rho| *rho < OPPOSITE)?;
    let detail = format!(
        "`{name}` is simulated against what was measured (correlation {rho:.2}): a sign is wrong, \
         of the signal in the recording or of a gain in the model"
    );
    Some(Doubt::new(Rule::OppositeSign, Trust::Low, detail))
}

/// Residuals of an output that the declared noise does not explain, that contradict the declared
/// noise, or of which no noise is declared.
fn unexplained(name: &str, residual: &ResidualReport, fit: &OutputFit) -> Option<Doubt> {
    let (rule, trust, detail) = match residual.chi_square_per_sample {
        Some(_) if residual.is_noise_overstated => return Some(overstated(name, residual, fit)),
        Some(chi_square) if chi_square > MISFIT && is_plain_noise(residual) => {
            return Some(understated(name, chi_square));
        }
        Some(chi_square) if chi_square > MISFIT => {
            let detail = format!(
                "the residuals of `{name}` are {:.2} times the declared noise (chi²/n \
                 {chi_square:.2}): the model misses an effect, and the parameters pay for it; \
                 free an effect such as friction, dead band, offset or gain",
                chi_square.sqrt()
            );
            (Rule::Misfit, Trust::Low, detail)
        }
        Some(chi_square) if chi_square > SLIGHT_MISFIT => {
            let detail = format!(
                "the residuals of `{name}` are somewhat larger than the declared noise (chi²/n \
                 {chi_square:.2}); check the noise level and try a richer model"
            );
            (Rule::SlightMisfit, Trust::Moderate, detail)
        }
        Some(_) => return None,
        None if residual.is_misfit_by_colour() => {
            let detail = format!(
                "no noise level of `{name}` is declared and what is left is no white noise \
                 (correlation {:.2} with the next sample): it is taken for what the model \
                 misses; free an effect, or give outputs.{name}.noise_std",
                residual.lag_1_autocorrelation.unwrap_or_default()
            );
            (Rule::Misfit, Trust::Low, detail)
        }
        None => {
            let percent = fit.fit_percent.filter(|percent| *percent < PLAIN_FIT)?;
            let detail = format!(
                "`{name}` is explained to {percent:.1} % and no noise level is declared, so noise \
                 cannot be told from misfit; give outputs.{name}.noise_std"
            );
            (Rule::NoiseUnknown, Trust::Moderate, detail)
        }
    };
    Some(Doubt::new(rule, trust, detail))
}

/// Whether residuals look like the noise of a sensor: white, and following no input.
fn is_plain_noise(residual: &ResidualReport) -> bool {
    let mut inputs = residual.inputs.values();
    residual.white == Some(true) && !inputs.any(|correlation| correlation.significant)
}

/// A declared noise that is larger than the noise in the residuals: it cannot excuse what is left.
fn overstated(name: &str, residual: &ResidualReport, fit: &OutputFit) -> Doubt {
    let chi_square = residual.chi_square_per_sample.unwrap_or_default();
    let (trust, detail) = if residual.is_misfit_by_colour() {
        let detail = format!(
            "the residuals of `{name}` are {:.2} times the declared noise (chi²/n {chi_square:.2}) and \
             follow each other (correlation {:.2} with the next sample): there is less noise than is \
             declared, and what is left is taken for what the model misses; free an effect, or give \
             the noise that the sensor really has",
            chi_square.sqrt(),
            residual.lag_1_autocorrelation.unwrap_or_default()
        );
        (Trust::Low, detail)
    } else {
        let detail = format!(
            "the declared noise of `{name}` is {:.2} times as large as what is left (chi²/n \
             {chi_square:.2}): the intervals are made with what is left; an error of the sensor's \
             gain or offset is no noise, and belongs into its tolerances",
            1.0 / chi_square.sqrt()
        );
        let is_plain = fit.fit_percent.is_none_or(|percent| percent >= PLAIN_FIT);
        let trust = match residual.white == Some(true) && is_plain {
            true => Trust::High,
            false => Trust::Moderate,
        };
        (trust, detail)
    };
    Doubt::new(Rule::NoiseContradicted, trust, detail)
}

/// A declared noise that is smaller than residuals that look like noise.
fn understated(name: &str, chi_square: f64) -> Doubt {
    let detail = format!(
        "the residuals of `{name}` are white and {:.2} times as large as the declared noise (chi²/n \
         {chi_square:.2}): the intervals are made with what is left; give the noise that the sensor \
         really has",
        chi_square.sqrt()
    );
    Doubt::new(Rule::NoiseContradicted, Trust::Moderate, detail)
}
