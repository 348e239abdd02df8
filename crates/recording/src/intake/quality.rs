//! What sources say of their samples, as one of four classes.
//!
//! | scheme | good | uncertain | bad |
//! |---|---|---|---|
//! | `opc_da` (OPC classic, Canary, AVEVA `OPCQuality`) | 192 to 255 | 64 to 127 | 0 to 63 |
//! | `opc_ua` (status codes, Part 6) | top bits 00, e.g. 0 | 01 | 10 |
//! | `aveva_quality` (Historian's `Quality`) | 0 | 16 | 1 |
//! | `aveva_quality_detail` | 192, 202, 212, 248, 252 | 16 | all others |
//! | `ignition` (8 and later) | 0 and 192 to 255, the low 16 bits | top bits 01 | top bits 10 |
//! | `ignition_legacy` (stored history) | 192 | 64 to 127 | all others |
//! | `cognite` | 0 | top bits 01 | top bits 10 |
//! | `is_good` | 1, yes, true | | 0, no, false |
//! | `is_bad` | 0, no, false | | 1, yes, true |
//! | `proficy` (REST of Proficy Historian) | 3 | 1 | 0, 2 (not available) |
//! | `fieldbus` (PROFIBUS PA, Foundation Fieldbus, tags of `WinCC`) | 128 to 255 | 64 to 127 | 0 to 63 |
//! | `factorytalk` (data logs of `FactoryTalk` View and `RSView32`) | blank | S (stale) | D, E, U, * |
//! | `words` | good …, ok, true | uncertain …, questionable, doubtful | bad …, not good, invalid, false |
//!
//! A 0 is bad in one and good in another: where the format does not settle the scheme it is asked
//! for, never guessed.

use super::cell::Cell;
use crate::Class;

/// What codes of quality mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scheme {
    OpcDa,
    OpcUa,
    AvevaQuality,
    AvevaQualityDetail,
    Ignition,
    IgnitionLegacy,
    Cognite,
    IsGood,
    IsBad,
    Proficy,
    Fieldbus,
    FactoryTalk,
    Words,
}

const NAMES: [(&str, Scheme); 13] = [
    ("opc_da", Scheme::OpcDa),
    ("opc_ua", Scheme::OpcUa),
    ("aveva_quality", Scheme::AvevaQuality),
    ("aveva_quality_detail", Scheme::AvevaQualityDetail),
    ("ignition", Scheme::Ignition),
    ("ignition_legacy", Scheme::IgnitionLegacy),
    ("cognite", Scheme::Cognite),
    ("is_good", Scheme::IsGood),
    ("is_bad", Scheme::IsBad),
    ("proficy", Scheme::Proficy),
    ("fieldbus", Scheme::Fieldbus),
    ("factorytalk", Scheme::FactoryTalk),
    ("words", Scheme::Words),
];

/// The names of the schemes of codes of quality.
pub fn quality_schemes() -> impl Iterator<Item = &'static str> {
    NAMES.into_iter().map(|(name, _)| name)
}

impl Scheme {
    pub(super) fn named(text: &str) -> Result<Self, String> {
        let entry = NAMES.iter().find(|(name, _)| *name == text);
        entry.map(|(_, scheme)| *scheme).ok_or_else(|| {
            let names = NAMES.map(|(name, _)| name);
            format!("`{text}` is not one of {}", names.join(", "))
        })
    }

    /// The class that a code stands for; none where it is no code of the scheme.
    pub(super) fn class(self, code: &Cell<'_>) -> Option<Class> {
        if let Cell::Text(text) = code
            && let Some(class) = word(text)
        {
            let is_answer = ["true", "false", "yes", "no"]
                .iter()
                .any(|answer| text.trim().eq_ignore_ascii_case(answer));
            return match class {
                Class::Good if self == Self::IsBad && is_answer => Some(Class::Bad),
                Class::Bad if self == Self::IsBad && is_answer => Some(Class::Good),
                class => Some(class),
            };
        }
        let code = match code {
            Cell::Empty => return Some(Class::Good),
            Cell::Bool(bad) if self == Self::IsBad => {
                return Some(if *bad { Class::Bad } else { Class::Good });
            }
            Cell::Bool(good) => return Some(if *good { Class::Good } else { Class::Bad }),
            Cell::Integer(code) => *code,
            Cell::Number(code) if code.fract() == 0.0 => *code as i64,
            Cell::Text(text) if self == Self::FactoryTalk => return class_of_letter(text.trim()),
            Cell::Text(text) => code_in(text.trim())?,
            _ => return None,
        };
        self.class_of(code)
    }

