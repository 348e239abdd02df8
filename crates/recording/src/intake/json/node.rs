//! The places of a document, each of which takes what the parser finds there.
//!
//! A value of the wrong kind is a fault at its pointer and is skipped, so that the rest is read.

use super::super::error::ReadingFaults;
use super::document::{Document, JsonColumn, escape, fault};
use super::scalar::JsonScalar;
use serde::de::{DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use std::fmt;

/// A place in the document and what it fills.
pub(super) enum DocumentTarget<'a> {
    /// The whole document.
    Document(&'a mut Document),
    /// The object of signals.
    Signals(&'a mut Document),
    /// A signal, or the time: an object with a unit and values.
    Column {
        column: &'a mut JsonColumn,
        faults: &'a mut ReadingFaults,
        pointer: String,
    },
    /// The array of values.
    Values {
        values: &'a mut Vec<f64>,
        faults: &'a mut ReadingFaults,
        pointer: String,
    },
}

impl<'de> DeserializeSeed<'de> for DocumentTarget<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl DocumentTarget<'_> {
    fn expected(&self) -> &'static str {
        match self {
            Self::Values { .. } => "an array",
            _ => "an object",
        }
    }

    /// Reports that something else was found here.
    fn mismatch(self, actual: &str) {
        let detail = format!("expected {}, found {actual}", self.expected());
        let (faults, pointer) = match self {
            Self::Document(document) => (&mut document.faults, String::new()),
            Self::Signals(document) => (&mut document.faults, "/signals".to_owned()),
            Self::Column {
                faults, pointer, ..
            }
            | Self::Values {
                faults, pointer, ..
            } => (faults, pointer),
        };
        faults.invalid(fault("wrong_type", pointer, &detail));
    }
}

impl<'de> Visitor<'de> for DocumentTarget<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.expected())
    }

    fn visit_unit<E>(self) -> Result<(), E> {
        self.mismatch("null");
        Ok(())
    }

    fn visit_bool<E>(self, _: bool) -> Result<(), E> {
        self.mismatch("a boolean");
        Ok(())
    }

    fn visit_f64<E>(self, _: f64) -> Result<(), E> {
        self.mismatch("a number");
        Ok(())
    }

    fn visit_u64<E>(self, _: u64) -> Result<(), E> {
        self.mismatch("a number");
        Ok(())
    }

    fn visit_i64<E>(self, _: i64) -> Result<(), E> {
        self.mismatch("a number");
        Ok(())
    }

    fn visit_str<E>(self, _: &str) -> Result<(), E> {
        self.mismatch("a string");
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        let Self::Values {
            values,
            faults,
            pointer,
        } = self
        else {
            self.mismatch("an array");
            while seq.next_element::<IgnoredAny>()?.is_some() {}
            return Ok(());
        };
        while let Some(scalar) = seq.next_element::<JsonScalar>()? {
            let value = match scalar {
                JsonScalar::Number(value) => value,
                JsonScalar::Null => f64::NAN,
                scalar => {
                    let detail = format!("expected a number or null, found {}", scalar.kind());
                    let place = format!("{pointer}/{}", values.len());
                    faults.invalid(fault("not_a_number", place, &detail));
                    f64::NAN
                }
            };
            values.push(value);
        }
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        match self {
            Self::Document(document) => read_document(document, map),
            Self::Signals(document) => read_signals(document, map),
            Self::Column {
                column,
                faults,
                pointer,
            } => read_column(column, faults, &pointer, map),
            Self::Values { .. } => {
                self.mismatch("an object");
                while map.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
                Ok(())
            }
        }
    }
}

fn read_document<'de, A: MapAccess<'de>>(
    document: &mut Document,
    mut map: A,
) -> Result<(), A::Error> {
    while let Some(key) = map.next_key::<String>()? {
        if !document.is_new_field(&key) {
            map.next_value::<IgnoredAny>()?;
            continue;
        }
        match key.as_str() {
            "signals" => map.next_value_seed(DocumentTarget::Signals(document))?,
            "time" => {
                let column = document.time.insert(JsonColumn::default());
                let faults = &mut document.faults;
                map.next_value_seed(DocumentTarget::Column {
                    column,
                    faults,
                    pointer: "/time".to_owned(),
                })?;
            }
            _ => {
                let scalar = map.next_value()?;
                document.take_scalar(&key, scalar);
            }
        }
    }
    Ok(())
}

fn read_signals<'de, A: MapAccess<'de>>(
    document: &mut Document,
    mut map: A,
) -> Result<(), A::Error> {
    document.has_signals = true;
    while let Some(name) = map.next_key::<String>()? {
        let pointer = format!("/signals/{}", escape(&name));
        if !document.is_new_signal(&name, &pointer) {
            map.next_value::<IgnoredAny>()?;
            continue;
        }
        let mut column = JsonColumn::default();
        let faults = &mut document.faults;
        map.next_value_seed(DocumentTarget::Column {
            column: &mut column,
            faults,
            pointer,
        })?;
        document.signals.push((name, column));
    }
    Ok(())
}

fn read_column<'de, A: MapAccess<'de>>(
    column: &mut JsonColumn,
    faults: &mut ReadingFaults,
    pointer: &str,
    mut map: A,
) -> Result<(), A::Error> {
    while let Some(key) = map.next_key::<String>()? {
        let place = format!("{pointer}/{}", escape(&key));
        match key.as_str() {
            "values" if column.values.is_none() => {
                let values = column.values.insert(Vec::new());
                map.next_value_seed(DocumentTarget::Values {
                    values,
                    faults,
                    pointer: place,
                })?;
            }
            "unit" if column.unit.is_none() => match map.next_value()? {
                JsonScalar::Text(unit) => column.unit = Some(unit.trim().to_owned()),
                scalar => {
                    let detail = format!("expected a string, found {}", scalar.kind());
                    faults.invalid(fault("wrong_type", place, &detail));
                }
            },
            "values" | "unit" => {
                map.next_value::<IgnoredAny>()?;
                faults.invalid(fault(
                    "duplicate_field",
                    place,
                    "the field stands here twice",
                ));
            }
            _ => {
                map.next_value::<IgnoredAny>()?;
                let detail = "unknown field; known: unit, values";
                faults.invalid(fault("unknown_field", place, detail));
            }
        }
    }
    Ok(())
}
