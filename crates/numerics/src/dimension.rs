//! Dimensional analysis: what a quantity is measured in, as powers of the SI base units.
//!
//! A [`Dimension`] is a product of powers of metre, kilogram, second, ampere, kelvin, mole and
//! candela (BIPM, *The International System of Units*, 9th edition, 2019); the radian counts as 1.
//! Exponents are twelfths, so that roots down to the twelfth are exact. [`Dimension::parse`] reads
//! coherent units only (`N`, not `kN`): a model's numbers are SI, and no factor can slip in.
//! [`parse_scaled`] reads the same expressions over whatever units its caller knows.

use std::fmt;

/// The base units, in the order of the exponents.
const BASE: [&str; 7] = ["kg", "m", "s", "A", "K", "mol", "cd"];

/// Parts of one whole exponent.
const PARTS: i16 = 12;

/// Exponents beyond this are no physical unit.
const LARGEST: i16 = 40 * PARTS;

/// How deep the parentheses of a unit may stand in each other.
const DEEPEST: usize = 8;

/// Units with names of their own, the ones that messages use first: exponents of [`BASE`].
#[rustfmt::skip]
const DERIVED: [(&str, [i16; 7]); 17] = [
    ("N",   [1, 1, -2, 0, 0, 0, 0]),
    ("Pa",  [1, -1, -2, 0, 0, 0, 0]),
    ("J",   [1, 2, -2, 0, 0, 0, 0]),
    ("W",   [1, 2, -3, 0, 0, 0, 0]),
    ("C",   [0, 0, 1, 1, 0, 0, 0]),
    ("V",   [1, 2, -3, -1, 0, 0, 0]),
    ("F",   [-1, -2, 4, 2, 0, 0, 0]),
    ("Ohm", [1, 2, -3, -2, 0, 0, 0]),
    ("Ω",   [1, 2, -3, -2, 0, 0, 0]),
    ("S",   [-1, -2, 3, 2, 0, 0, 0]),
    ("Wb",  [1, 2, -2, -1, 0, 0, 0]),
    ("T",   [1, 0, -2, -1, 0, 0, 0]),
    ("H",   [1, 2, -2, -2, 0, 0, 0]),
    ("rad", [0; 7]),
    ("sr",  [0; 7]),
    ("Hz",  [0, 0, -1, 0, 0, 0, 0]),
    ("lm",  [0, 0, 0, 0, 0, 0, 1]),
];

/// A product of powers of the SI base units.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Dimension([i16; 7]);

impl Dimension {
    /// A plain number.
    pub const NONE: Dimension = Dimension([0; 7]);

    /// The second.
    pub const SECOND: Dimension = Dimension([0, 0, PARTS, 0, 0, 0, 0]);

    /// Reads a coherent SI unit, e.g. `N*s/m`, `m^3/(s*sqrt(Pa))` or `kg·m²`.
    ///
    /// # Errors
    /// What cannot be understood, as a sentence.
    pub fn parse(text: &str) -> Result<Dimension, String> {
        let unit = |name: &str| {
            let dimension = coherent(name).ok_or_else(|| {
                let name: String = name.chars().take(20).collect();
                format!("`{name}` is not a coherent SI unit; values in a model are SI")
            })?;
            Ok(Scaled {
                dimension,
                factor: 1.0,
            })
        };
        parse_scaled(text, &unit).map(|scaled| scaled.dimension)
    }

    /// The unit of a product.
    #[must_use]
    pub fn times(self, other: Dimension) -> Option<Dimension> {
        self.combined(other, 1)
    }

    /// The unit of a quotient.
    #[must_use]
    pub fn over(self, other: Dimension) -> Option<Dimension> {
        self.combined(other, -1)
    }

    /// The unit of a power; none where an exponent would not be a twelfth.
    #[must_use]
    pub fn power(self, exponent: f64) -> Option<Dimension> {
        let mut result = [0; 7];
        for (part, result) in self.0.iter().zip(&mut result) {
            let exact = f64::from(*part) * exponent;
            let whole = (exact - exact.round()).abs() <= 1e-9;
            if !whole || exact.abs() > f64::from(LARGEST) {
                return None;
            }
            *result = exact.round() as i16;
        }
        Some(Dimension(result))
    }

