//! The units that plants use, and their SI counterparts.
//!
//! `value_si = value · factor + offset`. Only temperatures have an offset; a temperature
//! *difference* should therefore be recorded in K. Factors are exact by definition (BIPM, *The
//! International System of Units*, 9th edition, 2019; NIST SP 811, 2008, appendix B.8).

use std::f64::consts::PI;

/// A unit of measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// The SI unit that values are converted to.
    pub si: &'static str,
    /// What a value is multiplied by.
    pub factor: f64,
    /// What is added then.
    pub offset: f64,
}

impl Unit {
    /// The unit of a signal that names none: its values are taken as SI.
    pub const NONE: Self = Self {
        si: "",
        factor: 1.0,
        offset: 0.0,
    };

    /// The value in SI.
    #[must_use]
    pub fn to_si(self, value: f64) -> f64 {
        value * self.factor + self.offset
    }
}

/// The unit that `text` names; [`Unit::NONE`] for empty text, `None` for an unknown one.
#[must_use]
pub fn parse(text: &str) -> Option<Unit> {
    if text.is_empty() {
        return Some(Unit::NONE);
    }
    let row = TABLE
        .iter()
        .find(|row| row.names.split(' ').any(|name| name == text))?;
    Some(Unit {
        si: row.si,
        factor: row.factor,
        offset: row.offset,
    })
}

/// The unit of time that `text` names.
#[must_use]
pub fn parse_time(text: &str) -> Option<Unit> {
    let unit = if text.is_empty() { "s" } else { text };
    parse(unit).filter(|unit| unit.si == "s")
}

/// The first name of every known unit, for messages.
#[must_use]
pub fn known() -> String {
    first_names(|_| true)
}

/// The first name of every unit of time, for messages.
#[must_use]
pub fn known_times() -> String {
    first_names(|row| row.si == "s")
}

fn first_names(wanted: impl Fn(&Row) -> bool) -> String {
    let first = |row: &Row| row.names.split(' ').next().unwrap_or_default();
    TABLE
        .iter()
        .filter(|row| wanted(row))
        .map(first)
        .collect::<Vec<_>>()
        .join(", ")
}

struct Row {
    /// The names, separated by a blank; the first is shown in messages.
    names: &'static str,
    si: &'static str,
    factor: f64,
    offset: f64,
}

const fn row(names: &'static str, si: &'static str, factor: f64) -> Row {
    Row {
        names,
        si,
        factor,
        offset: 0.0,
    }
}

const fn affine(names: &'static str, si: &'static str, factor: f64, offset: f64) -> Row {
    Row {
        names,
        si,
        factor,
        offset,
    }
}

/// Standard gravity `[m/s²]`.
const G_N: f64 = 9.806_65;
/// International inch and foot `[m]`.
const INCH: f64 = 0.0254;
const FOOT: f64 = 0.3048;
/// Avoirdupois pound `[kg]`.
const POUND: f64 = 0.453_592_37;
/// US liquid gallon `[m³]`.
const GALLON: f64 = 231.0 * INCH * INCH * INCH;

