//! The moving mass and what acts upon it: pressures, damping, spring, friction, load, end stops.
//!
//! `M·v' = A1·p1 − A2·p2 − B·v − Ks·(x − xs0) − F_f(v) − F_L − F_stop(x, v)`. An end stop is a
//! stiff spring with losses that grow with the penetration δ: `k·δ·(1 + c·δ')`, never pulling
//! (K. H. Hunt, F. R. E. Crossley, Journal of Applied Mechanics 42, 1975, Eq. 4 with n = 1).

use super::friction::Friction;
use greybox_numerics::lanes::Real;

/// What follows from the load's parameters.
#[derive(Clone, Copy, Debug)]
pub struct Load<R> {
    /// 1/M [1/kg].
    pub inverse_mass: R,
    /// B [N·s/m].
    pub damping: R,
    /// Ks [N/m].
    pub stiffness: R,
    /// xs0 [m].
    pub neutral_position: R,
    /// F_L [N].
    pub constant_force: R,
    /// Dry friction.
    pub friction: Friction<R>,
    /// L [m].
    pub stroke: R,
    /// k [N/m].
    pub stop_stiffness: R,
    /// c [s/m].
    pub stop_damping: R,
    /// Whether there are end stops.
    pub has_stops: bool,
}

impl<R: Real> Load<R> {
    /// v' [m/s²] under the force of the pressures [N].
    #[inline(always)]
    pub fn acceleration<const EFFECTS: bool>(
        &self,
        pressure_force: R,
        position: R,
        velocity: R,
    ) -> R {
        let mut force = pressure_force
            - self.damping * velocity
            - self.stiffness * (position - self.neutral_position)
            - self.friction.force::<EFFECTS>(velocity)
            - self.constant_force;
        if EFFECTS && self.has_stops {
            force = force + self.stop(-position, -velocity)
                - self.stop(position - self.stroke, velocity);
        }
        force * self.inverse_mass
    }

    /// The force of a stop that is pressed in by `depth` at `speed`.
    #[inline(always)]
    fn stop(&self, depth: R, speed: R) -> R {
        let zero = R::splat(0.0);
        let loss = (R::splat(1.0) + self.stop_damping * speed).max(zero);
        self.stop_stiffness * depth.max(zero) * loss
    }
}