    fn combined(self, factor: Dimension, sign: i16) -> Option<Dimension> {
        let mut result = self.0;
        for (sum, factor) in result.iter_mut().zip(factor.0) {
            *sum += sign * factor;
            if sum.abs() > LARGEST {
                return None;
            }
        }
        Some(Dimension(result))
    }
}

impl fmt::Display for Dimension {
    /// The unit's own name with its base units, or the base units alone.
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Dimension::NONE {
            return formatter.write_str("1 (no unit)");
        }
        let whole = |exponents: &[i16; 7]| exponents.map(|exponent| exponent * PARTS) == self.0;
        let named = DERIVED.iter().find(|(_, exponents)| whole(exponents));
        match named {
            Some((name, _)) => write!(formatter, "{name} ({})", self.in_base_units()),
            None => formatter.write_str(&self.in_base_units()),
        }
    }
}

impl Dimension {
    /// As a product of powers of the base units, e.g. `kg·m·s^-2`.
    #[must_use]
    pub fn in_base_units(self) -> String {
        let power = |(name, exponent): (&&str, i16)| match (exponent / PARTS, exponent % PARTS) {
            (1, 0) => (*name).to_owned(),
            (whole, 0) => format!("{name}^{whole}"),
            _ => format!("{name}^({}/{PARTS})", exponent),
        };
        let factors = BASE
            .iter()
            .zip(self.0)
            .filter(|(_, exponent)| *exponent != 0);
        factors.map(power).collect::<Vec<_>>().join("·")
    }
}

/// A unit that may be a multiple of the coherent one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaled {
    /// The dimension of the quantity that the unit measures.
    pub dimension: Dimension,
    /// How many coherent units the unit is.
    pub factor: f64,
}

impl Scaled {
    fn times(self, other: Scaled) -> Option<Scaled> {
        Some(Scaled {
            dimension: self.dimension.times(other.dimension)?,
            factor: self.factor * other.factor,
        })
    }

    fn over(self, other: Scaled) -> Option<Scaled> {
        Some(Scaled {
            dimension: self.dimension.over(other.dimension)?,
            factor: self.factor / other.factor,
        })
    }

    fn power(self, exponent: f64) -> Option<Scaled> {
        Some(Scaled {
            dimension: self.dimension.power(exponent)?,
            factor: self.factor.powf(exponent),
        })
    }
}

/// Reads products, quotients, powers and roots of the units that `unit` knows.
///
/// # Errors
/// What cannot be understood, as a sentence.
pub fn parse_scaled(
    text: &str,
    unit: &dyn Fn(&str) -> Result<Scaled, String>,
) -> Result<Scaled, String> {
    let mut reader = UnitReader {
        text,
        rest: text,
        depth: 0,
        unit,
    };
    let scaled = reader.product()?;
    if reader.rest.is_empty() {
        Ok(scaled)
    } else {
        Err(reader.unexpected())
    }
}

struct UnitReader<'t> {
    text: &'t str,
    rest: &'t str,
    depth: usize,
    /// What a name stands for.
    unit: &'t dyn Fn(&str) -> Result<Scaled, String>,
}

