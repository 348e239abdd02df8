//! The Open Message Format (OMF) 1.0 to 1.2 and 2.0, which AVEVA's adapters and other senders write.
//!
//! A *type* says what properties a value has: which of them is the instant (`isindex`), their units (`uom`), how they go
//! on between samples (`interpolation`), and which of them says how good the value is (`isquality`). A *container* is
//! a series of values of one type. *Data* are values of containers. Senders send types and containers once, when they
//! begin, so that definitions have to be kept.
//!
//! | version | `messagetype` | body |
//! |---|---|---|
//! | 1.0 to 1.2 | `type`, `container`, `data` | an array of definitions, or of `{containerid, values}` |
//! | 2.0 | `schema` | `{"types": […], "containers": […]}` |
//! | 2.0 | `instance` | `{"streamingData": [{containerid, values}]}` |
//!
//! A container is the measurement of a [`Mapping`](crate::intake::spread::Mapping), a property the field. What the
//! rules leave open (a unit, an interpolation, the properties of quality) the definitions say.
//! Source: AVEVA, *Open Message Format*, 1.2 and 2.0.

mod data;
mod definitions;
mod header;

pub use data::{ContainerValues, OmfData, spread};
pub use definitions::{
    ContainerDefinition, DefinedContainer, DefinitionChange, DefinitionKey, DefinitionKind,
    OmfDefinition, OmfDefinitions, TypeDefinition,
};
pub use header::{OmfAction, OmfHeader, OmfMessageType};

use super::error::{ReadError, told};
use super::gzip::{self, Unpacked};
use super::memory::Memory;
use serde_json::Value;
use std::io::{BufRead, BufReader, Read};

/// Bytes of a body at the most, unpacked. CONNECT data services take less, senders split by themselves.
pub const MOST_OMF_BYTES: u64 = 2 << 20;

/// The content of a body.
#[derive(Debug)]
pub enum OmfMessage {
    /// Types and containers.
    Definitions(OmfDefinitions),
    /// Values of containers.
    Data(OmfData),
}

/// Why a body is not taken at all.
#[derive(Debug, thiserror::Error)]
pub enum OmfError {
    /// The body broke off.
    #[error(transparent)]
    Source(#[from] ReadError),
    /// The body has more than [`MOST_OMF_BYTES`].
    #[error("the body has more than {} MiB unpacked: send fewer values at once", MOST_OMF_BYTES >> 20)]
    TooLarge,
    /// The body is no message of its header.
    #[error("{0}")]
    Malformed(String),
}

fn malformed(detail: impl Into<String>) -> OmfError {
    OmfError::Malformed(detail.into())
}

/// Reads a body, which gzip may have packed.
///
/// # Errors
/// The source fails, or the body is too large or no JSON in the form of its message type.
pub fn read(source: impl Read, header: OmfHeader) -> Result<OmfMessage, OmfError> {
    let (memory, source) = Memory::counting(source);
    let mut source = BufReader::new(source);
    let mut text = Vec::new();
    let is_packed = source
        .fill_buf()
        .map_err(ReadError::from)?
        .starts_with(gzip::MAGIC);
    let count = if is_packed {
        let unpacked = Unpacked::of(source, &memory);
        unpacked.take(MOST_OMF_BYTES + 1).read_to_end(&mut text)
    } else {
        source.take(MOST_OMF_BYTES + 1).read_to_end(&mut text)
    };
    if count.map_err(|error| told(error.into()))? as u64 > MOST_OMF_BYTES {
        return Err(OmfError::TooLarge);
    }
    let body: Value =
        serde_json::from_slice(&text).map_err(|error| malformed(format!("no JSON: {error}")))?;
    drop(text);
    header.read_body(body)
}

impl OmfHeader {
    fn read_body(self, body: Value) -> Result<OmfMessage, OmfError> {
        match self.message_type {
            OmfMessageType::Type => self.read_definitions(vec![(DefinitionKind::Type, body)]),
            OmfMessageType::Container => {
                self.read_definitions(vec![(DefinitionKind::Container, body)])
            }
            OmfMessageType::Schema => {
                let written = arrays(body)?.into_iter().filter_map(|(name, values)| {
                    let kind = match name.as_str() {
                        "types" => DefinitionKind::Type,
                        "containers" => DefinitionKind::Container,
                        _ => return None,
                    };
                    Some((kind, values))
                });
                self.read_definitions(written.collect())
            }
            OmfMessageType::Data => self.read_data(vec![items(body)?]),
            OmfMessageType::Instance => {
                let streaming = arrays(body)?.into_iter();
                let streaming = streaming.filter(|(name, _)| name == "streamingdata");
                let streaming: Result<_, _> = streaming.map(|(_, values)| items(values)).collect();
                self.read_data(streaming?)
            }
        }
    }

    fn read_definitions(
        self,
        written: Vec<(DefinitionKind, Value)>,
    ) -> Result<OmfMessage, OmfError> {
        let mut definitions = OmfDefinitions::default();
        for (kind, written) in written {
            definitions.add(kind, self.action, items(written)?);
        }
        Ok(OmfMessage::Definitions(definitions))
    }

    fn read_data(self, messages: Vec<Vec<Value>>) -> Result<OmfMessage, OmfError> {
        if self.action == OmfAction::Delete {
            return Err(malformed(
                "data are not deleted by OMF; `DELETE /v1/streams/{name}/samples` removes a part of a stream",
            ));
        }
        let mut data = OmfData::default();
        for message in messages.into_iter().flatten() {
            data.add(message);
        }
        Ok(OmfMessage::Data(data))
    }
}

/// The items of a body that is an array.
fn items(body: Value) -> Result<Vec<Value>, OmfError> {
    match body {
        Value::Array(items) => Ok(items),
        _ => Err(malformed("the messages of this type are an array")),
    }
}

/// The arrays of a body of OMF 2.0 by their names in small letters, types before containers. An example of the
/// specification has the object within an array.
fn arrays(body: Value) -> Result<Vec<(String, Value)>, OmfError> {
    let objects = match body {
        Value::Object(object) => vec![Value::Object(object)],
        Value::Array(objects) => objects,
        _ => return Err(malformed("a message of OMF 2.0 is an object of arrays")),
    };
    let mut arrays = Vec::new();
    for object in objects {
        let Value::Object(object) = object else {
            return Err(malformed("a message of OMF 2.0 is an object of arrays"));
        };
        let named = object.into_iter();
        arrays.extend(named.map(|(name, values)| (name.to_ascii_lowercase(), values)));
    }
    arrays.sort_by_key(|(name, _)| name != "types");
    Ok(arrays)
}

#[cfg(test)]
mod tests;
