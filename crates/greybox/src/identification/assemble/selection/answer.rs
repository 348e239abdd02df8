//! A selection as the answer to a request.

use super::selecting::Selecting;
use super::window::{LookedWindow, SelectedSpan};
use crate::estimation::Finding;
use crate::identification::assemble::design::predicted;
use crate::identification::design::PredictedParameter;
use crate::identification::selection::{
    ChosenWindow, FollowedOutput, LeftOut, LeftOutCount, Selection, WantedParameter,
    WindowsOfSelection,
};
use crate::uncertainty::design::Known;
use crate::uncertainty::design::history::{History, WindowGoal, WindowInformation};
use crate::uncertainty::feedback::{LAGS, following};
use crate::uncertainty::width::is_too_wide;
use jiff::Timestamp;
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

/// An input moved in a window where it went over this share of what it went over in all windows.
const MOVED: f32 = 0.05;

/// The windows that say something, with their places among all.
struct Informing<'a> {
    places: Vec<usize>,
    information: Vec<&'a WindowInformation>,
    inputs: Vec<&'a [[f32; 2]]>,
    following: Vec<&'a [Option<[f32; 2 * LAGS]>]>,
}

impl Selecting {
    /// The windows that fix what is wanted best, of those that were looked at; when `stop` is raised, the best so far.
    /// Answers nothing where windows were looked at by another program.
    #[must_use]
    pub fn select(
        &self,
        span: SelectedSpan,
        looked: &[LookedWindow],
        stop: &AtomicBool,
    ) -> Option<Selection> {
        let informing = informing(looked);
        let history = History::new(&self.present, &informing.information)?;
        let goal = self.goal();
        let choice = history.choose(&goal, stop);
        let chosen = choice.windows;
        let all = history.known_with(0..informing.places.len());
        let with_chosen = history.known_with(chosen.iter().copied());
        let is_reached = history.fulfils(with_chosen.as_deref(), &goal);
        let never_fixed = self.never_fixed(all.as_deref(), &goal);
        let moved = Moved::new(self, &informing);
        let windows = chosen.iter().map(|window| {
            let place = informing.places[*window];
            let others = chosen.iter().copied().filter(|other| other != window);
            let without = history.known_with(others);
            ChosenWindow {
                window: place as u64,
                from: instant(span.bounds(place).0),
                to: instant(span.bounds(place).1),
                samples: informing.information[*window].samples,
                adds: self.adds(with_chosen.as_deref(), without.as_deref()),
                moved: moved.in_window(informing.inputs[*window]),
            }
        });
        let chosen: Vec<ChosenWindow> = windows.collect();
        let finished = choice.is_finished && looked.len() == span.count();
        let feedback = self.feedback(&informing);
        let mut findings = self.findings(&never_fixed, is_reached, finished);
        findings.extend(feedback.first().map(controlled));
        findings.extend(started_elsewhere(looked));
        Some(Selection {
            model: self.job.model.clone(),
            job: self.spec.job,
            stream: self.spec.stream.clone(),
            from: instant(span.from),
            to: instant(span.until),
            window_s: self.spec.window,
            initial_state: self.spec.initial_state.clone(),
            finished,
            wanted: self.wanted_parameters(&goal),
            reached: goal
                .targets
                .iter()
                .any(Option::is_some)
                .then_some(is_reached),
            samples: chosen.iter().map(|window| window.samples).sum(),
            with_chosen: self.predicted(with_chosen),
            with_random: self.predicted(history.known_at_random(
                chosen.len(),
                silent(looked),
                self.spec.seed,
            )),
            with_all: self.predicted(all),
            chosen,
            never_fixed,
            feedback,
            windows: self.windows(looked, &informing, &history.known_alone()),
            left_out: left_out(span, looked),
            findings,
        })
    }

    fn goal(&self) -> WindowGoal {
        let targets = self.wanted.iter().map(|index| {
            let coordinate = &self.shared.coordinates[*index];
            let target = self.spec.targets.get(&coordinate.quantity)?;
            Some(target.of(coordinate.value(self.positions[*index])))
        });
        WindowGoal {
            targets: targets.collect(),
            most_samples: self.spec.most_samples.unwrap_or(u64::MAX),
            most_windows: self.spec.most_windows,
        }
    }

    fn name(&self, unknown: usize) -> &str {
        &self.shared.coordinates[unknown].name
    }

