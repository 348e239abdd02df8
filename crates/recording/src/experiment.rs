//! The part of a recording that one estimation uses.

use super::resample::{ResampleGrid, ResampleRule, filled, is_of_grid};
use super::{
    Exclude, ExperimentError, Interpolation, Recording, Signal, TimeAxis, TimeWindow, Warning,
};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// In SI units and under the model's signal names; ready for an estimation.
#[derive(Clone, Debug)]
pub struct ExperimentData {
    /// The sample time `[s]`; the median interval of the recording where the samples have instants
    /// of their own.
    pub sample_time: f64,
    /// When the samples were taken, from the recording's first `[s]`, where they are not uniform.
    pub instants: Option<Vec<f64>>,
    /// The number of samples of every signal.
    pub samples: usize,
    /// Model names and values, in the order in which they were asked for; NaN is a missing sample.
    pub signals: Vec<(String, Vec<f64>)>,
    /// How the samples differ from the recording's, e.g. `resampled`.
    pub notes: Vec<Warning>,
}

/// Which instants the samples of an irregular recording get.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Instants {
    /// The instants at which samples were taken. What is measured is compared there alone; an
    /// input without a sample there goes on from the one before, as its `interpolation` says.
    Own,
    /// A uniform grid of the recording's median sample time, on which every signal is
    /// interpolated; what is measured only where a sample was taken within half a sample time.
    Grid,
}

/// What of a recording an experiment is made of.
#[derive(Clone, Copy, Debug, Default)]
pub struct RecordingSelection<'a> {
    /// The part of its time; none: all.
    pub window: Option<TimeWindow>,
    /// What is left out; none: nothing.
    pub exclude: Option<&'a Exclude>,
    /// Which instants irregular samples get; none: a grid where the samples are those of one but
    /// for jitter and single gaps, else their own.
    pub instants: Option<Instants>,
}

/// A recorded signal under the name that a model has for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mapped {
    /// The model's name.
    pub model: String,
    /// The recording's name.
    pub recorded: String,
    /// How the signal goes on between samples where the recording does not say.
    pub otherwise: Interpolation,
    /// Whether the signal drives the model, so that every instant needs a value.
    pub drives: bool,
}

impl Mapped {
    /// A signal that is held where the recording does not say otherwise: an input.
    #[must_use]
    pub fn held(model: &str, recorded: &str) -> Self {
        Self {
            otherwise: Interpolation::Hold,
            drives: true,
            ..Self::on_line(model, recorded)
        }
    }

    /// A signal that is interpolated where the recording does not say otherwise: an output.
    #[must_use]
    pub fn on_line(model: &str, recorded: &str) -> Self {
        Self {
            model: model.to_owned(),
            recorded: recorded.to_owned(),
            otherwise: Interpolation::Linear,
            drives: false,
        }
    }
}

impl Recording {
    /// The experiment of the given signals in a window, without what is left out.
    ///
    /// Irregular samples keep their instants, or are put on a grid ([`Instants`]), each signal in
    /// its own way: a held one keeps its last value, another is interpolated linearly, what is
    /// measured only near its samples; a note says so.
    ///
    /// # Errors
    /// When a signal does not exist, the window holds fewer than two samples, or gaps make up nearly
    /// all of a grid.
    pub fn experiment(
        &self,
        signals: &[Mapped],
        selection: RecordingSelection<'_>,
    ) -> Result<ExperimentData, ExperimentError> {
        let recorded: Vec<&Signal> = signals
            .iter()
            .map(|signal| self.mapped(&signal.model, &signal.recorded))
            .collect::<Result<_, _>>()?;
        let range = selection.window.unwrap_or_default().samples(&self.time)?;
        let sample_time = self.time.sample_time();
        let mut notes = Vec::new();
        let mut cut = Vec::with_capacity(recorded.len());
        for (signal, mapped) in recorded.iter().zip(signals) {
            let mut values = signal.values[range.clone()].to_vec();
            if let Some(exclude) = selection.exclude {
                let left_out = exclude.apply(signal, &self.time, range.start, &mut values);
                notes.extend(excluded(&mapped.model, left_out));
            }
            let rule = ResampleRule::of(signal.interpolation, mapped.otherwise);
            cut.push((values, rule, mapped.drives));
        }
        let mut own_instants = None;
        let (samples, values): (usize, Vec<Vec<f64>>) = match &self.time {
            TimeAxis::Uniform { .. } => (
                range.len(),
                cut.into_iter().map(|(values, ..)| values).collect(),
            ),
            TimeAxis::Instants(instants) => {
                let instants = &instants[range.clone()];
                let is_gridded = || match is_of_grid(instants, sample_time) {
                    true => Instants::Grid,
                    false => Instants::Own,
                };
                match selection.instants.unwrap_or_else(is_gridded) {
                    Instants::Own => {
                        notes.push(irregular(range.len()));
                        own_instants = Some(instants.to_vec());
                        let filled_columns =
                            cut.into_iter().map(|(values, rule, drives)| match drives {
                                true => filled(instants, &values, sample_time, rule),
                                false => values,
                            });
                        (range.len(), filled_columns.collect())
                    }
                    Instants::Grid => {
                        let grid = ResampleGrid::over(instants, sample_time)?;
                        notes.push(resampled(range.len(), grid.samples(), sample_time));
                        let on_grid = cut.iter().map(|(values, rule, drives)| match drives {
                            true => grid.resample(values, *rule),
                            false => grid.measured(values, *rule),
                        });
                        (grid.samples(), on_grid.collect())
                    }
                }
            }
        };
        let names = signals.iter().map(|signal| signal.model.clone());
        let signals: Vec<(String, Vec<f64>)> = names.zip(values).collect();
        notes.extend(
            signals
                .iter()
                .filter_map(|(name, values)| missing(name, values)),
        );
        Ok(ExperimentData {
            sample_time,
            instants: own_instants,
            samples,
            signals,
            notes,
        })
    }

