//! The rigs that the recordings are taken from: the servo model with parameters that are known.

use super::{Demo, SAMPLE_TIME};
use greybox_simulation::model::{Model, single_rod_servo};
use greybox_simulation::{Accuracy, DrivingInputs, SimulatedCandidate, single};
use std::sync::atomic::AtomicBool;

/// Stroke of the cylinder [m].
pub(super) const STROKE: f64 = 0.14;

/// Gain of the position loop [1/m].
const POSITION_GAIN: f64 = 100.0;

/// In which the imperfect rig differs from the data sheet, SI: a valve of 3 % more flow and 60 Hz,
/// overlapped by 2 % and 1 % out of its middle, and a seal of 100 N.
const IMPERFECTIONS: [(&str, f64); 5] = [
    ("flow_gain", 1.03 * 8.91e-8),
    ("spool_natural_frequency", 60.0 * std::f64::consts::TAU),
    ("dead_band", 0.02),
    ("valve_offset", 0.01),
    ("coulomb_friction", 100.0),
];

/// The names in which the imperfect rig differs from the nominal one.
pub(super) fn imperfect_parameters() -> impl Iterator<Item = &'static str> {
    IMPERFECTIONS.into_iter().map(|(name, _)| name)
}

/// What the rig does, a value for each sample.
#[derive(Clone, Debug)]
pub struct RigTrajectory {
    /// Position of the piston `[m]`.
    pub position: Vec<f64>,
    /// Pressure of each chamber `[Pa]`.
    pub chamber_pressures: [Vec<f64>; 2],
}

/// The model of the rig.
#[must_use]
pub fn model() -> Model {
    single_rod_servo::model()
}

/// The rig's parameters in the order of the model's description, SI.
#[must_use]
pub fn parameters(demo: Demo) -> Vec<f64> {
    let model = model();
    let mut parameters = model.description().defaults();
    if demo.has_imperfect_rig() {
        for (name, value) in IMPERFECTIONS {
            let index = model.description().parameter_index(name);
            parameters[index.expect("the model has its imperfections as parameters")] = value;
        }
    }
    parameters
}

/// The command of the controller at each sample: clip(Kp·(r − x), ±1), from the true position.
#[must_use]
pub fn command(reference: &[f64], position: &[f64]) -> Vec<f64> {
    reference
        .iter()
        .zip(position)
        .map(|(reference, position)| (POSITION_GAIN * (reference - position)).clamp(-1.0, 1.0))
        .collect()
}

/// The rig in its position loop, under set points `[m]`.
#[must_use]
pub fn simulate(parameters: &[f64], reference: &[f64]) -> RigTrajectory {
    drive(parameters, "reference", reference)
}

/// The rig with its position loop open, under commands to the valve `[1]`.
#[must_use]
pub fn simulate_under_command(parameters: &[f64], command: &[f64]) -> RigTrajectory {
    drive(parameters, "valve_command", command)
}

fn drive(parameters: &[f64], input: &str, samples: &[f64]) -> RigTrajectory {
    let model = model();
    let description = model.description();
    let input_set = description
        .input_sets
        .iter()
        .position(|set| set[..] == [input])
        .expect("the servo has an input set of this one input");
    let excitation = DrivingInputs {
        sample_time: SAMPLE_TIME,
        instants: None,
        samples: samples.len(),
        input_set,
        inputs: &[samples.to_vec()],
        accuracy: Accuracy::Full,
    };
    let candidate = SimulatedCandidate {
        parameters,
        initial_state: &vec![None; description.states.len()],
    };
    let never = AtomicBool::new(false);
    let outputs = single::outputs(model.plant(), &[(excitation, candidate)], &never)
        .expect("nobody stops this simulation")
        .expect("the rig can be simulated")
        .pop()
        .expect("one recording has one trajectory");
    let column = |output: &str| {
        let index = description.output_index(output);
        outputs[index.expect("the servo has this output")].clone()
    };
    RigTrajectory {
        position: column("position"),
        chamber_pressures: ["chamber_pressure_1", "chamber_pressure_2"].map(column),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rig_is_the_models_nominal_one() {
        let model = model();
        let default = |name| {
            let index = model.description().parameter_index(name).expect("a name");
            model.description().defaults()[index]
        };
        assert_eq!(default("stroke"), STROKE);
        assert_eq!(default("position_gain"), POSITION_GAIN);
    }

    #[test]
    fn a_constant_set_point_is_reached_up_to_the_droop_of_the_load() {
        let set_point = 0.08;
        let position = simulate(&parameters(Demo::A), &[set_point; 300]).position;
        assert_eq!(position[0], 0.07);
        let last = position[299];
        // The loop has an integrating plant; only the finite stiffness of the pressures remains.
        assert!((last - set_point).abs() < 1e-4, "{last}");
    }

    #[test]
    fn the_offset_of_the_valve_moves_the_resting_place_by_offset_over_gain() {
        let nominal = parameters(Demo::A);
        let mut offset = nominal.clone();
        let index = model().description().parameter_index("valve_offset");
        offset[index.expect("a name")] = 0.01;
        let rest = |parameters: &[f64]| simulate(parameters, &[0.07; 300]).position[299];
        let moved = rest(&offset) - rest(&nominal);
        assert!((moved - 0.01 / POSITION_GAIN).abs() < 1e-6, "{moved}");
    }
}
