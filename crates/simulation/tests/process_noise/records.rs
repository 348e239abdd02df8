//! The records, their models, and the likelihood of one under the other.

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
        let compiled = model.compiled(&self.names);
        let filtered = layout.map(|layout| {
            let layout = FilterLayout {
                n_inputs: self.names.len(),
                ..layout.clone()
            };
            compiled.filtered(&layout).unwrap()
        });
        let of_model = model.parameters.iter();
        let of_model = of_model.map(|name| point.values[*name].as_f64().unwrap());
        let parameters: Vec<f64> = of_model.chain(point.noise.iter().copied()).collect();
        let excitation = DrivingInputs {
            sample_time: self.interval(),
            instants: Some(&self.instants),
            samples: self.instants.len(),
            input_set: 0,
            inputs: &self.columns,
            accuracy: point.accuracy,
        };
        let candidate = SimulatedCandidate {
            parameters: &parameters,
            initial_state: &vec![None; model.states.len()],
        };
        let plant = filtered.as_ref().unwrap_or(&compiled).plant();
        let stop = AtomicBool::new(false);
        let outputs = single::outputs(plant, &[(excitation, candidate)], &stop);
        outputs.unwrap().unwrap().remove(0)
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
