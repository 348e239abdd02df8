//! Factors, spellings, and where a unit stands.

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
        let expected = RecordedUnit {
            si: Cow::Borrowed(row.si),
            ..RecordedUnit::NONE
        };
        assert_eq!(unit, expected);
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
        ("hp", 7.456_999e2),
        ("cfm", 4.719_474e-4),
        ("inWC", 2.490_889e2),
        ("cP", 1e-3),
        ("cSt", 1e-6),
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
fn plants_spellings_are_understood() {
    for (text, si, value) in [
        ("Bar", "Pa", 1e5),
        ("kpa", "Pa", 1e3),
        ("barg", "Pa", 201_325.0),
        ("PSIG", "Pa", 108_219.757_293_168),
        ("pct", "1", 0.01),
        ("Nm3/h", "m³/s", 1.0 / 3600.0),
        ("mmHg", "Pa", 133.322_387_415),
        ("Ohm", "Ω", 1.0),
        ("C", "K", 274.15),
        ("Grad C", "K", 274.15),
        ("DEG C", "K", 274.15),
        ("° F", "K", 255.927_777_777_777_8),
        ("bar g", "Pa", 201_325.0),
        ("bar (a)", "Pa", 1e5),
        ("mbar ü", "Pa", 101_425.0),
        ("W/m²K", "kg·s^-3·K^-1", 1.0),
        ("U/min", "rad/s", PI / 30.0),
        ("1/min", "rad/s", PI / 30.0),
        ("Sm3/h", "m³/s", 1.0 / 3600.0),
        ("%RH", "1", 0.01),
        ("AMPS", "A", 1.0),
        ("pH", "1", 1.0),
        ("daN", "N", 10.0),
        ("bar·g", "kg^2·m^-1·s^-2", 100.0),
        ("kN/mm", "N/m", 1e6),
        ("m3/(h bar)", "kg^-1·m^4·s", 1e-5 / 3600.0),
        ("l/(min·bar)", "kg^-1·m^4·s", 1e-8 / 60.0),
        ("W/(m2.K)", "kg·s^-3·K^-1", 1.0),
        ("degC/min", "s^-1·K", 1.0 / 60.0),
        ("min-1", "rad/s", PI / 30.0),
        ("min^-1", "rad/s", PI / 30.0),
        ("deg.C", "K", 274.15),
        ("kg/cm²", "Pa", 98_066.5),
        ("lb ft", "N·m", 1.355_817_948_331_4),
        ("in-lb", "N·m", 0.112_984_829_027_616_7),
        ("W/mK", "kg·m·s^-3·K^-1", 1.0),
        ("W/m·K", "kg·m·s^-3·K^-1", 1.0),
        ("kJ/kgK", "m^2·s^-2·K^-1", 1000.0),
        ("kg / h", "kg/s", 1.0 / 3600.0),
        ("Nm3/hr", "m³/s", 1.0 / 3600.0),
    ] {
        let unit = parse(text).unwrap_or_else(|| panic!("`{text}` is not known"));
        assert_eq!(unit.si, si, "{text}");
        assert!(
            (unit.to_si(1.0) / value - 1.0).abs() < 1e-12,
            "{text}: {unit:?}"
        );
    }
    for text in [
        "barg", "bar g", "C", "Nm3/h", "1/min", "%RH", "min-1", "kg/cm2", "ft lb", "bar·g",
    ] {
        assert!(!parse(text).unwrap().remark.is_empty(), "{text}");
    }
    assert!(parse("mw").is_none(), "milliwatt or megawatt");
    for text in [
        "mPa", "MV", "MA", "Mm", "M", "T", "G", "Grad", "kn", "m3/h N",
    ] {
        assert!(parse(text).is_none(), "{text}");
        assert!(
            unknown(text, UNITS_OPTION).contains("say which with `units`"),
            "{text}"
        );
    }
    assert!(unknown("mPa", UNITS_OPTION).contains("`MPa`"));
    assert!(unknown("degCC", UNITS_OPTION).contains("did you mean `degC`"));
    assert!(!unknown("parsec", UNITS_OPTION).contains("mbar"));
}

#[test]
fn only_units_of_time_are_times_and_none_means_seconds() {
    assert_eq!(parse_time("ms").unwrap().to_si(5.0), 0.005);
    assert_eq!(parse_time("").unwrap().to_si(5.0), 5.0);
    assert!(parse_time("mm").is_none());
    assert!(parse("parsec").is_none());
}

#[test]
fn words_are_units_of_a_time() {
    for (word, seconds) in [
        ("second(s)", 1.0),
        ("Second", 1.0),
        ("sec.", 1.0),
        ("Sek", 1.0),
        ("S", 1.0),
        ("msec", 1e-3),
        ("usec", 1e-6),
        ("minutes", 60.0),
        ("Stunden", 3600.0),
        ("hours", 3600.0),
        ("days", 86_400.0),
    ] {
        let unit = parse_time(word).unwrap_or_else(|| panic!("{word}"));
        assert_eq!((unit.factor, &*unit.si), (seconds, "s"), "{word}");
    }
    for word in ["m", "M", "secondary", "daily", "."] {
        assert_eq!(parse_time(word), None, "{word}");
    }
    assert_eq!(parse("hours"), None, "a signal has units of its own");
}