    fn mapped(&self, model_signal: &str, dataset_signal: &str) -> Result<&Signal, ExperimentError> {
        self.signal(dataset_signal)
            .ok_or_else(|| ExperimentError::NoSuchSignal {
                model_signal: model_signal.to_owned(),
                dataset_signal: dataset_signal.to_owned(),
                available: self
                    .signals
                    .iter()
                    .map(|signal| signal.name.clone())
                    .collect(),
            })
    }
}

impl ExperimentData {
    /// The values of the signal of that model name.
    #[must_use]
    pub fn signal(&self, name: &str) -> Option<&[f64]> {
        self.signals
            .iter()
            .find(|(signal, _)| signal == name)
            .map(|(_, values)| values.as_slice())
    }
}

fn irregular(samples: usize) -> Warning {
    let detail = format!(
        "{samples} samples at irregular times: each is compared at its own; an input without a \
         sample goes on from the one before"
    );
    Warning::of_recording("own_instants", detail)
}

fn resampled(from: usize, to: usize, sample_time: f64) -> Warning {
    let detail = format!(
        "{from} samples at irregular times put on {to} samples at {sample_time} s; held signals keep \
         their last value, others are interpolated linearly, and missing where no sample was taken \
         within half a sample time"
    );
    Warning::of_recording("resampled", detail)
}

fn excluded(name: &str, samples: usize) -> Option<Warning> {
    let detail = || format!("{samples} samples are left out, as the job asks");
    (samples > 0).then(|| Warning::of_signal("excluded_samples", name, detail()))
}

