//! The units that plants use, and their SI counterparts.
//!
//! `value_si = value · factor + offset`. Only temperatures and gauge pressures have an offset; a
//! temperature *difference* should therefore be recorded in K. A gauge pressure becomes absolute by
//! the standard atmosphere, 101325 Pa. What the table does not have is read as a product of what it
//! has, with SI prefixes: `kN/mm`, `l/(min·bar)`. Factors are exact by definition (BIPM, *The
//! International System of Units*, 9th edition, 2019; NIST SP 811, 2008, appendix B.8).

use greybox_numerics::dimension::{Dimension, Scaled, parse_scaled};
use greybox_numerics::parsing::reader::did_you_mean;
use std::borrow::Cow;
use std::f64::consts::PI;

/// A unit of measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedUnit {
    /// The SI unit that values are converted to.
    pub si: Cow<'static, str>,
    /// What a value is multiplied by.
    pub factor: f64,
    /// What is added then.
    pub offset: f64,
    /// What a reader of the values should know; empty where there is nothing.
    pub remark: &'static str,
}

impl RecordedUnit {
    /// The unit of a signal that names none: its values are taken as SI.
    pub const NONE: Self = Self {
        si: Cow::Borrowed(""),
        factor: 1.0,
        offset: 0.0,
        remark: "",
    };

    /// The value in SI.
    #[must_use]
    pub fn to_si(&self, value: f64) -> f64 {
        value * self.factor + self.offset
    }
}

/// The unit that `text` names; [`RecordedUnit::NONE`] for empty text, `None` for an unknown one.
///
/// Upper and lower case may be mixed up where that leaves one unit.
#[must_use]
pub fn parse(text: &str) -> Option<RecordedUnit> {
    if text.is_empty() {
        return Some(RecordedUnit::NONE);
    }
    if let Some(row) = exact(text) {
        return Some(row.unit());
    }
    if may_be_two(text) {
        return None;
    }
    of_any_case(text)
        .or_else(|| of_degrees(text))
        .map(UnitRow::unit)
        .or_else(|| pressure(text))
        .or_else(|| torque(text))
        .or_else(|| compound(text))
}

/// Whether a text means one unit by its letters and another one in another case, such as `mPa` and `MV`, or a unit
/// that plants write for something else: such a text is asked about.
fn may_be_two(text: &str) -> bool {
    /// Tesla, giga and mega, which plants write for temperatures, grams and metres; a gigaradian, for degrees; a
    /// kilonewton, for knots.
    const OF_OTHERS: [&str; 5] = ["M", "T", "G", "Grad", "kn"];
    let by_letters = || compound(text).map(|unit| (unit.si, unit.factor));
    OF_OTHERS.contains(&text)
        || of_any_case(text).is_some_and(|row| {
            let in_other_case = (Cow::Borrowed(row.si), row.factor);
            by_letters().is_some_and(|letters| letters != in_other_case)
        })
}

/// `deg C`, `Grad Celsius` and `° F`: a scale of temperature behind a word for degrees.
fn of_degrees(text: &str) -> Option<&'static UnitRow> {
    let (degrees, scale) = text.split_once([' ', '.'])?;
    let degrees = degrees.to_lowercase();
    if !["deg", "degree", "degrees", "grad", "°"].contains(&degrees.as_str()) {
        return None;
    }
    match scale.trim().to_lowercase().as_str() {
        "c" | "celsius" => exact("degC"),
        "f" | "fahrenheit" => exact("degF"),
        _ => None,
    }
}

/// A pressure with a word for what it is measured from: `bar g`, `mbar (abs)`, `bar ü`.
fn pressure(text: &str) -> Option<RecordedUnit> {
    let (unit, reference) = text.split_once([' ', '(', '_'])?;
    let row = exact(unit).or_else(|| of_any_case(unit))?;
    let is_plain = row.si == "Pa" && row.offset == 0.0;
    let reference = reference.trim_matches([' ', '(', ')', '.']).to_lowercase();
    match reference.as_str() {
        "g" | "gauge" | "ü" | "rel" if is_plain => Some(gauge("", row.factor).unit()),
        "a" | "abs" | "absolute" if is_plain => Some(row.unit()),
        _ => None,
    }
}

/// A torque in pounds or ounces.
fn torque(text: &str) -> Option<RecordedUnit> {
    let torque = row("lbf·ft", "N·m", spelled::torque(text)?);
    Some(remarked(torque, "the pounds or ounces were read as forces").unit())
}

