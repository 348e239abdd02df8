//! The records, their models, and the likelihood of one under the other.

use greybox_numerics::lanes::Lanes;
use greybox_simulation::batch::{self, BatchRun, Sink};
use greybox_simulation::filter::FilterLayout;
use greybox_simulation::model::{Model, document};
use greybox_simulation::{Accuracy, DrivingInputs, SimulatedCandidate, single};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/process_noise")
}

/// For each record its true values and likelihoods.
pub fn reference() -> Value {
    let text = std::fs::read_to_string(folder().join("reference.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

/// The equations of a record, all in plain numbers.
pub struct RecordModel {
    pub parameters: Vec<&'static str>,
    /// Name, rate and start of each state.
    pub states: Vec<(&'static str, &'static str, &'static str)>,
    pub output: &'static str,
    pub is_linear_between_samples: bool,
}

impl RecordModel {
    fn compiled(&self, inputs: &[String]) -> Model {
        let unit = json!({"unit": "1"});
        let parameter = json!({"unit": "1", "default": 1, "lower": 1e-9, "upper": 1e9});
        let section = |names: &mut dyn Iterator<Item = (String, Value)>| -> Value {
            Value::Object(names.collect::<Map<_, _>>())
        };
        let states = self.states.iter().map(|(name, derivative, initial)| {
            let state = json!({"unit": "1", "derivative": derivative, "initial": initial});
            ((*name).to_owned(), state)
        });
        let hold = if self.is_linear_between_samples {
            "first"
        } else {
            "zero"
        };
        let document = json!({
            "name": "record",
            "title": "record",
            "inputs": section(&mut inputs.iter().map(|name| (name.clone(), unit.clone()))),
            "parameters": section(
                &mut self.parameters.iter().map(|name| ((*name).to_owned(), parameter.clone()))
            ),
            "states": section(&mut states.into_iter()),
            "outputs": {"seen": {"unit": "1", "expression": self.output}},
            "options": {"input_hold": hold},
        });
        let read = document::read(&document);
        read.unwrap_or_else(|faults| panic!("{faults:#?}")).model
    }
}

/// The values at which a record is filtered.
#[derive(Clone, Copy)]
pub struct Point<'a> {
    /// Those of the model, by name.
    pub values: &'a Value,
    /// Those of the disturbances and of the sensor.
    pub noise: &'a [f64],
    pub accuracy: Accuracy,
}

impl Point<'_> {
    /// The parameters of the filter of a model.
    fn parameters(&self, model: &RecordModel) -> Vec<f64> {
        let of_model = model.parameters.iter();
        let of_model = of_model.map(|name| self.values[*name].as_f64().unwrap());
        of_model.chain(self.noise.iter().copied()).collect()
    }
}

/// The outputs of all lanes of a piece.
struct AllLanes(Vec<Lanes>);

impl Sink for AllLanes {
    fn consume(&mut self, _first_sample: usize, outputs: &[Lanes]) {
        self.0.extend_from_slice(outputs);
    }
}

/// Instants, inputs and the measured output.
pub struct Record {
    instants: Vec<f64>,
    names: Vec<String>,
    pub columns: Vec<Vec<f64>>,
}

impl Record {
    pub fn read(name: &str) -> Record {
        let path = folder().join(format!("{name}.csv"));
        let mut reader = csv::Reader::from_path(path).unwrap();
        let plain = |header: &str| header.split(" [").next().unwrap().to_owned();
        let names: Vec<String> = reader.headers().unwrap().iter().map(plain).collect();
        let mut columns = vec![Vec::new(); names.len()];
        for row in reader.records() {
            for (column, cell) in columns.iter_mut().zip(&row.unwrap()) {
                column.push(cell.parse().unwrap_or(f64::NAN));
            }
        }
        let instants = columns.remove(0);
        let inputs = names.len() - 2;
        Record {
            instants,
            names: names[1..=inputs].to_vec(),
            columns,
        }
    }

    /// The time between the first two samples `[s]`.
    pub fn interval(&self) -> f64 {
        self.instants[1] - self.instants[0]
    }

    /// A record of so many zeros of one input and of the output.
    pub fn of_zeros(input: &str, interval: f64, samples: usize) -> Record {
        Record {
            instants: (0..samples)
                .map(|sample| sample as f64 * interval)
                .collect(),
            names: vec![input.to_owned()],
            columns: vec![vec![0.0; samples]; 2],
        }
    }

    /// The record with `steps` stairs between two samples in the place of a straight line of each input.
    pub fn with_stairs(&self, steps: usize) -> Record {
        let last = self.instants.len() - 1;
        let steps_of = |sample: usize| if sample < last { 0..steps } else { 0..1 };
        let stairs: Vec<(usize, usize)> = (0..=last)
            .flat_map(|sample| steps_of(sample).map(move |step| (sample, step)))
            .collect();
        let share = |step: usize, ahead: f64| (step as f64 + ahead) / steps as f64;
        // The values so far ahead of the beginning of each stair, in stairs.
        let along = |values: &[f64], ahead: f64| -> Vec<f64> {
            let between = |(sample, step): &(usize, usize)| {
                let next = values[last.min(sample + 1)];
                values[*sample] + share(*step, ahead) * (next - values[*sample])
            };
            stairs.iter().map(between).collect()
        };
        let (inputs, measured) = self.columns.split_at(self.names.len());
        let seen = |(sample, step): &(usize, usize)| match step {
            0 => measured[0][*sample],
            _ => f64::NAN,
        };
        let inputs = inputs.iter().map(|values| along(values, 0.5));
        Record {
            instants: along(&self.instants, 0.0),
            names: self.names.clone(),
            columns: inputs.chain([stairs.iter().map(seen).collect()]).collect(),
        }
    }

    /// The record without these samples, ascending.
    pub fn remove(&mut self, samples: &[usize]) {
        for column in self.columns.iter_mut().chain([&mut self.instants]) {
            let mut place = 0;
            column.retain(|_| {
                place += 1;
                samples.binary_search(&(place - 1)).is_err()
            });
        }
    }

    /// What is expected of the output and the variance of its error, sample by sample; without a
    /// layout what the model simulates.
    pub fn predicted(
        &self,
        model: &RecordModel,
        layout: Option<&FilterLayout>,
        point: Point<'_>,
    ) -> Vec<Vec<f64>> {
        let compiled = self.compiled(model, layout);
        let parameters = point.parameters(model);
        let initial_state = vec![None; model.states.len()];
        let candidate = SimulatedCandidate {
            parameters: &parameters,
            initial_state: &initial_state,
        };
        let recordings = [(self.excitation(point), candidate)];
        let stop = AtomicBool::new(false);
        let outputs = single::outputs(compiled.plant(), &recordings, &stop);
        outputs.unwrap().unwrap().remove(0)
    }

    /// What is expected at a point whose candidate goes through the record beside others, each with its first
    /// parameter multiplied by one of these factors.
    pub fn predicted_among(
        &self,
        model: &RecordModel,
        layout: &FilterLayout,
        point: Point<'_>,
        factors: &[f64],
    ) -> Vec<Vec<f64>> {
        let compiled = self.compiled(model, Some(layout));
        let middle = point.parameters(model);
        let others = factors.iter().map(|factor| {
            let mut parameters = middle.clone();
            parameters[0] *= factor;
            parameters
        });
        let mut parameters: Vec<Vec<f64>> = others.collect();
        let place = parameters.len() / 2;
        parameters.insert(place, middle.clone());
        let initial_state = vec![None; model.states.len()];
        let candidates = parameters.iter().map(|parameters| SimulatedCandidate {
            parameters,
            initial_state: &initial_state,
        });
        let run = BatchRun {
            excitation: self.excitation(point),
            candidates: candidates.collect(),
            in_step: 0,
        };
        let stop = AtomicBool::new(false);
        let sink = |_| AllLanes(Vec::new());
        let pieces = batch::simulate(compiled.plant(), &[run], &stop, sink).unwrap();
        let lane_of = |members: &[usize]| members.iter().position(|member| *member == place);
        let mut pieces = pieces.iter();
        let (piece, lane) = pieces
            .find_map(|piece| Some((piece, lane_of(&piece.members)?)))
            .unwrap();
        let column = |output: usize| {
            let values = piece.sink.0.iter().skip(output).step_by(2);
            values.map(|value| value.0[lane]).collect()
        };
        vec![column(0), column(1)]
    }

    fn compiled(&self, model: &RecordModel, layout: Option<&FilterLayout>) -> Model {
        let compiled = model.compiled(&self.names);
        let Some(layout) = layout else {
            return compiled;
        };
        let layout = FilterLayout {
            n_inputs: self.names.len(),
            ..layout.clone()
        };
        compiled.filtered(&layout).unwrap()
    }

    fn excitation(&self, point: Point<'_>) -> DrivingInputs<'_> {
        DrivingInputs {
            sample_time: self.interval(),
            instants: Some(&self.instants),
            samples: self.instants.len(),
            input_set: 0,
            inputs: &self.columns,
            accuracy: point.accuracy,
        }
    }

    pub fn log_likelihood(
        &self,
        model: &RecordModel,
        layout: &FilterLayout,
        point: Point<'_>,
    ) -> f64 {
        let outputs = self.predicted(model, Some(layout), point);
        let measured = self.columns.last().unwrap().iter();
        let samples = measured.zip(outputs[0].iter().zip(&outputs[1]));
        samples
            .filter(|(measured, _)| !measured.is_nan())
            .map(|(measured, (predicted, variance))| {
                let error = measured - predicted;
                let scale = (2.0 * std::f64::consts::PI * variance).ln();
                -0.5 * (scale + error * error / variance)
            })
            .sum()
    }
}
