//! What the disturbances that move the plant say for and against a result.

use super::assumptions::Moves;
use super::{Case, short};
use crate::uncertainty::noise_analysis::{Band, DisturbanceEstimate, NoiseAnalysis};
use crate::uncertainty::verdict::{Doubt, Grade, Rule, Subject, Trust};

/// Twice the logarithm of a likelihood ratio below which a disturbance is chance, one time of twenty: its
/// strength cannot be below nothing.
const NOT_NEEDED: f64 = 2.71;
/// The share of an output's variance from which a disturbance dominates it.
const DOMINATES: f64 = 0.5;
/// Standard deviations by which the mean square of what was held back is off by chance.
const BAND_SCORE: f64 = 3.0;
/// The share of the samples held back that lies within the 95 % band at the least.
const INSIDE_BAND: f64 = 0.9;
/// A mean square of what was held back from which the trust is low.
const GRAVE_BAND: f64 = 4.0;

impl Case<'_> {
    /// What moves the plant, and what speaks against the way in which it is taken to move it.
    pub(super) fn disturbances(&self) -> Vec<Doubt> {
        let Some(noise) = &self.analysis.noise else {
            return Vec::new();
        };
        let mut doubts = Vec::new();
        doubts.extend(
            noise
                .disturbances
                .iter()
                .map(|estimate| self.disturbance(estimate)),
        );
        doubts.extend(
            noise
                .disturbances
                .iter()
                .filter_map(|estimate| self.dominates(estimate)),
        );
        doubts.extend(self.not_needed(noise));
        doubts.extend(self.rivals(noise));
        doubts.extend(self.windows());
        let bands = noise.bands.iter().enumerate();
        doubts.extend(bands.filter_map(|(output, band)| self.held_back(output, (*band)?)));
        doubts
    }

    fn disturbance(&self, estimate: &DisturbanceEstimate) -> Doubt {
        let model = self.problem.model.description();
        let unit = estimate.sought.unit(model);
        let size = match (estimate.std, estimate.time_constant) {
            (Some(std), Some(memory)) => format!(
                "{} {unit} with a memory of {} s",
                short(std.value),
                short(memory.value)
            ),
            _ => format!("strength {} {unit}·√s", short(estimate.strength.value)),
        };
        let shares = self.problem.outputs.iter().zip(&estimate.shares);
        let shares = shares.filter_map(|(output, share)| {
            let per_cent = short(100.0 * (*share)?);
            Some(format!("{per_cent} % of the variance of `{}`", output.name))
        });
        let shares: Vec<String> = shares.collect();
        let detail = format!(
            "something that was not recorded moves the plant: {} ({size}), which makes {}; the \
             intervals hold for it, if it follows neither the inputs nor the states",
            estimate.sought.in_words(model),
            shares.join(" and ")
        );
        Doubt::new(Rule::Disturbance, Trust::High, detail)
    }

    fn dominates(&self, estimate: &DisturbanceEstimate) -> Option<Doubt> {
        let shares = self.problem.outputs.iter().zip(&estimate.shares);
        let mut largest = shares.filter(|(_, share)| share.is_some_and(|share| share > DOMINATES));
        let (output, share) = largest.next()?;
        let detail = format!(
            "{} makes {} % of the variance of `{}`: the parameters may hold, but a simulation \
             from the inputs alone predicts little of it; record what moves the plant",
            estimate.sought.in_words(self.problem.model.description()),
            short(100.0 * (*share)?),
            output.name
        );
        Some(Doubt::new(Rule::DisturbanceDominates, Trust::High, detail))
    }

    /// Whether the record is as likely without the disturbances that the job lists.
    fn not_needed(&self, noise: &NoiseAnalysis) -> Option<Doubt> {
        if noise.disturbances.is_empty() {
            return None;
        }
        let mut without = noise
            .compared
            .iter()
            .filter(|compared| compared.disturbances.is_empty());
        let without = without.next()?.fit.as_ref()?.log_likelihood;
        let gain = 2.0 * (noise.log_likelihood - without);
        if gain >= NOT_NEEDED {
            return None;
        }
        let detail = format!(
            "the record is about as likely without any disturbance (twice the logarithm of the \
             ratio is {}): say `\"process_noise\": \"none\"`",
            short(gain)
        );
        Some(Doubt::new(Rule::NoiseNotNeeded, Trust::High, detail))
    }

    /// Other noise models that the data leave standing, and that put a parameter elsewhere.
    fn rivals(&self, noise: &NoiseAnalysis) -> Option<Doubt> {
        let by_free_run = |index: usize| {
            let (coordinate, free) = (&self.problem.coordinates[index], noise.free_run.get(index)?);
            let position = self.report.positions[index];
            let by = free.disagreement(coordinate, position, self.deviation(index)?);
            by.map(f64::abs)
        };
        let moved = |index: usize| {
            let position = self.report.positions[index];
            let moves = noise
                .rivals()
                .map(|rival| (rival.fit.positions[index] - position).abs());
            moves.chain(by_free_run(index)).fold(0.0, f64::max)
        };
        let coordinates = 0..self.problem.coordinates.len();
        let why = if coordinates.filter_map(by_free_run).next().is_some() {
            "the free run is further off than its errors allow, as where the model misses an effect, and puts"
        } else if noise.is_white {
            "other noise models explain the data about as well, and put"
        } else {
            "no noise model leaves white innovations, and others than the likeliest put"
        };
        let detail =
            format!("{why} parameters elsewhere: the total intervals cover what each of them says");
        let moves = Moves {
            any: &moved,
            large: &moved,
        };
        let doubt = self.graded_by_moves(Rule::NoiseModelsDisagree, moves, detail);
        let is_moved = doubt
            .concerns
            .as_ref()
            .is_some_and(|grades| !grades.is_empty());
        is_moved.then_some(doubt)
    }

    /// Windows of the record that do not agree about the parameters.
    fn windows(&self) -> Option<Doubt> {
        let windows = self.analysis.windows.as_ref()?;
        let coordinates = 0..self.problem.coordinates.len();
        let doubted = coordinates.filter(|coordinate| windows.disagree_about(*coordinate));
        let grades = doubted.map(|coordinate| Grade {
            coordinate,
            trust: match windows.scatters[coordinate] {
                Some(_) => self.trust_in_hull(coordinate),
                None => Trust::Moderate,
            },
        });
        let grades: Vec<Grade> = grades.collect();
        if grades.is_empty() {
            return None;
        }
        let spreads = windows.spreads.iter().enumerate();
        let fixed = spreads.filter_map(|(index, spread)| Some((index, (*spread)?)));
        let worst = fixed.max_by(|(_, a), (_, b)| a.total_cmp(b));
        let furthest = worst.map_or_else(String::new, |(index, spread)| {
            format!(
                "; what each alone makes of `{}` lies {} times as far apart as noise allows",
                self.problem.coordinates[index].name,
                short(spread)
            )
        });
        let detail = format!(
            "four windows of the record do not agree ({} standard deviations{furthest}): \
             something changes within the record, or the model misses an effect; the total \
             intervals cover what the windows say",
            short(windows.score)
        );
        Some(Doubt::graded(Rule::WindowsDisagree, grades, detail))
    }

    /// Samples that were held back and lie beyond the band that is expected of them.
    fn held_back(&self, output: usize, band: Band) -> Option<Doubt> {
        let chance = BAND_SCORE * (2.0 / band.effective_samples).sqrt();
        if band.inside >= INSIDE_BAND || band.mean_square <= 1.0 + chance {
            return None;
        }
        let trust = match band.mean_square > GRAVE_BAND {
            true => Trust::Low,
            false => Trust::Moderate,
        };
        let detail = format!(
            "{} % of the samples of `{}` that were held back lie within the 95 % band that is \
             expected of them: the estimate does not carry over; use a longer or richer recording",
            short(100.0 * band.inside),
            self.problem.outputs[output].name
        );
        let doubt = Doubt::new(Rule::WorseOnValidation, trust, detail);
        Some(doubt.about(Subject::Output(output)))
    }
}
