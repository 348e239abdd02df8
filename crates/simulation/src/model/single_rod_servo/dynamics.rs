//! The servo's equations: valve, cylinder and load joined by their flows, pressures and force.

use super::cylinder::{Cylinder, PerChamber};
use super::friction::Friction;
use super::load::Load;
use super::orifice::signed_root;
use super::servovalve::{SpoolState, Valve};
use crate::equations::Sample;
use crate::native::Dynamics;
use greybox_numerics::lanes::Real;

/// Which input set stands for the position loop of the paper's Fig. 2.
const REFERENCE: usize = 0;

/// Chamber 2 starts at this share of the supply pressure.
const INITIAL_PRESSURE_SHARE: f64 = 0.575;

/// The equations, with the switchable effects and the lag that the constants have, or without
/// effects and with the lag of second order.
#[derive(Clone, Copy, Debug)]
pub(super) struct SingleRodServo<const EFFECTS: bool>;

/// What follows from a candidate's parameters.
#[derive(Clone, Copy, Debug)]
pub(super) struct ServoConstants<R> {
    mass: R,
    flow_gain: R,
    supply_pressure: R,
    return_pressure: R,
    transition_squared: R,
    position_gain: R,
    valve_offset: R,
    input_delay: R,
    supply_droop: R,
    has_droop: bool,
    valve: Valve<R>,
    cylinder: Cylinder<R>,
    load: Load<R>,
}

/// Opening of the valve and the pressure drops over its two ports.
struct Ports<R> {
    opening: R,
    drops: PerChamber<R>,
}

impl<R: Real> ServoConstants<R> {
    /// Whether a switchable effect is there, or another lag of the valve than that of second order.
    pub fn has_effects(&self) -> bool {
        self.has_droop
            || !self.valve.is_of_second_order()
            || self.valve.has_dead_band
            || self.cylinder.has_leakage
            || self.cylinder.has_air
            || self.load.friction.has_friction
            || self.load.has_stops
    }

    /// The pressure drops that drive Q1 and Q2, by the sign of the opening.
    #[inline(always)]
    fn ports<const EFFECTS: bool>(&self, opening: R, pressures: PerChamber<R>) -> Ports<R> {
        let zero = R::splat(0.0);
        let PerChamber {
            chamber_1: p1,
            chamber_2: p2,
        } = pressures;
        let supply = self.supply::<EFFECTS>(opening, pressures);
        let drop_1 = opening.select_ge(zero, supply - p1, p1 - self.return_pressure);
        let drop_2 = opening.select_ge(zero, p2 - self.return_pressure, supply - p2);
        Ports {
            opening,
            drops: PerChamber {
                chamber_1: drop_1,
                chamber_2: drop_2,
            },
        }
    }

    /// The supply pressure, which sags by the droop times the flow that the valve would take at
    /// full pressure (a first approximation of the sag; exact for small droop).
    #[inline(always)]
    fn supply<const EFFECTS: bool>(&self, opening: R, pressures: PerChamber<R>) -> R {
        if !(EFFECTS && self.has_droop) {
            return self.supply_pressure;
        }
        let chamber = opening.select_ge(R::splat(0.0), pressures.chamber_1, pressures.chamber_2);
        let root = signed_root(self.supply_pressure - chamber, self.transition_squared);
        let taken = (self.flow_gain * opening.abs() * root).max(R::splat(0.0));
        self.supply_pressure - self.supply_droop * taken
    }

    #[inline(always)]
    fn flows(&self, ports: &Ports<R>) -> PerChamber<R> {
        let gain = self.flow_gain * ports.opening;
        PerChamber {
            chamber_1: gain * signed_root(ports.drops.chamber_1, self.transition_squared),
            chamber_2: gain * signed_root(ports.drops.chamber_2, self.transition_squared),
        }
    }
}

impl<const EFFECTS: bool> Dynamics for SingleRodServo<EFFECTS> {
    /// p1, p2, x, v, spool position, spool velocity.
    type State<R: Real> = [R; 6];
    /// The valve command.
    type Held<R: Real> = [R; 1];
    type Constants<R: Real> = ServoConstants<R>;

