//! Sections of settings: a field is stated once, with its description, type, default and range.
//!
//! [`settings!`](crate::settings) makes of that the type, its `Default`, the limits in the
//! description of the API, and the reader that tells all faults at once.

use serde::de::value::StrDeserializer;
use serde::de::{DeserializeOwned, IntoDeserializer};

use super::reader::{Field, Object};

/// The numbers that a setting may have.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct NumberLimits {
    /// The least number.
    pub from: Option<f64>,
    /// The number that the setting has to exceed.
    pub above: Option<f64>,
    /// The largest number.
    pub to: Option<f64>,
}

/// A limit from a literal of either kind.
pub fn limit(number: impl Into<f64>) -> Option<f64> {
    Some(number.into())
}

/// A type of settings.
pub trait Setting: Sized {
    /// The value of a field; where the field has none within the limits, that is a fault.
    fn read(field: &Field<'_>, limits: &NumberLimits) -> Option<Self>;
}

impl Setting for u64 {
    fn read(field: &Field<'_>, limits: &NumberLimits) -> Option<Self> {
        let least = limits.from.unwrap_or(0.0) as u64;
        field.integer(least, limits.to.map_or(u64::MAX, |most| most as u64))
    }
}

impl Setting for u32 {
    fn read(field: &Field<'_>, limits: &NumberLimits) -> Option<Self> {
        let most = limits.to.unwrap_or(f64::from(u32::MAX));
        let limits = NumberLimits {
            to: Some(most),
            ..*limits
        };
        u64::read(field, &limits)?.try_into().ok()
    }
}

impl Setting for f64 {
    fn read(field: &Field<'_>, limits: &NumberLimits) -> Option<Self> {
        if limits.above == Some(0.0) {
            return field.positive();
        }
        let least = limits.from.unwrap_or(f64::NEG_INFINITY);
        field.number_within(least, limits.to.unwrap_or(f64::INFINITY))
    }
}

impl Setting for bool {
    fn read(field: &Field<'_>, _: &NumberLimits) -> Option<Self> {
        field.boolean()
    }
}

impl<T: Setting> Setting for Option<T> {
    fn read(field: &Field<'_>, limits: &NumberLimits) -> Option<Self> {
        T::read(field, limits).map(Some)
    }
}

/// One of the words of an enumeration; the fault lists all of them.
pub fn word<T: DeserializeOwned>(field: &Field<'_>) -> Option<T> {
    let word: StrDeserializer<'_, serde::de::value::Error> = field.text()?.into_deserializer();
    match T::deserialize(word) {
        Ok(value) => Some(value),
        Err(error) => {
            field.fault("unknown_choice", error.to_string());
            None
        }
    }
}

/// Settings that are read from an object of a document.
pub trait Section: Default {
    /// The settings; what the object leaves out is the default.
    fn read_fields(object: &mut Object<'_>) -> Self;

    /// The settings of an object that has no other fields.
    fn read(field: &Field<'_>) -> Self {
        let Some(mut object) = field.object() else {
            return Self::default();
        };
        let section = Self::read_fields(&mut object);
        object.finish();
        section
    }
}

/// Makes enumerations of words to types of settings.
#[macro_export]
macro_rules! words {
    ($($name:ty),* $(,)?) => {$(
        impl $crate::parsing::settings::Setting for $name {
            fn read(
                field: &$crate::parsing::reader::Field<'_>,
                _: &$crate::parsing::settings::NumberLimits,
            ) -> Option<Self> {
                $crate::parsing::settings::word(field)
            }
        }
    )*};
}

/// Makes a section of settings from its fields, each `name: type = default`, where numbers have
/// limits followed by `from` the least, `above` a number that is excluded, and `to` the largest.
/// `unless` names a function that says what is wrong with a value all the same.
///
/// ```
/// greybox_numerics::settings! {
///     /// How long is waited.
///     pub struct Waiting {
///         /// For how long `[s]`.
///         length_s: f64 = 1.5, above 0, to 60;
///         /// How often.
///         times: u32 = 3, from 1, to 10;
///     }
/// }
/// use greybox_numerics::parsing::reader::{Faults, Field};
/// use greybox_numerics::parsing::settings::Section;
///
/// let (document, faults) = (serde_json::json!({"times": 11}), Faults::default());
/// let waiting = Waiting::read(&Field::root(&document, &faults));
/// assert_eq!(waiting.length_s, 1.5);
/// assert_eq!(&*faults.into_vec()[0].detail, "11 is outside 1 to 10");
/// ```
#[macro_export]
macro_rules! settings {
    (
        $(#[$about:meta])*
        pub struct $name:ident {$(
            $(#[$about_field:meta])*
            $field:ident: $type:ty = $default:expr
            $(, from $from:tt)? $(, above $above:tt)? $(, to $to:tt)? $(, unless $unless:path)?;
        )*}
    ) => {
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize, utoipa::ToSchema)]
        #[serde(default, deny_unknown_fields)]
        $(#[$about])*
        pub struct $name {$(
            $(#[$about_field])*
            $(#[schema(minimum = $from)])?
            $(#[schema(exclusive_minimum = $above)])?
            $(#[schema(maximum = $to)])?
            pub $field: $type,
        )*}

        impl Default for $name {
            fn default() -> Self {
                Self {$($field: $default,)*}
            }
        }

        impl $crate::parsing::settings::Section for $name {
            fn read_fields(object: &mut $crate::parsing::reader::Object<'_>) -> Self {
                let mut section = Self::default();
                $(
                    let limits = $crate::parsing::settings::NumberLimits {
                        from: None$(.or($crate::parsing::settings::limit($from)))?,
                        above: None$(.or($crate::parsing::settings::limit($above)))?,
                        to: None$(.or($crate::parsing::settings::limit($to)))?,
                    };
                    let field = object.optional(stringify!($field));
                    let value = field.as_ref().and_then(|field| {
                        $crate::parsing::settings::Setting::read(field, &limits)
                    });
                    if let Some(value) = value {
                        $(
                            if let (Some(field), Some(detail)) = (&field, $unless(&value)) {
                                field.fault("out_of_range", detail);
                            }
                        )?
                        section.$field = value;
                    }
                )*
                section
            }
        }
    };
}
