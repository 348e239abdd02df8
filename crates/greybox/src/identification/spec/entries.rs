//! Lists of a specification, whose entries are limited in number.

use greybox_numerics::parsing::reader::Field;

/// The entries of a list. A list of more than `most` is a fault and answers nothing.
pub(super) fn at_most<'v>(
    field: &Field<'v>,
    most: usize,
    noun: &str,
) -> Option<impl ExactSizeIterator<Item = Field<'v>> + use<'v>> {
    let entries = field.array()?;
    if entries.len() > most {
        field.fault("out_of_range", too_many(entries.len(), most, noun));
        return None;
    }
    Some(entries)
}

/// The first entries of a list, `most` of them; more are a fault.
pub(super) fn first<'v>(
    field: &Field<'v>,
    most: usize,
    noun: &str,
) -> impl Iterator<Item = Field<'v>> + use<'v> {
    let entries = field.array();
    let count = entries.as_ref().map_or(0, ExactSizeIterator::len);
    if count > most {
        field.fault("too_many", too_many(count, most, noun));
    }
    entries.into_iter().flatten().take(most)
}

fn too_many(count: usize, most: usize, noun: &str) -> String {
    format!("{count} {noun} are more than {most}")
}