/// The unit of time that `text` names.
#[must_use]
pub fn parse_time(text: &str) -> Option<RecordedUnit> {
    let of_time = |unit: &str| parse(unit).filter(|unit| unit.si == "s");
    of_time(text).or_else(|| of_time(spelled::time(text)?))
}

/// The remedy for a unit of a recording that is not known.
pub(super) const UNITS_OPTION: &str = "say which with `units`, such as `units=name:unit`";

/// A sentence on a unit that is not known, with the unit that may have been meant and the remedy.
#[must_use]
pub fn unknown(text: &str, remedy: &str) -> String {
    let names = TABLE.iter().flat_map(|row| row.names.split(' '));
    if may_be_two(text) {
        let other = of_any_case(text).and_then(|row| row.names.split(' ').next());
        let other = other.map_or_else(String::new, |other| format!(" or `{other}`"));
        return format!("unit `{text}` may be what its letters say{other}: {remedy}");
    }
    let hint = did_you_mean(text, names);
    let text = super::error::excerpt(text);
    format!("unit `{text}` is not known{hint}: {remedy}")
}

/// The first name of every unit of time, for messages.
#[must_use]
pub fn known_times() -> String {
    first_names(|row| row.si == "s")
}

/// Whether a text is one unit of the table as the table writes it.
pub(super) fn is_exact(text: &str) -> bool {
    exact(text).is_some()
}

/// Whether a text is one unit of the table, in any case of letters.
pub(super) fn is_listed(text: &str) -> bool {
    exact(text).is_some() || of_any_case(text).is_some()
}

fn exact(text: &str) -> Option<&'static UnitRow> {
    let has_it = |row: &&UnitRow| row.names.split(' ').any(|name| name == text);
    TABLE.iter().find(has_it)
}

/// The only unit of that name in any case; `MW` and `mW` are two, of which neither is `mw`.
fn of_any_case(text: &str) -> Option<&'static UnitRow> {
    let has_it = |row: &&UnitRow| {
        let mut names = row.names.split(' ');
        names.any(|name| name.to_lowercase() == text.to_lowercase())
    };
    let mut rows = TABLE.iter().filter(has_it);
    let first = rows.next()?;
    rows.next().is_none().then_some(first)
}

/// The remark on a unit whose dimension no unit of the table has.
const PRODUCT: &str =
    "no unit that is usual has this dimension: the text was read as a product of units";

/// A product of units.
fn compound(text: &str) -> Option<RecordedUnit> {
    /// Longer texts are no unit.
    const LONGEST: usize = 60;
    if text.len() > LONGEST {
        return None;
    }
    let lookup = |name: &str| part(name).ok_or_else(String::new);
    let scaled = parse_scaled(&spelled::out(text)?, &lookup).ok()?;
    let is_same = |row: &&UnitRow| {
        let of_row = Dimension::parse(row.si);
        of_row.is_ok_and(|dimension| dimension == scaled.dimension)
    };
    let (si, remark) = match TABLE.iter().find(is_same) {
        Some(row) => (Cow::Borrowed(row.si), ""),
        None if scaled.dimension == Dimension::NONE => (Cow::Borrowed("1"), ""),
        None => (Cow::Owned(scaled.dimension.in_base_units()), PRODUCT),
    };
    Some(RecordedUnit {
        si,
        factor: scaled.factor,
        remark,
        ..RecordedUnit::NONE
    })
}

/// A unit within a product: of the table, or a coherent one with a prefix. A temperature is a
/// difference there.
fn part(name: &str) -> Option<Scaled> {
    const PREFIXES: [(&str, f64); 9] = [
        ("k", 1e3),
        ("M", 1e6),
        ("G", 1e9),
        ("m", 1e-3),
        ("µ", 1e-6),
        ("u", 1e-6),
        ("n", 1e-9),
        ("c", 1e-2),
        ("d", 1e-1),
    ];
    let coherent = |name: &str| Dimension::parse(name).ok();
    if let Some(row) = exact(name).filter(|row| row.remark.is_empty()) {
        let dimension = coherent(row.si)?;
        let factor = row.factor;
        return Some(Scaled { dimension, factor });
    }
    if let Some(dimension) = coherent(name) {
        let factor = 1.0;
        return Some(Scaled { dimension, factor });
    }
    PREFIXES.iter().find_map(|(prefix, factor)| {
        let dimension = coherent(name.strip_prefix(prefix)?)?;
        let factor = *factor;
        Some(Scaled { dimension, factor })
    })
}

