//! The rules of the verdict; the table of the rules is [`super::verdict::Rule`].

mod assumptions;
mod disturbances;
mod noise;
mod posterior;
mod width;

use super::Analysis;
use super::verdict::{Doubt, Judgement, Rule, Subject, Trust};
use crate::estimation::problem::{Coordinate, Problem, Target};
use crate::estimation::report::Report;
use crate::estimation::stop_reason::StopReason;
use greybox_numerics::digits;
use std::collections::BTreeSet;

/// Correlation beyond which two unknowns are hardly told apart.
const LARGEST_CORRELATION: f64 = 0.95;
/// A correlation does no harm where both unknowns are known to this share of their values.
const KNOWN_WELL: f64 = 0.02;
/// The RMSE on the data held back as a multiple of the RMSE on the data estimated from: from where
/// the multiple is told, and from where it is grave.
const VALIDATION_RATIOS: [f64; 2] = [1.3, 2.0];
/// A parameter has another value in another minimum where it lies this share of its range off.
const ELSEWHERE: f64 = 0.02;

/// Judges an analysed estimate.
#[must_use]
pub(super) fn judge(problem: &Problem, report: &Report, analysis: &Analysis) -> Judgement {
    let case = Case {
        problem,
        report,
        analysis,
    };
    Judgement::of(problem, case.doubts())
}

/// An analysed estimate that is judged.
struct Case<'a> {
    problem: &'a Problem,
    report: &'a Report,
    analysis: &'a Analysis,
}

