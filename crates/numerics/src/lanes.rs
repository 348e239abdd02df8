//! The numbers that equations are written in: one candidate ([`f64`]) or several at once
//! ([`Lanes`]), and the same in single precision for ranking ([`SingleLanes`]).
//!
//! A model writes its equations once over [`Real`]. [`Lanes`] keeps one candidate in each lane and
//! does every operation lane by lane, with the same IEEE 754 operations in the same order as
//! one number alone does: a lane's bits depend neither on its neighbours nor on the width of the
//! machine's registers. No fused multiply-add, no hardware estimate, no platform mathematics
//! library.

use super::elementary;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// Candidates in one [`Lanes`].
pub const LANES: usize = 8;

/// Candidates in one [`SingleLanes`]: as many as fill the same registers.
pub const SINGLE_LANES: usize = 2 * LANES;

/// One number per lane.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Lanes<T = f64, const N: usize = LANES>(pub [T; N]);

/// One number of single precision per lane.
pub type SingleLanes = Lanes<f32, SINGLE_LANES>;

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
    /// The number of lanes: numbers that stand side by side.
    const WIDTH: usize;
    /// Whether the lanes are of single precision.
    const IS_SINGLE: bool;
    /// `value` in every lane.
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
    /// The exponential, accurate to 2 units in the last place for arguments in [-700, 700] ([-87,
    /// 87] in single precision); arguments outside are taken as the nearer end.
    fn exp(self) -> Self;
    /// The natural logarithm, accurate to 2 units in the last place.
    fn ln(self) -> Self;
    /// `self` to the power of `exponent`, accurate to 2 units in the last place.
    fn pow(self, exponent: Self) -> Self;
    /// x^(−⅛) of a positive number, within a tenth of it: a step control needs no more. What is not
    /// a number gives one below 1e-4.
    fn inverse_eighth_root_estimate(self) -> Self;
    /// Whether a condition holds for the number in at least one lane.
    fn any(&self, condition: impl Fn(f64) -> bool) -> bool {
        (0..Self::WIDTH).any(|lane| condition(self.lane(lane)))
    }
    /// Whether the number in at least one lane is above a threshold.
    fn any_above(&self, threshold: f64) -> bool;
    /// `self` held in `[lower, upper]`.
    #[inline(always)]
    fn clamp(self, lower: f64, upper: f64) -> Self {
        self.max(Self::splat(lower)).min(Self::splat(upper))
    }
    /// The hyperbolic tangent, with an absolute error below 3e-16 (2e-7 in single precision).
    #[inline(always)]
    fn tanh(self) -> Self {
        // Beyond 20 the result rounds to ±1.
        let magnitude = self.abs().min(Self::splat(20.0));
        let e = (magnitude + magnitude).exp();
        (Self::splat(1.0) - Self::splat(2.0) / (e + Self::splat(1.0))).copysign(self)
    }
}

/// One number.
pub trait Scalar: Real + PartialOrd {}

impl Scalar for f64 {}
impl Scalar for f32 {}

/// The exponent of a floating-point number stands in its high bits, so that a shift to the right
/// takes roots of its logarithm; the constant is 9/8 of the bits of 1.
#[inline(always)]
fn inverse_eighth_root_f64(x: f64) -> f64 {
    f64::from_bits(0x47EE_0000_0000_0000 - (x.to_bits() >> 3))
}

/// Estimates x^(−1/8) in single precision; the constant is 9/8 of the bits of 1.
#[inline(always)]
fn inverse_eighth_root_f32(x: f32) -> f32 {
    f32::from_bits(0x4770_0000 - (x.to_bits() >> 3))
}