fn missing(name: &str, values: &[f64]) -> Option<Warning> {
    let missing = values.iter().filter(|value| value.is_nan()).count();
    let detail = || format!("{missing} of {} samples are missing", values.len());
    (missing > 0).then(|| Warning::of_signal("missing_samples", name, detail()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(names: &[(&str, &str)]) -> Vec<Mapped> {
        let mapped = names.iter();
        mapped
            .map(|(model, recorded)| Mapped::on_line(model, recorded))
            .collect()
    }

    fn within(window: TimeWindow) -> RecordingSelection<'static> {
        RecordingSelection {
            window: Some(window),
            ..RecordingSelection::default()
        }
    }

    fn on_grid(window: Option<TimeWindow>) -> RecordingSelection<'static> {
        RecordingSelection {
            window,
            instants: Some(Instants::Grid),
            ..RecordingSelection::default()
        }
    }

    #[test]
    fn samples_keep_their_instants_and_an_input_goes_on_between_its_own() {
        let time = TimeAxis::Instants(vec![0.0, 1.0, 1.5, 6.0, 7.25]);
        let gap = f64::NAN;
        let command = Signal::new("u", "V", vec![1.0, gap, 2.0, gap, gap]);
        let level = Signal::new("h", "m", vec![gap, 0.1, gap, 0.3, 0.4]);
        let mapped = [Mapped::held("u", "u"), Mapped::on_line("h", "h")];
        let experiment = Recording::new(time, vec![command, level])
            .experiment(&mapped, RecordingSelection::default())
            .unwrap();
        assert_eq!(
            experiment.instants.as_deref(),
            Some(&[0.0, 1.0, 1.5, 6.0, 7.25][..])
        );
        assert_eq!(experiment.signal("u"), Some(&[1.0, 1.0, 2.0, 2.0, 2.0][..]));
        let present = |value: &f64| !value.is_nan();
        let level = experiment.signal("h").unwrap();
        let measured: Vec<f64> = level.iter().copied().filter(present).collect();
        assert_eq!(measured, [0.1, 0.3, 0.4], "nothing is interpolated");
    }

    #[test]
    fn jitter_and_single_gaps_are_of_a_grid_and_sparse_samples_are_not() {
        let of = |instants: Vec<f64>| {
            let time = TimeAxis::Instants(instants);
            let experiment = recording(time)
                .experiment(&map(&[("position", "pos")]), RecordingSelection::default());
            experiment.unwrap().instants.is_some()
        };
        let jittering = (0..100).map(|k| f64::from(k) + 0.01 * f64::from(k % 3));
        assert!(!of(jittering.collect()));
        let with_gaps = (0..100).filter(|k| k % 17 != 5).map(f64::from);
        assert!(!of(with_gaps.collect()));
        assert!(of(vec![0.0, 60.0, 120.0, 240.0, 300.0, 600.0]));
        let spreading = (0..100).map(|k| f64::from(k * k));
        assert!(of(spreading.collect()));
    }

    fn recording(time: TimeAxis) -> Recording {
        let values = (0..time.samples()).map(|k| k as f64).collect();
        Recording::new(time, vec![Signal::new("pos", "m", values)])
    }

    #[test]
    fn a_window_of_a_uniform_recording_is_copied_under_the_models_name() {
        let recording = recording(TimeAxis::Uniform {
            sample_time: 0.5,
            samples: 10,
        });
        let window = TimeWindow {
            from_s: Some(1.0),
            to_s: Some(2.5),
        };
        let experiment = recording
            .experiment(&map(&[("position", "pos")]), within(window))
            .unwrap();
        assert_eq!((experiment.sample_time, experiment.samples), (0.5, 4));
        assert_eq!(
            experiment.signal("position"),
            Some(&[2.0, 3.0, 4.0, 5.0][..])
        );
        assert!(experiment.notes.is_empty());
    }

    #[test]
    fn irregular_samples_are_resampled_where_it_is_asked_for_and_it_is_said() {
        let recording = recording(TimeAxis::Instants(vec![0.0, 1.0, 2.0, 6.0, 7.0]));
        let experiment = recording
            .experiment(&map(&[("position", "pos")]), on_grid(None))
            .unwrap();
        assert_eq!((experiment.sample_time, experiment.samples), (1.0, 8));
        let codes: Vec<&str> = experiment
            .notes
            .iter()
            .map(|note| note.code.as_str())
            .collect();
        assert_eq!(codes, ["resampled", "missing_samples"]);
        let values = experiment.signal("position").unwrap();
        assert_eq!(values.iter().filter(|value| value.is_nan()).count(), 3);
        assert_eq!(values[6..], [3.0, 4.0]);
    }

    #[test]
    fn the_window_does_not_change_the_sample_time_of_an_irregular_recording() {
        let recording = recording(TimeAxis::Instants(vec![0.0, 1.0, 2.0, 3.0, 4.5, 6.0, 7.0]));
        let window = TimeWindow {
            from_s: Some(3.0),
            to_s: Some(6.5),
        };
        let experiment = recording
            .experiment(&map(&[("position", "pos")]), on_grid(Some(window)))
            .unwrap();
        assert_eq!(experiment.sample_time, 1.0);
        assert_eq!(experiment.samples, 4);
    }

    #[test]
    fn a_signal_that_is_not_there_is_refused_with_those_that_are() {
        let recording = recording(TimeAxis::Uniform {
            sample_time: 0.5,
            samples: 10,
        });
        let error = recording
            .experiment(&map(&[("position", "x")]), RecordingSelection::default())
            .unwrap_err();
        let expected = "`position` is mapped to `x`, which the recording does not have; it has pos";
        assert_eq!(error.to_string(), expected);
    }
}
