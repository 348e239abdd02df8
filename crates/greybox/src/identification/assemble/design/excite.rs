//! How the inputs are driven best, and which sensor more would help.

use super::looked::Pass;
use super::report::{self, Candidate, predicted, relative};
use super::subject::{Subject, measured_output};
use crate::estimation::problem::Problem;
use crate::identification::design::{Design, PlayedInputs, RankedSensor};
use crate::identification::spec::design::{DesignSpec, Excitable};
use crate::uncertainty::design::search::Search;
use crate::uncertainty::design::{Assessment, Excitation, Present};
use greybox_recording::SampledSignal;
use std::sync::atomic::AtomicBool;

/// The experiments that are looked at.
struct Bench<'a, 'l> {
    spec: &'a DesignSpec,
    plan: &'a Excitable,
    subject: &'a Subject,
    present: &'a Present,
    pass: Pass<'l>,
    stop: &'a AtomicBool,
}

/// The best experiment, as far as the pass and `stop` let it be looked for; nothing where that ended
/// before the first was looked at.
pub(super) fn best(
    spec: &DesignSpec,
    plan: &Excitable,
    (subject, present): (&Subject, &Present),
    (pass, stop): (Pass<'_>, &AtomicBool),
) -> Option<Design> {
    let bench = Bench {
        spec,
        plan,
        subject,
        present,
        pass,
        stop,
    };
    let (mut ranked, assessed, mut finished) = bench.candidates();
    // Equal ones keep their order: what was proposed first.
    ranked.sort_by(|a, b| b.assessment.score.total_cmp(&a.assessment.score));
    let sensors = ranked.first().map(|best| bench.sensors(best));
    let (sensors, is_whole) = sensors.unwrap_or_default();
    finished &= is_whole || spec.sensors.is_empty();
    let mut design = report::design(spec, (subject, present), &ranked, (assessed, finished))?;
    design.sensors = sensors;
    design.inputs = ranked.first().and_then(|best| bench.played(best));
    Some(design)
}

impl Bench<'_, '_> {
    /// What was proposed and the best of each family, how many were looked at, and whether all
    /// that were to be.
    fn candidates(&self) -> (Vec<Candidate>, usize, bool) {
        let mut candidates = Vec::new();
        for proposal in &self.plan.proposals {
            let inputs = match &proposal.samples {
                Some(samples) => samples.clone(),
                None => proposal.excitation.play(&self.plan.grid),
            };
            let Some(assessment) = self.assess(&self.subject.next, || inputs.clone()) else {
                let assessed = candidates.len();
                return (candidates, assessed, false);
            };
            candidates.push(Candidate {
                name: proposal.name.clone(),
                excitation: proposal.excitation.clone(),
                inputs,
                assessment,
            });
        }
        let (searches, finished) = self.searches();
        let assessed = searches.iter().map(Search::assessed).sum::<usize>();
        let assessed = candidates.len() + assessed;
        let found = searches.iter().filter_map(|search| {
            let best = search.best()?;
            Some(Candidate {
                name: search.family().name().to_owned(),
                inputs: best.excitation.play(&self.plan.grid),
                excitation: best.excitation.clone(),
                assessment: best.assessment.clone(),
            })
        });
        candidates.extend(found);
        (candidates, assessed, finished)
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
        let assess =
            |excitation: &Excitation| self.assess(&self.subject.next, || excitation.play(grid));
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
        let mut experiment = self.subject.experiment(
            self.spec,
            (grid.samples, grid.sample_time),
            None,
            (self.plan.input_set, inputs),
        );
        experiment.measured = vec![vec![0.0; grid.samples]; next.outputs.len()];
        experiment.weights = vec![None; next.outputs.len()];
        self.present.assess(next, experiment, self.stop)
    }

    /// What each sensor more would bring in the best experiment, and whether all were looked at.
    fn sensors(&self, best: &Candidate) -> (Vec<RankedSensor>, bool) {
        let description = self.subject.next.model.description();
        let mut sensors = Vec::new();
        for (name, noise) in &self.spec.sensors {
            let mut next = self.subject.next.clone();
            next.outputs
                .extend(measured_output(description, name, *noise));
            let Some(assessment) = self.assess(&next, || best.inputs.clone()) else {
                return (sensors, false);
            };
            sensors.push(RankedSensor {
                output: name.clone(),
                relative_error: relative(&best.assessment, &assessment, self.subject.wanted.len()),
                after: predicted(self.subject, assessment.known),
            });
        }
        sensors.sort_by(|a, b| a.relative_error.total_cmp(&b.relative_error));
        (sensors, true)
    }

    /// The samples of the best, by input.
    fn played(&self, best: &Candidate) -> Option<PlayedInputs> {
        let description = self.subject.next.model.description();
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