macro_rules! real {
    ($number:ident, $is_single:literal, $exp:path, $inverse_eighth_root:ident) => {
        impl Real for $number {
            const WIDTH: usize = 1;
            const IS_SINGLE: bool = $is_single;
            #[inline(always)]
            fn splat(value: f64) -> Self {
                value as $number
            }
            #[inline(always)]
            fn lane(&self, _lane: usize) -> f64 {
                f64::from(*self)
            }
            #[inline(always)]
            fn set_lane(&mut self, _lane: usize, value: f64) {
                *self = value as $number;
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $number::sqrt(self)
            }
            #[inline(always)]
            fn abs(self) -> Self {
                $number::abs(self)
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
                $number::copysign(self, sign)
            }
            #[inline(always)]
            fn exp(self) -> Self {
                $exp(self)
            }
            #[inline(always)]
            fn ln(self) -> Self {
                elementary::ln(f64::from(self)) as $number
            }
            #[inline(always)]
            fn pow(self, exponent: Self) -> Self {
                elementary::pow(f64::from(self), f64::from(exponent)) as $number
            }
            #[inline(always)]
            fn any_above(&self, threshold: f64) -> bool {
                f64::from(*self) > threshold
            }
            #[inline(always)]
            fn inverse_eighth_root_estimate(self) -> Self {
                $inverse_eighth_root(self)
            }
        }
    };
}
real!(f64, false, elementary::exp, inverse_eighth_root_f64);
real!(f32, true, elementary::exp_single, inverse_eighth_root_f32);

impl<T: Copy, const N: usize> Lanes<T, N> {
    /// `function` of each lane.
    #[inline(always)]
    pub fn map(self, function: impl Fn(T) -> T) -> Self {
        let mut result = self;
        for lane in 0..N {
            result.0[lane] = function(self.0[lane]);
        }
        result
    }

    /// `function` of each pair of lanes.
    #[inline(always)]
    pub fn zip(self, right: Self, function: impl Fn(T, T) -> T) -> Self {
        let mut result = self;
        for lane in 0..N {
            result.0[lane] = function(self.0[lane], right.0[lane]);
        }
        result
    }
}

impl<T: Scalar, const N: usize> Real for Lanes<T, N> {
    const WIDTH: usize = N;
    const IS_SINGLE: bool = T::IS_SINGLE;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        Lanes([T::splat(value); N])
    }
    #[inline(always)]
    fn lane(&self, lane: usize) -> f64 {
        self.0[lane].lane(0)
    }
    #[inline(always)]
    fn set_lane(&mut self, lane: usize, value: f64) {
        self.0[lane] = T::splat(value);
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.map(T::sqrt)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.map(T::abs)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, T::min)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, T::max)
    }
    #[inline(always)]
    fn select_ge(self, threshold: Self, at_least: Self, below: Self) -> Self {
        let mut result = self;
        for lane in 0..N {
            result.0[lane] =
                self.0[lane].select_ge(threshold.0[lane], at_least.0[lane], below.0[lane]);
        }
        result
    }
    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        self.zip(sign, T::copysign)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        self.map(T::exp)
    }
    #[inline(always)]
    fn ln(self) -> Self {
        let mut result = self;
        let mut all_ordinary = true;
        for lane in 0..N {
            let x = self.0[lane].lane(0);
            result.0[lane] = T::splat(elementary::ln_of_ordinary(x));
            all_ordinary &= elementary::is_ordinary(x);
        }
        if all_ordinary {
            result
        } else {
            self.map(T::ln)
        }
    }
    #[inline(always)]
    fn pow(self, exponent: Self) -> Self {
        let mut result = self;
        let mut all_ordinary = true;
        for lane in 0..N {
            let (x, y) = (self.0[lane].lane(0), exponent.0[lane].lane(0));
            let (power, is_ordinary) = elementary::pow_of_ordinary(x, y);
            result.0[lane] = T::splat(power);
            all_ordinary &= is_ordinary;
        }
        if all_ordinary {
            result
        } else {
            self.zip(exponent, T::pow)
        }
    }
    #[inline(always)]
    fn any_above(&self, threshold: f64) -> bool {
        let threshold = T::splat(threshold);
        // Without a way out in between, so that all lanes are compared at once.
        let any = |any, number: &T| any | (*number > threshold);
        self.0.iter().fold(false, any)
    }
    #[inline(always)]
    fn inverse_eighth_root_estimate(self) -> Self {
        self.map(T::inverse_eighth_root_estimate)
    }
}

