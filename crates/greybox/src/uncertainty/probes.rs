//! What a document takes as exact or leaves out, each within a tolerance that nobody declared.
//!
//! Whoever writes equations rarely says how well an input or a sensor is known, or which losses a state has beside
//! those of the equations. Without any tolerance the total error would be that of noise alone, and the residuals
//! would be asked nothing. So the gain and the offset of each input, the gain, the offset and the lag of each
//! sensor, and a constant and a quadratic loss of each state that a force moves are assumptions with small
//! tolerances. They do not move the estimate; they widen its total error, and the residuals speak for or against
//! each of them. White innovations certify little: a disturbance makes up for a friction that the equations lack,
//! and the damping pays for it. The job says otherwise by name (`tolerances`).

use crate::estimation::problem::{Assumed, Assumption, Experiment, Problem, SensorNumber, Target};
use crate::estimation::trajectory;
use greybox_numerics::statistics;
use greybox_simulation::model::ParameterDescription;
use greybox_simulation::program::{Losses, Probes};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// One standard deviation of an input's gain: ± 5 % at 95 %, which is grade 1B of ISO 9906 for the flow of a pump;
/// catalogues give ± 10 % for the rated flow of a servo valve and for the torque constant of a motor.
const INPUT_GAIN: f64 = 0.025;
/// One standard deviation of a sensor's gain: ± 1 % at 95 %, as of sensors of class 1.
const SENSOR_GAIN: f64 = 0.005;
/// One standard deviation of an offset as a share of the largest magnitude of an input, or of an output's span.
const OFFSET: f64 = 0.003;
/// One standard deviation of when a sample was taken, as a share of the time from one sample to the next.
const LAG: f64 = 0.03;
/// One standard deviation of a loss as a share of the rate's root mean square.
const LOSS: f64 = 0.003;

/// The problem with what its document takes as exact or leaves out among its assumptions; as it is where the
/// model is no document. Answers nothing when `stop` was raised.
pub(crate) fn probed(problem: &Problem, positions: &[f64], stop: &AtomicBool) -> Option<Problem> {
    let mut tolerances = Vec::new();
    let mut probes = Probes::default();
    for input in problem.model.acting_inputs() {
        if let Some(largest) = largest_magnitude(problem, input) {
            probes.inputs.push(input);
            tolerances.extend([INPUT_GAIN, OFFSET * largest]);
        }
    }
    for driven in driven_states(problem, positions, stop)? {
        probes.losses.push(driven.losses);
        tolerances.extend([LOSS * driven.rate, LOSS * driven.rate]);
    }
    let Some(model) = problem.model.with_probes(&probes) else {
        return Some(problem.clone());
    };
    let first = problem.parameters.len();
    let described = &model.description().parameters[first..];
    let simulated = described.iter().zip(&tolerances).enumerate();
    let simulated = simulated.map(|(place, (parameter, tolerance))| {
        let target = Target::Parameter(first + place);
        let target = match place < 2 * probes.inputs.len() {
            true => Assumed::Input(target),
            false => Assumed::Probe(target),
        };
        of_parameter(parameter, target, *tolerance)
    });
    let mut probed = problem.clone();
    probed.assumptions = Arc::new(with_defaults(problem, simulated.collect()));
    let values = described.iter().map(|parameter| parameter.default);
    probed.parameters.extend(values);
    probed.model = Arc::new(model);
    Some(probed)
}

/// A number that a problem takes as exact and whose tolerance nobody declared.
#[derive(Clone, Debug, PartialEq)]
pub struct DefaultTolerance {
    /// The name of the number in the budget.
    pub name: String,
    /// The value, SI.
    pub value: f64,
    /// The SI unit.
    pub unit: String,
}

