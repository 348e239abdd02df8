//! What the headers of a request say of its body.

/// The type of a message, by `omfversion` and `messagetype`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OmfMessageType {
    /// Types, to OMF 1.2.
    Type,
    /// Containers, to OMF 1.2.
    Container,
    /// Values, to OMF 1.2.
    Data,
    /// Types and containers, from OMF 2.0 on.
    Schema,
    /// Values, from OMF 2.0 on.
    Instance,
}

/// The action of a message on the definitions and values that its body names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OmfAction {
    /// Definitions and values are stored; a definition takes the place of the earlier one of its id.
    Store,
    /// Definitions are removed.
    Delete,
}

/// The headers of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OmfHeader {
    /// The type of the message.
    pub message_type: OmfMessageType,
    /// The action of the message.
    pub action: OmfAction,
}

impl OmfHeader {
    /// Reads the headers, each of which `value` gives by its name in small letters.
    ///
    /// # Errors
    /// A sentence where a header is missing or not understood.
    pub fn read<'t>(value: impl Fn(&str) -> Option<&'t str>) -> Result<Self, String> {
        let value = |name| value(name).map(|text: &str| text.trim().to_ascii_lowercase());
        let message_type = value("messagetype").ok_or("the header `messagetype` is missing")?;
        let version = value("omfversion").ok_or("the header `omfversion` is missing")?;
        let message_type = match (version.as_str(), message_type.as_str()) {
            ("1.0" | "1.1" | "1.2", "type") => OmfMessageType::Type,
            ("1.0" | "1.1" | "1.2", "container") => OmfMessageType::Container,
            ("1.0" | "1.1" | "1.2", "data") => OmfMessageType::Data,
            ("2.0", "schema") => OmfMessageType::Schema,
            ("2.0", "instance") => OmfMessageType::Instance,
            _ => {
                return Err(
                    "`omfversion` 1.0, 1.1 and 1.2 have the `messagetype` type, container or data, and 2.0 schema \
                     or instance"
                        .to_owned(),
                );
            }
        };
        let action = match value("action").as_deref() {
            None | Some("create" | "update") => OmfAction::Store,
            Some("delete") => OmfAction::Delete,
            Some(_) => return Err("`action` is create, update or delete".to_owned()),
        };
        let is_json = |format: String| format == "json";
        if !value("messageformat").is_none_or(is_json) {
            return Err("`messageformat` is json".to_owned());
        }
        let is_gzip = |compression: String| ["", "none", "gzip"].contains(&compression.as_str());
        if !value("compression").is_none_or(is_gzip) {
            return Err("`compression` is gzip or left out".to_owned());
        }
        Ok(Self {
            message_type,
            action,
        })
    }
}