    fn class_of(self, code: i64) -> Option<Class> {
        // Codes of 32 bits may come signed.
        let code = if code < 0 { code + (1 << 32) } else { code };
        let severity = |code: i64| match (code >> 30) & 3 {
            0 => Class::Good,
            1 => Class::Uncertain,
            _ => Class::Bad,
        };
        let class = match self {
            Self::OpcDa => match code & 0xC0 {
                0xC0 => Class::Good,
                0x40 => Class::Uncertain,
                // The specification leaves these codes out.
                0x80 => return None,
                _ => Class::Bad,
            },
            Self::OpcUa | Self::Cognite => severity(code),
            Self::AvevaQuality => match code {
                0 => Class::Good,
                16 => Class::Uncertain,
                1 => Class::Bad,
                133 => Class::Good,
                _ => return None,
            },
            Self::AvevaQualityDetail => match code {
                192 | 202 | 212 | 248 | 252 => Class::Good,
                16 => Class::Uncertain,
                _ => Class::Bad,
            },
            Self::Ignition => match (severity(code), code & 0xFFFF) {
                (Class::Good, 0 | 192..=255) => Class::Good,
                (Class::Good, 256..=511) => Class::Uncertain,
                (Class::Good, _) => Class::Bad,
                (class, _) => class,
            },
            Self::IgnitionLegacy => match code {
                192 => Class::Good,
                64..=127 => Class::Uncertain,
                _ => Class::Bad,
            },
            Self::IsGood => match code {
                1 => Class::Good,
                0 => Class::Bad,
                _ => return None,
            },
            Self::IsBad => return Self::IsGood.class_of(code.checked_neg()?.checked_add(1)?),
            Self::Proficy => match code {
                3 => Class::Good,
                1 => Class::Uncertain,
                0 | 2 => Class::Bad,
                _ => return None,
            },
            Self::Fieldbus => match code {
                0..64 => Class::Bad,
                64..128 => Class::Uncertain,
                128..256 => Class::Good,
                _ => return None,
            },
            Self::FactoryTalk | Self::Words => return None,
        };
        Some(class)
    }
}

/// The class of a letter in a data log of `FactoryTalk` View: disabled, error of communication, uninitialized or bad,
/// and stale.
fn class_of_letter(letter: &str) -> Option<Class> {
    match letter {
        "D" | "E" | "U" | "*" => Some(Class::Bad),
        "S" => Some(Class::Uncertain),
        _ => None,
    }
}

/// Every scheme whose codes have 192 calls it good.
pub(super) fn is_good_everywhere(code: &Cell<'_>) -> bool {
    match code {
        Cell::Integer(code) => *code == 192,
        Cell::Number(code) => *code == 192.0,
        Cell::Text(text) => text.trim() == "192",
        _ => false,
    }
}

/// Whether a field of a table may say how good a sample is: a word of quality, or a code that some scheme has.
pub(super) fn may_rate(field: &str) -> bool {
    /// Codes that schemes have beside those of 192 and above.
    const CODES: [i64; 12] = [0, 1, 2, 3, 4, 8, 16, 24, 28, 64, 68, 128];
    let is_code =
        |code: i64| CODES.contains(&code) || (192..=255).contains(&code) || code.abs() >= 1 << 30;
    word(field).is_some() || field.trim().parse().is_ok_and(is_code)
}

/// A code that is written as a number, in hexadecimal digits (`0xC0`), or in these behind its name, as Telegraf writes
/// those of OPC UA: `OK (0x0)`.
fn code_in(text: &str) -> Option<i64> {
    let named = text
        .strip_suffix(')')
        .and_then(|text| text.rsplit_once("(0x"));
    let digits = named.map_or_else(|| text.strip_prefix("0x"), |(_, digits)| Some(digits));
    match digits {
        Some(digits) => i64::from_str_radix(digits, 16).ok(),
        None => text.parse().ok(),
    }
}

/// The class of a word by its beginning: a class, or the name of a status of OPC.
fn begun(word: &str) -> Option<Class> {
    const BEGINNINGS: [(&str, Class); 16] = [
        ("good", Class::Good),
        ("local override", Class::Good),
        ("uncertain", Class::Uncertain),
        ("last usable", Class::Uncertain),
        ("sensor not accurate", Class::Uncertain),
        ("sub-normal", Class::Uncertain),
        ("bad", Class::Bad),
        ("not good", Class::Bad),
        ("no good", Class::Bad),
        ("comm fail", Class::Bad),
        ("configuration error", Class::Bad),
        ("not connected", Class::Bad),
        ("device failure", Class::Bad),
        ("sensor failure", Class::Bad),
        ("last known", Class::Bad),
        ("out of service", Class::Bad),
    ];
    let mut beginnings = BEGINNINGS.into_iter();
    let class = beginnings.find(|(beginning, _)| word.starts_with(beginning));
    class.map(|(_, class)| class)
}

