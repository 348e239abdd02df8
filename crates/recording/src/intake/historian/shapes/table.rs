//! Tables within a document: the names of their columns, and their rows.

use super::super::leaf::{Fields, JsonLeaf};
use super::super::walk::PathStep;
use super::instants;
use super::keys::{is_any, is_called};
use super::measured::scalar_leaf;
use std::rc::Rc;

/// Keys of lists of columns, and of the name of one, in small letters without signs.
const COLUMNS: [&str; 4] = ["columns", "columninfo", "fields", "schema"];
const COLUMN_NAMES: [&str; 4] = ["columnname", "name", "text", "id"];

/// The columns of the rows of a list.
pub(super) struct TableHeader {
    /// The path of the list.
    pub(super) list: Vec<PathStep>,
    pub(super) names: Vec<Rc<str>>,
}

/// Which of the two cells of a pair is the time.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct PairOrder {
    /// The path of the list of the pairs.
    pub(super) list: Vec<PathStep>,
    pub(super) time: usize,
    /// The time is known by its look: each time of the list is an instant.
    pub(super) are_instants: bool,
}

/// The names of the columns of which an object tells, two at the least.
pub(super) fn columns_of(fields: &Fields) -> Option<Vec<Rc<str>>> {
    let mut told = fields.0.iter().filter(|(key, _)| is_any(key, &COLUMNS));
    told.find_map(|(_, leaf)| match leaf {
        JsonLeaf::Object(schema) => columns_of(schema),
        JsonLeaf::List(columns) if columns.len() > 1 => columns.iter().map(column_name).collect(),
        _ => None,
    })
}

fn column_name(column: &JsonLeaf) -> Option<Rc<str>> {
    match column {
        JsonLeaf::Text(name) => Some(name.as_str().into()),
        JsonLeaf::Object(column) => COLUMN_NAMES.iter().find_map(|name| {
            let mut fields = column.0.iter().filter(|(key, _)| is_called(key, name));
            fields.find_map(|(_, leaf)| Some(leaf.text()?.as_str().into()))
        }),
        _ => None,
    }
}

/// The names of columns that a row of titles has.
pub(super) fn titles(cells: &[JsonLeaf]) -> Option<Vec<Rc<str>>> {
    let title = |cell: &JsonLeaf| match cell {
        JsonLeaf::Text(text) if text.parse::<f64>().is_err() && !instants::is_instant(cell) => {
            Some(text.as_str().into())
        }
        _ => None,
    };
    cells
        .iter()
        .map(title)
        .collect::<Option<Vec<Rc<str>>>>()
        .filter(|titles| titles.len() > 1)
}

/// The cells of a row: a list of scalars, or an object of one list of objects of one scalar each.
pub(super) fn cells_of(row: &JsonLeaf) -> Option<Vec<JsonLeaf>> {
    match row {
        JsonLeaf::List(cells) => cells.iter().map(scalar_leaf).collect(),
        JsonLeaf::Object(object) => match &object.0[..] {
            [(_, JsonLeaf::List(cells))] => cells.iter().map(scalar_leaf).collect(),
            _ => None,
        },
        _ => None,
    }
}

/// A row with the names of its columns. None where it has another number of cells.
pub(super) fn named_row(names: &[Rc<str>], cells: &[JsonLeaf]) -> Option<Fields> {
    let cells = (names.len() == cells.len()).then_some(cells)?;
    let named = names.iter().map(Rc::clone).zip(cells.iter().cloned());
    Some(Fields(named.collect()))
}

impl PairOrder {
    /// The order of the pairs that begin with this one, under this key. A sentence where there are two ways to read
    /// the pair, none where the pair is no sample.
    pub(super) fn of(
        key: &str,
        pair: &[JsonLeaf],
        list: &[PathStep],
    ) -> Option<Result<Self, String>> {
        let [first, second] = pair else {
            return None;
        };
        let is_number = |leaf: &JsonLeaf| {
            let is_text = matches!(leaf, JsonLeaf::Text(text) if text.parse::<f64>().is_err());
            leaf.is_scalar() && !is_text
        };
        let by_look = (instants::is_instant(first), instants::is_instant(second));
        let (time, are_instants) = match by_look {
            (true, false) => (0, true),
            (false, true) => (1, true),
            (both, _) if is_called(key, "datapoints") => (1, both),
            (both, _) if is_called(key, "values") => (0, both),
            (true, true) => {
                let detail = "both numbers of a pair may be its time: send objects such as \
                              {\"time\": …, \"value\": …}";
                return Some(Err(detail.to_owned()));
            }
            (false, false) => return None,
        };
        if !(are_instants || is_number(first) && is_number(second)) {
            return None;
        }
        Some(Ok(Self {
            list: list.to_vec(),
            time,
            are_instants,
        }))
    }
}
