//! Turbulent flow through an orifice, with a finite slope at zero pressure drop.
//!
//! `ψ(d) = d / (d² + d0²)^¼` is the signed square root of the pressure drop d [Pa], linear well
//! below the transition pressure d0 [Pa], where a real orifice is laminar (H. E. Merritt,
//! *Hydraulic Control Systems*, 1967, ch. 3; the smooth form is that of method description §1).

use crate::simulation::lanes::Real;

/// ψ(d) [√Pa].
#[inline(always)]
pub fn signed_root<R: Real>(drop: R, transition_squared: R) -> R {
    drop / (drop * drop + transition_squared).sqrt().sqrt()
}

/// dψ/dd [1/√Pa].
#[inline(always)]
pub fn signed_root_slope<R: Real>(drop: R, transition_squared: R) -> R {
    let squared = drop * drop;
    let z = squared + transition_squared;
    (squared * R::splat(0.5) + transition_squared) / (z * z.sqrt().sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn far_from_zero_it_is_the_signed_square_root() {
        for drop in [3e6, -3e6] {
            let expected = f64::sqrt(3e6).copysign(drop);
            assert!((signed_root(drop, 2e4 * 2e4) / expected - 1.0).abs() < 2e-5);
        }
    }

    #[test]
    fn the_slope_is_the_difference_quotient_through_zero_and_far_away() {
        for drop in [-2e6, -1e4, 0.0, 5e3, 7e5] {
            let quotient = (signed_root(drop + 1.0, 4e8) - signed_root(drop - 1.0, 4e8)) / 2.0;
            let slope = signed_root_slope(drop, 4e8);
            assert!(
                (slope / quotient - 1.0).abs() < 1e-6,
                "at {drop}: {slope} {quotient}"
            );
        }
    }
}
