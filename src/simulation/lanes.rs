//! The numbers that equations are written in: one candidate (`f64`) or eight at once ([`Lanes`]).
//!
//! A model writes its equations once over [`Real`]. [`Lanes`] keeps one candidate in each lane and
//! does every operation lane by lane, with the same IEEE 754 operations in the same order as
//! `f64` does: a lane's bits depend neither on its neighbours nor on the width of the machine's
//! registers. No fused multiply-add, no hardware estimate, no platform mathematics library.

use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// Candidates in one [`Lanes`].
pub const LANES: usize = 8;

/// One number per lane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes(pub [f64; LANES]);

/// A real number, or several side by side, with the operations that equations need.
pub trait Real:
    Copy
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + 'static
{
    /// How many numbers stand side by side.
    const WIDTH: usize;
    /// The same number in every lane.
    fn splat(value: f64) -> Self;
    /// The number in one lane.
    fn lane(&self, lane: usize) -> f64;
    /// Replaces the number in one lane.
    fn set_lane(&mut self, lane: usize, value: f64);
    /// The square root.
    fn sqrt(self) -> Self;
    /// The absolute value.
    fn abs(self) -> Self;
    /// The smaller of two; `other` where `self` is not a number.
    fn min(self, other: Self) -> Self;
    /// The larger of two; `other` where `self` is not a number.
    fn max(self, other: Self) -> Self;
    /// `at_least` where `self >= threshold`, `below` elsewhere.
    fn select_ge(self, threshold: Self, at_least: Self, below: Self) -> Self;
    /// The magnitude of `self` with the sign of `sign`.
    fn copysign(self, sign: Self) -> Self;
    /// The exponential, accurate to 2 units in the last place for arguments in [-700, 700];
    /// arguments outside are taken as the nearer end.
    fn exp(self) -> Self;
    /// Whether a condition holds for the number in at least one lane.
    fn any(&self, condition: impl Fn(f64) -> bool) -> bool {
        (0..Self::WIDTH).any(|lane| condition(self.lane(lane)))
    }
    /// `self` held in `[lower, upper]`.
    #[inline(always)]
    fn clamp(self, lower: f64, upper: f64) -> Self {
        self.max(Self::splat(lower)).min(Self::splat(upper))
    }
    /// The hyperbolic tangent, with an absolute error below 3e-16.
    #[inline(always)]
    fn tanh(self) -> Self {
        // Beyond 20 the result rounds to ±1.
        let magnitude = self.abs().min(Self::splat(20.0));
        let e = (magnitude + magnitude).exp();
        (Self::splat(1.0) - Self::splat(2.0) / (e + Self::splat(1.0))).copysign(self)
    }
}

/// e^x by reduction to |r| ≤ ln 2 / 2 and the Taylor polynomial of degree 13 (remainder below
/// 5e-18), scaled by a power of two through the exponent bits. Plain adds and multiplies only.
#[inline(always)]
fn exp_f64(x: f64) -> f64 {
    /// 1.5·2^52: adding it rounds to an integer, held in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    /// ln 2 in two parts, the first with 33 significant bits (so that k·LN_2_HIGH is exact).
    const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
    const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
    let x = if x > 700.0 { 700.0 } else { x };
    let x = if x < -700.0 { -700.0 } else { x };
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let mut sum = 1.0 / 6_227_020_800.0;
    for inverse_factorial in [
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ] {
        sum = sum * r + inverse_factorial;
    }
    let exponent = shifted.to_bits().wrapping_add(1023) << 52;
    sum * f64::from_bits(exponent)
}

