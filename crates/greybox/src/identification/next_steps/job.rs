//! Steps that change the job as a whole: effects, noise, data, search and time.

use super::{Change, DIGITS, Finished};
use crate::estimation::StopReason;
use crate::estimation::problem::{Assumed, Target};
use crate::identification::JobSpec;
use crate::identification::spec::{
    ExperimentRole, JobNoiseSpec, ModelSearch, NoiseChoice, WindowSpec,
};
use crate::uncertainty::budget::Line;
use greybox_numerics::digits::{rounded, short};

/// Effects that the data are asked about at the most.
const MOST_EFFECTS: usize = 4;
/// Effects that a job may leave to the data at the most.
const MOST_EFFECTS_OF_JOB: usize = 10;
/// A longer search has so many times the candidates.
const MORE_CANDIDATES: u32 = 2;
/// Candidates of a generation at the most.
const MOST_CANDIDATES: u32 = 10_000;
/// A longer search has so many further searches at the least.
const FEWEST_FURTHER_SEARCHES: u32 = 8;
/// Further searches at the most.
const MOST_FURTHER_SEARCHES: u32 = 31;
/// Longer chains of a posterior have so many times the generations.
const MORE_GENERATIONS: u32 = 4;
/// Generations of the chains of a posterior at the most.
const MOST_GENERATIONS: u32 = 100_000;
/// A longer run has so many times the time.
const MORE_TIME: f64 = 3.0;
/// The longest run that is proposed `[s]`: a day, which a server allows where its settings do not
/// say otherwise.
const LONGEST_RUN_S: f64 = 86_400.0;