    fn wanted_parameters(&self, goal: &WindowGoal) -> Vec<WantedParameter> {
        let wanted = self.wanted.iter().zip(&goal.targets);
        let wanted = wanted.map(|(index, target)| WantedParameter {
            name: self.name(*index).to_owned(),
            target: *target,
        });
        wanted.collect()
    }

    fn predicted(&self, knowledge: Option<Vec<Known>>) -> Vec<PredictedParameter> {
        predicted(&self.shared, &self.positions, knowledge)
    }

    /// The inputs that follow an output, over all windows together.
    fn feedback(&self, informing: &Informing<'_>) -> Vec<FollowedOutput> {
        let inputs = Moved::new(self, informing).inputs;
        let pairs = 0..self.shared.outputs.len() * inputs.len();
        let followed = pairs.filter_map(|pair| {
            let windows = informing.following.iter();
            let windows = windows.filter_map(|window| window.get(pair)?.as_ref());
            let following = following(windows)?;
            Some(FollowedOutput {
                input: inputs[pair % inputs.len()].0.to_owned(),
                output: self.shared.outputs[pair / inputs.len()].name.clone(),
                samples_later: following.lag as u64,
                score: following.score,
            })
        });
        followed.collect()
    }

    /// The wanted parameters that all windows together do not fix.
    fn never_fixed(&self, all: Option<&[Known]>, goal: &WindowGoal) -> Vec<String> {
        let is_fixed = |unknown: usize, target: Option<f64>| {
            let Some(total) = all.and_then(|all| all[unknown].total) else {
                return false;
            };
            let coordinate = &self.shared.coordinates[unknown];
            let value = coordinate.value(self.positions[unknown]);
            target.map_or_else(
                || !is_too_wide(coordinate, value, total),
                |target| total <= target,
            )
        };
        let wanted = self.wanted.iter().zip(&goal.targets);
        let never = wanted.filter(|(unknown, target)| !is_fixed(**unknown, **target));
        never
            .map(|(unknown, _)| self.name(*unknown).to_owned())
            .collect()
    }

    /// The share by which the total variance of each parameter would be larger without a window.
    fn adds(&self, with: Option<&[Known]>, without: Option<&[Known]>) -> BTreeMap<String, f64> {
        let share = |unknown: usize| {
            let with = with?[unknown].total?;
            let without = without.and_then(|without| without[unknown].total);
            Some(without.map_or(1.0, |without| {
                (1.0 - (with / without).powi(2)).clamp(0.0, 1.0)
            }))
        };
        let unknowns = 0..self.shared.coordinates.len();
        let adds =
            unknowns.map(|unknown| (self.name(unknown).to_owned(), share(unknown).unwrap_or(0.0)));
        adds.collect()
    }

    fn windows(
        &self,
        looked: &[LookedWindow],
        informing: &Informing<'_>,
        alone: &[Option<Vec<Known>>],
    ) -> WindowsOfSelection {
        let of_unknown = |unknown: usize| {
            let mut errors = vec![None; looked.len()];
            for (place, knowledge) in informing.places.iter().zip(alone) {
                errors[*place] = knowledge
                    .as_ref()
                    .and_then(|knowledge| knowledge[unknown].total);
            }
            errors
        };
        let wanted = self.wanted.iter();
        WindowsOfSelection {
            count: looked.len() as u64,
            alone: wanted
                .map(|unknown| (self.name(*unknown).to_owned(), of_unknown(*unknown)))
                .collect(),
            left_out: looked.iter().map(reason).collect(),
        }
    }

    fn findings(&self, never_fixed: &[String], is_reached: bool, finished: bool) -> Vec<Finding> {
        let mut findings = Vec::new();
        if !never_fixed.is_empty() {
            let names: Vec<String> = never_fixed.iter().map(|name| format!("`{name}`")).collect();
            let detail = format!(
                "not even all windows together fix {} as closely as is wanted: ask for a design (`POST /v1/designs` \
                 with this `job`) of what to record instead",
                names.join(", ")
            );
            findings.push(Finding::new("never_fixed", "/wanted", &detail));
        } else if !self.spec.targets.is_empty() && !is_reached {
            let detail = format!(
                "{} windows of this length do not reach the target, though all together do: make `window_s` longer, \
                 or `budget_samples` and `max_windows` larger",
                self.spec.most_windows
            );
            findings.push(Finding::new("target_not_reached", "/target", &detail));
        }
        if !finished {
            let detail = "the job ended before all windows and their exchanges were looked at: this is the best so far";
            findings.push(Finding::new("not_finished", "", detail));
        }
        findings
    }
}