macro_rules! lanewise {
    ($($trait:ident $method:ident $assign:ident $assign_method:ident $operator:tt;)*) => {$(
        impl<T: Scalar, const N: usize> $trait for Lanes<T, N> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.zip(other, |a, b| a $operator b)
            }
        }
        impl<T: Scalar, const N: usize> $assign for Lanes<T, N> {
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

impl<T: Scalar, const N: usize> Div for Lanes<T, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.zip(other, |a, b| a / b)
    }
}

impl<T: Scalar, const N: usize> Neg for Lanes<T, N> {
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

/// One lane of each number, in the precision that is asked for.
pub fn lane_of<R: Real, S: Real, W: RealArray<R>, A: RealArray<S>>(wide: &W, lane: usize) -> A {
    let mut single = A::zeros();
    for (value, lanes) in single.as_mut().iter_mut().zip(wide.as_ref()) {
        *value = S::splat(lanes.lane(lane));
    }
    single
}

/// Replaces one lane of each number.
pub fn set_lane_of<R: Real, S: Real, W: RealArray<R>, A: RealArray<S>>(
    wide: &mut W,
    lane: usize,
    single: &A,
) {
    for (lanes, value) in wide.as_mut().iter_mut().zip(single.as_ref()) {
        lanes.set_lane(lane, value.lane(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn tanh_agrees_with_an_independent_library(x in -30.0..30.0f64) {
            prop_assert!((Real::tanh(x) - libm::tanh(x)).abs() <= 3e-16);
        }

        #[test]
        fn the_estimate_of_an_inverse_eighth_root_is_within_a_tenth(exponent in -30.0..30.0f64) {
            let x = libm::exp2(exponent);
            let expected = libm::pow(x, -0.125);
            let (double, single) = (
                x.inverse_eighth_root_estimate(),
                f64::from((x as f32).inverse_eighth_root_estimate()),
            );
            prop_assert!((double / expected - 1.0).abs() < 0.1, "{double} for {expected}");
            prop_assert!((single / expected - 1.0).abs() < 0.1, "{single} for {expected}");
        }

        #[test]
        fn exp_and_tanh_of_single_precision_agree_with_an_independent_library(
            x in -87.0..87.0f32,
        ) {
            let (exp, tanh) = (libm::exp(f64::from(x)), libm::tanh(f64::from(x)));
            let error = (f64::from(Real::exp(x)) - exp).abs();
            prop_assert!(error <= 2.0 * f64::from(f32::EPSILON) * exp);
            prop_assert!((f64::from(Real::tanh(x)) - tanh).abs() <= 2e-7);
        }

        #[test]
        fn a_lane_of_single_precision_has_the_bits_of_a_single_number(
            a in -50.0..50.0f32,
            b in -50.0..50.0f32,
        ) {
            let mut lanes = SingleLanes::splat(1.25);
            lanes.0[13] = a;
            let other = Lanes([b; SINGLE_LANES]);
            let pairs = [
                ((lanes * other + lanes / other).0[13], a * b + a / b),
                (lanes.tanh().0[13], Real::tanh(a)),
                (lanes.abs().sqrt().0[13], a.abs().sqrt()),
                (lanes.select_ge(other, lanes, other).0[13], if a >= b { a } else { b }),
            ];
            for (lane, single) in pairs {
                prop_assert_eq!(lane.to_bits(), single.to_bits());
            }
        }

        #[test]
        fn a_lane_has_the_bits_of_a_single_number(a in -50.0..50.0f64, b in -50.0..50.0f64) {
            let mut lanes: Lanes = Lanes::splat(1.25);
            lanes.set_lane(5, a);
            let other = Lanes::splat(b);
            let pairs = [
                ((lanes * other + lanes / other).lane(5), a * b + a / b),
                (lanes.tanh().lane(5), Real::tanh(a)),
                (lanes.exp().lane(5), Real::exp(a)),
                (lanes.abs().ln().lane(5), Real::ln(a.abs())),
                (lanes.abs().pow(other).lane(5), Real::pow(a.abs(), b)),
                (lanes.pow(other).lane(3), Real::pow(1.25, b)),
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
