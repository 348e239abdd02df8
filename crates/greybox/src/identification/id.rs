//! Identifiers: UUIDv7 with a prefix that says what they name.
//!
//! The text is a prefix such as `ds_` and 32 lower-case hexadecimal digits. It sorts by time of
//! creation, so "newest first" is a descending order of identifiers.

pub use utoipa::ToSchema;
pub use uuid::Uuid;

/// A text that does not name a thing of the expected kind.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is not an identifier of the form {prefix}<32 hexadecimal digits>")]
pub struct InvalidId {
    /// The text that was given.
    pub text: String,
    /// The prefix that was expected, e.g. `job_`.
    pub prefix: &'static str,
}

/// The UUID of a text that begins with `prefix`.
pub fn parse(text: &str, prefix: &'static str) -> Result<Uuid, InvalidId> {
    text.strip_prefix(prefix)
        .filter(|digits| digits.len() == 32 && !digits.bytes().any(|b| b.is_ascii_uppercase()))
        .and_then(|digits| Uuid::try_parse(digits).ok())
        .ok_or_else(|| InvalidId {
            text: text.chars().take(80).collect(),
            prefix,
        })
}

/// Declares an identifier: a UUIDv7 behind a prefix that says what it names, as text in every document.
#[macro_export]
macro_rules! identifier {
    ($(#[$meta:meta])* $name:ident, $prefix:literal, $example:literal) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, $crate::identification::id::ToSchema)]
        #[schema(value_type = String, example = $example)]
        pub struct $name($crate::identification::id::Uuid);

        impl $name {
            /// What the text begins with.
            pub const PREFIX: &'static str = $prefix;

            /// A new identifier, later in order than those this process made before.
            pub fn new() -> Self {
                Self($crate::identification::id::Uuid::now_v7())
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self::new()
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                write!(f, concat!($prefix, "{}"), self.0.simple())
            }
        }

        impl std::str::FromStr for $name {
            type Err = $crate::identification::InvalidId;

            fn from_str(text: &str) -> Result<Self, Self::Err> {
                $crate::identification::id::parse(text, $prefix).map(Self)
            }
        }

        impl serde::Serialize for $name {
            fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                serializer.collect_str(self)
            }
        }

        impl<'de> serde::Deserialize<'de> for $name {
            fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
                let text = <String as serde::Deserialize>::deserialize(deserializer)?;
                text.parse().map_err(serde::de::Error::custom)
            }
        }
    };
}

identifier!(
    /// Names a job.
    JobId,
    "job_",
    "job_0192d3a4b5c67d8e9f00112233445566"
);

identifier!(
    /// Names a stored recording.
    DatasetId,
    "ds_",
    "ds_0192d3a4b5c67d8e9f00112233445566"
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_reads_back_to_the_same_identifier() {
        let id = JobId::new();
        assert_eq!(id.to_string().parse::<JobId>(), Ok(id));
        assert_eq!(id.to_string().len(), 36);
    }

    #[test]
    fn one_kind_of_identifier_is_not_taken_for_the_other() {
        let dataset = DatasetId::new().to_string();
        let error = dataset.parse::<JobId>().expect_err("a dataset is no job");
        assert_eq!(error.prefix, "job_");
    }

    #[test]
    fn each_identifier_has_one_spelling_only() {
        let text = JobId::new().to_string();
        for other in [
            text.to_uppercase(),
            text.replace("job_", "job_{") + "}",
            format!("{}-{}", &text[..12], &text[12..]),
            format!("job_{}", text[4..].to_uppercase()),
            text[..35].to_owned(),
        ] {
            assert!(other == text || other.parse::<JobId>().is_err(), "{other}");
        }
    }

    #[test]
    fn later_identifiers_sort_after_earlier_ones() {
        let ids: Vec<String> = (0..100).map(|_| JobId::new().to_string()).collect();
        assert!(ids.is_sorted());
    }
}
