//! The values of a statement, as both databases take them.

use sqlx::error::BoxDynError;
use sqlx::{Arguments, Database, Encode, Type};

/// A value, or none of its type: PostgreSQL wants to know the type of what is not there.
#[derive(Clone, Debug)]
pub(in crate::store) enum Value {
    Boolean(Option<bool>),
    Integer(Option<i64>),
    Real(Option<f64>),
    Text(Option<String>),
    Bytes(Option<Vec<u8>>),
}

/// The values of a statement in the order of their places.
pub(super) fn arguments<DB>(values: Vec<Value>) -> Result<DB::Arguments, BoxDynError>
where
    DB: Database,
    for<'q> Option<bool>: Encode<'q, DB> + Type<DB>,
    for<'q> Option<i64>: Encode<'q, DB> + Type<DB>,
    for<'q> Option<f64>: Encode<'q, DB> + Type<DB>,
    for<'q> Option<String>: Encode<'q, DB> + Type<DB>,
    for<'q> Option<Vec<u8>>: Encode<'q, DB> + Type<DB>,
{
    let mut arguments = DB::Arguments::default();
    for value in values {
        match value {
            Value::Boolean(value) => arguments.add(value)?,
            Value::Integer(value) => arguments.add(value)?,
            Value::Real(value) => arguments.add(value)?,
            Value::Text(value) => arguments.add(value)?,
            Value::Bytes(value) => arguments.add(value)?,
        }
    }
    Ok(arguments)
}

/// How a type becomes a value, and how none of it does.
macro_rules! values {
    ($($type:ty => $variant:ident, $into:expr;)*) => {$(
        impl From<$type> for Value {
            fn from(value: $type) -> Self {
                Self::$variant(Some($into(value)))
            }
        }

        impl From<Option<$type>> for Value {
            fn from(value: Option<$type>) -> Self {
                Self::$variant(value.map($into))
            }
        }
    )*};
}

values! {
    bool => Boolean, std::convert::identity;
    i64 => Integer, std::convert::identity;
    i32 => Integer, i64::from;
    u32 => Integer, i64::from;
    u16 => Integer, i64::from;
    f64 => Real, std::convert::identity;
    String => Text, std::convert::identity;
    &String => Text, Clone::clone;
    &str => Text, str::to_owned;
    Vec<u8> => Bytes, std::convert::identity;
    &Vec<u8> => Bytes, Clone::clone;
    &[u8] => Bytes, <[u8]>::to_vec;
}

impl From<&Option<String>> for Value {
    fn from(value: &Option<String>) -> Self {
        Self::Text(value.clone())
    }
}
