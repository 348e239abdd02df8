//! The values of a record: its own fields, and those of objects within it.

use super::super::super::cell::Cell;
use super::super::super::csv::ValueColumns;
use super::super::super::value;
use super::super::leaf::{Fields, JsonLeaf};
use super::instants;
use super::keys::{is_any, is_called};
use super::naming::{is_holder, is_label};
use std::borrow::Cow;

/// Keys of values beside those of tables, in small letters without signs.
const VALUES: [&str; 4] = ["state", "y", "doublevalue", "integervalue"];

/// Keys of objects that say something about values and hold none.
const NOTES: [&str; 5] = ["attributes", "metadata", "meta", "context", "units"];

/// A value of a record.
pub(super) struct MeasuredValue<'f> {
    /// The key of the value, behind those of the objects that it stands in.
    pub(super) key: Cow<'f, str>,
    pub(super) value: Cell<'f>,
    pub(super) unit: Option<&'f str>,
    pub(super) quality: Option<&'f JsonLeaf>,
    /// The value stands in an object of its own.
    pub(super) is_nested: bool,
}

impl MeasuredValue<'_> {
    /// Whether the value is a number, or a text that is one.
    pub(super) fn is_number(&self) -> bool {
        match &self.value {
            Cell::Integer(_) | Cell::Number(_) | Cell::Bool(_) => true,
            Cell::Text(text) => value::number(text.trim(), None).is_some(),
            _ => false,
        }
    }

    /// The text of a value that is neither a number nor an instant.
    pub(super) fn word(&self) -> Option<&str> {
        match &self.value {
            Cell::Text(text) if !self.is_number() && !instants::is_instant_text(text) => Some(text),
            _ => None,
        }
    }
}

/// Where an object has a value, what is said of it, and how good it is.
pub(super) struct ValueFields<'f> {
    pub(super) key: &'f str,
    leaf: &'f JsonLeaf,
    pub(super) unit: Option<&'f str>,
    pub(super) quality: Option<&'f JsonLeaf>,
}

impl<'f> ValueFields<'f> {
    /// The value of an object by the names of its fields, but for the field of its time.
    pub(super) fn of(fields: &'f Fields, time: Option<&str>) -> Option<Self> {
        Self::at(fields, columns_of(fields, time))
    }

    /// The value of an object in these columns of its fields.
    pub(super) fn at(fields: &'f Fields, columns: ValueColumns) -> Option<Self> {
        let leaf = |place: usize| fields.0.get(place).map(|(_, leaf)| leaf);
        let place = columns.value?;
        let quality = columns.quality.filter(|(quality, _)| *quality != place);
        Some(Self {
            key: fields.0.get(place).map(|(key, _)| &**key)?,
            leaf: leaf(place)?,
            unit: columns
                .unit
                .and_then(leaf)
                .or_else(|| unit_beside(fields))
                .and_then(JsonLeaf::as_text),
            quality: quality.and_then(|(place, _)| leaf(place)),
        })
    }

    /// Whether neither a unit nor a quality is said of the value.
    pub(super) fn says_nothing(&self) -> bool {
        self.unit.is_none() && self.quality.is_none()
    }

    /// Whether an object has no numbers but the value, its time and its quality.
    pub(super) fn is_alone(&self, fields: &Fields, time: &str) -> bool {
        let is_quality = |leaf: &JsonLeaf| {
            self.quality
                .is_some_and(|quality| std::ptr::eq(quality, leaf))
        };
        let mut beside = fields.0.iter().filter(|(key, leaf)| {
            **key != *self.key && **key != *time && !is_quality(leaf) && !instants::is_instant(leaf)
        });
        beside.all(|(_, leaf)| !matches!(leaf, JsonLeaf::Integer(_) | JsonLeaf::Number(_)))
    }

    /// The value, where it is none of several.
    pub(super) fn measured(self) -> Option<MeasuredValue<'f>> {
        Some(MeasuredValue {
            key: Cow::Borrowed(self.key),
            value: scalar(self.leaf)?,
            unit: self.unit,
            quality: self.quality,
            is_nested: false,
        })
    }
}