const TABLE: &[Row] = &[
    row("m", "m", 1.0),
    row("km", "m", 1e3),
    row("dm", "m", 1e-1),
    row("cm", "m", 1e-2),
    row("mm", "m", 1e-3),
    row("µm μm um", "m", 1e-6),
    row("in inch", "m", INCH),
    row("ft", "m", FOOT),
    row("s sec", "s", 1.0),
    row("ms", "s", 1e-3),
    row("µs μs us", "s", 1e-6),
    row("min", "s", 60.0),
    row("h hr", "s", 3600.0),
    row("d", "s", 86_400.0),
    row("Pa", "Pa", 1.0),
    row("hPa", "Pa", 1e2),
    row("kPa", "Pa", 1e3),
    row("MPa", "Pa", 1e6),
    row("GPa", "Pa", 1e9),
    row("bar", "Pa", 1e5),
    row("mbar", "Pa", 1e2),
    row("psi", "Pa", POUND * G_N / (INCH * INCH)),
    row("kgf/cm² kgf/cm2 at", "Pa", G_N * 1e4),
    row("N", "N", 1.0),
    row("kN", "N", 1e3),
    row("MN", "N", 1e6),
    row("kgf", "N", G_N),
    row("lbf", "N", POUND * G_N),
    row("kg", "kg", 1.0),
    row("g", "kg", 1e-3),
    row("t", "kg", 1e3),
    row("lb", "kg", POUND),
    row("V", "V", 1.0),
    row("mV", "V", 1e-3),
    row("kV", "V", 1e3),
    row("A", "A", 1.0),
    row("mA", "A", 1e-3),
    row("K", "K", 1.0),
    affine("degC °C ℃", "K", 1.0, 273.15),
    affine("degF °F", "K", 5.0 / 9.0, 273.15 - 160.0 / 9.0),
    row("m³/s m3/s m^3/s", "m³/s", 1.0),
    row("m³/h m3/h m^3/h", "m³/s", 1.0 / 3600.0),
    row("l/s L/s", "m³/s", 1e-3),
    row("l/min L/min lpm", "m³/s", 1e-3 / 60.0),
    row("l/h L/h", "m³/s", 1e-3 / 3600.0),
    row("gpm gal/min", "m³/s", GALLON / 60.0),
    row("m³ m3 m^3", "m³", 1.0),
    row("l L", "m³", 1e-3),
    row("ml mL cm³ cm3", "m³", 1e-6),
    row("m² m2 m^2", "m²", 1.0),
    row("cm² cm2 cm^2", "m²", 1e-4),
    row("mm² mm2 mm^2", "m²", 1e-6),
    row("kg/s", "kg/s", 1.0),
    row("g/s", "kg/s", 1e-3),
    row("kg/h", "kg/s", 1.0 / 3600.0),
    row("t/h", "kg/s", 1.0 / 3.6),
    row("rad", "rad", 1.0),
    row("mrad", "rad", 1e-3),
    row("deg °", "rad", PI / 180.0),
    row("rev", "rad", 2.0 * PI),
    row("rad/s", "rad/s", 1.0),
    row("deg/s °/s", "rad/s", PI / 180.0),
    row("rpm 1/min rev/min", "rad/s", PI / 30.0),
    row("rad/s² rad/s2 rad/s^2", "rad/s²", 1.0),
    row("m/s", "m/s", 1.0),
    row("mm/s", "m/s", 1e-3),
    row("cm/s", "m/s", 1e-2),
    row("m/min", "m/s", 1.0 / 60.0),
    row("km/h", "m/s", 1.0 / 3.6),
    row("m/s² m/s2 m/s^2", "m/s²", 1.0),
    row("g_n", "m/s²", G_N),
    row("Hz", "Hz", 1.0),
    row("kHz", "Hz", 1e3),
    row("W", "W", 1.0),
    row("mW", "W", 1e-3),
    row("kW", "W", 1e3),
    row("MW", "W", 1e6),
    row("J", "J", 1.0),
    row("kJ", "J", 1e3),
    row("kWh", "J", 3.6e6),
    row("N·m N⋅m N*m N.m Nm", "N·m", 1.0),
    row("mN·m mN*m mNm", "N·m", 1e-3),
    row("kN·m kN*m kNm", "N·m", 1e3),
    row("N/m", "N/m", 1.0),
    row("N/mm", "N/m", 1e3),
    row("N·s/m N*s/m Ns/m", "N·s/m", 1.0),
    row("kg/m³ kg/m3", "kg/m³", 1.0),
    row("1 -", "1", 1.0),
    row("%", "1", 1e-2),
    row("‰", "1", 1e-3),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn a_name_means_one_unit() {
        let mut seen = HashSet::new();
        for name in TABLE.iter().flat_map(|row| row.names.split(' ')) {
            assert!(seen.insert(name), "`{name}` stands in the table twice");
        }
    }

    #[test]
    fn every_si_unit_is_a_unit_that_changes_nothing() {
        for row in TABLE {
            let unit = parse(row.si).unwrap_or_else(|| panic!("`{}` is not in the table", row.si));
            assert_eq!(
                unit,
                Unit {
                    si: row.si,
                    factor: 1.0,
                    offset: 0.0
                }
            );
        }
    }

    /// Values of NIST SP 811 (2008), appendix B.8, to the digits printed there.
    #[test]
    fn customary_units_agree_with_the_published_factors() {
        for (text, si) in [
            ("psi", 6.894_757e3),
            ("lbf", 4.448_222),
            ("gpm", 6.309_020e-5),
            ("kgf/cm2", 9.806_65e4),
            ("rpm", 1.047_198e-1),
            ("deg", 1.745_329e-2),
            ("l/min", 1.666_667e-5),
        ] {
            let value = parse(text).unwrap().to_si(1.0);
            assert!((value / si - 1.0).abs() < 5e-7, "1 {text} is {value}");
        }
    }

    #[test]
    fn water_freezes_at_the_same_temperature_on_three_scales() {
        for (value, text) in [(0.0, "degC"), (32.0, "°F"), (273.15, "K")] {
            let kelvin = parse(text).unwrap().to_si(value);
            assert!(
                (kelvin - 273.15).abs() < 1e-12,
                "{value} {text} is {kelvin} K"
            );
        }
    }

    #[test]
    fn only_units_of_time_are_times_and_none_means_seconds() {
        assert_eq!(parse_time("ms").unwrap().to_si(5.0), 0.005);
        assert_eq!(parse_time("").unwrap().to_si(5.0), 5.0);
        assert!(parse_time("mm").is_none());
        assert!(parse("parsec").is_none());
    }
}
