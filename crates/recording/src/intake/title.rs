//! Titles of columns: a name, and a unit where the title has one for certain.

use super::units;

/// A title as name and unit: `position [mm]`, `p (bar)`, `p_bar`, `p / bar`. Text in parentheses or behind the last
/// `_` is the unit only where it is one for certain. The name stays whole where the unit stands in neither brackets nor
/// parentheses at its end.
pub(super) fn name_and_unit(title: &str) -> (&str, &str) {
    if let Some(named) = cut(title, '[', ']') {
        return named;
    }
    if let Some((name, unit)) = cut(title, '(', ')')
        && !name.is_empty()
        && units::parse(unit).is_some()
    {
        return (name, unit);
    }
    let suffix = title.rsplit_once('_');
    let suffix = suffix.filter(|(name, unit)| !name.is_empty() && is_suffix(unit));
    let suffix = suffix.map(|(_, unit)| unit);
    let unit = suffix.or_else(|| within(title)).or_else(|| behind(title));
    (title, unit.unwrap_or_default())
}

/// The unit at the end of each of several titles, behind a blank or a dot: `PT101 bar`, `TT102 °C`. None where one of
/// them has none for certain, as parameters of controllers (`FIC1.PV`) and phases (`motor A`) have none.
pub(super) fn units_behind<'t>(titles: &[&'t str]) -> Option<Vec<&'t str>> {
    /// Parameters of controllers that are units too.
    const PARAMETERS: [&str; 2] = ["MV", "PS"];
    let of_sign = |sign: char| -> Option<Vec<&'t str>> {
        let unit = |title: &&'t str| {
            let (name, unit) = title.rsplit_once(sign)?;
            let is_time = units::parse_time(unit).is_some();
            let is_one = is_suffix(unit) && units::is_exact(unit) && !is_time;
            let is_one = is_one && !PARAMETERS.contains(&unit);
            (!name.trim().is_empty() && is_one).then_some(unit)
        };
        titles.iter().map(unit).collect()
    };
    let has_unit = |title: &&str| !name_and_unit(title).1.is_empty();
    if titles.len() < 2 || titles.iter().any(has_unit) {
        return None;
    }
    of_sign(' ').or_else(|| of_sign('.'))
}

/// The name before the last of two signs and the unit between them, where the title ends with the second.
fn cut(title: &str, open: char, close: char) -> Option<(&str, &str)> {
    let (name, unit) = title.strip_suffix(close)?.rsplit_once(open)?;
    let unit = unit.trim();
    Some((name.trim(), unit.strip_prefix("in ").unwrap_or(unit)))
}

/// The unit between signs that stand anywhere in a title: `[bar] p`, `p (bar) mean`, `p {bar}`.
fn within(title: &str) -> Option<&str> {
    const SIGNS: [(char, char); 4] = [('[', ']'), ('{', '}'), ('<', '>'), ('(', ')')];
    SIGNS.into_iter().find_map(|(open, close)| {
        let (before, behind) = title.split_once(open)?;
        let (unit, behind) = behind.split_once(close)?;
        let unit = unit.trim();
        let has_name = !before.trim().is_empty() || !behind.trim().is_empty();
        // A letter in parentheses may name a side or a phase.
        let is_one = is_certain(unit) && (open != '(' || !is_letter(unit));
        (has_name && is_one).then_some(unit)
    })
}

/// The unit behind a sign that stands before units: `p / bar`, `p, bar`, `p in bar`, `T, °C (LGR S/N: 1)`.
fn behind(title: &str) -> Option<&str> {
    const SIGNS: [&str; 9] = [" / ", " in ", ", ", " - ", " EU=", "/", ":", "#", "|"];
    let remark = title
        .strip_suffix(')')
        .and_then(|title| title.rsplit_once(" ("));
    let title = remark.map_or(title, |(title, _)| title);
    SIGNS.into_iter().find_map(|sign| {
        let (name, unit) = title.rsplit_once(sign)?;
        let unit = unit.trim();
        let is_one = match sign {
            " / " | " in " | " EU=" => is_certain(unit),
            // Paths have bare signs between names, and quotients between quantities.
            "/" | ":" | "#" | "|" => {
                !name.contains(sign) && is_suffix(unit) && units::is_exact(unit)
            }
            _ => is_certain(unit) && !is_letter(unit),
        };
        (!name.trim().is_empty() && is_one).then_some(unit)
    })
}

