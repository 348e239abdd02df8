//! JSON text to a JSON value, stricter than the parser: a key that appears twice is an error,
//! because which of the two counts would be chance. Depth is bounded by the parser (128).

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::map::Entry;
use serde_json::{Map, Number, Value};

use super::Fault;

/// Parses one JSON document; the error carries the line and the column.
pub fn parse(text: &[u8]) -> Result<Value, serde_json::Error> {
    let mut deserializer = serde_json::Deserializer::from_slice(text);
    let Strict(value) = Strict::deserialize(&mut deserializer)?;
    deserializer.end()?;
    Ok(value)
}

/// The fault of a text that is no JSON.
pub fn not_json(error: &serde_json::Error) -> Fault {
    Fault::of_whole("not_json", format!("not JSON: {error}"))
        .within((error.line() as u64, error.column() as u64))
}

struct Strict(Value);

impl<'de> Deserialize<'de> for Strict {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(StrictVisitor).map(Strict)
    }
}

struct StrictVisitor;

impl<'de> Visitor<'de> for StrictVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E: serde::de::Error>(self, value: f64) -> Result<Value, E> {
        let number = Number::from_f64(value).ok_or_else(|| E::custom("number out of range"))?;
        Ok(Value::Number(number))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_string<E>(self, value: String) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(Strict(value)) = items.next_element()? {
            values.push(value);
        }
        Ok(Value::Array(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some(key) = entries.next_key::<String>()? {
            match map.entry(key) {
                Entry::Vacant(place) => place.insert(entries.next_value::<Strict>()?.0),
                Entry::Occupied(first) => {
                    let detail = format!("key `{}` appears twice", first.key());
                    return Err(A::Error::custom(detail));
                }
            };
        }
        Ok(Value::Object(map))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_that_appears_twice_is_an_error_with_its_place() {
        let error = parse(&b"{\"seed\": 1,\n \"seed\": 2}"[..]).unwrap_err();
        assert!(
            error.to_string().starts_with("key `seed` appears twice"),
            "{error}"
        );
        assert_eq!(error.line(), 2);
    }

    #[test]
    fn nesting_is_bounded_and_trailing_text_refused() {
        assert!(parse("[".repeat(100_000).as_bytes()).is_err());
        assert!(parse(&b"{} {}"[..]).is_err());
        assert!(parse(&b"1e999"[..]).is_err());
    }

    #[test]
    fn a_document_survives_unchanged() {
        let text = r#"{"b":[1,-2,0.1,true,null,"x"],"a":{"c":1e-300}}"#;
        assert_eq!(parse(text.as_bytes()).unwrap().to_string(), text);
    }
}
