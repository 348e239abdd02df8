//! How well a number is known that is taken as known.

use greybox_numerics::parsing::reader::Field;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// One standard deviation of what is not known of a value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "ToleranceText", try_from = "ToleranceText")]
pub enum Tolerance {
    /// In the value's own unit.
    Absolute(f64),
    /// A share of the value [%].
    Percent(f64),
}

/// One standard deviation: a number in the parameter's own unit, or a share of the value such as
/// `"1 %"`.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(untagged)]
#[schema(as = Tolerance, example = "1 %")]
pub enum ToleranceText {
    /// In the parameter's own unit.
    Number(f64),
    /// A share of the value.
    Text(String),
}

/// A text that is no tolerance.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is neither a number that is not negative nor a share such as \"1 %\"")]
pub struct NotATolerance(String);

impl Tolerance {
    /// The standard deviation of a value, in its unit.
    #[must_use]
    pub fn of(self, value: f64) -> f64 {
        match self {
            Tolerance::Absolute(deviation) => deviation,
            Tolerance::Percent(share) => 0.01 * share * value.abs(),
        }
    }

    /// Reads a number or a share; a fault where it is neither.
    #[must_use]
    pub fn read(field: &Field<'_>) -> Option<Tolerance> {
        let text = match field.value.as_str() {
            Some(text) => ToleranceText::Text(text.to_owned()),
            None => ToleranceText::Number(field.number()?),
        };
        let read = Tolerance::try_from(text);
        if let Err(error) = &read {
            field.fault("tolerance_not_understood", error.to_string());
        }
        read.ok()
    }
}

impl From<Tolerance> for ToleranceText {
    fn from(tolerance: Tolerance) -> Self {
        match tolerance {
            Tolerance::Absolute(deviation) => ToleranceText::Number(deviation),
            Tolerance::Percent(share) => ToleranceText::Text(format!("{share} %")),
        }
    }
}

impl TryFrom<ToleranceText> for Tolerance {
    type Error = NotATolerance;

    fn try_from(text: ToleranceText) -> Result<Self, NotATolerance> {
        let sound = |number: &f64| number.is_finite() && *number >= 0.0;
        match text {
            ToleranceText::Number(deviation) => Some(deviation)
                .filter(sound)
                .map(Tolerance::Absolute)
                .ok_or_else(|| NotATolerance(deviation.to_string())),
            ToleranceText::Text(text) => text
                .strip_suffix('%')
                .and_then(|share| share.trim().parse().ok())
                .filter(sound)
                .map(Tolerance::Percent)
                .ok_or(NotATolerance(text)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_tolerance_is_a_number_or_a_share_and_reads_back_to_itself() {
        let cases = [
            (json!(7e4), Tolerance::Absolute(7e4)),
            (json!("1 %"), Tolerance::Percent(1.0)),
            (json!("0.25%"), Tolerance::Percent(0.25)),
        ];
        for (text, expected) in cases {
            let read: Tolerance = serde_json::from_value(text).unwrap();
            assert_eq!(read, expected);
            let again = serde_json::to_value(read).unwrap();
            assert_eq!(serde_json::from_value::<Tolerance>(again).unwrap(), read);
        }
        assert_eq!(Tolerance::Percent(1.0).of(-7e6), 7e4);
    }

    #[test]
    fn what_is_no_tolerance_is_refused() {
        for text in [
            json!(-1),
            json!("1"),
            json!("-1 %"),
            json!("nan %"),
            json!("a %"),
        ] {
            assert!(serde_json::from_value::<Tolerance>(text).is_err());
        }
    }
}
