//! The `labels` section and other short texts.

use std::collections::BTreeMap;

use greybox_numerics::parsing::reader::Field;

/// The labels of one job at the most.
pub const MAX_LABELS: usize = 16;
/// The characters of a name or a label at the most.
pub const MAX_NAME_CHARS: usize = 200;

/// PostgreSQL stores no such text, so no database does.
const NO_NUL: &str = "a text has no NUL character";

/// The labels; faults where there are too many, or one is too long.
pub(super) fn read(field: &Field<'_>) -> BTreeMap<String, String> {
    let Some(object) = field.object() else {
        return BTreeMap::new();
    };
    if object.n_entries() > MAX_LABELS {
        let detail = format!("{} labels are more than {MAX_LABELS}", object.n_entries());
        field.fault("too_many", detail);
    }
    let mut labels = BTreeMap::new();
    for (key, value) in object.entries() {
        if key.is_empty() || key.chars().count() > MAX_NAME_CHARS {
            let detail = format!("a label's name has 1 to {MAX_NAME_CHARS} characters");
            value.fault("out_of_range", detail);
        }
        if key.contains('\0') {
            value.fault("out_of_range", NO_NUL);
        }
        if let Some(text) = short_text(&value) {
            labels.insert(key.to_owned(), text.to_owned());
        }
    }
    labels
}

/// A name for people: a text of at most [`MAX_NAME_CHARS`] characters, where one is given.
pub(super) fn name(field: Option<Field<'_>>) -> Option<String> {
    field.and_then(|field| short_text(&field).map(str::to_owned))
}

/// A text of at most [`MAX_NAME_CHARS`] characters.
pub(super) fn short_text<'v>(field: &Field<'v>) -> Option<&'v str> {
    let text = field.text()?;
    let length = text.chars().count();
    if length > MAX_NAME_CHARS {
        let detail = format!("{length} characters are more than {MAX_NAME_CHARS}");
        field.fault("too_long", detail);
        return None;
    }
    if text.contains('\0') {
        field.fault("out_of_range", NO_NUL);
        return None;
    }
    Some(text)
}