fn first_names(wanted: impl Fn(&UnitRow) -> bool) -> String {
    let first = |row: &UnitRow| row.names.split(' ').next().unwrap_or_default();
    TABLE
        .iter()
        .filter(|row| wanted(row))
        .map(first)
        .collect::<Vec<_>>()
        .join(", ")
}

struct UnitRow {
    /// The names, separated by a blank; the first is shown in messages.
    names: &'static str,
    si: &'static str,
    factor: f64,
    offset: f64,
    remark: &'static str,
}

impl UnitRow {
    fn unit(&self) -> RecordedUnit {
        RecordedUnit {
            si: Cow::Borrowed(self.si),
            factor: self.factor,
            offset: self.offset,
            remark: self.remark,
        }
    }
}

const fn row(names: &'static str, si: &'static str, factor: f64) -> UnitRow {
    affine(names, si, factor, 0.0)
}

const fn affine(names: &'static str, si: &'static str, factor: f64, offset: f64) -> UnitRow {
    UnitRow {
        names,
        si,
        factor,
        offset,
        remark: "",
    }
}

const fn gauge(names: &'static str, factor: f64) -> UnitRow {
    UnitRow {
        remark: "gauge pressure was made absolute: the standard atmosphere, 101325 Pa, was added",
        ..affine(names, "Pa", factor, ATMOSPHERE)
    }
}

const fn remarked(row: UnitRow, remark: &'static str) -> UnitRow {
    UnitRow { remark, ..row }
}

/// Standard gravity `[m/s²]`.
const G_N: f64 = 9.806_65;
/// Standard atmosphere `[Pa]`.
const ATMOSPHERE: f64 = 101_325.0;
/// Conventional millimetre of mercury `[Pa]`.
const MMHG: f64 = 133.322_387_415;
/// International inch and foot `[m]`.
const INCH: f64 = 0.0254;
const FOOT: f64 = 0.3048;
/// Avoirdupois pound `[kg]`.
const POUND: f64 = 0.453_592_37;
/// US liquid gallon `[m³]`.
const GALLON: f64 = 231.0 * INCH * INCH * INCH;

/// The units in which people read values, by SI unit; the SI unit comes first.
pub const READ_IN: &[(&str, &[&str])] = &[
    ("Pa", &["Pa", "kPa", "bar", "MPa", "psi"]),
    ("K", &["K", "°C"]),
    ("m", &["m", "cm", "mm", "µm"]),
    ("m/s", &["m/s", "mm/s", "m/min", "km/h"]),
    ("m^2", &["m²", "cm²", "mm²"]),
    ("m^3", &["m³", "l", "cm³"]),
    ("m^3/s", &["m³/s", "l/s", "l/min", "m³/h"]),
    ("kg/s", &["kg/s", "kg/min", "kg/h", "t/h"]),
    ("rad", &["rad", "°", "rev"]),
    ("rad/s", &["rad/s", "°/s", "rpm"]),
    ("N", &["N", "kN"]),
    ("W", &["W", "kW", "MW"]),
    ("V", &["V", "mV"]),
    ("A", &["A", "mA"]),
    ("s", &["s", "ms", "min", "h"]),
];