impl UnitReader<'_> {
    fn skip_blanks(&mut self) {
        self.rest = self.rest.trim_start();
    }

    fn take(&mut self, symbols: &[char]) -> Option<char> {
        self.skip_blanks();
        let first = self.rest.chars().next().filter(|c| symbols.contains(c))?;
        self.rest = &self.rest[first.len_utf8()..];
        Some(first)
    }

    fn unexpected(&self) -> String {
        let rest: String = self.rest.chars().take(20).collect();
        match rest.is_empty() {
            true => format!("the unit `{}` ends too early", self.shown()),
            false => format!("`{rest}` in the unit `{}` is not understood", self.shown()),
        }
    }

    fn shown(&self) -> String {
        self.text.chars().take(60).collect()
    }

    fn product(&mut self) -> Result<Scaled, String> {
        let mut result = self.factor()?;
        while let Some(operator) = self.take(&['*', '·', '⋅', '/']) {
            let factor = self.factor()?;
            let combined = match operator {
                '/' => result.over(factor),
                _ => result.times(factor),
            };
            result = combined.ok_or("the exponents of the unit are too large")?;
            self.skip_blanks();
        }
        Ok(result)
    }

    fn factor(&mut self) -> Result<Scaled, String> {
        let base = self.base()?;
        let exponent = match self.take(&['^', '²', '³']) {
            Some('²') => 2.0,
            Some('³') => 3.0,
            Some(_) => self.exponent()?,
            None => 1.0,
        };
        let power = base.power(exponent);
        power.ok_or_else(|| format!("the exponent {exponent} is not possible"))
    }

    fn base(&mut self) -> Result<Scaled, String> {
        self.skip_blanks();
        if self.take(&['(']).is_some() {
            return self.bracketed();
        }
        let is_part = |c: char| c.is_alphabetic() || matches!(c, '%' | '°');
        let end = self.rest.find(|c| !is_part(c)).unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(end);
        if name.is_empty() {
            return match self.rest.strip_prefix('1') {
                Some(rest) => {
                    self.rest = rest;
                    Ok(Scaled {
                        dimension: Dimension::NONE,
                        factor: 1.0,
                    })
                }
                None => Err(self.unexpected()),
            };
        }
        self.rest = rest;
        if name == "sqrt" && self.take(&['(']).is_some() {
            let inner = self.bracketed()?;
            let root = inner.power(0.5);
            return root.ok_or_else(|| "the root of the unit is not possible".to_owned());
        }
        (self.unit)(name)
    }

    fn bracketed(&mut self) -> Result<Scaled, String> {
        self.depth += 1;
        if self.depth > DEEPEST {
            return Err("the unit's parentheses stand too deep".to_owned());
        }
        let inner = self.product()?;
        self.depth -= 1;
        match self.take(&[')']) {
            Some(_) => Ok(inner),
            None => Err(self.unexpected()),
        }
    }

    fn exponent(&mut self) -> Result<f64, String> {
        let bracket = self.take(&['(']).is_some();
        let mut exponent = self.number()?;
        if bracket {
            if self.take(&['/']).is_some() {
                exponent /= self.number()?;
            }
            self.take(&[')']).ok_or_else(|| self.unexpected())?;
        }
        Ok(exponent)
    }

    fn number(&mut self) -> Result<f64, String> {
        self.skip_blanks();
        let is_part = |c: char| c.is_ascii_digit() || matches!(c, '.' | '-');
        let end = self.rest.find(|c| !is_part(c)).unwrap_or(self.rest.len());
        let (number, rest) = self.rest.split_at(end);
        let value = number.parse().map_err(|_| self.unexpected())?;
        self.rest = rest;
        Ok(value)
    }
}

fn coherent(name: &str) -> Option<Dimension> {
    if let Some(index) = BASE.iter().position(|base| *base == name) {
        let mut exponents = [0; 7];
        exponents[index] = PARTS;
        return Some(Dimension(exponents));
    }
    let (_, exponents) = DERIVED.iter().find(|(derived, _)| *derived == name)?;
    Some(Dimension(exponents.map(|exponent| exponent * PARTS)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn parsed(text: &str) -> Dimension {
        Dimension::parse(text).unwrap_or_else(|why| panic!("{text}: {why}"))
    }

    #[test]
    fn different_spellings_of_one_unit_are_equal() {
        for (one, other) in [
            ("N*s/m", "kg/s"),
            ("m^3/(s*sqrt(Pa))", "m^(7/2)/kg^0.5"),
            ("N·m", "J"),
            ("m²", "m^2"),
            ("V*A", "W"),
            ("rad/s", "1/s"),
            ("1", "m/m"),
            ("V*s/rad", "Wb"),
        ] {
            assert_eq!(parsed(one), parsed(other), "{one} and {other}");
        }
        assert_ne!(parsed("N"), parsed("Pa"));
    }

    #[test]
    fn a_unit_is_shown_by_its_name_and_in_base_units() {
        assert_eq!(parsed("N").to_string(), "N (kg·m·s^-2)");
        assert_eq!(parsed("m/s").to_string(), "m·s^-1");
        assert_eq!(Dimension::NONE.to_string(), "1 (no unit)");
    }

    #[test]
    fn what_is_not_coherent_si_is_refused_by_name() {
        assert!(Dimension::parse("mm").unwrap_err().contains("`mm`"));
        for wrong in ["", "m/", "m^", "kN", "(m", "m)", "%", "m^x", "m^1000"] {
            assert!(Dimension::parse(wrong).is_err(), "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(text in "\\PC{0,40}") {
            drop(Dimension::parse(&text));
        }

        #[test]
        fn no_mixture_of_the_symbols_makes_the_reader_panic(text in "[mskg()^/*1-9. sqrt-]{0,60}") {
            drop(Dimension::parse(&text));
        }
    }
}
