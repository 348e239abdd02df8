//! Numbers that JSON does not have, for `#[serde(with = …)]`: `null` stands for them.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

fn serialize<S: Serializer>(value: f64, serializer: S) -> Result<S::Ok, S::Error> {
    Some(value)
        .filter(|value| value.is_finite())
        .serialize(serializer)
}

fn deserialize<'de, D: Deserializer<'de>>(instead: f64, from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(instead))
}

/// `null` is infinity.
pub mod or_infinity {
    use super::{Deserializer, Serializer};

    /// Writes a number, or `null`.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        super::serialize(*value, serializer)
    }

    /// Reads a number, or `null`.
    ///
    /// # Errors
    /// Those of the deserializer.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        super::deserialize(f64::INFINITY, from)
    }
}

/// `null` is what is not a number.
pub mod or_nan {
    use super::{Deserializer, Serializer};

    /// Writes a number, or `null`.
    ///
    /// # Errors
    /// Those of the serializer.
    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        super::serialize(*value, serializer)
    }

    /// Reads a number, or `null`.
    ///
    /// # Errors
    /// Those of the deserializer.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
        super::deserialize(f64::NAN, from)
    }
}
