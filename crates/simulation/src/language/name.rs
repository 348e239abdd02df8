//! The parts of a name in an equation: Greek letters and lowered indices.

const GREEK: [(&str, &str); 23] = [
    ("alpha", "α"),
    ("beta", "β"),
    ("gamma", "γ"),
    ("delta", "δ"),
    ("epsilon", "ε"),
    ("zeta", "ζ"),
    ("eta", "η"),
    ("theta", "θ"),
    ("kappa", "κ"),
    ("lambda", "λ"),
    ("mu", "μ"),
    ("nu", "ν"),
    ("xi", "ξ"),
    ("pi", "π"),
    ("rho", "ρ"),
    ("sigma", "σ"),
    ("tau", "τ"),
    ("phi", "φ"),
    ("chi", "χ"),
    ("psi", "ψ"),
    ("omega", "ω"),
    ("Delta", "Δ"),
    ("Omega", "Ω"),
];

/// A name as a base and a lowered index, which may be empty: `Km`, `p1`, `K_m` and `tau1` have an index.
#[derive(Debug, PartialEq, Eq)]
pub struct NameParts {
    /// What stands on the line.
    pub base: String,
    /// What stands below it.
    pub index: String,
}

impl NameParts {
    /// Splits a name.
    pub fn of(name: &str) -> NameParts {
        let (base, index) = greek_base(name)
            .or_else(|| underlined(name))
            .or_else(|| lettered(name))
            .unwrap_or_else(|| (name.to_owned(), String::new()));
        NameParts { base, index }
    }
}

/// The letter that a name spells.
pub fn greek(name: &str) -> Option<&'static str> {
    let (_, letter) = GREEK.iter().find(|(spelt, _)| *spelt == name)?;
    Some(letter)
}

/// A name that begins with the name of a Greek letter; more small letters make it a word of its own.
fn greek_base(name: &str) -> Option<(String, String)> {
    GREEK.iter().find_map(|(spelt, letter)| {
        let rest = name.strip_prefix(spelt)?;
        let is_word = rest.starts_with(|c: char| c.is_ascii_lowercase());
        let index = rest.strip_prefix('_').unwrap_or(rest);
        (!is_word).then(|| ((*letter).to_owned(), index.replace('_', " ")))
    })
}

fn underlined(name: &str) -> Option<(String, String)> {
    let (base, index) = name.split_once('_')?;
    let has_both = !base.is_empty() && !index.is_empty();
    has_both.then(|| (base.to_owned(), index.replace('_', " ")))
}

/// A letter has an index of a few letters or digits behind it; small letters alone are a word, as in `area`.
fn lettered(name: &str) -> Option<(String, String)> {
    let mut letters = name.chars();
    let first = letters.next()?;
    let index = letters.as_str();
    let are = |part: &str, of: fn(&char) -> bool| part.chars().all(|c| of(&c));
    let is_short = index.chars().count() <= 3;
    let has_index = match first {
        'A'..='Z' | '\u{370}'..='\u{3ff}' => is_short && are(index, char::is_ascii_alphanumeric),
        'a'..='z' => {
            let digits = index.trim_start_matches(|c: char| c.is_ascii_alphabetic());
            let is_one_letter = index.len() - digits.len() <= 1;
            is_short && is_one_letter && are(digits, char::is_ascii_digit)
        }
        _ => false,
    };
    has_index.then(|| (first.to_string(), index.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::NameParts;

    #[test]
    fn a_letter_has_an_index_and_a_word_has_none() {
        for (name, base, index) in [
            ("Km", "K", "m"),
            ("p1", "p", "1"),
            ("K_m", "K", "m"),
            ("tau1", "τ", "1"),
            ("tau_1", "τ", "1"),
            ("x_a_2", "x", "a 2"),
            ("vst", "vst", ""),
            ("vs", "v", "s"),
            ("x12", "x", "12"),
            ("xs0", "x", "s0"),
            ("area", "area", ""),
            ("etab", "etab", ""),
            ("eta", "η", ""),
            ("τ1", "τ", "1"),
            ("Ambient", "Ambient", ""),
            ("_x", "_x", ""),
            ("x_", "x_", ""),
            ("u", "u", ""),
        ] {
            let parts = NameParts::of(name);
            assert_eq!((&*parts.base, &*parts.index), (base, index), "{name}");
        }
    }
}
