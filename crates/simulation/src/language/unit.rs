//! Units of the quantities in a model's equations, and which of them fit together.
//!
//! A unit that is left out (or said to be `unitless`) opts out: it fits everything, and so does
//! all that is computed from it. A quantity declared `1` and a bare number are plain numbers in
//! products, and fit everything in sums and comparisons: `x - 0.82` stands for 0.82 of x's unit.

use greybox_numerics::dimension::Dimension;
use std::fmt;

/// The unit of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unit {
    /// Not checked.
    Any,
    /// A bare number.
    Number,
    /// Checked.
    Known(Dimension),
}

impl Unit {
    /// Reads the unit of a declaration.
    ///
    /// # Errors
    /// What is not understood, as a sentence.
    pub fn parse(text: &str) -> Result<Unit, String> {
        match text {
            "" | "unitless" => Ok(Unit::Any),
            "1" => Ok(Unit::Number),
            _ => Dimension::parse(text).map(Unit::Known),
        }
    }

    /// The unit of both sides of a sum or a comparison; none where they do not fit.
    #[must_use]
    pub fn joined(self, other: Unit) -> Option<Unit> {
        match (self, other) {
            (Unit::Any, _) | (_, Unit::Any) => Some(Unit::Any),
            (Unit::Number, unit) | (unit, Unit::Number) => Some(unit),
            (Unit::Known(one), Unit::Known(other)) => (one == other).then_some(self),
        }
    }

    /// The unit of a product.
    #[must_use]
    pub fn times(self, other: Unit) -> Unit {
        match (self, other) {
            (Unit::Any, _) | (_, Unit::Any) => Unit::Any,
            (Unit::Number, unit) | (unit, Unit::Number) => unit,
            (Unit::Known(one), Unit::Known(other)) => {
                one.times(other).map_or(Unit::Any, Unit::Known)
            }
        }
    }

    /// The unit of a quotient.
    #[must_use]
    pub fn over(self, other: Unit) -> Unit {
        self.times(other.power(-1.0).unwrap_or(Unit::Any))
    }

    /// The unit of a power; none where it has no meaning.
    #[must_use]
    pub fn power(self, exponent: f64) -> Option<Unit> {
        match self {
            Unit::Any | Unit::Number => Some(self),
            Unit::Known(dimension) => dimension.power(exponent).map(Unit::Known),
        }
    }

    /// The unit of a rate of change.
    #[must_use]
    pub fn per_second(self) -> Unit {
        match self {
            Unit::Any | Unit::Number => self,
            Unit::Known(_) => self.over(Unit::Known(Dimension::SECOND)),
        }
    }

    /// Whether a function that needs a plain number takes it.
    #[must_use]
    pub fn is_number(self) -> bool {
        !matches!(self, Unit::Known(dimension) if dimension != Dimension::NONE)
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Unit::Any => formatter.write_str("any unit"),
            Unit::Number => formatter.write_str("1 (no unit)"),
            Unit::Known(dimension) => dimension.fmt(formatter),
        }
    }
}
