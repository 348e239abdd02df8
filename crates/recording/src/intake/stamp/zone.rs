//! What stands behind a time for its zone: an offset, or letters.

use super::date::month;
use crate::intake::offset;

/// Letters that one zone has, with the hours that it is ahead of UTC.
const HOURS: [(&str, i32); 13] = [
    ("UTC", 0),
    ("UT", 0),
    ("GMT", 0),
    ("Z", 0),
    ("WET", 0),
    ("WEST", 1),
    ("CET", 1),
    ("MEZ", 1),
    ("CEST", 2),
    ("MESZ", 2),
    ("EET", 2),
    ("EEST", 3),
    ("MSK", 3),
];

/// A zone as a text names it.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum WrittenZone {
    /// A number of seconds ahead of UTC.
    Ahead(i32),
    /// Letters that several zones share.
    Letters(String),
}

impl WrittenZone {
    /// The zone that all words name; none where they name different ones.
    pub(super) fn of(words: &[&str]) -> Option<Self> {
        let mut offsets = words.iter().filter_map(|word| ahead(word));
        match (offsets.next(), words) {
            (Some(first), _) => offsets
                .all(|offset| offset == first)
                .then_some(Self::Ahead(first)),
            (None, [letters]) => Some(Self::Letters((*letters).to_owned())),
            (None, _) => None,
        }
    }
}

/// Whether a word names a zone.
pub(super) fn is_zone(word: &str) -> bool {
    let letters =
        (1..=5).contains(&word.len()) && word.bytes().all(|byte| byte.is_ascii_uppercase());
    let is_month = word.len() == 3 && month(word).is_some();
    letters && !["AM", "PM"].contains(&word) && !is_month || numeric(word).is_some()
}

/// A time and the zone that stands at its end without a blank: `08:15:00Z`, `08:15:00+01:00`.
pub(super) fn split(time: &str) -> (&str, Option<&str>) {
    let end = match time.strip_suffix('Z') {
        Some(time) => Some(time.len()),
        None => time.find(['+', '-']).filter(|end| *end > 0),
    };
    match end.and_then(|end| time.split_at_checked(end)) {
        Some((time, zone)) => (time, Some(zone)),
        None => (time, None),
    }
}

/// The seconds that a zone is ahead of UTC; none where its letters are those of several zones.
pub(super) fn ahead(zone: &str) -> Option<i32> {
    let lettered = HOURS.iter().find(|(letters, _)| *letters == zone);
    lettered
        .map(|(_, hours)| hours * 3600)
        .or_else(|| numeric(zone))
}

/// The seconds of `+01:00`, `-0530` and `GMT+0100`.
fn numeric(text: &str) -> Option<i32> {
    let behind = text.strip_prefix("GMT").or(text.strip_prefix("UTC"));
    offset::seconds(behind.unwrap_or(text))
}
