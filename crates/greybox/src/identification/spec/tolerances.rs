//! The `tolerances` section: how well what a model document takes as exact is known.

use super::outputs::tolerance;
use greybox_numerics::parsing::reader::Field;
use greybox_simulation::model::Tolerance;
use std::collections::BTreeMap;

/// The numbers that are named at the most.
const MOST_NUMBERS: usize = 256;

/// The tolerance of each number; which numbers there are is known when the problem is assembled.
pub(super) fn read(field: &Field<'_>) -> BTreeMap<String, Tolerance> {
    let Some(object) = field.object() else {
        return BTreeMap::new();
    };
    if object.n_entries() > MOST_NUMBERS {
        let detail = format!("{} numbers: {MOST_NUMBERS} at the most", object.n_entries());
        field.fault("out_of_range", detail);
    }
    let entries = object.entries().take(MOST_NUMBERS);
    let read = |(name, field): (&str, Field<'_>)| Some((name.to_owned(), tolerance(Some(field))?));
    entries.filter_map(read).collect()
}
