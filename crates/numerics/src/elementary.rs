//! The exponential, the logarithm and powers by plain additions, multiplications and divisions, so
//! that a compiler does them for all lanes of a row at once and the bits are the same everywhere.
//!
//! The series are those of Taylor, cut where the rest is below the last digit. A power is
//! e^(y·ln x) with the logarithm and the product in two parts, for y·ln x may be large and its last
//! digits are those of the power (J.-M. Muller et al., *Handbook of Floating-Point Arithmetic*,
//! 2018, chapters 4 and 10).

/// ln 2 in two parts, the first with 33 significant bits (so that k·LN_2_HIGH is exact).
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// The exponential of more is no ordinary number.
const LARGEST_EXPONENT: f64 = 700.0;

/// e^x by reduction to |r| ≤ ln 2 / 2 and the Taylor polynomial of degree 13 (remainder below
/// 5e-18), scaled by a power of two through the exponent bits. Arguments beyond ±700 are taken as
/// the nearer of these.
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    let x = if x > LARGEST_EXPONENT {
        LARGEST_EXPONENT
    } else {
        x
    };
    let x = if x < -LARGEST_EXPONENT {
        -LARGEST_EXPONENT
    } else {
        x
    };
    exp_of_sum(x, 0.0)
}

/// e^(x + rest), where |x| ≤ 700 and the rest is small.
#[inline(always)]
fn exp_of_sum(x: f64, rest: f64) -> f64 {
    /// 1.5·2^52: adding it rounds to an integer, held in the low bits.
    const ROUND: f64 = 6_755_399_441_055_744.0;
    let shifted = x * std::f64::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let (high, low) = (x - k * LN_2_HIGH, k * LN_2_LOW - rest);
    let r = high - low;
    let lost = (high - r) - low;
    let mut series = 1.0 / 6_227_020_800.0;
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
    ] {
        series = series * r + inverse_factorial;
    }
    let sum = 1.0 + (r + (r * r * series + lost));
    let exponent = shifted.to_bits().wrapping_add(1023) << 52;
    sum * f64::from_bits(exponent)
}

/// [`exp`] in single precision: the polynomial of degree 7 (remainder below 1e-8), arguments within
/// ±87.
#[inline(always)]
pub fn exp_single(x: f32) -> f32 {
    /// 1.5·2^23.
    const ROUND: f32 = 12_582_912.0;
    /// ln 2 in two parts, the first with 16 significant bits.
    const LN_2_HIGH: f32 = 0.693_145_75;
    const LN_2_LOW: f32 = 1.428_606_8e-6;
    let x = if x > 87.0 { 87.0 } else { x };
    let x = if x < -87.0 { -87.0 } else { x };
    let shifted = x * std::f32::consts::LOG2_E + ROUND;
    let k = shifted - ROUND;
    let r = (x - k * LN_2_HIGH) - k * LN_2_LOW;
    let mut sum = 1.0 / 5040.0;
    for inverse_factorial in [
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
    let exponent = shifted.to_bits().wrapping_add(127) << 23;
    sum * f32::from_bits(exponent)
}

/// The natural logarithm of any number, as [`libm::log`] has it.
#[inline]
pub fn ln(x: f64) -> f64 {
    if is_ordinary(x) {
        ln_of_ordinary(x)
    } else {
        libm::log(x)
    }
}

/// A power of any number, as [`libm::pow`] has it.
#[inline]
pub fn pow(x: f64, y: f64) -> f64 {
    match pow_of_ordinary(x, y) {
        (power, true) => power,
        _ => libm::pow(x, y),
    }
}

/// Whether a number is positive, finite and not so small that it has lost digits.
#[inline(always)]
pub fn is_ordinary(x: f64) -> bool {
    (f64::MIN_POSITIVE..=f64::MAX).contains(&x)
}

/// The natural logarithm of an ordinary number; of others, anything.
#[inline(always)]
pub fn ln_of_ordinary(x: f64) -> f64 {
    let (high, low) = ln_in_two_parts(x);
    high + low
}

/// `x` to the power of `y`, where `x` and the outcome are ordinary numbers, and whether they are.
#[inline(always)]
pub fn pow_of_ordinary(x: f64, y: f64) -> (f64, bool) {
    let (high, low) = ln_in_two_parts(x);
    let short = first_bits(high + low);
    let rest = (high - short) + low;
    let y_short = first_bits(y);
    let product = y_short * short;
    let product_rest = y * rest + (y - y_short) * short;
    let is_within = product.abs() < LARGEST_EXPONENT;
    let within = if is_within { product } else { 0.0 };
    let power = exp_of_sum(within, product_rest);
    (power, is_ordinary(x) & is_within)
}

/// The first 26 bits of a number: products of two such are exact.
#[inline(always)]
fn first_bits(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & 0xFFFF_FFFF_F800_0000)
}

