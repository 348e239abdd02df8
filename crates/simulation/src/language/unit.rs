//! Units of the quantities in a model's equations, and which of them fit together.
//!
//! A unit that is left out (or said to be `unitless`) opts out: it fits everything, and so does
//! all that is computed from it. A quantity declared `1` and a bare number are plain numbers in
//! products, and fit everything in sums and comparisons: `x - 0.82` stands for 0.82 of x's unit.

use greybox_numerics::dimension::Dimension;
use std::fmt;

/// The unit of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ValueUnit {
    /// Not checked.
    Any,
    /// A bare number.
    Number,
    /// Checked.
    Known(Dimension),
}

impl ValueUnit {
    /// Reads the unit of a declaration.
    ///
    /// # Errors
    /// What is not understood, as a sentence.
    pub fn parse(text: &str) -> Result<ValueUnit, String> {
        match text {
            "" | "unitless" => Ok(ValueUnit::Any),
            "1" => Ok(ValueUnit::Number),
            _ => Dimension::parse(text).map(ValueUnit::Known),
        }
    }

    /// The unit of both sides of a sum or a comparison; none where they do not fit.
    #[must_use]
    pub fn joined(self, other: ValueUnit) -> Option<ValueUnit> {
        match (self, other) {
            (ValueUnit::Any, _) | (_, ValueUnit::Any) => Some(ValueUnit::Any),
            (ValueUnit::Number, unit) | (unit, ValueUnit::Number) => Some(unit),
            (ValueUnit::Known(left), ValueUnit::Known(right)) => (left == right).then_some(self),
        }
    }

    /// The unit of a product.
    #[must_use]
    pub fn times(self, other: ValueUnit) -> ValueUnit {
        match (self, other) {
            (ValueUnit::Any, _) | (_, ValueUnit::Any) => ValueUnit::Any,
            (ValueUnit::Number, unit) | (unit, ValueUnit::Number) => unit,
            (ValueUnit::Known(left), ValueUnit::Known(right)) => {
                left.times(right).map_or(ValueUnit::Any, ValueUnit::Known)
            }
        }
    }

    /// The unit of a quotient.
    #[must_use]
    pub fn over(self, other: ValueUnit) -> ValueUnit {
        self.times(other.power(-1.0).unwrap_or(ValueUnit::Any))
    }

    /// The unit of a power; none where it has no meaning.
    #[must_use]
    pub fn power(self, exponent: f64) -> Option<ValueUnit> {
        match self {
            ValueUnit::Any | ValueUnit::Number => Some(self),
            ValueUnit::Known(dimension) => dimension.power(exponent).map(ValueUnit::Known),
        }
    }

    /// The unit of a rate of change.
    #[must_use]
    pub fn per_second(self) -> ValueUnit {
        match self {
            ValueUnit::Any | ValueUnit::Number => self,
            ValueUnit::Known(_) => self.over(ValueUnit::Known(Dimension::SECOND)),
        }
    }

    /// Whether a function that needs a plain number takes it.
    #[must_use]
    pub fn is_number(self) -> bool {
        !matches!(self, ValueUnit::Known(dimension) if dimension != Dimension::NONE)
    }
}

impl fmt::Display for ValueUnit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ValueUnit::Any => formatter.write_str("any unit"),
            ValueUnit::Number => formatter.write_str("1 (no unit)"),
            ValueUnit::Known(dimension) => dimension.fmt(formatter),
        }
    }
}