/// Words mean the same wherever they stand. Sources say more behind the first of them: `Bad, Not Connected`,
/// `Bad [Comm Failure]`, `GoodClamped`.
pub(super) fn word(text: &str) -> Option<Class> {
    let text = text.trim().to_ascii_lowercase();
    let class = match text.as_str() {
        "" | "ok" | "true" | "yes" => Class::Good,
        "questionable" | "doubtful" => Class::Uncertain,
        "substituted" => Class::Substituted,
        "false" | "no" | "error" | "invalid" | "failed" => Class::Bad,
        text => return begun(text),
    };
    Some(class)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_means_what_its_scheme_says() {
        use Class::{Bad, Good, Uncertain};
        for (scheme, code, class) in [
            (Scheme::OpcDa, 0, Bad),
            (Scheme::OpcDa, 192, Good),
            (Scheme::OpcDa, 216, Good),
            (Scheme::OpcDa, 64, Uncertain),
            (Scheme::IsBad, 1, Bad),
            (Scheme::IsBad, 0, Good),
            (Scheme::OpcUa, 0, Good),
            (Scheme::OpcUa, 0x4000_0000, Uncertain),
            (Scheme::OpcUa, 0x8000_0000, Bad),
            (Scheme::AvevaQuality, 0, Good),
            (Scheme::AvevaQuality, 1, Bad),
            (Scheme::AvevaQuality, 16, Uncertain),
            (Scheme::AvevaQualityDetail, 0, Bad),
            (Scheme::AvevaQualityDetail, 202, Good),
            (Scheme::Ignition, 0, Good),
            (Scheme::Ignition, 1_073_742_080, Uncertain),
            (Scheme::Ignition, -2_147_483_136, Bad),
            (Scheme::IgnitionLegacy, 0, Bad),
            (Scheme::IgnitionLegacy, 192, Good),
            (Scheme::Cognite, 0, Good),
            (Scheme::Proficy, 0, Bad),
            (Scheme::Proficy, 3, Good),
            (Scheme::Fieldbus, 128, Good),
            (Scheme::Fieldbus, 192, Good),
            (Scheme::Fieldbus, 72, Uncertain),
            (Scheme::Fieldbus, 0, Bad),
        ] {
            assert_eq!(
                scheme.class(&Cell::Integer(code)),
                Some(class),
                "{scheme:?} {code}"
            );
        }
        assert_eq!(Scheme::OpcDa.class(&Cell::Text("Good")), Some(Good));
        let timeout = Cell::Text("BadTimeout (0x800A0000)");
        assert_eq!(Scheme::OpcUa.class(&timeout), Some(Bad));
        assert_eq!(Scheme::OpcUa.class(&Cell::Text("OK (0x0)")), Some(Good));
        assert_eq!(Scheme::Words.class(&Cell::Integer(0)), None);
        assert_eq!(Scheme::OpcDa.class(&Cell::Text("x")), None);
        assert_eq!(Scheme::OpcDa.class(&Cell::Integer(128)), None);
        assert_eq!(Scheme::IsBad.class(&Cell::Text("False")), Some(Good));
        assert_eq!(Scheme::IsBad.class(&Cell::Integer(i64::MIN)), None);
        for (text, class) in [
            ("Bad, Not Connected", Bad),
            ("Not Good", Bad),
            ("0x0", Bad),
            ("0xC0", Good),
            ("GoodClamped", Good),
            ("Uncertain [Sub-Normal]", Uncertain),
        ] {
            assert_eq!(
                Scheme::OpcDa.class(&Cell::Text(text)),
                Some(class),
                "{text}"
            );
        }
    }

    #[test]
    fn letters_are_those_of_one_program() {
        use Class::{Bad, Good, Uncertain};
        assert_eq!(Scheme::Fieldbus.class(&Cell::Integer(256)), None);
        for (letter, class) in [
            ("", Some(Good)),
            ("E", Some(Bad)),
            ("S", Some(Uncertain)),
            ("B", None),
            ("1", None),
        ] {
            assert_eq!(
                Scheme::FactoryTalk.class(&Cell::Text(letter)),
                class,
                "{letter}"
            );
        }
    }
}
