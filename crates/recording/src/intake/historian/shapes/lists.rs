//! Columns that stand side by side in an object, as lists or as objects by the numbers of the rows.

use super::super::super::csv::time_name_and_unit;
use super::super::leaf::{Fields, JsonLeaf};
use super::super::time_names;
use super::instants;
use super::keys::is_any;
use super::naming::is_holder;

/// Times that are looked at to see whether a list has them.
const LOOKED_AT: usize = 3;

/// Keys of lists of values that their object names, in small letters without signs.
const VALUES: [&str; 3] = ["y", "v", "value"];

/// A column.
pub(super) struct ListColumn<'f> {
    pub(super) key: &'f str,
    pub(super) leaves: Vec<&'f JsonLeaf>,
    pub(super) unit: Option<&'f str>,
}

/// The columns of an object, of which one is the time.
pub(super) struct SideBySide<'f> {
    pub(super) time: ListColumn<'f>,
    pub(super) values: Vec<ListColumn<'f>>,
}

impl<'f> SideBySide<'f> {
    /// The columns of an object, where it has a time and a value among them. `option` is the key of the time where an
    /// option names it.
    pub(super) fn of(fields: &'f Fields, option: Option<&str>) -> Option<Self> {
        let mut columns: Vec<ListColumn<'f>> = fields
            .0
            .iter()
            .filter_map(|(key, leaf)| list(key, leaf))
            .collect();
        if columns.is_empty() {
            columns = numbered(fields)?;
        }
        let keys = columns.iter().map(|column| column.key);
        let named = option.or_else(|| time_names::named(keys));
        let is_named = |column: &ListColumn<'_>| {
            Some(column.key) == named && column.may_be_time(option.is_some())
        };
        let by_name = columns.iter().position(is_named);
        let has_time = instants::time_key(fields, None).is_some();
        let by_look = || {
            columns
                .iter()
                .position(|column| !has_time && column.are_instants())
        };
        let time = columns.remove(by_name.or_else(by_look)?);
        if let Some(JsonLeaf::Object(units)) = fields.get("units") {
            for column in &mut columns {
                column.unit = units.get(column.key).and_then(JsonLeaf::as_text);
            }
        }
        columns.retain(|column| column.leaves.len() == time.leaves.len() || column.has_numbers());
        (!columns.is_empty()).then_some(Self {
            time,
            values: columns,
        })
    }

    /// Whether there is one column of values, which its object names.
    pub(super) fn is_lone_value(&self) -> bool {
        match &self.values[..] {
            [column] => is_holder(column.key) || is_any(column.key, &VALUES),
            _ => false,
        }
    }
}

impl ListColumn<'_> {
    fn are_instants(&self) -> bool {
        let mut first = self.leaves.iter().take(LOOKED_AT);
        first.all(|leaf| instants::is_instant_field(self.key, leaf))
    }

    /// Whether a column with the name of a time is one.
    fn may_be_time(&self, is_named: bool) -> bool {
        let (name, _) = time_name_and_unit(self.key);
        is_named || self.are_instants() || is_any(name, &instants::CLOCKS)
    }

    fn has_numbers(&self) -> bool {
        let is_number =
            |leaf: &&JsonLeaf| matches!(leaf, JsonLeaf::Integer(_) | JsonLeaf::Number(_));
        self.leaves.iter().any(is_number)
    }
}

/// A field that is a list of scalars.
fn list<'f>(key: &'f str, leaf: &'f JsonLeaf) -> Option<ListColumn<'f>> {
    match leaf {
        JsonLeaf::List(leaves) if !leaves.is_empty() && leaves.iter().all(JsonLeaf::is_scalar) => {
            Some(ListColumn {
                key,
                leaves: leaves.iter().collect(),
                unit: None,
            })
        }
        _ => None,
    }
}

/// The columns of an object whose fields are objects by the numbers of the same rows.
fn numbered(fields: &Fields) -> Option<Vec<ListColumn<'_>>> {
    let is_number = |key: &str| !key.is_empty() && key.bytes().all(|byte| byte.is_ascii_digit());
    let (_, JsonLeaf::Object(first)) = fields.0.first()? else {
        return None;
    };
    let are_rows = fields.0.len() > 1 && first.0.iter().all(|(key, _)| is_number(key));
    let mut columns = Vec::with_capacity(fields.0.len());
    for (key, leaf) in fields.0.iter().filter(|_| are_rows) {
        let JsonLeaf::Object(rows) = leaf else {
            return None;
        };
        let are_same = rows.0.len() == first.0.len()
            && rows
                .0
                .iter()
                .zip(&first.0)
                .all(|((row, leaf), (of_first, _))| row == of_first && leaf.is_scalar());
        columns.push(are_same.then(|| ListColumn {
            key,
            leaves: rows.0.iter().map(|(_, leaf)| leaf).collect(),
            unit: None,
        })?);
    }
    Some(columns)
}