impl Real for f64 {
    const WIDTH: usize = 1;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn lane(&self, _lane: usize) -> f64 {
        *self
    }
    #[inline(always)]
    fn set_lane(&mut self, _lane: usize, value: f64) {
        *self = value;
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        f64::abs(self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn select_ge(self, threshold: Self, at_least: Self, below: Self) -> Self {
        if self >= threshold { at_least } else { below }
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        f64::copysign(self, sign)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        exp_f64(self)
    }
}

impl Lanes {
    /// `function` of each lane.
    #[inline(always)]
    pub fn map(self, function: impl Fn(f64) -> f64) -> Self {
        let mut result = self;
        for lane in 0..LANES {
            result.0[lane] = function(self.0[lane]);
        }
        result
    }

    /// `function` of each pair of lanes.
    #[inline(always)]
    pub fn zip(self, other: Self, function: impl Fn(f64, f64) -> f64) -> Self {
        let mut result = self;
        for lane in 0..LANES {
            result.0[lane] = function(self.0[lane], other.0[lane]);
        }
        result
    }
}

impl Real for Lanes {
    const WIDTH: usize = LANES;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Lanes([value; LANES])
    }
    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        self.0[lane]
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        self.0[lane] = value;
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(f64::sqrt)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(f64::abs)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, <f64 as Real>::min)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, <f64 as Real>::max)
    }
    #[inline(always)]
    fn select_ge(self, threshold: Self, at_least: Self, below: Self) -> Self {
        let mut result = self;
        for lane in 0..LANES {
            result.0[lane] =
                self.0[lane].select_ge(threshold.0[lane], at_least.0[lane], below.0[lane]);
        }
        result
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.zip(sign, f64::copysign)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        self.map(exp_f64)
    }
}

macro_rules! lanewise {
    ($($trait:ident $method:ident $assign:ident $assign_method:ident $operator:tt;)*) => {$(
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $operator b)
            }
        }
        impl $assign for Lanes {
            #[inline(always)]
            fn $assign_method(&mut self, other: Self) {
                *self = *self $operator other;
            }
        }
    )*};
}
lanewise! {
    Add add AddAssign add_assign +;
    Sub sub SubAssign sub_assign -;
    Mul mul MulAssign mul_assign *;
}

impl Div for Lanes {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|a| -a)
    }
}

/// A fixed number of reals: the states of a plant, or what is held over a sample.
pub trait RealArray<R: Real>: Copy + Send + Sync + AsRef<[R]> + AsMut<[R]> + 'static {
    /// Zeros.
    fn zeros() -> Self;
    /// `self + scale · direction`, element by element.
    #[must_use]
    fn plus_scaled(&self, scale: R, direction: &Self) -> Self;
}

impl<R: Real, const N: usize> RealArray<R> for [R; N] {
    #[inline(always)]
    fn zeros() -> Self {
        [R::splat(0.0); N]
    }
    #[inline(always)]
    fn plus_scaled(&self, scale: R, direction: &Self) -> Self {
        let mut result = *self;
        for (value, slope) in result.iter_mut().zip(direction) {
            *value += scale * *slope;
        }
        result
    }
}

/// One lane of each number.
pub fn lane_of<W: RealArray<Lanes>, S: RealArray<f64>>(wide: &W, lane: usize) -> S {
    let mut single = S::zeros();
    for (value, lanes) in single.as_mut().iter_mut().zip(wide.as_ref()) {
        *value = lanes.0[lane];
    }
    single
}

/// Replaces one lane of each number.
pub fn set_lane_of<W: RealArray<Lanes>, S: RealArray<f64>>(wide: &mut W, lane: usize, single: &S) {
    for (lanes, value) in wide.as_mut().iter_mut().zip(single.as_ref()) {
        lanes.0[lane] = *value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn exp_agrees_with_an_independent_library(x in -700.0..700.0f64) {
            let expected = libm::exp(x);
            prop_assert!((Real::exp(x) - expected).abs() <= 4.0 * f64::EPSILON * expected);
        }

        #[test]
        fn tanh_agrees_with_an_independent_library(x in -30.0..30.0f64) {
            prop_assert!((Real::tanh(x) - libm::tanh(x)).abs() <= 3e-16);
        }

        #[test]
        fn a_lane_has_the_bits_of_a_single_number(a in -50.0..50.0f64, b in -50.0..50.0f64) {
            let mut lanes = Lanes::splat(1.25);
            lanes.set_lane(5, a);
            let other = Lanes::splat(b);
            let pairs = [
                ((lanes * other + lanes / other).lane(5), a * b + a / b),
                (lanes.tanh().lane(5), Real::tanh(a)),
                (lanes.exp().lane(5), Real::exp(a)),
                (lanes.abs().sqrt().lane(5), a.abs().sqrt()),
                (lanes.select_ge(other, lanes, other).lane(5), if a >= b { a } else { b }),
                (Real::min(lanes, other).lane(5), Real::min(a, b)),
            ];
            for (lane, single) in pairs {
                prop_assert_eq!(lane.to_bits(), single.to_bits());
            }
        }
    }
}
