//! What stands behind a time for its zone: an offset, or letters.

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

/// A text as a date and time and what stands behind it for a zone.
pub(super) fn split(text: &str) -> (&str, Option<&str>) {
    let glued = || {
        let stamp = text.strip_suffix('Z')?;
        stamp
            .ends_with(|c: char| c.is_ascii_digit())
            .then_some((stamp, "Z"))
    };
    let is_zone = |word: &str| {
        let letters =
            (1..=5).contains(&word.len()) && word.bytes().all(|byte| byte.is_ascii_uppercase());
        (letters && !["AM", "PM"].contains(&word)) || numeric(word).is_some()
    };
    let behind = text.rsplit_once(' ').filter(|(_, word)| is_zone(word));
    match behind.or_else(glued) {
        Some((stamp, zone)) => (stamp.trim_end(), Some(zone)),
        None => (text, None),
    }
}

/// The seconds that a zone is ahead of UTC; none where its letters are those of several zones.
pub(super) fn offset(zone: &str) -> Option<i32> {
    let lettered = HOURS.iter().find(|(letters, _)| *letters == zone);
    lettered
        .map(|(_, hours)| hours * 3600)
        .or_else(|| numeric(zone))
}

/// The seconds of `+01:00` and `-0530`.
fn numeric(text: &str) -> Option<i32> {
    let (sign, digits) = match text.split_at_checked(1)? {
        ("+", digits) => (1, digits),
        ("-", digits) => (-1, digits),
        _ => return None,
    };
    let digits = digits.replace(':', "");
    let is_offset = digits.len() == 4 && digits.bytes().all(|byte| byte.is_ascii_digit());
    let number: i32 = digits.parse().ok().filter(|_| is_offset)?;
    Some(sign * (number / 100 * 3600 + number % 100 * 60))
}
