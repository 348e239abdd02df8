//! A design as the answer to a request.

use super::problem::{DesignProblem, Question};
use crate::estimation::Finding;
use crate::estimation::problem::Problem;
use crate::identification::design::{Design, PredictedParameter, RankedProposal};
use crate::uncertainty::design::{Assessment, Excitation, Known, Present};

/// One experiment that was assessed.
pub(super) struct AssessedExperiment {
    pub name: String,
    pub excitation: Excitation,
    /// The samples of the inputs.
    pub inputs: Vec<Vec<f64>>,
    pub assessment: Assessment,
}

/// The experiments that were assessed.
#[derive(Default)]
pub(super) struct Ranking {
    /// The best of each family and all that were proposed, the best first.
    pub candidates: Vec<AssessedExperiment>,
    /// How many experiments were assessed.
    pub assessed: usize,
    /// Whether all experiments were assessed that were to be.
    pub finished: bool,
}

impl Ranking {
    /// Puts the best first. Equal experiments keep their order: what was proposed comes first.
    pub(super) fn sort(&mut self) {
        let score = |candidate: &AssessedExperiment| candidate.assessment.score;
        self.candidates
            .sort_by(|a, b| score(b).total_cmp(&score(a)));
    }
}

/// An answer without inputs and sensors.
pub(super) fn design(question: Question<'_>, ranking: &Ranking) -> Option<Design> {
    let Question {
        spec,
        problem,
        present,
    } = question;
    let best = ranking.candidates.first()?;
    let wanted = problem.wanted.len();
    let mut findings = problem.findings.clone();
    findings.extend(doubts(problem, present, &best.assessment));
    if !ranking.finished {
        let detail = "not all was looked at before the time was up or it was stopped: this is the best \
                      so far; ask for fewer families, points or samples, or, where a client waited, \
                      for a job (`Prefer: respond-async`)";
        findings.push(Finding::new("not_finished", "", detail));
    }
    Some(Design {
        model: spec.job.model.clone(),
        finished: ranking.finished,
        wanted: names(problem),
        points: present.n_points() as u64,
        assessed: ranking.assessed as u64,
        seed: spec.seed,
        before: predicted(&problem.next, &problem.positions, present.known()),
        proposals: ranking
            .candidates
            .iter()
            .map(|candidate| RankedProposal {
                name: candidate.name.clone(),
                excitation: candidate.excitation.clone(),
                relative_error: relative(&best.assessment, &candidate.assessment, wanted),
                log10_determinant: log10_determinant(problem, present, &candidate.assessment),
                failed_points: candidate.assessment.failed_points as u64,
                after: predicted(
                    &problem.next,
                    &problem.positions,
                    candidate.assessment.known.clone(),
                ),
            })
            .collect(),
        inputs: None,
        sensors: Vec::new(),
        findings,
    })
}

/// How many times larger standard errors are than by the best assessment.
pub(super) fn relative(best: &Assessment, assessment: &Assessment, wanted: usize) -> f64 {
    libm::exp((best.score - assessment.score) / wanted as f64)
}

/// The score as the determinant of the parameters' information and not of their positions'.
fn log10_determinant(problem: &DesignProblem, present: &Present, assessment: &Assessment) -> f64 {
    let slopes = present.points().iter().map(|positions| {
        let wanted = problem.wanted.iter();
        let slopes = wanted.map(|&index| {
            let coordinate = &problem.next.coordinates[index];
            libm::log(coordinate.slope(positions[index]).abs())
        });
        slopes.sum::<f64>()
    });
    let slopes = slopes.sum::<f64>() / present.n_points() as f64;
    2.0 * (assessment.score - slopes) / std::f64::consts::LN_10
}

/// What would be known of each unknown at these positions; nothing where that is not known.
pub(in crate::identification::assemble) fn predicted(
    problem: &Problem,
    positions: &[f64],
    knowledge: Option<Vec<Known>>,
) -> Vec<PredictedParameter> {
    let coordinates = problem.coordinates.iter().zip(positions);
    let knowledge = knowledge.into_iter().flatten();
    coordinates
        .zip(knowledge)
        .map(|((coordinate, position), knowledge)| PredictedParameter {
            name: coordinate.name.clone(),
            unit: coordinate.unit.clone(),
            value: coordinate.value(*position),
            standard_error: knowledge.noise,
            total_standard_error: knowledge.total,
        })
        .collect()
}

fn names(problem: &DesignProblem) -> Vec<String> {
    let wanted = problem.wanted.iter();
    wanted
        .map(|index| problem.next.coordinates[*index].name.clone())
        .collect()
}

/// What even the best experiment leaves open.
fn doubts(problem: &DesignProblem, present: &Present, best: &Assessment) -> Vec<Finding> {
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
    let knowledge = best.known.iter().flatten().enumerate();
    let open = knowledge
        .filter(|(index, knowledge)| problem.wanted.contains(index) && knowledge.total.is_none());
    let open: Vec<String> = open
        .map(|(index, _)| format!("`{}`", problem.next.coordinates[index].name))
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
