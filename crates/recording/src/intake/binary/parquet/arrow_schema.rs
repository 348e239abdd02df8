//! The schema that Arrow's writers (pyarrow, pandas, polars) keep in the metadata of a Parquet file: units of columns,
//! and columns of durations, which Parquet has no type for.
//!
//! The schema is a message of Flatbuffers. Offsets are followed within the bytes alone, a fixed number of steps deep.
//!
//! Source: <https://arrow.apache.org/docs/format/Columnar.html>, `Schema.fbs` and `Message.fbs` of Arrow;
//! <https://flatbuffers.dev/internals/> for how a table lies in its bytes.

use crate::MAX_SIGNALS;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use parquet::file::metadata::FileMetaData;

/// The key of the schema in the metadata of a file.
const KEY: &str = "ARROW:schema";
/// Marks a message behind which its length follows.
const CONTINUATION: &[u8] = &[0xff; 4];
/// Fields of tables by their places: of a message, of a schema, of a field, of a pair of texts, of a duration.
const MESSAGE_HEADER: usize = 2;
const SCHEMA_FIELDS: usize = 1;
const FIELD_NAME: usize = 0;
const FIELD_TYPE_KIND: usize = 2;
const FIELD_TYPE: usize = 3;
const FIELD_METADATA: usize = 6;
const PAIR_KEY: usize = 0;
const PAIR_VALUE: usize = 1;
const DURATION_UNIT: usize = 0;
/// The kind of type that counts durations.
const DURATION: u8 = 18;
/// The unit of durations that a table leaves out: milliseconds.
const USUAL_UNIT: u8 = 1;
/// The columns that are looked at, and the remarks on each, at the most.
const MOST_FIELDS: usize = 2 * MAX_SIGNALS;
const MOST_PAIRS: usize = 100;
/// The bytes of a text at the most: the offsets of many fields may lead to one text.
const LONGEST_TEXT: usize = 1000;
/// Names of the metadata of a field that say its unit.
const UNIT_KEYS: [&str; 6] = [
    "unit",
    "units",
    "uom",
    "unit_of_measure",
    "engineering_unit",
    "engunits",
];

/// A column as the schema describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ArrowField {
    pub(super) name: String,
    /// The unit in the metadata of the field; nothing where there is none.
    pub(super) unit: String,
    /// The nanoseconds of a count of durations.
    pub(super) duration: Option<i64>,
}

/// The columns that the metadata of a file describes; none where there is no such schema.
pub(super) fn fields(metadata: &FileMetaData) -> Vec<ArrowField> {
    let pairs = metadata.key_value_metadata().into_iter().flatten();
    let mut texts = pairs
        .filter(|pair| pair.key == KEY)
        .filter_map(|pair| pair.value.as_ref());
    let decoded = texts.next().and_then(|text| STANDARD.decode(text).ok());
    decoded
        .and_then(|bytes| described(&bytes))
        .unwrap_or_default()
}

fn described(bytes: &[u8]) -> Option<Vec<ArrowField>> {
    let message = bytes.strip_prefix(CONTINUATION).unwrap_or(bytes);
    // The length of the message stands before it.
    let message = message.get(4..)?;
    let schema = BufferTable::root(message)?.table(MESSAGE_HEADER)?;
    let fields = schema.tables(SCHEMA_FIELDS)?;
    Some(fields.take(MOST_FIELDS).filter_map(field).collect())
}

fn field(field: BufferTable<'_>) -> Option<ArrowField> {
    let pairs = field.tables(FIELD_METADATA).into_iter().flatten();
    let mut pairs = pairs.take(MOST_PAIRS);
    let unit = pairs.find_map(|pair| {
        let key = pair.text(PAIR_KEY)?.to_lowercase();
        let value = pair.text(PAIR_VALUE)?.trim();
        UNIT_KEYS.contains(&key.as_str()).then_some(value)
    });
    let is_duration = field.byte(FIELD_TYPE_KIND) == Some(DURATION);
    let nanoseconds = || {
        let unit = field
            .table(FIELD_TYPE)?
            .byte(DURATION_UNIT)
            .unwrap_or(USUAL_UNIT);
        [1_000_000_000, 1_000_000, 1_000, 1]
            .get(usize::from(unit))
            .copied()
    };
    Some(ArrowField {
        name: field.text(FIELD_NAME)?.to_owned(),
        unit: unit.unwrap_or_default().to_owned(),
        duration: if is_duration { nanoseconds() } else { None },
    })
}

/// A table of Flatbuffers.
#[derive(Clone, Copy)]
struct BufferTable<'b> {
    bytes: &'b [u8],
    /// Where the table begins.
    begin: usize,
}

impl<'b> BufferTable<'b> {
    /// The table at which a buffer begins.
    fn root(bytes: &'b [u8]) -> Option<Self> {
        Some(Self {
            bytes,
            begin: follow(bytes, 0)?,
        })
    }

