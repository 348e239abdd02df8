//! The operations of a model's equations: on numbers, on rows of lanes, and their derivatives.
//!
//! A lane has the bits that a single number has. Functions beyond those of
//! [`Real`] come from one portable library, lane by lane.

use greybox_numerics::lanes::Real;

/// What one instruction does with up to three numbers a, b and c.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// a + b
    Add,
    /// a − b
    Subtract,
    /// a·b
    Multiply,
    /// a/b
    Divide,
    /// −a
    Negate,
    /// The smaller.
    Minimum,
    /// The larger.
    Maximum,
    /// |a|
    Absolute,
    /// −1, 0 or 1
    Sign,
    /// √a
    SquareRoot,
    /// e^a
    Exponential,
    /// ln a
    Logarithm,
    /// sin a
    Sine,
    /// cos a
    Cosine,
    /// tan a
    Tangent,
    /// arctan a
    ArcTangent,
    /// The angle of the point (b, a).
    ArcTangent2,
    /// tanh a
    HyperbolicTangent,
    /// a^b
    Power,
    /// 1 where a ≥ b, else 0
    AtLeast,
    /// 1 where a > b, else 0
    Above,
    /// b where a is 1, c where a is 0
    Select,
    /// The table of that number, interpolated at a.
    Table(u8),
}

impl Operation {
    /// Whether a and b may change places, to the last bit.
    #[must_use]
    pub fn is_symmetric(self) -> bool {
        matches!(self, Operation::Add | Operation::Multiply)
    }

    /// How many numbers it works on.
    #[must_use]
    pub fn arguments(self) -> usize {
        match self {
            Operation::Select => 3,
            Operation::Add
            | Operation::Subtract
            | Operation::Multiply
            | Operation::Divide
            | Operation::Minimum
            | Operation::Maximum
            | Operation::ArcTangent2
            | Operation::Power
            | Operation::AtLeast
            | Operation::Above => 2,
            _ => 1,
        }
    }
}

/// A curve through points, straight between them and level beyond them.
#[derive(Clone, Debug, PartialEq)]
pub struct LookupTable {
    /// Where the points stand, rising.
    pub x: Vec<f64>,
    /// The heights of the points.
    pub y: Vec<f64>,
}

impl LookupTable {
    /// The point before `x` of the segment that holds it; none beyond the ends.
    fn segment(&self, x: f64) -> Option<usize> {
        let after = self.x.partition_point(|point| *point <= x);
        (after > 0 && after < self.x.len()).then(|| after - 1)
    }

    fn slope_of(&self, segment: usize) -> f64 {
        (self.y[segment + 1] - self.y[segment]) / (self.x[segment + 1] - self.x[segment])
    }

    fn value(&self, x: f64) -> f64 {
        match self.segment(x) {
            Some(at) => self.y[at] + self.slope_of(at) * (x - self.x[at]),
            None if x.is_nan() => x,
            None if x < self.x[0] => self.y[0],
            None => self.y[self.y.len() - 1],
        }
    }

    fn slope(&self, x: f64) -> f64 {
        self.segment(x).map_or(0.0, |at| self.slope_of(at))
    }
}

#[inline(always)]
fn each<R: Real>(value: R, function: impl Fn(f64) -> f64) -> R {
    let mut result = value;
    for lane in 0..R::WIDTH {
        result.set_lane(lane, function(value.lane(lane)));
    }
    result
}

#[inline(always)]
fn each_pair<R: Real>(a: R, b: R, function: impl Fn(f64, f64) -> f64) -> R {
    let mut result = a;
    for lane in 0..R::WIDTH {
        result.set_lane(lane, function(a.lane(lane), b.lane(lane)));
    }
    result
}

fn sign(value: f64) -> f64 {
    match value {
        value if value > 0.0 => 1.0,
        value if value < 0.0 => -1.0,
        value => value,
    }
}

/// The result of an operation on single numbers.
#[must_use]
pub fn apply(operation: Operation, [a, b, c]: [f64; 3], tables: &[LookupTable]) -> f64 {
    let mut registers = [a, b, c, 0.0];
    execute(operation, &mut registers, [0, 1, 2], 3, tables);
    registers[3]
}

