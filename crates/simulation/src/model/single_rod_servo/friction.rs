//! Dry friction of the piston and its guides.
//!
//! `F_f(v) = (Fc + Fs·exp(−(v/v_s)²))·tanh(v/v_t)`: Coulomb friction with its sign smoothed over
//! the friction velocity v_t, and the Stribeck excess Fs at low speed (H. Olsson and others,
//! "Friction models and friction compensation", European Journal of Control 4, 1998).

use greybox_numerics::lanes::Real;

/// What follows from the friction parameters.
#[derive(Clone, Copy, Debug)]
pub struct Friction<R> {
    coulomb: R,
    stribeck: R,
    inverse_velocity: R,
    inverse_stribeck_velocity: R,
    /// Whether there is any.
    pub has_friction: bool,
    has_stribeck: bool,
}

impl<R: Real> Friction<R> {
    /// From Fc [N], v_t [m/s], Fs [N] and v_s [m/s].
    pub fn new([coulomb, velocity, stribeck, stribeck_velocity]: [R; 4]) -> Self {
        let has_stribeck = stribeck.any(|force| force != 0.0);
        Friction {
            coulomb,
            stribeck,
            inverse_velocity: R::splat(1.0) / velocity,
            inverse_stribeck_velocity: R::splat(1.0) / stribeck_velocity,
            has_friction: has_stribeck || coulomb.any(|force| force != 0.0),
            has_stribeck,
        }
    }

    /// The friction force at a velocity [N].
    #[inline(always)]
    pub fn force<const EFFECTS: bool>(&self, velocity: R) -> R {
        if !(EFFECTS && self.has_friction) {
            return R::splat(0.0);
        }
        self.level(velocity) * (velocity * self.inverse_velocity).tanh()
    }

    #[inline(always)]
    fn level(&self, velocity: R) -> R {
        if !self.has_stribeck {
            return self.coulomb;
        }
        let ratio = velocity * self.inverse_stribeck_velocity;
        self.coulomb + self.stribeck * (-(ratio * ratio)).exp()
    }
}
