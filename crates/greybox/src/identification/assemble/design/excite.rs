//! How the inputs are driven best, and which sensor more would help.

use super::assessments::Pass;
use super::problem::{Course, Question, measured_output};
use super::report::{self, AssessedExperiment, Ranking, predicted, relative};
use crate::estimation::problem::Problem;
use crate::identification::design::{Design, PlayedInputs, RankedSensor};
use crate::identification::spec::design::Excitable;
use crate::uncertainty::design::search::Search;
use crate::uncertainty::design::{Assessment, Excitation};
use greybox_recording::SampledSignal;
use std::sync::atomic::AtomicBool;

/// The experiments that are assessed.
struct ExperimentSearch<'a, 'l> {
    question: Question<'a>,
    plan: &'a Excitable,
    pass: Pass<'l>,
    stop: &'a AtomicBool,
}

/// The best experiment, as far as the pass and `stop` let the experiment be looked for; nothing where
/// the pass ended before the first experiment was assessed.
pub(super) fn best(
    question: Question<'_>,
    plan: &Excitable,
    pass: Pass<'_>,
    stop: &AtomicBool,
) -> Option<Design> {
    let search = ExperimentSearch {
        question,
        plan,
        pass,
        stop,
    };
    let mut ranking = search.ranking();
    let sensors = ranking.candidates.first().map(|best| search.sensors(best));
    let (sensors, is_whole) = sensors.unwrap_or_default();
    ranking.finished &= is_whole || question.spec.sensors.is_empty();
    let mut design = report::design(question, &ranking)?;
    design.sensors = sensors;
    let best = ranking.candidates.first();
    design.inputs = best.and_then(|best| search.played(best));
    Some(design)
}

impl ExperimentSearch<'_, '_> {
    /// The ranking of the proposals and of the best of each family.
    fn ranking(&self) -> Ranking {
        let mut ranking = Ranking::default();
        for proposal in &self.plan.proposals {
            let inputs = match &proposal.samples {
                Some(samples) => samples.clone(),
                None => proposal.excitation.play(&self.plan.grid),
            };
            let next = &self.question.problem.next;
            let Some(assessment) = self.assess(next, || inputs.clone()) else {
                ranking.sort();
                return ranking;
            };
            ranking.assessed += 1;
            ranking.candidates.push(AssessedExperiment {
                name: proposal.name.clone(),
                excitation: proposal.excitation.clone(),
                inputs,
                assessment,
            });
        }
        let (searches, finished) = self.searches();
        ranking.finished = finished;
        ranking.assessed += searches.iter().map(Search::assessed).sum::<usize>();
        let best_of_families = searches.iter().filter_map(|search| {
            let best = search.best()?;
            Some(AssessedExperiment {
                name: search.family().name().to_owned(),
                inputs: best.excitation.play(&self.plan.grid),
                excitation: best.excitation.clone(),
                assessment: best.assessment.clone(),
            })
        });
        ranking.candidates.extend(best_of_families);
        ranking.sort();
        ranking
    }

    /// All families: the first grid of each, then the most promising improved before the others.
    fn searches(&self) -> (Vec<Search>, bool) {
        let grid = &self.plan.grid;
        let mut searches: Vec<Search> = self
            .plan
            .families
            .iter()
            .map(|family| Search::new(*family))
            .collect();
        let next = &self.question.problem.next;
        let assess = |excitation: &Excitation| self.assess(next, || excitation.play(grid));
        let mut finished = searches
            .iter_mut()
            .all(|search| search.begin(grid, assess).is_some());
        let score = |search: &Search| {
            let best = search.best();
            best.map_or(f64::NEG_INFINITY, |best| best.assessment.score)
        };
        searches.sort_by(|a, b| score(b).total_cmp(&score(a)));
        finished = finished
            && searches
                .iter_mut()
                .all(|search| search.improve(grid, assess).is_some());
        (searches, finished)
    }

    /// What an experiment with these inputs would bring where these outputs are measured.
    fn assess(&self, next: &Problem, inputs: impl FnOnce() -> Vec<Vec<f64>>) -> Option<Assessment> {
        self.pass.next(|| self.simulate(next, inputs()))
    }

    fn simulate(&self, next: &Problem, inputs: Vec<Vec<f64>>) -> Option<Assessment> {
        let grid = &self.plan.grid;
        let Question {
            spec,
            problem,
            present,
        } = self.question;
        let course = Course {
            samples: grid.samples,
            sample_time: grid.sample_time,
            instants: None,
            input_set: self.plan.input_set,
            inputs,
        };
        let mut experiment = problem.experiment(spec, course);
        experiment.measured = vec![vec![0.0; grid.samples]; next.outputs.len()];
        experiment.weights = vec![None; next.outputs.len()];
        present.assess(next, experiment, self.stop)
    }

    /// What each sensor more would bring in the best experiment, and whether all were assessed.
    fn sensors(&self, best: &AssessedExperiment) -> (Vec<RankedSensor>, bool) {
        let Question { spec, problem, .. } = self.question;
        let description = problem.next.model.description();
        let mut sensors = Vec::new();
        for (name, noise) in &spec.sensors {
            let mut next = problem.next.clone();
            next.outputs
                .extend(measured_output(description, name, *noise));
            let Some(assessment) = self.assess(&next, || best.inputs.clone()) else {
                return (sensors, false);
            };
            sensors.push(RankedSensor {
                output: name.clone(),
                relative_error: relative(&best.assessment, &assessment, problem.wanted.len()),
                after: predicted(&problem.next, &problem.positions, assessment.known),
            });
        }
        sensors.sort_by(|a, b| a.relative_error.total_cmp(&b.relative_error));
        (sensors, true)
    }

    /// The samples of the best, by input.
    fn played(&self, best: &AssessedExperiment) -> Option<PlayedInputs> {
        let description = self.question.problem.next.model.description();
        let names = &description.input_sets[self.plan.input_set];
        let signals = names.iter().zip(&best.inputs).map(|(name, values)| {
            let mut inputs = description.inputs.iter();
            let input = inputs.find(|input| input.name == *name);
            let signal = SampledSignal {
                unit: input.map_or_else(String::new, |input| input.unit.to_string()),
                values: values.iter().copied().map(Some).collect(),
            };
            (name.to_string(), signal)
        });
        (!names.is_empty()).then(|| PlayedInputs {
            sample_time_s: self.plan.grid.sample_time,
            signals: signals.collect(),
        })
    }
}