/// Which inputs moved in a window, by what they went over in all windows.
struct Moved<'a> {
    /// The inputs with what they went over in all windows.
    inputs: Vec<(&'a str, f32)>,
}

impl<'a> Moved<'a> {
    fn new(selecting: &'a Selecting, informing: &Informing<'_>) -> Moved<'a> {
        let description = selecting.model.description();
        let signals = &selecting.job.experiments[0].signals;
        let mut sets = description.input_sets.iter();
        let set = sets.find(|set| set.iter().all(|input| signals.contains_key(&**input)));
        let range = |place: usize| {
            let extremes = informing
                .inputs
                .iter()
                .filter_map(|inputs| inputs.get(place));
            let joined = extremes.fold(
                [f32::INFINITY, f32::NEG_INFINITY],
                |joined, [least, greatest]| [joined[0].min(*least), joined[1].max(*greatest)],
            );
            joined[1] - joined[0]
        };
        let names = set.into_iter().flatten().enumerate();
        Moved {
            inputs: names.map(|(place, name)| (&**name, range(place))).collect(),
        }
    }

    fn in_window(&self, extremes: &[[f32; 2]]) -> Vec<String> {
        let inputs = self.inputs.iter().zip(extremes);
        let moved =
            inputs.filter(|((_, range), [least, greatest])| greatest - least > MOVED * range);
        moved.map(|((name, _), _)| (*name).to_owned()).collect()
    }
}

fn instant(nanoseconds: i64) -> Timestamp {
    Timestamp::from_nanosecond(nanoseconds.into()).expect("an instant of 64 bits")
}

fn informing(looked: &[LookedWindow]) -> Informing<'_> {
    let mut informing = Informing {
        places: Vec::new(),
        information: Vec::new(),
        inputs: Vec::new(),
        following: Vec::new(),
    };
    for (place, window) in looked.iter().enumerate() {
        if let LookedWindow::Informs {
            information,
            inputs,
            following,
        } = window
        {
            informing.places.push(place);
            informing.information.push(information);
            informing.inputs.push(inputs);
            informing.following.push(following);
        }
    }
    informing
}

fn reason(window: &LookedWindow) -> Option<LeftOut> {
    match window {
        LookedWindow::Informs { .. } => None,
        LookedWindow::LeftOut(reason) => Some(*reason),
    }
}

/// The finding of an input that a controller makes.
fn controlled(followed: &FollowedOutput) -> Finding {
    let FollowedOutput { input, output, .. } = followed;
    let detail = format!(
        "`{input}` follows `{output}`: a controller makes it, or somebody who looks. What noise and disturbances have moved \
         it by counts as excitation here; put the controller into the model, with its set point as the input, or leave \
         out the time in which it acts"
    );
    Finding::new("feedback", "/stream", &detail)
}

/// The finding of windows that were left out because the model starts elsewhere.
fn started_elsewhere(looked: &[LookedWindow]) -> Option<Finding> {
    let reasons = looked.iter().filter_map(reason);
    let count = reasons
        .filter(|reason| *reason == LeftOut::StartsElsewhere)
        .count();
    (count > 0).then(|| {
        let detail = format!(
            "in {count} windows the model starts elsewhere than the first samples: say where each window begins, as a \
             range that is estimated (`\"initial_state\": {{\"STATE\": {{\"estimate\": {{\"lower\": …, \"upper\": …}}}}}}`) or as \
             `first_sample` for a state that is a measured output"
        );
        Finding::new("starts_elsewhere", "/initial_state", &detail)
    })
}

/// How many windows say nothing because nothing moved in them.
fn silent(looked: &[LookedWindow]) -> usize {
    let still = [LeftOut::InputsStoodStill, LeftOut::OutputStoodStill];
    let reasons = looked.iter().filter_map(reason);
    reasons.filter(|reason| still.contains(reason)).count()
}

fn left_out(span: SelectedSpan, looked: &[LookedWindow]) -> Vec<LeftOutCount> {
    let mut counts: BTreeMap<LeftOut, (u64, i64)> = BTreeMap::new();
    for (place, reason) in looked.iter().map(reason).enumerate() {
        if let Some(reason) = reason {
            let (from, until) = span.bounds(place);
            let count = counts.entry(reason).or_default();
            *count = (count.0 + 1, count.1 + (until - from));
        }
    }
    let counts = counts
        .into_iter()
        .map(|(reason, (windows, nanoseconds))| LeftOutCount {
            reason,
            windows,
            hours: nanoseconds as f64 / 3.6e12,
        });
    counts.collect()
}
