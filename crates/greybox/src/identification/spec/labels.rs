//! The `labels` section and other short texts.

use std::collections::BTreeMap;

use greybox_numerics::parsing::reader::{Field, Object};

/// The labels of one job at the most.
pub const MAX_LABELS: usize = 16;
/// The characters of a name or a label at the most.
pub const MAX_NAME_CHARS: usize = 200;
/// The characters of a note at the most.
pub const MAX_NOTE_CHARS: usize = 4000;

/// PostgreSQL stores no such text, so no database does.
const NO_NUL: &str = "a text has no NUL character";

/// What a job is called.
pub(super) struct WordsOfSpec {
    pub(super) name: Option<String>,
    pub(super) labels: BTreeMap<String, String>,
    pub(super) note: Option<String>,
}

impl WordsOfSpec {
    pub(super) fn read(root: &mut Object<'_>) -> Self {
        let labels = root.optional("labels");
        Self {
            name: root.optional("name").and_then(|field| name(&field)),
            labels: labels.map_or_else(BTreeMap::new, |field| read(&field)),
            note: root.optional("note").and_then(|field| note(&field)),
        }
    }
}

/// The labels; faults where there are too many, or one is too long.
fn read(field: &Field<'_>) -> BTreeMap<String, String> {
    let Some(object) = field.object() else {
        return BTreeMap::new();
    };
    if object.n_entries() > MAX_LABELS {
        let detail = format!("{} labels are more than {MAX_LABELS}", object.n_entries());
        field.fault("too_many", detail);
    }
    let labels = object.entries().filter_map(|(key, value)| {
        let text = label(key, &value)?;
        Some((key.to_owned(), text))
    });
    labels.collect()
}

/// The text of the label `key`.
pub fn label(key: &str, value: &Field<'_>) -> Option<String> {
    if key.is_empty() || key.chars().count() > MAX_NAME_CHARS {
        let detail = format!("a label's name has 1 to {MAX_NAME_CHARS} characters");
        value.fault("out_of_range", detail);
    }
    if key.contains('\0') {
        value.fault("out_of_range", NO_NUL);
    }
    short_text(value).map(str::to_owned)
}

/// A name for people: a text of at most [`MAX_NAME_CHARS`] characters.
pub fn name(field: &Field<'_>) -> Option<String> {
    short_text(field).map(str::to_owned)
}

/// What people should know: a text of at most [`MAX_NOTE_CHARS`] characters.
pub fn note(field: &Field<'_>) -> Option<String> {
    bounded_text(field, MAX_NOTE_CHARS).map(str::to_owned)
}

/// A text of at most [`MAX_NAME_CHARS`] characters.
pub(super) fn short_text<'v>(field: &Field<'v>) -> Option<&'v str> {
    bounded_text(field, MAX_NAME_CHARS)
}

fn bounded_text<'v>(field: &Field<'v>, most: usize) -> Option<&'v str> {
    let text = field.text()?;
    let length = text.chars().count();
    if length > most {
        let detail = format!("{length} characters are more than {most}");
        field.fault("too_long", detail);
        return None;
    }
    if text.contains('\0') {
        field.fault("out_of_range", NO_NUL);
        return None;
    }
    Some(text)
}