impl Case<'_> {
    /// What all rules say.
    fn doubts(&self) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        doubts.extend(self.completion());
        doubts.extend(self.bounds());
        doubts.extend(self.identifiability());
        doubts.extend(self.noise());
        doubts.extend(self.colour());
        doubts.extend(self.inputs());
        doubts.extend(self.contradictions());
        doubts.extend(self.drifts());
        doubts.extend(self.left_out());
        doubts.extend(self.widths());
        doubts.extend(self.priors());
        doubts.extend(self.constraints());
        doubts.extend(self.correlation());
        doubts.extend(self.disturbances());
        doubts.extend(self.validation());
        doubts.extend(self.starts());
        doubts.extend(self.minima());
        doubts.extend(self.posterior());
        doubts
    }

    fn completion(&self) -> Option<Doubt> {
        let reason = match self.report.stop_reason {
            StopReason::Cancelled => "cancelled",
            StopReason::Paused => "paused",
            StopReason::TimeLimit => "ended by its time limit",
            _ => return None,
        };
        let detail = format!(
            "the run was {reason} after {} generations, before its refinement had finished; let it \
             run to its end",
            self.report.generations
        );
        Some(Doubt::new(Rule::NotFinished, Trust::Low, detail))
    }

    fn bounds(&self) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        let described = self.analysis.coordinates.iter().enumerate();
        for (index, _) in described.filter(|(_, uncertainty)| uncertainty.at_bound) {
            let coordinate = &self.problem.coordinates[index];
            let trust = match coordinate.target {
                Target::Parameter(_) | Target::ExperimentParameter { .. } => Trust::Low,
                Target::InitialState { .. } => Trust::Moderate,
            };
            let detail = format!(
                "`{}` stands at an end of its search range {} to {} {}; widen the range, or look \
                 for an effect that the model leaves out",
                coordinate.name, coordinate.lower, coordinate.upper, coordinate.unit
            );
            let subject = Subject::Coordinates(vec![index]);
            doubts.push(Doubt::new(Rule::AtBound, trust, detail).about(subject));
        }
        doubts
    }

    /// What the data do not fix; a flat direction is one reason.
    fn identifiability(&self) -> Vec<Doubt> {
        let analysis = self.analysis;
        let doubt = |detail| Doubt::new(Rule::NotIdentifiable, Trust::Low, detail);
        let mut doubts = Vec::new();
        for flat in &analysis.flat {
            let parts = flat.parts.iter().map(|(index, _)| *index).collect();
            let doubt = doubt(flat.words.clone());
            doubts.push(if analysis.missing.is_some() {
                // Without a covariance nothing is promised of the other unknowns either.
                doubt.about(Subject::Coordinates(parts))
            } else {
                doubt.concerning(parts).at_stake(1.0)
            });
        }
        for (index, uncertainty) in analysis.coordinates.iter().enumerate() {
            let is_wide = uncertainty.standard_error.is_some() && !uncertainty.identifiable;
            if is_wide && !self.is_flat(index) {
                let detail = format!(
                    "the 95 % interval of `{}` is wider than its search range: the data do not fix \
                     it; give its value, or record an experiment that excites it",
                    self.problem.coordinates[index].name
                );
                doubts.push(doubt(detail).concerning(vec![index]).at_stake(1.0));
            }
        }
        if let (Some(missing), true) = (&analysis.missing, analysis.flat.is_empty()) {
            let detail = format!("there are no standard errors: {missing}; fix an unknown");
            doubts.push(doubt(detail));
        }
        doubts
    }

    /// Whether a coordinate is part of a direction that the data do not see.
    fn is_flat(&self, index: usize) -> bool {
        let mut parts = self.analysis.flat.iter().flat_map(|flat| &flat.parts);
        parts.any(|(part, _)| *part == index)
    }

    /// The value of a coordinate as a share of its range: moves are measured by it.
    fn value_share(&self, index: usize) -> f64 {
        let coordinate = &self.problem.coordinates[index];
        let slope = coordinate.slope(self.report.positions[index]).abs();
        (self.report.values[index].abs() / slope).max(f64::MIN_POSITIVE)
    }

    /// The standard deviation that noise leaves of a coordinate, as a share of its range.
    fn deviation(&self, index: usize) -> Option<f64> {
        self.analysis.deviations.get(index).copied().flatten()
    }

    fn correlation(&self) -> Vec<Doubt> {
        let mut doubts = Vec::new();
        let is_known_well = |index: usize| {
            let deviation = self.deviation(index);
            deviation.is_some_and(|deviation| deviation / self.value_share(index) < KNOWN_WELL)
        };
        let rows = self.analysis.correlation.iter().flatten().enumerate();
        let entries = rows.flat_map(|(row, entries)| {
            let entries = entries.iter().enumerate().take(row);
            entries.map(move |(column, value)| ([column, row], *value))
        });
        for (pair, value) in entries {
            let is_told = pair.iter().all(|index| self.is_flat(*index));
            let is_harmless = pair.iter().all(|index| is_known_well(*index));
            if value.abs() <= LARGEST_CORRELATION || is_told || is_harmless {
                continue;
            }
            let [a, b] = pair.map(|index| &self.problem.coordinates[index].name);
            let detail = format!(
                "`{a}` and `{b}` move together (correlation {value:.3}): the data fix a \
                 combination better than either; fix one of them from a data sheet"
            );
            let doubt = Doubt::new(Rule::Correlated, Trust::Moderate, detail);
            doubts.push(doubt.concerning(pair.to_vec()));
        }
        doubts
    }

    fn validation(&self) -> Vec<Doubt> {
        // Where a disturbance moves the plant, its band is what can be expected.
        if self.analysis.noise.is_some() {
            return Vec::new();
        }
        let parts = self.analysis.estimation_fit.iter();
        let parts = parts.zip(&self.analysis.validation_fit).enumerate();
        let [slight, grave] = VALIDATION_RATIOS;
        let mut doubts = Vec::new();
        for (output, (estimation, validation)) in parts {
            let (Some(inside), Some(outside)) = (estimation.rmse, validation.rmse) else {
                continue;
            };
            let ratio = outside / inside;
            let percent = validation.fit_percent.filter(|percent| *percent < 0.0);
            if ratio <= slight {
                continue;
            }
            let (trust, than_a_mean) = match percent {
                Some(_) => (Trust::Low, ", and a constant would explain them better"),
                None if ratio > grave => (Trust::Low, ""),
                None => (Trust::Moderate, ""),
            };
            let detail = format!(
                "the RMSE of `{}` is {ratio:.2} times as large on the data held back{than_a_mean}: \
                 the estimate does not carry over; use a longer or richer recording",
                self.problem.outputs[output].name,
            );
            let doubt = Doubt::new(Rule::WorseOnValidation, trust, detail);
            doubts.push(doubt.about(Subject::Output(output)));
        }
        doubts
    }

    fn starts(&self) -> Option<Doubt> {
        let floor = self.report.floor.as_ref()?;
        if floor.plateau {
            let detail = "a constant explains the data as well as the estimate does: nothing was \
                          found that follows them; look at the search ranges and the initial \
                          states, or search longer with a larger `population`";
            return Some(Doubt::new(Rule::Plateau, Trust::Low, detail));
        }
        if floor.starts <= 1 || floor.starts_at_floor > 1 {
            return None;
        }
        let reached = match floor.starts_at_floor {
            0 => "none",
            _ => "only one",
        };
        let detail = format!(
            "{reached} of {} starts of the refinement, in {} searches, reached the lowest cost: \
             there may be better minima; ask for more `further_searches`, or a larger `population`",
            floor.starts,
            self.report.searches.len().max(1)
        );
        Some(Doubt::new(Rule::StartsDisagree, Trust::Moderate, detail))
    }

    /// Other minima as low, by what noise allows. A minimum that differs only in what the data do
    /// not fix is a point of the same valley, which has its own reason.
    fn minima(&self) -> Option<Doubt> {
        let is_fixed =
            |index: &usize| !self.is_flat(*index) && self.analysis.coordinates[*index].identifiable;
        let twins = self.report.twins.iter().enumerate();
        let twins = twins.map(|(place, twin)| (place, self.elsewhere(twin)));
        let twins = twins.filter(|(_, differing)| differing.iter().any(is_fixed));
        let twins: Vec<(usize, Vec<usize>)> = twins.collect();
        let (first, _) = twins.first()?;
        let values: Vec<String> = self.report.twins[*first]
            .iter()
            .map(|(name, value)| format!("{name} {}", short(*value)))
            .collect();
        let values = values.join(", ");
        let others = match twins.len() {
            1 => format!("another minimum explains the data as well ({values}): two answers"),
            n => format!("{n} other minima explain the data as well (one at {values})"),
        };
        let detail =
            format!("{others}; say in the search ranges or with a prior which one is meant");
        let differing: BTreeSet<usize> = twins.iter().flat_map(|(_, all)| all).copied().collect();
        let doubt = Doubt::new(Rule::TwinMinima, Trust::Low, detail);
        let doubt = doubt.concerning(differing.into_iter().collect());
        Some(doubt.at_stake(1.0).about(Subject::Twin(*first)))
    }

    /// The coordinates that have another value in another minimum.
    fn elsewhere(&self, twin: &[(String, f64)]) -> Vec<usize> {
        let pairs = self.problem.coordinates.iter().zip(twin).enumerate();
        let elsewhere = pairs.filter(|(index, (coordinate, (_, value)))| {
            let Coordinate { lower, upper, .. } = **coordinate;
            let position = coordinate.scale.position(*value, lower, upper);
            (position - self.report.positions[*index]).abs() > ELSEWHERE
        });
        elsewhere.map(|(index, _)| index).collect()
    }
}

/// A number in a reason.
fn short(value: f64) -> String {
    digits::short(value, 3)
}
