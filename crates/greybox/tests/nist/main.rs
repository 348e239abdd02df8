//! The nonlinear regression sets of the statistical reference datasets (NIST/ITL StRD, a work of
//! the United States government in the public domain), each from both of its starting points:
//! parameters and standard errors against the certified values.
//!
//! The predictor is the input, a sample for each observation; the only state is the time, which
//! acts on nothing.

use greybox::Identification;
use greybox::estimation::{Estimation, Problem, Settings, sensitivity};
use greybox::numerics::least_squares::RowGatherer;
use greybox::recording::{Recording, Signal, TimeAxis};
use greybox::simulation::Accuracy;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use std::sync::atomic::AtomicBool;

#[derive(Deserialize)]
struct Set {
    name: String,
    level: String,
    expression: String,
    parameters: Vec<Parameter>,
    y: Vec<f64>,
    x: Vec<f64>,
    x2: Option<Vec<f64>>,
}

#[derive(Deserialize)]
struct Parameter {
    starts: [f64; 2],
    certified: f64,
    deviation: f64,
}

impl Parameter {
    /// A search range with the start in its middle, wide enough to hold the certified value.
    fn range(&self, start: usize) -> Value {
        let from = self.starts[start];
        let ratio = from / self.certified;
        if from > 0.0 && ratio > 0.0 && !(0.02..50.0).contains(&ratio) {
            return json!({"lower": from / 1e8, "upper": from * 1e8, "scale": "log"});
        }
        let reach = 5.0 * from.abs().max(self.certified.abs());
        json!({"lower": from - reach, "upper": from + reach, "scale": "linear"})
    }
}

static NEVER: AtomicBool = AtomicBool::new(false);

fn sets() -> Vec<Set> {
    serde_json::from_str(include_str!("sets.json")).expect("the sets")
}

impl Set {
    /// The response as it is fitted: the model of one set is of its logarithm.
    fn response(&self) -> Vec<f64> {
        match self.name.as_str() {
            "Nelson" => self.y.iter().map(|y| y.ln()).collect(),
            _ => self.y.clone(),
        }
    }

    fn recording(&self) -> Recording {
        let time = TimeAxis::Uniform {
            sample_time: 1.0,
            samples: self.y.len(),
        };
        let mut signals = vec![
            Signal::new("y", "1", self.response()),
            Signal::new("x", "1", self.x.clone()),
        ];
        if let Some(x2) = &self.x2 {
            signals.push(Signal::new("x2", "1", x2.clone()));
        }
        Recording::new(time, signals)
    }

    fn document(&self) -> Value {
        let names = (1..=self.parameters.len()).map(|number| format!("b{number}"));
        let parameters: Map<String, Value> = names
            .map(|name| {
                (
                    name,
                    json!({"unit": "unitless", "default": 1, "unknown": true}),
                )
            })
            .collect();
        let mut inputs = json!({"x": {"unit": "unitless"}});
        if self.x2.is_some() {
            inputs["x2"] = json!({"unit": "unitless"});
        }
        json!({
            "name": self.name.to_lowercase(),
            "inputs": inputs,
            "parameters": parameters,
            "states": {"time": {"unit": "s", "derivative": "1", "initial": 0}},
            "outputs": {"y": {"unit": "unitless", "expression": self.expression}}
        })
    }

    fn problem(&self, start: usize) -> (Problem, Settings) {
        let ranges = self
            .parameters
            .iter()
            .enumerate()
            .map(|(index, parameter)| {
                let range = json!({"estimate": parameter.range(start)});
                (format!("b{}", index + 1), range)
            });
        let job = json!({
            "model": self.document(),
            "experiments": [{}],
            "parameters": ranges.collect::<Map<String, Value>>(),
            // Least squares from the middle of the ranges alone.
            "method": {"generations": 0},
            "validation": {"fraction": 0},
            "seed": 1
        });
        let assembly = Identification::of_job(job, self.recording()).assembly();
        let (assembly, spec) = assembly.unwrap_or_else(|error| panic!("{}: {error}", self.name));
        (assembly.problem, spec.method)
    }
}

/// Digits that agree with a certified value.
fn digits(found: f64, certified: f64) -> f64 {
    let error = (found - certified).abs() / certified.abs();
    if error.is_nan() {
        0.0
    } else {
        -error.max(1e-16).log10()
    }
}

/// The fewest digits of any parameter, and of any standard error.
fn agreement(set: &Set, start: usize) -> (f64, f64) {
    let (problem, settings) = set.problem(start);
    let mut run = Estimation::start(&problem, &settings, 1);
    let Some(report) = run.run(&problem, &NEVER, &mut ()) else {
        return (0.0, 0.0);
    };
    let pairs = report.values.iter().zip(&set.parameters);
    let of_values = pairs.map(|(value, known)| digits(*value, known.certified));
    let of_errors = standard_errors(&problem, &report.positions)
        .into_iter()
        .zip(&set.parameters)
        .map(|(error, known)| digits(error, known.deviation));
    (
        of_values.fold(16.0, f64::min),
        of_errors.fold(16.0, f64::min),
    )
}

/// By the derivatives with which the program linearises.
fn standard_errors(problem: &Problem, positions: &[f64]) -> Vec<f64> {
    let mut rows = RowGatherer::new(positions.len());
    let mut squares = 0.0;
    let gather = |row: sensitivity::Row<'_>| {
        rows.add(row.derivatives.iter().copied(), 0.0);
        squares += row.residual * row.residual;
    };
    sensitivity::visit_rows(problem, positions, Accuracy::Full, &NEVER, gather)
        .expect("the estimate can be simulated");
    let triangle = rows.finish();
    let freedom = (triangle.rows() - positions.len()) as f64;
    let factor = triangle.factor();
    let identity = nalgebra::DMatrix::identity(positions.len(), positions.len());
    let inverse = factor.solve_upper_triangular(&identity);
    let Some(inverse) = inverse else {
        return vec![f64::NAN; positions.len()];
    };
    let errors = (0..positions.len()).map(|index| {
        let slope = problem.coordinates[index].slope(positions[index]).abs();
        inverse.row(index).norm() * (squares / freedom).sqrt() * slope
    });
    errors.collect()
}

/// Its first start is fifty times too large, with exponents that overflow nearly everywhere around
/// it: least squares ends in another minimum.
const OTHER_MINIMUM: (&str, usize) = ("MGH17", 0);

/// Digits that agree at least, of parameters and of standard errors.
fn expected(set: &Set) -> (f64, f64) {
    match set.name.as_str() {
        // What it leaves is 1e-13 of the observations: rounding of the observations themselves.
        "Lanczos1" => (8.0, 2.5),
        // The eighth digit is that of rounding: 7.5 and 7.97 were seen.
        "Bennett5" | "Lanczos3" => (7.0, 4.0),
        _ => (8.0, 4.0),
    }
}

#[test]
fn certified_parameters_and_standard_errors_are_reached_from_both_starts() {
    let sets = sets();
    assert_eq!(sets.len(), 27);
    let mut faults = Vec::new();
    for set in sets {
        let least = expected(&set);
        for start in [0, 1] {
            if (set.name.as_str(), start) == OTHER_MINIMUM {
                continue;
            }
            let (of_values, of_errors) = agreement(&set, start);
            let line = format!(
                "{} ({}), start {}: {of_values:.1} and {of_errors:.1} digits",
                set.name,
                set.level,
                start + 1
            );
            println!("{line}");
            if of_values < least.0 || of_errors < least.1 {
                faults.push(line);
            }
        }
    }
    assert_eq!(faults, Vec::<String>::new());
}