/// Whether a text between or behind signs is a unit. A number counts columns.
fn is_certain(text: &str) -> bool {
    let is_word = |sign: char| sign.is_alphabetic() || ['%', '°'].contains(&sign);
    text.contains(is_word) && !is_common_word(text) && units::parse(text).is_some()
}

fn is_letter(text: &str) -> bool {
    text.chars().count() == 1 && text.chars().all(char::is_alphabetic)
}

/// Whether the end of a name can only be meant as a unit. `x_min`, `flow_in` and `seen_at` are not,
/// nor is a single letter.
fn is_suffix(text: &str) -> bool {
    let has_letters = text.chars().any(char::is_alphabetic);
    let of_letters = text.chars().all(|sign| sign.is_alphabetic() || sign == '°');
    has_letters && of_letters && !is_letter(text) && !is_common_word(text) && units::is_listed(text)
}

/// Whether a word of names is a unit too.
fn is_common_word(text: &str) -> bool {
    const WORDS: [&str; 10] = [
        "min", "in", "at", "rev", "ft", "hr", "sec", "inch", "lb", "var",
    ];
    WORDS.contains(&text.to_ascii_lowercase().as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_stands_in_brackets_in_parentheses_or_at_the_end_of_the_name() {
        for (title, name, unit) in [
            ("position [mm]", "position", "mm"),
            ("spool [left] [ V ]", "spool [left]", "V"),
            ("spool [left] []", "spool [left]", ""),
            ("p [parsec]", "p", "parsec"),
            ("x (bar)", "x", "bar"),
            ("x (in bar)", "x", "bar"),
            ("valve (left)", "valve (left)", ""),
            ("p_bar", "p_bar", "bar"),
            ("oil_degC", "oil_degC", "degC"),
            ("x_min", "x_min", ""),
            ("flow_in", "flow_in", ""),
            ("speed_m", "speed_m", ""),
            ("position", "position", ""),
            ("position]", "position]", ""),
        ] {
            assert_eq!(name_and_unit(title), (name, unit), "{title}");
        }
    }

    #[test]
    fn units_stand_behind_blanks_and_dots_where_all_titles_have_one() {
        let all = |titles: &[&str]| units_behind(titles).map(|units| units.join(","));
        assert_eq!(all(&["PT101 bar", "TT102 °C"]).as_deref(), Some("bar,°C"));
        assert_eq!(all(&["PT101.bar", "n.rpm"]).as_deref(), Some("bar,rpm"));
        for titles in [
            &["PT101 bar"][..],
            &["PT101 bar", "TT102"],
            &["PT101 bar", "TT102.°C"],
            &["PLC.A", "PLC.B"],
            &["motor.s", "pump.s"],
            &["FIC1.MV", "FIC2.MV"],
            &["FIC1.PV", "FIC1.SP"],
            &["x.min", "y.min"],
            &["energy.day", "peak.day"],
            &["a BAR", "b BAR"],
            &["p [bar]", "T bar"],
            &["rig/p bar/s", "x bar"],
            &[" bar", " Hz"],
        ] {
            assert_eq!(all(titles), None, "{titles:?}");
        }
    }

    #[test]
    fn a_unit_may_stand_behind_a_sign_and_names_that_look_so_have_none() {
        for (title, unit) in [
            ("p / bar", "bar"),
            ("U / V", "V"),
            ("p/bar", "bar"),
            ("p in bar", "bar"),
            ("q, m3/h", "m3/h"),
            ("PT101:bar", "bar"),
            ("PT101 EU=bar", "bar"),
            ("rig:p:bar", ""),
            ("p - bar", "bar"),
            ("p {bar}", "bar"),
            ("p <bar>", "bar"),
            ("[bar] p", "bar"),
            ("p [bar] avg", "bar"),
            ("p (bar) mean", "bar"),
            ("T_°C", "°C"),
            ("Temp, °C (LGR S/N: 1, SEN S/N: 1)", "°C"),
            ("RH, % (LGR S/N: 1)", "%"),
            ("U/I", ""),
            ("U/V", ""),
            ("hall/rig/bar", ""),
            ("flow, in", ""),
            ("pump - A", ""),
            ("phase (A) current", ""),
            ("valve - open", ""),
            ("step 1 / 2", ""),
        ] {
            let (name, read) = name_and_unit(title);
            assert_eq!(read, unit, "{title}");
            assert_eq!(name, title);
        }
    }
}