const TABLE: &[UnitRow] = &[
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
    row("ns", "s", 1e-9),
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
    row("kgf/cm² kgf/cm2 kp/cm² kp/cm2 at", "Pa", G_N * 1e4),
    remarked(
        row("kg/cm² kg/cm2 kg/cm^2", "Pa", G_N * 1e4),
        "the kilograms were read as kilograms-force",
    ),
    row("mmHg Torr", "Pa", MMHG),
    row("inHg", "Pa", 25.4 * MMHG),
    row("mmH2O mmH₂O mmWC mmWS", "Pa", G_N),
    row("inH2O inH₂O inWC inWG", "Pa", 25.4 * G_N),
    row("atm", "Pa", ATMOSPHERE),
    row("bara bar(a) bar_a", "Pa", 1e5),
    row("psia psi(a)", "Pa", POUND * G_N / (INCH * INCH)),
    gauge("barg bar(g) bar_g", 1e5),
    gauge("mbarg mbar(g)", 1e2),
    gauge("kPag kPa(g)", 1e3),
    gauge("MPag MPa(g)", 1e6),
    gauge("psig psi(g)", POUND * G_N / (INCH * INCH)),
    row("N", "N", 1.0),
    row("kN", "N", 1e3),
    row("MN", "N", 1e6),
    row("daN", "N", 1e1),
    row("kgf kp", "N", G_N),
    row("lbf", "N", POUND * G_N),
    row("kg", "kg", 1.0),
    row("g", "kg", 1e-3),
    row("t", "kg", 1e3),
    row("lb", "kg", POUND),
    row("V Volt Volts VDC Vdc VAC Vac", "V", 1.0),
    row("mV", "V", 1e-3),
    row("kV", "V", 1e3),
    row("A Amp Amps Ampere", "A", 1.0),
    row("mA", "A", 1e-3),
    row("K", "K", 1.0),
    affine("degC °C ℃ celsius", "K", 1.0, 273.15),
    remarked(
        affine("C", "K", 1.0, 273.15),
        "`C` was read as degrees Celsius, not as coulomb",
    ),
    remarked(
        affine("F", "K", 5.0 / 9.0, 273.15 - 160.0 / 9.0),
        "`F` was read as degrees Fahrenheit, not as farad",
    ),
    affine("degF °F fahrenheit", "K", 5.0 / 9.0, 273.15 - 160.0 / 9.0),
    row("m³/s m3/s m^3/s", "m³/s", 1.0),
    row("m³/h m3/h m^3/h", "m³/s", 1.0 / 3600.0),
    remarked(
        row("Nm3/h Nm³/h Nm^3/h Nm3/hr Nm³/hr", "m³/s", 1.0 / 3600.0),
        "cubic metres at normal conditions (0 °C, 101325 Pa), not at those of the plant",
    ),
    remarked(
        row("Sm3/h Sm³/h Sm^3/h Sm3/hr Sm³/hr", "m³/s", 1.0 / 3600.0),
        "cubic metres at standard conditions (15 °C, 101325 Pa), not at those of the plant",
    ),
    row("cfm ft³/min ft3/min", "m³/s", FOOT * FOOT * FOOT / 60.0),
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
    row("rpm RPM U/min Upm rev/min r/min", "rad/s", PI / 30.0),
    remarked(
        row("1/min 1/Min 1/Min. min-1 min^-1 min⁻¹", "rad/s", PI / 30.0),
        "a number a minute was read as revolutions per minute, in rad/s",
    ),
    remarked(
        row("1/s s-1 s^-1 s⁻¹", "rad/s", 1.0),
        "a number a second was read in rad/s, neither as revolutions nor as hertz",
    ),
    remarked(
        row("1/h h-1 h^-1 h⁻¹", "rad/s", 1.0 / 3600.0),
        "a number an hour was read in rad/s, neither as revolutions nor as hertz",
    ),
    row("rad/s² rad/s2 rad/s^2", "rad/s²", 1.0),
    row("m/s", "m/s", 1.0),
    row("mm/s", "m/s", 1e-3),
    row("cm/s", "m/s", 1e-2),
    row("m/min", "m/s", 1.0 / 60.0),
    row("km/h", "m/s", 1.0 / 3.6),
    row("kt knot knots", "m/s", 1852.0 / 3600.0),
    row("m/s² m/s2 m/s^2", "m/s²", 1.0),
    row("g_n", "m/s²", G_N),
    row("Ω Ohm ohm", "Ω", 1.0),
    row("kΩ kOhm", "Ω", 1e3),
    row("Hz", "Hz", 1.0),
    row("kHz", "Hz", 1e3),
    row("W", "W", 1.0),
    row("mW", "W", 1e-3),
    row("kW", "W", 1e3),
    row("hp", "W", 550.0 * FOOT * POUND * G_N),
    row("PS", "W", 75.0 * G_N),
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
    row("m²/s m2/s m^2/s", "m²/s", 1.0),
    row("cSt mm²/s mm2/s", "m²/s", 1e-6),
    row("Pa·s Pa*s Pas", "Pa·s", 1.0),
    row("cP mPa·s mPa*s mPas", "Pa·s", 1e-3),
    row(
        "kg·s^-3·K^-1 W/m²K W/m2K W/(m²K) W/(m2K)",
        "kg·s^-3·K^-1",
        1.0,
    ),
    row("1 - pH count counts", "1", 1.0),
    row("ppm", "1", 1e-6),
    remarked(
        row("%RH %rH", "1", 1e-2),
        "a relative humidity, as a share of saturation",
    ),
    row("% pct percent", "1", 1e-2),
    row("‰", "1", 1e-3),
];

mod spelled;
#[cfg(test)]
mod tests;
