//! Points that agents write: the values of fields, and why a point is not taken.

use crate::intake::units::RecordedUnit;
use std::borrow::Cow;

/// The characters of a sender's text that are repeated where something is wrong with it.
const SHOWN_CHARACTERS: usize = 200;

/// The value of a field.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::intake) enum FieldValue<'t> {
    /// A number, with a fraction or without.
    Number(f64),
    /// True or false.
    Boolean(bool),
    /// A text without its quotes.
    Text(Cow<'t, str>),
}

/// A field of a point.
pub(in crate::intake) struct PointField<'t> {
    pub(in crate::intake) name: Cow<'t, str>,
    pub(in crate::intake) value: FieldValue<'t>,
}

/// Why a point is not taken.
#[derive(Debug, thiserror::Error)]
pub(in crate::intake) enum PointFault {
    #[error(
        "field type conflict: input field \"{field}\" on measurement \"{measurement}\" is type string, a signal \
         takes numbers"
    )]
    Text { field: String, measurement: String },
    #[error(
        "value {value} of field \"{field}\" on measurement \"{measurement}\" is not a finite number in SI"
    )]
    NotFinite {
        value: f64,
        field: String,
        measurement: String,
    },
    #[error(
        "quality {code} in field \"{field}\" on measurement \"{measurement}\" is no word that is known: say in \
         `quality.codes` of its rule what the codes mean"
    )]
    Quality {
        code: String,
        field: String,
        measurement: String,
    },
    #[error("it is further ahead of this server's clock than stamps may be")]
    Ahead,
}

impl PointField<'_> {
    /// The value in SI of a field that a rule names.
    pub(super) fn si(&self, unit: &RecordedUnit, measurement: &str) -> Result<f64, PointFault> {
        let number = match &self.value {
            FieldValue::Number(number) => *number,
            FieldValue::Boolean(value) => f64::from(u8::from(*value)),
            FieldValue::Text(_) => {
                return Err(PointFault::Text {
                    field: shown(&self.name),
                    measurement: shown(measurement),
                });
            }
        };
        let value = unit.to_si(number);
        if value.is_finite() {
            return Ok(value);
        }
        Err(PointFault::NotFinite {
            value: number,
            field: shown(&self.name),
            measurement: shown(measurement),
        })
    }
}

/// A text of a sender, short enough for a sentence.
pub(in crate::intake) fn shown(text: &str) -> String {
    match text.char_indices().nth(SHOWN_CHARACTERS) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}