/// Does an operation on registers: reads up to three, writes one. Each branch writes for itself,
/// so that a row of lanes goes from register to register without a stop in between. `N` is a
/// power of two, so that no place needs to be checked.
#[inline(always)]
pub fn execute<R: Real, const N: usize>(
    operation: Operation,
    registers: &mut [R; N],
    on: [u16; 3],
    to: u16,
    tables: &[LookupTable],
) {
    let r = registers;
    let place = |register: u16| usize::from(register) & (N - 1);
    let [a, b, c] = on.map(place);
    let to = place(to);
    match operation {
        Operation::Add => r[to] = r[a] + r[b],
        Operation::Subtract => r[to] = r[a] - r[b],
        Operation::Multiply => r[to] = r[a] * r[b],
        Operation::Divide => r[to] = r[a] / r[b],
        Operation::Negate => r[to] = -r[a],
        Operation::Minimum => r[to] = Real::min(r[a], r[b]),
        Operation::Maximum => r[to] = Real::max(r[a], r[b]),
        Operation::Absolute => r[to] = Real::abs(r[a]),
        Operation::SquareRoot => r[to] = Real::sqrt(r[a]),
        Operation::Exponential => r[to] = Real::exp(r[a]),
        Operation::HyperbolicTangent => r[to] = Real::tanh(r[a]),
        Operation::AtLeast => r[to] = r[a].select_ge(r[b], R::splat(1.0), R::splat(0.0)),
        Operation::Above => r[to] = r[b].select_ge(r[a], R::splat(0.0), R::splat(1.0)),
        Operation::Select => r[to] = r[a].select_ge(R::splat(0.5), r[b], r[c]),
        Operation::Sign => r[to] = each(r[a], sign),
        Operation::Logarithm => r[to] = Real::ln(r[a]),
        Operation::Sine => r[to] = each(r[a], libm::sin),
        Operation::Cosine => r[to] = each(r[a], libm::cos),
        Operation::Tangent => r[to] = each(r[a], libm::tan),
        Operation::ArcTangent => r[to] = each(r[a], libm::atan),
        Operation::ArcTangent2 => r[to] = each_pair(r[a], r[b], libm::atan2),
        Operation::Power => r[to] = Real::pow(r[a], r[b]),
        Operation::Table(number) => {
            r[to] = each(r[a], |x| tables[usize::from(number)].value(x));
        }
    }
}