/// ln x as a sum that is exact to 1e-18 of it: x = 2^k·m with m from √½ to √2, and
/// ln m = 2·artanh s with s = (m − 1)/(m + 1).
#[inline(always)]
fn ln_in_two_parts(x: f64) -> (f64, f64) {
    /// The bits of √½.
    const LEAST: u64 = 0x3FE6_A09E_667F_3BCD;
    const ONE: u64 = 0x3FF0_0000_0000_0000;
    /// The bits of 2^52: put before an integer they make a number of it.
    const INTEGER: u64 = 0x4330_0000_0000_0000;
    const INTEGER_OFFSET: f64 = 4_503_599_627_370_496.0 + 1023.0;
    let shifted = x.to_bits().wrapping_add(ONE - LEAST);
    let k = f64::from_bits((shifted >> 52) | INTEGER) - INTEGER_OFFSET;
    let m = f64::from_bits((shifted & 0x000F_FFFF_FFFF_FFFF).wrapping_add(LEAST));
    let difference = m - 1.0;
    let sum = m + 1.0;
    let s = difference / sum;
    // The quotient once more, in two parts.
    let s_short = first_bits(s);
    let sum_short = first_bits(sum);
    let sum_rest = (sum - sum_short) + (m - (sum - 1.0));
    let s_rest = ((difference - s_short * sum_short) - s_short * sum_rest) / sum;
    let z = s * s;
    let mut series = 2.0 / 25.0;
    for term in [
        2.0 / 23.0,
        2.0 / 21.0,
        2.0 / 19.0,
        2.0 / 17.0,
        2.0 / 15.0,
        2.0 / 13.0,
        2.0 / 11.0,
        2.0 / 9.0,
        2.0 / 7.0,
        2.0 / 5.0,
        2.0 / 3.0,
    ] {
        series = series * z + term;
    }
    let of_k = k * LN_2_HIGH;
    let high = of_k + 2.0 * s_short;
    let lost = (of_k - high) + 2.0 * s_short;
    (
        high,
        lost + (2.0 * s_rest + s * (z * series) + k * LN_2_LOW),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// How far a number is from one that an independent library gives, in units of its last place.
    fn off(ours: f64, theirs: f64) -> f64 {
        (ours - theirs).abs() / (theirs.abs() * f64::EPSILON)
    }

    proptest! {
        #[test]
        fn exp_agrees_with_an_independent_library(x in -700.0..700.0f64) {
            prop_assert!(off(exp(x), libm::exp(x)) <= 2.0);
        }

        #[test]
        fn logarithms_agree_with_an_independent_library(exponent in -1000.0..1000.0f64) {
            let x = libm::exp2(exponent);
            prop_assert!(off(ln(x), libm::log(x)) <= 2.0, "{} {}", ln(x), libm::log(x));
        }

        #[test]
        fn logarithms_near_one_agree_with_an_independent_library(distance in -0.5..0.5f64) {
            let x = 1.0 + distance.powi(9);
            prop_assert!(x == 1.0 || off(ln(x), libm::log(x)) <= 2.0);
        }

        #[test]
        fn powers_agree_with_an_independent_library(
            exponent in -40.0..40.0f64,
            y in -20.0..20.0f64,
        ) {
            let x = libm::exp2(exponent);
            prop_assert!(off(pow(x, y), libm::pow(x, y)) <= 2.0);
        }

        #[test]
        fn whole_powers_of_two_are_exact(x in -30..30_i32, y in -20..20_i32) {
            let power = pow(f64::from(x).exp2(), f64::from(y));
            prop_assert_eq!(power, f64::from(x * y).exp2());
        }
    }

    #[test]
    fn what_is_not_ordinary_is_as_an_independent_library_has_it() {
        let numbers = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            2.0,
            -2.0,
            0.5,
            -3.0,
            1e308,
            1e-310,
            f64::INFINITY,
            f64::NEG_INFINITY,
            f64::NAN,
            800.0,
        ];
        let same = |a: f64, b: f64| a == b || (a.is_nan() && b.is_nan()) || off(a, b) <= 3.0;
        for x in numbers {
            assert!(same(ln(x), libm::log(x)), "ln {x}");
            for y in numbers {
                let (ours, theirs) = (pow(x, y), libm::pow(x, y));
                assert!(same(ours, theirs), "{x}^{y}: {ours} and {theirs}");
            }
        }
    }
}