/// The numbers whose tolerances a job may say by name; none where the model is no document.
#[must_use]
pub fn default_tolerances(problem: &Problem) -> Vec<DefaultTolerance> {
    let losses = |state| Losses { state, size: 1.0 };
    let probes = Probes {
        inputs: problem.model.acting_inputs(),
        losses: problem
            .model
            .driven_states()
            .into_iter()
            .map(losses)
            .collect(),
    };
    let Some(model) = problem.model.with_probes(&probes) else {
        return Vec::new();
    };
    let simulated = model.description().parameters[problem.parameters.len()..].iter();
    let simulated = simulated.map(|parameter| DefaultTolerance {
        name: parameter.name.to_string(),
        value: parameter.default,
        unit: parameter.unit.to_string(),
    });
    let sensors = default_sensors(problem)
        .into_iter()
        .map(|number| DefaultTolerance {
            name: number.name,
            value: number.value,
            unit: number.unit,
        });
    simulated.chain(sensors).collect()
}

/// The assumptions of a problem with those of its sensors and with `simulated` numbers that nobody declared a
/// tolerance of. Numbers of the model stand before those of sensors and of the clock.
fn with_defaults(problem: &Problem, simulated: Vec<Assumption>) -> Vec<Assumption> {
    let (of_model, measured): (Vec<_>, Vec<_>) = problem
        .assumptions
        .iter()
        .cloned()
        .partition(|declared| declared.target.simulated().is_some());
    let settled = |mut default: Assumption| {
        if let Some(tolerance) = problem.tolerances.get(&default.name) {
            default.tolerance = *tolerance;
        }
        Some(default).filter(|default| default.tolerance > 0.0)
    };
    of_model
        .into_iter()
        .chain(simulated.into_iter().filter_map(settled))
        .chain(measured)
        .chain(default_sensors(problem).into_iter().filter_map(settled))
        .collect()
}

/// The numbers of the sensors that nobody declared a tolerance of.
fn default_sensors(problem: &Problem) -> Vec<Assumption> {
    let outputs = problem.outputs.iter().enumerate();
    let sensors = outputs.flat_map(|(place, output)| {
        let numbers = [
            (SensorNumber::Gain, SENSOR_GAIN),
            (SensorNumber::Offset, OFFSET * span(problem, place)),
            (SensorNumber::Lag, LAG * longest_interval(problem)),
        ];
        numbers.map(|(number, tolerance)| Assumption {
            is_default: true,
            ..Assumption::of_sensor(&output.name, &output.unit, place, number, tolerance)
        })
    });
    let is_open = |default: &Assumption| {
        let mut declared = problem.assumptions.iter();
        !declared.any(|declared| declared.name == default.name)
    };
    sensors.filter(is_open).collect()
}

/// A number behind those of the model that nobody declared a tolerance of.
fn of_parameter(parameter: &ParameterDescription, target: Assumed, tolerance: f64) -> Assumption {
    Assumption {
        name: parameter.name.to_string(),
        unit: parameter.unit.to_string(),
        target,
        value: parameter.default,
        taken: parameter.default,
        tolerance,
        is_absent_effect: matches!(target, Assumed::Probe(_)),
        is_default: true,
        limits: [None, None],
    }
}

/// A state that a force moves.
struct DrivenState {
    losses: Losses,
    /// The root mean square of its rate.
    rate: f64,
}

/// The states that a force, an inflow or a current moves, as far as they move at a candidate. Answers nothing when
/// `stop` was raised.
fn driven_states(
    problem: &Problem,
    positions: &[f64],
    stop: &AtomicBool,
) -> Option<Vec<DrivenState>> {
    let states = problem.model.driven_states();
    if states.is_empty() {
        return Some(Vec::new());
    }
    let Some(watching) = problem.model.watching(&states) else {
        return Some(Vec::new());
    };
    let watched = Problem {
        model: Arc::new(watching),
        ..problem.clone()
    };
    let Ok(paths) = trajectory::simulate(&watched, positions, stop)? else {
        return Some(Vec::new());
    };
    let size = |output: usize| {
        let samples = paths.iter().flat_map(|outputs| &outputs[output]);
        let mean = statistics::mean(samples.map(|value| value * value));
        mean.map(f64::sqrt)
            .filter(|size| *size > 0.0 && size.is_finite())
    };
    let driven = states.iter().enumerate().filter_map(|(place, state)| {
        let losses = Losses {
            state: *state,
            size: size(place)?,
        };
        let rate = size(states.len() + place)?;
        Some(DrivenState { losses, rate })
    });
    Some(driven.collect())
}

