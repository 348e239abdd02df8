//! What was found as the answer says it.

use super::subject::Subject;
use crate::estimation::Finding;
use crate::identification::design::{Design, PredictedParameter, RankedProposal};
use crate::identification::spec::design::DesignSpec;
use crate::uncertainty::design::{Assessment, Excitation, Known, Present};

/// One experiment that was looked at.
pub(super) struct Candidate {
    pub name: String,
    pub excitation: Excitation,
    /// The samples of its inputs.
    pub inputs: Vec<Vec<f64>>,
    pub assessment: Assessment,
}

/// An answer without inputs and sensors: the candidates, the best first.
pub(super) fn design(
    spec: &DesignSpec,
    (subject, present): (&Subject, &Present),
    ranked: &[Candidate],
    (assessed, finished): (usize, bool),
) -> Option<Design> {
    let best = ranked.first()?;
    let wanted = subject.wanted.len();
    let mut findings = subject.findings.clone();
    findings.extend(doubts(subject, present, &best.assessment));
    if !finished {
        let detail = "not all was looked at before the time was up or it was stopped: this is the best \
                      so far; ask for fewer families, points or samples, or, where a client waited, \
                      for a job (`Prefer: respond-async`)";
        findings.push(Finding::new("not_finished", "", detail));
    }
    Some(Design {
        model: spec.job.model.clone(),
        finished,
        wanted: names(subject),
        points: present.n_points() as u64,
        assessed: assessed as u64,
        seed: spec.seed,
        before: predicted(subject, present.known()),
        proposals: ranked
            .iter()
            .map(|own| RankedProposal {
                name: own.name.clone(),
                excitation: own.excitation.clone(),
                relative_error: relative(&best.assessment, &own.assessment, wanted),
                log10_determinant: log10_determinant(subject, present, &own.assessment),
                failed_points: own.assessment.failed_points as u64,
                after: predicted(subject, own.assessment.known.clone()),
            })
            .collect(),
        inputs: None,
        sensors: Vec::new(),
        findings,
    })
}

/// How many times larger standard errors are than by another assessment.
pub(super) fn relative(than: &Assessment, own: &Assessment, wanted: usize) -> f64 {
    libm::exp((than.score - own.score) / wanted as f64)
}

/// The score as the determinant of the parameters' information and not of their positions'.
fn log10_determinant(subject: &Subject, present: &Present, own: &Assessment) -> f64 {
    let slopes = present.points().iter().map(|positions| {
        let wanted = subject.wanted.iter();
        let slopes = wanted.map(|&index| {
            let coordinate = &subject.next.coordinates[index];
            libm::log(coordinate.slope(positions[index]).abs())
        });
        slopes.sum::<f64>()
    });
    let slopes = slopes.sum::<f64>() / present.n_points() as f64;
    2.0 * (own.score - slopes) / std::f64::consts::LN_10
}

/// What would be known of each unknown; nothing where that is not known.
pub(super) fn predicted(subject: &Subject, known: Option<Vec<Known>>) -> Vec<PredictedParameter> {
    let coordinates = subject.next.coordinates.iter().zip(&subject.positions);
    let known = known.into_iter().flatten();
    coordinates
        .zip(known)
        .map(|((coordinate, position), known)| PredictedParameter {
            name: coordinate.name.clone(),
            unit: coordinate.unit.clone(),
            value: coordinate.value(*position),
            standard_error: known.noise,
            total_standard_error: known.total,
        })
        .collect()
}

fn names(subject: &Subject) -> Vec<String> {
    let wanted = subject.wanted.iter();
    wanted
        .map(|index| subject.next.coordinates[*index].name.clone())
        .collect()
}

/// What even the best experiment leaves open.
fn doubts(subject: &Subject, present: &Present, best: &Assessment) -> Vec<Finding> {
    let mut findings = Vec::new();
    if best.failed_points > 0 {
        let detail = format!(
            "the best experiment cannot be simulated at {} of {} points of what is known at \
             present; narrow the ranges to where the plant is stable",
            best.failed_points,
            present.n_points()
        );
        findings.push(Finding::new("points_failed", "/parameters", &detail));
    }
    let known = best.known.iter().flatten().enumerate();
    let open =
        known.filter(|(index, known)| subject.wanted.contains(index) && known.total.is_none());
    let open: Vec<String> = open
        .map(|(index, _)| format!("`{}`", subject.next.coordinates[index].name))
        .collect();
    if !open.is_empty() {
        let detail = format!(
            "even the best experiment does not fix {}: measure one output more, or give a value or \
             a prior to one of the unknowns",
            open.join(", ")
        );
        findings.push(Finding::new("not_identifiable", "/wanted", &detail));
    }
    findings
}
