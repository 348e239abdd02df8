//! A positioning drive: a carriage under a recorded force, with viscous and Coulomb friction.
//!
//! `M·q'' = τ − Fv·q' − Fc·tanh(q'/vs) − F0`, SI: mass M, viscous friction Fv, Coulomb friction Fc
//! with its sign smoothed over the friction velocity vs, constant offset F0 (A. Janot, M. Gautier,
//! M. Brunot, "Data Set and Reference Models of EMPS", Workshop on Nonlinear System Identification
//! Benchmarks, 2019). The recorded force is held over a sample, as the drive's amplifier holds it.
//! An axis without a spring drifts, so where it starts is estimated with the rest.

use super::{
    InitialState, Model, ModelDescription, ParameterDescription, SignalDescription,
    StateDescription, Tolerance,
};
use crate::equations::Sample;
use crate::native::Dynamics;
use greybox_numerics::lanes::Real;

/// The model with its description.
#[must_use]
pub fn model() -> Model {
    Model::new(describe(), PositioningDrive)
}

/// The equations.
#[derive(Clone, Copy, Debug)]
struct PositioningDrive;

#[derive(Clone, Copy, Debug)]
struct DriveConstants<R> {
    inverse_mass: R,
    viscous_friction: R,
    coulomb_friction: R,
    offset: R,
    inverse_velocity: R,
    input_delay: R,
}

impl Dynamics for PositioningDrive {
    /// Position and velocity.
    type State<R: Real> = [R; 2];
    /// The force.
    type Held<R: Real> = [R; 1];
    type Constants<R: Real> = DriveConstants<R>;

    fn constants<R: Real>(&self, parameters: &[R]) -> DriveConstants<R> {
        let &[
            mass,
            viscous_friction,
            coulomb_friction,
            offset,
            friction_velocity,
            input_delay,
        ] = parameters
        else {
            unreachable!("a parameter vector has as many values as the description has parameters")
        };
        DriveConstants {
            inverse_mass: R::splat(1.0) / mass,
            viscous_friction,
            coulomb_friction,
            offset,
            inverse_velocity: R::splat(1.0) / friction_velocity,
            input_delay,
        }
    }

    fn initial_state<R: Real>(&self, _constants: &DriveConstants<R>) -> [R; 2] {
        [R::splat(0.0); 2]
    }

    #[inline(always)]
    fn hold<R: Real>(
        &self,
        _constants: &DriveConstants<R>,
        sample: &Sample<'_>,
        _state: &[R; 2],
    ) -> [R; 1] {
        [R::splat(sample.input(0))]
    }

    #[inline(always)]
    fn derivative<R: Real>(
        &self,
        constants: &DriveConstants<R>,
        &[force]: &[R; 1],
        &[_, velocity]: &[R; 2],
    ) -> [R; 2] {
        let friction = constants.viscous_friction * velocity
            + constants.coulomb_friction * (velocity * constants.inverse_velocity).tanh();
        [
            velocity,
            (force - friction - constants.offset) * constants.inverse_mass,
        ]
    }

    #[inline(always)]
    fn outputs<R: Real>(&self, _constants: &DriveConstants<R>, state: &[R; 2], outputs: &mut [R]) {
        outputs.copy_from_slice(state);
    }

    fn input_delay<R: Real>(&self, constants: &DriveConstants<R>) -> Option<R> {
        Some(constants.input_delay)
    }

    fn sizes<R: Real>(&self, _constants: &DriveConstants<R>) -> [R; 2] {
        [R::splat(1.0); 2]
    }
}

fn describe() -> ModelDescription {
    ModelDescription {
        name: "positioning_drive".into(),
        title: "Positioning drive".into(),
        summary: "A carriage on a guide under a recorded drive force, with viscous and Coulomb \
                  friction and a constant offset. Initial position and velocity are estimated \
                  near the first samples."
            .into(),
        inputs: vec![SignalDescription::new(
            "force",
            "N",
            "drive force, held over a sample",
        )],
        input_sets: vec![vec!["force".into()]],
        states: vec![
            StateDescription {
                name: "position".into(),
                unit: "m".into(),
                meaning: "position of the carriage".into(),
                initial: InitialState::EstimatedFromOutput { output: 0 },
            },
            StateDescription {
                name: "velocity".into(),
                unit: "m/s".into(),
                meaning: "velocity of the carriage".into(),
                initial: InitialState::EstimatedFromSlope { output: 0 },
            },
        ],
        sampled: Vec::new(),
        outputs: vec![
            SignalDescription::new("position", "m", "position of the carriage"),
            SignalDescription::new("velocity", "m/s", "velocity of the carriage"),
        ],
        parameters: parameters(),
        equations: ["q' = v", "v' = (force - Fv*v - Fc*tanh(v/vs) - F0) / M"]
            .map(Into::into)
            .to_vec(),
        source: "A. Janot, M. Gautier, M. Brunot, Data Set and Reference Models of EMPS, Workshop \
                 on Nonlinear System Identification Benchmarks, Eindhoven, 2019"
            .into(),
    }
}

fn parameters() -> Vec<ParameterDescription> {
    const MASS: [&str; 3] = ["M", "kg", "moving mass, rotating parts included"];
    const VISCOUS: [&str; 3] = ["Fv", "N*s/m", "viscous friction"];
    const COULOMB: [&str; 3] = ["Fc", "N", "Coulomb friction"];
    const OFFSET: [&str; 3] = ["F0", "N", "constant offset of the force"];
    const VELOCITY: [&str; 3] = ["vs", "m/s", "velocity over which friction changes its sign"];
    const DELAY: [&str; 3] = ["td", "s", "time until the recorded force acts"];
    const ROUGH: &str = "a constant of the model that no data sheet gives";
    const CURRENT_LOOP: &str = "bandwidth of a drive's current loop";
    let positive = Some(f64::MIN_POSITIVE);
    vec![
        ParameterDescription::known("mass", MASS, 100.0, [10.0, 1000.0])
            .log_scale()
            .unknown()
            .within(positive, None),
        ParameterDescription::known("viscous_friction", VISCOUS, 200.0, [1.0, 2000.0])
            .log_scale()
            .unknown(),
        ParameterDescription::known("coulomb_friction", COULOMB, 20.0, [1.0, 500.0])
            .log_scale()
            .unknown(),
        ParameterDescription::known("offset", OFFSET, 0.0, [-100.0, 100.0])
            .unknown()
            .within(None, None),
        ParameterDescription::known("friction_velocity", VELOCITY, 2e-3, [1e-4, 2e-2])
            .log_scale()
            .within(positive, None)
            .within_tolerance(Tolerance::Percent(50.0), ROUGH),
        ParameterDescription::known("input_delay", DELAY, 0.0, [0.0, 0.05])
            .within_tolerance(Tolerance::Absolute(5e-4), CURRENT_LOOP),
    ]
}