/// The largest magnitude of an input, by its place, in what is estimated from; none where it is always 0.
fn largest_magnitude(problem: &Problem, input: usize) -> Option<f64> {
    let description = problem.model.description();
    let name = &description.inputs[input].name;
    let samples = problem.experiments.iter().filter_map(|experiment| {
        let names = &description.input_sets[experiment.input_set];
        let place = names.iter().position(|of_set| of_set == name)?;
        Some(&experiment.inputs[place][..experiment.estimation_samples])
    });
    let magnitudes = samples.flatten().map(|value| value.abs());
    Some(magnitudes.fold(0.0, f64::max)).filter(|largest| *largest > 0.0)
}

/// The span of an output, by its place among the compared ones, in what is estimated from.
fn span(problem: &Problem, output: usize) -> f64 {
    let samples = |experiment: &Experiment| {
        experiment.measured[output][..experiment.estimation_samples].to_vec()
    };
    let values = problem.experiments.iter().flat_map(samples);
    let [least, most] = values.filter(|value| value.is_finite()).fold(
        [f64::INFINITY, f64::NEG_INFINITY],
        |[least, most], value| [least.min(value), most.max(value)],
    );
    (most - least).max(0.0)
}

/// The longest time from one sample to the next, as each experiment has it in the middle `[s]`.
fn longest_interval(problem: &Problem) -> f64 {
    let experiments = problem.experiments.iter();
    experiments.map(|data| data.sample_time).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use crate::identification::budget::AssumptionKind;
    use crate::uncertainty::verdict::{Rule, Trust};
    use crate::{Identification, IdentificationError, Outcome, Recording};
    use greybox_numerics::rng::{self, Purpose, stream};
    use serde_json::{Value, json};

    const GAIN: f64 = 2.0;
    const TIME_CONSTANT: f64 = 3.0;
    const SAMPLE_TIME: f64 = 0.5;
    const NOISE: f64 = 1e-3;

    /// A first-order plant without a term for what a probe stands for.
    fn document() -> Value {
        let unknown = |unit: &str, value: f64| {
            json!({
                "unit": unit, "default": value, "lower": value / 5.0, "upper": value * 4.0,
                "scale": "log", "unknown": true,
            })
        };
        json!({
            "name": "lag",
            "inputs": {"u": {"unit": "V"}, "valve": {"unit": "1"}},
            "parameters": {"k": unknown("m/V", 1.5), "T": unknown("s", 2.0)},
            "states": {"x": {"unit": "m", "initial": 0, "derivative": "(if(valve > 0.5, k*u, 0) - x)/T"}},
            "outputs": {"y": {"unit": "m", "expression": "x"}},
        })
    }

    /// A recording of the plant, by its closed form from sample to sample, whose sensor is late by a share of the
    /// time between samples.
    fn recording(late: f64) -> Recording {
        let mut noise = stream(3, 0, Purpose::Noise);
        let mut draws = stream(3, 1, Purpose::Noise);
        let decay = (-SAMPLE_TIME / TIME_CONSTANT).exp();
        let (mut x, mut before, mut u) = (0.0, 0.0, 0.0);
        let (mut inputs, mut outputs) = (Vec::new(), Vec::new());
        for sample in 0..600 {
            if sample % 15 == 0 {
                u = rng::normal(&mut draws);
            }
            inputs.push(u);
            let seen = (1.0 - late) * x + late * before;
            outputs.push(seen + NOISE * rng::normal(&mut noise));
            before = x;
            x = GAIN * u + (x - GAIN * u) * decay;
        }
        let valve = vec![1.0; inputs.len()];
        let signals = [
            ("u", "V", inputs),
            ("valve", "1", valve),
            ("y", "m", outputs),
        ];
        Recording::from_samples(SAMPLE_TIME, signals)
    }

    fn job(tolerances: Value) -> Value {
        json!({
            "model": document(), "outputs": {"y": {"noise_std": NOISE}}, "tolerances": tolerances,
            "validation": {"fraction": 0}, "seed": 1,
        })
    }

    fn estimated(tolerances: Value, late: f64) -> Outcome {
        let run = Identification::of_job(job(tolerances), recording(late)).run();
        run.unwrap_or_else(|error| panic!("{error}"))
    }

    /// The gain of the plant is known no better than those of its input and of its sensor: each of them does what
    /// it does, and the time constant does not care.
    #[test]
    fn gains_that_nobody_declared_add_their_closed_forms() {
        let outcome = estimated(json!({}), 0.0);
        let adds = |line: &str, parameter: &str| {
            let mut lines = outcome.budget.iter();
            let line = lines.find(|own| own.assumption == line).expect("a line");
            assert!(line.by_default);
            line.contributions[parameter].standard_error
        };
        let estimate = |name: &str| {
            let parameter = outcome.parameters.iter().find(|own| own.name == name);
            parameter.expect("it is free").estimate.clone()
        };
        let gain = estimate("k");
        for (line, share) in [("u.input_gain", 0.025), ("y.gain", 0.005)] {
            let expected = share * gain.estimate;
            let added = adds(line, "k");
            assert!(
                (added / expected - 1.0).abs() < 1e-3,
                "{line}: {added} {expected}"
            );
            assert!(adds(line, "T") < 1e-4 * TIME_CONSTANT);
        }
        let total = gain.total_standard_error.expect("a total");
        assert!(total > (0.025_f64.hypot(0.005)) * gain.estimate && total < 0.03 * gain.estimate);
        assert!((gain.estimate - GAIN).abs() < 4.0 * gain.standard_error.expect("noise"));
        let kind = |name: &str| {
            let mut lines = outcome.budget.iter();
            lines.find(|own| own.assumption == name).map(|own| own.kind)
        };
        assert_eq!(kind("u.input_offset"), Some(AssumptionKind::Input));
        assert_eq!(kind("x.quadratic_loss"), Some(AssumptionKind::AbsentEffect));
        assert_eq!(
            kind("valve.input_gain"),
            None,
            "a signal that decides has no gain"
        );
    }

    #[test]
    fn a_job_says_by_name_how_well_a_number_is_known() {
        let outcome = estimated(json!({"*": 0}), 0.0);
        assert!(outcome.budget.is_empty());
        for parameter in &outcome.parameters {
            let estimate = &parameter.estimate;
            assert_eq!(estimate.total_standard_error, estimate.standard_error);
        }
        let outcome = estimated(json!({"*": 0, "u.input_gain": "0.1 %"}), 0.0);
        assert_eq!(outcome.budget.len(), 1);
        let mut lines = outcome.budget.iter();
        let line = lines.find(|line| line.assumption == "u.input_gain");
        assert_eq!(line.expect("a line").tolerance, 0.001);
    }

    #[test]
    fn a_name_of_no_number_and_a_share_of_nothing_are_faults_at_their_places() {
        for (tolerances, pointer, code) in [
            (json!({"u.gain": 0}), "/tolerances/u.gain", "unknown_number"),
            (
                json!({"u.input_offset": "1 %"}),
                "/tolerances/u.input_offset",
                "tolerance_not_understood",
            ),
            (
                json!({"*": "1 %"}),
                "/tolerances/*",
                "tolerance_not_understood",
            ),
            (
                json!({"u.input_gain": -1}),
                "/tolerances/u.input_gain",
                "tolerance_not_understood",
            ),
        ] {
            let run = Identification::of_job(job(tolerances), recording(0.0)).run();
            let Err(IdentificationError::Invalid(faults)) = run else {
                panic!("{pointer} is taken");
            };
            let fault = faults.iter().find(|fault| fault.pointer() == pointer);
            assert_eq!(fault.map(|fault| &*fault.code), Some(code), "{faults:?}");
        }
    }

    /// A sensor that is late by a fifth of the time between samples looks like a longer time constant; the residuals
    /// tell it all the same.
    #[test]
    fn a_lag_that_nobody_declared_is_named() {
        let outcome = estimated(json!({"y.lag": 0.01}), 0.2);
        let mut reasons = outcome.verdict.reasons.iter();
        let reason = reasons.find(|reason| reason.code == Rule::AssumptionContradicted);
        let text = &reason
            .expect("the residuals contradict an assumption")
            .detail;
        assert!(text.contains("`y.lag`"), "{text}");
        let trusts = outcome.parameters.iter().map(|own| own.estimate.trust);
        assert!(trusts.max() < Some(Some(Trust::High)));
    }
}