/// The derivatives of an operation by a, b and c, at numbers whose result is `result`. That of a
/// power by its exponent, which costs a logarithm, is 0 unless it is asked for.
#[inline(always)]
pub fn partials<R: Real>(
    operation: Operation,
    [a, b, _]: [R; 3],
    result: R,
    by_exponent: bool,
    tables: &[LookupTable],
) -> [R; 3] {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let by_a = |slope: R| [slope, zero, zero];
    match operation {
        Operation::Add => [one, one, zero],
        Operation::Subtract => [one, -one, zero],
        Operation::Multiply => [b, a, zero],
        Operation::Divide => {
            let inverse = one / b;
            [inverse, -(result * inverse), zero]
        }
        Operation::Negate => by_a(-one),
        Operation::Minimum => [b.select_ge(a, one, zero), b.select_ge(a, zero, one), zero],
        Operation::Maximum => [a.select_ge(b, one, zero), a.select_ge(b, zero, one), zero],
        Operation::Absolute => by_a(each(a, sign)),
        Operation::SquareRoot => by_a(R::splat(0.5) / result),
        Operation::Exponential => by_a(result),
        Operation::Logarithm => by_a(one / a),
        Operation::Sine => by_a(each(a, libm::cos)),
        Operation::Cosine => by_a(-each(a, libm::sin)),
        Operation::Tangent => by_a(one + result * result),
        Operation::ArcTangent => by_a(one / (one + a * a)),
        Operation::ArcTangent2 => {
            let squared = a * a + b * b;
            [b / squared, -(a / squared), zero]
        }
        Operation::HyperbolicTangent => by_a(one - result * result),
        Operation::Power => {
            let least = R::splat(f64::MIN_POSITIVE);
            let mut slope = b * (result / a);
            if a.any(|a| a < f64::MIN_POSITIVE) {
                slope = a.select_ge(least, slope, b * Real::pow(a, b - one));
            }
            // 0 where the exponent is 0, and by the exponent where the base is not positive.
            let by_base = Real::abs(b).select_ge(least, slope, zero);
            let by_exponent = match by_exponent {
                true => zero.select_ge(a, zero, result * Real::ln(a)),
                false => zero,
            };
            [by_base, by_exponent, zero]
        }
        Operation::Select => {
            let half = R::splat(0.5);
            [
                zero,
                a.select_ge(half, one, zero),
                a.select_ge(half, zero, one),
            ]
        }
        Operation::Sign | Operation::AtLeast | Operation::Above => [zero; 3],
        Operation::Table(number) => by_a(each(a, |x| tables[usize::from(number)].slope(x))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use greybox_numerics::lanes::{LANES, Lanes};
    use proptest::prelude::*;

    fn tables() -> Vec<LookupTable> {
        vec![LookupTable {
            x: vec![-1.0, 0.0, 2.0],
            y: vec![3.0, 1.0, 5.0],
        }]
    }

    const ALL: [Operation; 23] = [
        Operation::Add,
        Operation::Subtract,
        Operation::Multiply,
        Operation::Divide,
        Operation::Negate,
        Operation::Minimum,
        Operation::Maximum,
        Operation::Absolute,
        Operation::Sign,
        Operation::SquareRoot,
        Operation::Exponential,
        Operation::Logarithm,
        Operation::Sine,
        Operation::Cosine,
        Operation::Tangent,
        Operation::ArcTangent,
        Operation::ArcTangent2,
        Operation::HyperbolicTangent,
        Operation::Power,
        Operation::AtLeast,
        Operation::Above,
        Operation::Select,
        Operation::Table(0),
    ];

    #[test]
    fn a_table_is_straight_between_its_points_and_level_beyond_them() {
        let table = &tables()[0];
        for (x, y) in [
            (-5.0, 3.0),
            (-1.0, 3.0),
            (-0.5, 2.0),
            (0.0, 1.0),
            (1.0, 3.0),
            (9.0, 5.0),
        ] {
            assert_eq!(table.value(x), y, "at {x}");
        }
        assert!(table.value(f64::NAN).is_nan());
    }

    proptest! {
        #[test]
        fn a_lane_has_the_bits_of_a_single_number(a in -5.0..5.0f64, b in -5.0..5.0f64) {
            for operation in ALL {
                let single = apply(operation, [a, b, 0.25], &tables());
                let mut row: [Lanes; 3] = [Lanes::splat(1.5), Lanes::splat(0.5), Lanes::splat(0.25)];
                row[0].set_lane(LANES - 1, a);
                row[1].set_lane(LANES - 1, b);
                let mut registers = [row[0], row[1], row[2], Lanes::splat(0.0)];
                execute(operation, &mut registers, [0, 1, 2], 3, &tables());
                let lane = registers[3].lane(LANES - 1);
                prop_assert!(lane.to_bits() == single.to_bits() || lane.is_nan() && single.is_nan());
            }
        }

        #[test]
        fn a_slope_is_the_difference_quotient(a in 0.1..1.9f64, b in 0.2..3.0f64) {
            let change = 1e-6;
            // Not across the kink where a and b are equal, nor at that of the selection, nor near
            // the pole of the tangent.
            prop_assume!((a - b).abs() > 1e-3 && (a - 0.5).abs() > 1e-3);
            prop_assume!((a - std::f64::consts::FRAC_PI_2).abs() > 0.05);
            for operation in ALL {
                let at = [a, b, 0.7];
                let result = apply(operation, at, &tables());
                let slopes = partials(operation, at, result, true, &tables());
                for (place, slope) in slopes.into_iter().enumerate() {
                    let moved = |by: f64| {
                        let mut at = at;
                        at[place] += by;
                        apply(operation, at, &tables())
                    };
                    let quotient = (moved(change) - moved(-change)) / (2.0 * change);
                    let size = quotient.abs().max(1.0);
                    prop_assert!((slope - quotient).abs() < 1e-5 * size, "{operation:?} {place}");
                }
            }
        }
    }
}