impl Finished<'_> {
    /// Effects that the model has and the job leaves out: the data choose among them, or the effect
    /// that the residuals ask for most is freed.
    pub(super) fn free_effects(&self) -> Vec<Change> {
        let absent = self.absent_effects();
        let Some((first, line)) = absent.first().copied() else {
            return Vec::new();
        };
        let mut changes = Vec::new();
        // Huber's loss gives up the likelihood by which a search compares models.
        if self.spec.method.huber_threshold.is_none() {
            changes.push(self.search_effects(&absent));
        }
        changes.push(Change {
            label: format!("Free {}", self.words(first)),
            why: "The effect that the residuals ask for most.".to_owned(),
            spec: self.changed(|spec| self.free(spec, first, line)),
        });
        changes
    }

    /// The data choose a noise model, where the job has none and its model can be filtered.
    pub(super) fn look_for_disturbances(&self) -> Option<Change> {
        let model = &self.conclusion.problem.model;
        let is_possible = !self.spec.looks_for_disturbances()
            && self.spec.method.huber_threshold.is_none()
            && !model.driven_states().is_empty();
        is_possible.then(|| Change {
            label: "Look for what moves the plant".to_owned(),
            why: "Noise models are compared: a disturbance of a state, with and without a memory, \
                  and a sensor that drifts."
                .to_owned(),
            spec: self.changed(|spec| {
                spec.process_noise = Some(JobNoiseSpec::Choice(NoiseChoice::Auto));
            }),
        })
    }

    fn search_effects(&self, absent: &[(Target, &Line)]) -> Change {
        let several = &absent[..absent.len().min(MOST_EFFECTS)];
        let words: Vec<String> = several
            .iter()
            .map(|(effect, _)| self.words(*effect))
            .collect();
        let spec = self.changed(|spec| {
            let search = spec.model_search.take();
            let mut effects = search.map_or_else(Vec::new, |search| search.effects);
            for (effect, line) in several {
                self.free(spec, *effect, line);
                effects.push(line.assumption.name.clone());
            }
            effects.truncate(MOST_EFFECTS_OF_JOB);
            spec.model_search = Some(ModelSearch { effects });
        });
        Change {
            label: "Let the data choose the effects".to_owned(),
            why: format!("Tries {} and keeps what the data support.", listed(&words)),
            spec,
        }
    }

    /// The effects that are left out of all experiments and that no search has looked at, the one
    /// that the residuals ask for most first.
    fn absent_effects(&self) -> Vec<(Target, &Line)> {
        let searched = self.spec.model_search.as_ref();
        let searched = searched.map_or(&[][..], |search| &search.effects);
        let is_open = |name: &str| {
            let mut experiments = self.spec.experiments.iter();
            !searched.iter().any(|effect| effect == name)
                && !experiments.any(|experiment| experiment.parameters.contains_key(name))
        };
        let lines = self.conclusion.analysis.budget.lines.iter();
        let absent = lines.filter_map(|line| match line.assumption.target {
            Assumed::Model(target @ Target::Parameter(_))
                if line.assumption.is_absent_effect && is_open(&line.assumption.name) =>
            {
                Some((target, line))
            }
            _ => None,
        });
        let mut absent: Vec<(Target, &Line)> = absent.collect();
        let pull = |line: &Line| line.score.map_or(0.0, f64::abs);
        absent.sort_by(|(_, a), (_, b)| pull(b).total_cmp(&pull(a)));
        absent
    }

    /// Whether the residuals of an output pass for white noise.
    pub(super) fn is_white(&self, output: usize) -> bool {
        self.conclusion.analysis.residuals[output].white == Some(true)
    }

    /// A noise level for an output of which none is declared.
    pub(super) fn declare_noise(&self, output: usize) -> Option<Change> {
        let declared = &self.conclusion.problem.outputs[output];
        let is_open = declared.noise_std.is_none();
        is_open.then(|| self.noise_of_residuals(output)).flatten()
    }

    /// Another noise level in the place of the declared one, where that is one number.
    pub(super) fn correct_noise(&self, output: usize) -> Option<Change> {
        let name = &self.conclusion.problem.outputs[output].name;
        let spec = self.spec.outputs.get(name)?;
        let is_number = spec.noise_share.is_none() && spec.noise_signal.is_none();
        is_number.then(|| self.noise_of_residuals(output)).flatten()
    }

    /// The noise level of an output: what is left over stands there to begin with.
    fn noise_of_residuals(&self, output: usize) -> Option<Change> {
        let declared = &self.conclusion.problem.outputs[output];
        let noise = rounded(self.conclusion.analysis.residuals[output].noise_std, DIGITS);
        if noise <= 0.0 {
            return None;
        }
        let spec = self.changed(|spec| {
            let output = spec.outputs.entry(declared.name.clone()).or_default();
            output.noise_std = Some(noise);
        });
        Some(Change {
            label: format!("Give the noise of {}", declared.name.replace('_', " ")),
            why: format!(
                "From the sensor's data sheet; what is left over, {} {}, stands there to begin with.",
                short(noise, DIGITS),
                declared.unit
            ),
            spec,
        })
    }

    /// The whole recordings in the place of windows.
    pub(super) fn whole_recordings(&self) -> Option<Change> {
        let mut windows = self
            .spec
            .experiments
            .iter()
            .map(|experiment| experiment.window);
        windows.any(|window| window.is_some()).then(|| Change {
            label: "Use the whole recordings".to_owned(),
            why: "Without windows.".to_owned(),
            spec: self.changed(|spec| {
                for experiment in &mut spec.experiments {
                    experiment.window = None;
                }
            }),
        })
    }

    /// More candidates and more searches.
    pub(super) fn search_longer(&self) -> Change {
        let method = &self.spec.method;
        let population = method.population.saturating_mul(MORE_CANDIDATES);
        let population = population.min(MOST_CANDIDATES);
        let further = method.further_searches.saturating_mul(MORE_CANDIDATES);
        let further = further.clamp(FEWEST_FURTHER_SEARCHES, MOST_FURTHER_SEARCHES);
        Change {
            label: "Search longer".to_owned(),
            why: format!("{population} candidates, up to {further} further searches."),
            spec: self.changed(|spec| {
                spec.method.population = population;
                spec.method.further_searches = further;
            }),
        }
    }

    /// More time, where the time limit ended the run.
    pub(super) fn run_longer(&self) -> Option<Change> {
        let limit = self.spec.limits.max_duration_s;
        let longer = (MORE_TIME * limit).min(LONGEST_RUN_S);
        let was_cut = self.conclusion.report.stop_reason == StopReason::TimeLimit;
        (was_cut && longer > limit).then(|| Change {
            label: "Run it longer".to_owned(),
            why: format!("Up to {} s.", short(longer, DIGITS)),
            spec: self.changed(|spec| spec.limits.max_duration_s = longer),
        })
    }

    /// Longer chains of a posterior, where they can be longer.
    pub(super) fn draw_longer(&self) -> Option<Change> {
        let generations = self.spec.uncertainty.posterior_generations;
        let more = generations.saturating_mul(MORE_GENERATIONS);
        let more = more.min(MOST_GENERATIONS);
        (more > generations).then(|| Change {
            label: "Draw longer".to_owned(),
            why: format!("Up to {more} generations of the chains."),
            spec: self.changed(|spec| spec.uncertainty.posterior_generations = more),
        })
    }

    /// Whether the run was ended from outside.
    pub(super) fn was_stopped(&self) -> bool {
        let stopped = [
            StopReason::TimeLimit,
            StopReason::Cancelled,
            StopReason::Paused,
        ];
        stopped.contains(&self.conclusion.report.stop_reason)
    }

    /// Each half of the record alone.
    pub(super) fn halves(&self) -> Vec<Change> {
        let half = |words: &str, is_first: bool| Change {
            label: format!("Use the {words} half of the record"),
            why: "What changes within the record, or is too long to be gone through, shows in the \
                  halves."
                .to_owned(),
            spec: self.changed(|spec| self.halve(spec, is_first)),
        };
        vec![half("first", true), half("second", false)]
    }

    /// Cuts the experiments that are estimated from to one of their halves.
    fn halve(&self, spec: &mut JobSpec, is_first: bool) {
        for (place, experiment) in spec.experiments.iter_mut().enumerate() {
            let mut data = self.conclusion.problem.experiments.iter();
            let data = data.find(|data| data.place == place);
            let Some(data) = data.filter(|data| data.samples > 1) else {
                continue;
            };
            if experiment.role == ExperimentRole::Validation {
                continue;
            }
            let window = experiment.window.unwrap_or_default();
            let from = window.from_s.unwrap_or(0.0);
            let middle = from + rounded(0.5 * data.instant(data.samples - 1), DIGITS);
            experiment.window = Some(match is_first {
                true => WindowSpec {
                    from_s: window.from_s,
                    to_s: Some(middle),
                    ..WindowSpec::default()
                },
                false => WindowSpec {
                    from_s: Some(middle),
                    to_s: window.to_s,
                    ..WindowSpec::default()
                },
            });
        }
    }
}

/// Words as a list: `a, b and c`.
fn listed(words: &[String]) -> String {
    match words {
        [] => String::new(),
        [word] => word.clone(),
        [words @ .., last] => format!("{} and {last}", words.join(", ")),
    }
}
