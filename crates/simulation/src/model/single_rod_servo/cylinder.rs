//! The two chambers of the cylinder: how flow, motion and leakage change their pressures.
//!
//! `p1' = K/V1·(Q1 − A1·v − Q_li − Q_le1)` and `p2' = K/V2·(A2·v − Q2 + Q_li − Q_le2)` with
//! `V1 = V01 + A1·x`, `V2 = V02 + A2·(L − x)`: conservation of mass in each chamber (M. Jelali,
//! A. Kroll, *Hydraulic Servo-systems*, 2003, ch. 4). The paper's Eq. 4–6 print p2' with its sign
//! reversed. Air in the oil, a share α of the volume at atmospheric pressure, compressed at
//! constant temperature, softens it: `1/K(p) = 1/Km + α·p_a/p²`.

use greybox_numerics::lanes::Real;

/// Atmospheric pressure [Pa] (ISO 2533).
const ATMOSPHERE: f64 = 101_325.0;

/// Below this pressure the softening by air no longer grows [Pa].
const LOWEST_AIR_PRESSURE: f64 = 2e4;

/// A quantity of each chamber.
#[derive(Clone, Copy, Debug)]
pub struct PerChamber<R> {
    /// The quantity of chamber 1.
    pub chamber_1: R,
    /// The quantity of chamber 2.
    pub chamber_2: R,
}

/// What follows from the cylinder's parameters.
#[derive(Clone, Copy, Debug)]
pub struct Cylinder<R> {
    /// K_m [Pa].
    pub bulk_modulus: R,
    /// A1 [m²].
    pub piston_area: R,
    /// A2 [m²].
    pub annulus_area: R,
    /// L [m].
    pub stroke: R,
    /// V01 [m³].
    pub dead_volume_1: R,
    /// V02 [m³].
    pub dead_volume_2: R,
    /// c_i [m³/(s·Pa)].
    pub internal_leakage: R,
    /// c_e [m³/(s·Pa)].
    pub external_leakage: R,
    /// p_t [Pa].
    pub return_pressure: R,
    /// α·p_a [Pa].
    pub air: R,
    /// Whether either leakage is there.
    pub has_leakage: bool,
    /// Whether air is there.
    pub has_air: bool,
}

impl<R: Real> Cylinder<R> {
    /// α·p_a of an air fraction α.
    pub fn air_pressure(air_fraction: R) -> R {
        air_fraction * R::splat(ATMOSPHERE)
    }

    /// V1 and V2 at a position [m³].
    #[inline(always)]
    pub fn volumes(&self, position: R) -> PerChamber<R> {
        PerChamber {
            chamber_1: self.dead_volume_1 + self.piston_area * position,
            chamber_2: self.dead_volume_2 + self.annulus_area * (self.stroke - position),
        }
    }

    /// p1' and p2' [Pa/s] from the flows into chamber 1 and out of chamber 2 [m³/s].
    #[inline(always)]
    pub fn pressure_rates<const EFFECTS: bool>(
        &self,
        flows: PerChamber<R>,
        pressures: PerChamber<R>,
        position: R,
        velocity: R,
    ) -> PerChamber<R> {
        let PerChamber {
            chamber_1: p1,
            chamber_2: p2,
        } = pressures;
        let volumes = self.volumes(position);
        let mut net_1 = flows.chamber_1 - self.piston_area * velocity;
        let mut net_2 = self.annulus_area * velocity - flows.chamber_2;
        if EFFECTS && self.has_leakage {
            let across = self.internal_leakage * (p1 - p2);
            net_1 = net_1 - across - self.external_leakage * (p1 - self.return_pressure);
            net_2 = net_2 + across - self.external_leakage * (p2 - self.return_pressure);
        }
        PerChamber {
            chamber_1: self.bulk_modulus_at::<EFFECTS>(p1) / volumes.chamber_1 * net_1,
            chamber_2: self.bulk_modulus_at::<EFFECTS>(p2) / volumes.chamber_2 * net_2,
        }
    }

    #[inline(always)]
    fn bulk_modulus_at<const EFFECTS: bool>(&self, pressure: R) -> R {
        if !(EFFECTS && self.has_air) {
            return self.bulk_modulus;
        }
        let pressure = pressure.max(R::splat(LOWEST_AIR_PRESSURE));
        let softening = self.air / (pressure * pressure) * self.bulk_modulus;
        self.bulk_modulus / (R::splat(1.0) + softening)
    }

    /// The square of the hydraulic natural frequency at a position for a mass [1/s²]:
    /// `Km·(A1²/V1 + A2²/V2)/M`.
    #[inline(always)]
    pub fn hydraulic_mode_squared(&self, position: R, mass: R) -> R {
        let volumes = self.volumes(position);
        let spring = self.piston_area * self.piston_area / volumes.chamber_1
            + self.annulus_area * self.annulus_area / volumes.chamber_2;
        (self.bulk_modulus * spring / mass).abs()
    }
}