    /// Where a field of the table stands; nothing where it is left out.
    fn place(&self, field: usize) -> Option<usize> {
        let back = i32::from_le_bytes(*array(self.bytes, self.begin)?);
        let places = self
            .begin
            .checked_add_signed((-i64::from(back)).try_into().ok()?)?;
        let length = usize::from(u16::from_le_bytes(*array(self.bytes, places)?));
        let entry = 4 + 2 * field;
        if entry + 2 > length {
            return None;
        }
        let offset = u16::from_le_bytes(*array(self.bytes, places.checked_add(entry)?)?);
        (offset > 0).then_some(self.begin + usize::from(offset))
    }

    fn byte(&self, field: usize) -> Option<u8> {
        self.bytes.get(self.place(field)?).copied()
    }

    fn table(&self, field: usize) -> Option<BufferTable<'b>> {
        let begin = follow(self.bytes, self.place(field)?)?;
        Some(BufferTable { begin, ..*self })
    }

    fn text(&self, field: usize) -> Option<&'b str> {
        let begin = follow(self.bytes, self.place(field)?)?;
        let length = usize::try_from(u32::from_le_bytes(*array(self.bytes, begin)?)).ok()?;
        let text = self.bytes.get(begin + 4..)?.get(..length)?;
        let text = (length <= LONGEST_TEXT).then_some(text)?;
        std::str::from_utf8(text).ok()
    }

    /// The tables of a list.
    fn tables(&self, field: usize) -> Option<impl Iterator<Item = BufferTable<'b>> + use<'b>> {
        let bytes = self.bytes;
        let begin = follow(bytes, self.place(field)?)?;
        let length = u32::from_le_bytes(*array(bytes, begin)?);
        let (offsets, _) = bytes.get(begin + 4..)?.as_chunks::<4>();
        let offsets = offsets.get(..usize::try_from(length).ok()?)?;
        let places = (0..offsets.len()).map(move |k| begin + 4 + 4 * k);
        Some(places.filter_map(move |place| {
            let begin = follow(bytes, place)?;
            Some(BufferTable { bytes, begin })
        }))
    }
}

/// Where the offset at a place leads.
fn follow(bytes: &[u8], place: usize) -> Option<usize> {
    let offset = u32::from_le_bytes(*array(bytes, place)?);
    place.checked_add(usize::try_from(offset).ok()?)
}

/// The bytes of a number at a place.
fn array<const N: usize>(bytes: &[u8], place: usize) -> Option<&[u8; N]> {
    bytes.get(place..)?.first_chunk()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The schema that pyarrow 26.0.1 writes for four columns, two of durations and two with a unit.
    const WRITTEN_BY_PYARROW: &str = "\
        /////6ABAAAQAAAAAAAKAAwABgAFAAgACgAAAAABBAAMAAAACAAIAAAABAAIAAAABAAAAAQAAAA4AQAAxAAAADAAAA\
        AEAAAA6P7//wAAARIQAAAAGAAAAAQAAAAAAAAAAwAAAGxhZwAEAAQABAAAAIL///8AAAEDFAAAAGwAAAAIAAAAFAAA\
        AAAAAAAFAAAAVFQxMDIAAAACAAAAKAAAAAQAAAB0////EAAAAAQAAAADAAAAwrBDAAUAAABVbml0cwAAAJT///8QAA\
        AABAAAAAEAAAB4AAAABAAAAG5vdGUAAAYABgAEAAYAAAACABIAGAAIAAYABwAMAAAAEAAUABIAAAAAAAEDFAAAAEwA\
        AAAIAAAAFAAAAAAAAAAFAAAAUFQxMDEAAAABAAAADAAAAAgADAAEAAgACAAAABAAAAAEAAAAAwAAAGJhcgAEAAAAdW\
        5pdAAAAADC////AAACABAAFAAIAAYABwAMAAAAEAAQAAAAAAABEhAAAAAgAAAABAAAAAAAAAAHAAAAZWxhcHNlZAAA\
        AAYACAAGAAYAAAAAAAIAAAAAAA==";

    fn decoded() -> Vec<u8> {
        STANDARD.decode(WRITTEN_BY_PYARROW).unwrap()
    }

    #[test]
    fn units_and_durations_are_told() {
        let column = |name: &str, unit: &str, duration| ArrowField {
            name: name.to_owned(),
            unit: unit.to_owned(),
            duration,
        };
        let described = described(&decoded()).unwrap();
        let expected = [
            column("elapsed", "", Some(1_000)),
            column("PT101", "bar", None),
            column("TT102", "°C", None),
            column("lag", "", Some(1_000_000)),
        ];
        assert_eq!(described, expected);
    }

    proptest! {
        #[test]
        fn damaged_schemas_end(place in 0_usize..600, byte: u8, length in 0_usize..700) {
            let mut bytes = decoded();
            let place = place % bytes.len();
            bytes[place] = byte;
            bytes.truncate(length);
            let _ = described(&bytes);
        }
    }
}
