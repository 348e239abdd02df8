//! Units of tags in a table above that of the samples: the section `[Tags]` of Proficy.

use super::super::error::at_line;
use super::super::tags::Tags;
use super::fields::line_of;
use super::top_rows::fields_of;
use ::csv::ByteRecord;

/// Titles of the column of tags, in small letters.
const TAGS: [&str; 3] = ["tagname", "tag name", "tag"];

/// Titles of the column of units, in small letters.
const UNITS: [&str; 4] = ["engineeringunits", "engineering units", "engunits", "units"];

/// Gives tags the units that a table among the rows above the samples has for them.
pub(super) fn describe(tags: &mut Tags<'_>, above: &[ByteRecord]) {
    let rows: Vec<Vec<String>> = above.iter().map(fields_of).collect();
    let column = |row: &[String], names: &[&str]| {
        let mut titles = row.iter().map(|title| title.to_lowercase());
        titles.position(|title| names.contains(&title.as_str()))
    };
    let columns =
        |(k, row): (usize, &Vec<String>)| Some((k, column(row, &TAGS)?, column(row, &UNITS)?));
    let Some((titles, name, unit)) = rows.iter().enumerate().find_map(columns) else {
        return;
    };
    let described = rows.iter().zip(above).skip(titles + 1);
    for (row, record) in described.take_while(|(row, _)| row.len() > 1) {
        let place = |code, detail| at_line(line_of(record), None, code, detail);
        let tag = row.get(name).and_then(|name| tags.of_key(name));
        if let (Some(tag), Some(unit)) = (tag, row.get(unit)) {
            tags.describe(tag, Some(unit), None, &place);
        }
    }
}
