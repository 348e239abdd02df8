//! Turbulent flow through an orifice, with a finite slope at zero pressure drop.
//!
//! `ψ(d) = d / (d² + d0²)^¼` is the signed square root of the pressure drop d [Pa], linear well
//! below the transition pressure d0 [Pa], where a real orifice is laminar (H. E. Merritt,
//! *Hydraulic Control Systems*, 1967, ch. 3; the smooth form is that of method description §1).

use greybox_numerics::lanes::Real;

/// ψ(d) [√Pa].
#[inline(always)]
pub fn signed_root<R: Real>(drop: R, transition_squared: R) -> R {
    drop / (drop * drop + transition_squared).sqrt().sqrt()
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
}