/// Where among the fields of an object its value stands by the names of all, but for that of its time.
pub(super) fn columns_of(fields: &Fields, time: Option<&str>) -> ValueColumns {
    let keys = fields.0.iter().map(|(key, _)| &**key);
    let keys = keys.map(|key| if Some(key) == time { "" } else { key });
    let keys: Vec<&str> = keys.collect();
    let mut columns = ValueColumns::of(&keys);
    let named = || keys.iter().position(|key| is_any(key, &VALUES));
    columns.value = columns.value.or_else(named);
    columns
}

/// The unit that Home Assistant has among the attributes of a state.
fn unit_beside(fields: &Fields) -> Option<&JsonLeaf> {
    match fields.get("attributes")? {
        JsonLeaf::Object(attributes) => attributes.get("unit_of_measurement"),
        _ => None,
    }
}

/// The one scalar of an object that says of which type it is.
fn typed(object: &Fields) -> Option<(&str, &JsonLeaf)> {
    let is_value =
        |key: &str| key.to_lowercase().ends_with("value") || key.starts_with('$') || key == "v";
    match &object.0[..] {
        [(key, leaf)] if is_value(key) && leaf.is_scalar() => Some((key, leaf)),
        _ => None,
    }
}

/// The value that a leaf is: itself, or the one of an object that says of which type it is.
pub(super) fn scalar(leaf: &JsonLeaf) -> Option<Cell<'_>> {
    let JsonLeaf::Object(object) = leaf else {
        return leaf.is_scalar().then(|| leaf.cell());
    };
    let (key, leaf) = typed(object)?;
    Some(match is_called(key, "nullvalue") {
        true => Cell::Empty,
        false => leaf.cell(),
    })
}

/// The value that a leaf is, as a leaf of its own.
pub(super) fn scalar_leaf(leaf: &JsonLeaf) -> Option<JsonLeaf> {
    let JsonLeaf::Object(object) = leaf else {
        return leaf.is_scalar().then(|| leaf.clone());
    };
    let (key, leaf) = typed(object)?;
    Some(match is_called(key, "nullvalue") {
        true => JsonLeaf::Null,
        false => leaf.clone(),
    })
}

/// All values of a record but its time and its names, in the order of the record.
pub(super) fn values_of<'f>(
    fields: &'f Fields,
    is_apart: &dyn Fn(&str) -> bool,
) -> Vec<MeasuredValue<'f>> {
    let mut values = Vec::with_capacity(fields.0.len());
    collect(fields, "", is_apart, &mut values);
    values
}

fn collect<'f>(
    fields: &'f Fields,
    within: &str,
    is_apart: &dyn Fn(&str) -> bool,
    values: &mut Vec<MeasuredValue<'f>>,
) {
    for (key, leaf) in fields.0.iter().filter(|(key, _)| !is_apart(key)) {
        let name = match within {
            "" => Cow::Borrowed(&**key),
            within => Cow::Owned(format!("{within}.{key}")),
        };
        let JsonLeaf::Object(object) = leaf else {
            values.push(MeasuredValue {
                key: name,
                value: leaf.cell(),
                unit: None,
                quality: None,
                is_nested: false,
            });
            continue;
        };
        let measured = || {
            let told = ValueFields::of(object, None)?;
            told.is_alone(object, "").then(|| told.measured())?
        };
        if let Some(cell) = scalar(leaf) {
            values.push(MeasuredValue {
                key: name,
                value: cell,
                unit: None,
                quality: None,
                is_nested: true,
            });
        } else if let Some(measured) = measured() {
            values.push(MeasuredValue {
                key: name,
                is_nested: true,
                ..measured
            });
        } else if is_holder(key) {
            nest(object, within, is_apart, values);
        } else if !is_label(key) && !is_any(key, &NOTES) && instants::of_parts(object).is_none() {
            nest(object, &name, is_apart, values);
        }
    }
}

fn nest<'f>(
    object: &'f Fields,
    within: &str,
    is_apart: &dyn Fn(&str) -> bool,
    values: &mut Vec<MeasuredValue<'f>>,
) {
    let before = values.len();
    collect(object, within, is_apart, values);
    values
        .iter_mut()
        .skip(before)
        .for_each(|value| value.is_nested = true);
}