    fn constants<R: Real>(&self, parameters: &[R]) -> ServoConstants<R> {
        #[rustfmt::skip]
        let &[
            mass, damping, stiffness, bulk_modulus, flow_gain, supply_pressure, return_pressure,
            transition_pressure, piston_area, annulus_area, stroke, dead_volume_1, dead_volume_2,
            spring_neutral_position, position_gain, spool_natural_frequency, spool_damping_ratio,
            spool_time_constant, dead_band, valve_offset, coulomb_friction, friction_velocity,
            stribeck_friction, stribeck_velocity, internal_leakage, external_leakage,
            air_fraction, end_stop_stiffness, end_stop_damping, input_delay, load_force,
            supply_droop,
        ] = parameters else {
            unreachable!("a parameter vector has as many values as the description has parameters")
        };
        let is_there = |value: R| value.any(|value| value != 0.0);
        ServoConstants {
            mass,
            flow_gain,
            supply_pressure,
            return_pressure,
            transition_squared: transition_pressure * transition_pressure,
            position_gain,
            valve_offset,
            input_delay,
            supply_droop,
            has_droop: is_there(supply_droop),
            valve: Valve::new([
                spool_natural_frequency,
                spool_damping_ratio,
                spool_time_constant,
                dead_band,
            ]),
            cylinder: Cylinder {
                bulk_modulus,
                piston_area,
                annulus_area,
                stroke,
                dead_volume_1,
                dead_volume_2,
                internal_leakage,
                external_leakage,
                return_pressure,
                air: Cylinder::air_pressure(air_fraction),
                has_leakage: is_there(internal_leakage) || is_there(external_leakage),
                has_air: is_there(air_fraction),
            },
            load: Load {
                inverse_mass: R::splat(1.0) / mass,
                damping,
                stiffness,
                neutral_position: spring_neutral_position,
                constant_force: load_force,
                friction: Friction::new([
                    coulomb_friction,
                    friction_velocity,
                    stribeck_friction,
                    stribeck_velocity,
                ]),
                stroke,
                stop_stiffness: end_stop_stiffness,
                stop_damping: end_stop_damping,
                has_stops: is_there(end_stop_stiffness),
            },
        }
    }

    fn initial_state<R: Real>(&self, constants: &ServoConstants<R>) -> [R; 6] {
        let zero = R::splat(0.0);
        let p2 = constants.supply_pressure * R::splat(INITIAL_PRESSURE_SHARE);
        let p1 = p2 * constants.cylinder.annulus_area / constants.cylinder.piston_area;
        [p1, p2, constants.load.neutral_position, zero, zero, zero]
    }

    #[inline(always)]
    fn hold<R: Real>(
        &self,
        constants: &ServoConstants<R>,
        sample: &Sample<'_>,
        state: &[R; 6],
    ) -> [R; 1] {
        let input = R::splat(sample.input(0));
        let command = if sample.input_set == REFERENCE {
            (constants.position_gain * (input - state[2])).clamp(-1.0, 1.0)
        } else {
            input
        };
        [command + constants.valve_offset]
    }

    #[inline(always)]
    fn derivative<R: Real>(
        &self,
        constants: &ServoConstants<R>,
        &[command]: &[R; 1],
        &[p1, p2, x, v, spool_position, spool_velocity]: &[R; 6],
    ) -> [R; 6] {
        let spool = SpoolState {
            position: spool_position,
            velocity: spool_velocity,
        };
        let opening = constants.valve.opening::<EFFECTS>(command, &spool);
        let pressures = PerChamber {
            chamber_1: p1,
            chamber_2: p2,
        };
        let flows = constants.flows(&constants.ports::<EFFECTS>(opening, pressures));
        let pressure_rates = constants
            .cylinder
            .pressure_rates::<EFFECTS>(flows, pressures, x, v);
        let force = constants.cylinder.piston_area * p1 - constants.cylinder.annulus_area * p2;
        let acceleration = constants.load.acceleration::<EFFECTS>(force, x, v);
        let spool_rates = constants.valve.rates::<EFFECTS>(command, &spool);
        [
            pressure_rates.chamber_1,
            pressure_rates.chamber_2,
            v,
            acceleration,
            spool_rates.position,
            spool_rates.velocity,
        ]
    }

    #[inline(always)]
    fn outputs<R: Real>(&self, _constants: &ServoConstants<R>, state: &[R; 6], outputs: &mut [R]) {
        let &[p1, p2, x, v, _, _] = state;
        outputs.copy_from_slice(&[x, v, p1, p2]);
    }

    fn input_delay<R: Real>(&self, constants: &ServoConstants<R>) -> Option<R> {
        Some(constants.input_delay)
    }

    fn work_rate(&self, constants: &ServoConstants<f64>) -> f64 {
        let middle = constants.load.stroke * 0.5;
        let mode = constants
            .cylinder
            .hydraulic_mode_squared(middle, constants.mass);
        mode.sqrt()
    }

    /// In proportion to what the rig can reach, with factors by which each state adds about as
    /// much to the error of the position (tried on steps like recording A's).
    fn sizes<R: Real>(&self, constants: &ServoConstants<R>) -> [R; 6] {
        let pressure = R::splat(80.0) * constants.supply_pressure;
        let position = R::splat(40.0) * constants.cylinder.stroke;
        let [velocity, opening, spool_velocity] = [20.0, 600.0, 2e5].map(R::splat);
        [
            pressure,
            pressure,
            position,
            velocity,
            opening,
            spool_velocity,
        ]
    }

    #[inline(always)]
    fn validity<R: Real>(&self, constants: &ServoConstants<R>, state: &[R; 6]) -> R {
        let volumes = constants.cylinder.volumes(state[2]);
        Real::min(volumes.chamber_1, volumes.chamber_2)
    }
}
