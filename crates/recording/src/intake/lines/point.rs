//! A line of the protocol, taken apart: the series, the fields and the stamp.
//!
//! A backslash escapes a comma or a space in a measurement, a comma, a space or `=` in the key or the value
//! of a tag and in the key of a field, and `"` or a backslash within a text. Quotes begin and end a text in
//! the value of a field alone. Source: InfluxData, *Line protocol reference*, InfluxDB 1.8 and 2.7.

use crate::intake::spread::FieldValue;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Why a line is no point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LineFault {
    /// The line is not UTF-8.
    #[error("the line is not UTF-8")]
    NotText,
    /// The line is longer than any line may be.
    #[error("the line is too long")]
    TooLong,
    /// The line begins with a comma or a space.
    #[error("missing measurement")]
    MissingMeasurement,
    /// A tag has no key.
    #[error("missing tag key")]
    MissingTagKey,
    /// A tag has no value.
    #[error("missing tag value")]
    MissingTagValue,
    /// The line has no fields.
    #[error("missing fields")]
    MissingFields,
    /// A field has no key.
    #[error("missing field key")]
    MissingFieldKey,
    /// A field has no value.
    #[error("missing field value")]
    MissingFieldValue,
    /// A text does not end.
    #[error("unbalanced quotes")]
    UnbalancedQuotes,
    /// A value is neither a number nor a text, nor true or false.
    #[error("invalid number")]
    InvalidNumber,
    /// There is no stamp.
    #[error("missing timestamp: a sample is stored with the instant at which it was taken")]
    MissingStamp,
    /// The stamp is no whole number.
    #[error("bad timestamp")]
    BadStamp,
    /// The stamp lies outside what nanoseconds since 1970 can say.
    #[error("time outside range")]
    StampOutOfRange,
}

/// Where in a line a reader is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LinePlace {
    Start,
    Comment,
    Series,
    Gap,
    FieldKey,
    FieldValue,
    Text,
    Stamp,
}

/// Follows a line byte by byte.
#[derive(Clone, Debug)]
pub(super) struct LineScanner {
    place: LinePlace,
    is_escaped: bool,
}

impl LineScanner {
    /// At the beginning of a line.
    pub(super) fn new() -> Self {
        Self::at(LinePlace::Start)
    }

    fn at(place: LinePlace) -> Self {
        Self {
            place,
            is_escaped: false,
        }
    }

    /// Whether a text has begun that has not ended.
    pub(super) fn is_in_text(&self) -> bool {
        self.place == LinePlace::Text
    }

    /// Goes on by one byte.
    pub(super) fn step(&mut self, byte: u8) {
        if std::mem::take(&mut self.is_escaped) || self.place == LinePlace::Comment {
            return;
        }
        self.place = match (self.place, byte) {
            (LinePlace::Start, b' ' | b'\t') => LinePlace::Start,
            (LinePlace::Start, b'#') => LinePlace::Comment,
            (LinePlace::Start, _) => LinePlace::Series,
            (LinePlace::Gap, byte) if byte != b' ' => LinePlace::FieldKey,
            (place, _) => place,
        };
        if byte == b'\\' && self.place != LinePlace::Stamp {
            self.is_escaped = true;
            return;
        }
        self.place = match (self.place, byte) {
            (LinePlace::Series, b' ') => LinePlace::Gap,
            (LinePlace::FieldKey, b'=') | (LinePlace::Text, b'"') => LinePlace::FieldValue,
            (LinePlace::FieldKey | LinePlace::FieldValue, b' ') => LinePlace::Stamp,
            (LinePlace::FieldValue, b',') => LinePlace::FieldKey,
            (LinePlace::FieldValue, b'"') => LinePlace::Text,
            (place, _) => place,
        };
    }
}

/// A line in its three parts, as they are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ProtocolLine<'t> {
    /// The measurement with its tags.
    pub(super) series: &'t str,
    /// The fields.
    pub(super) fields: &'t str,
    /// The stamp; empty where there is none.
    pub(super) stamp: &'t str,
}

impl<'t> ProtocolLine<'t> {
    /// The parts of a line that is no comment.
    pub(super) fn parse(text: &'t str) -> Result<Self, LineFault> {
        let text = text.trim_start_matches([' ', '\t']);
        let mut scanner = LineScanner::new();
        let (mut series_end, mut fields_begin, mut fields_end) = (None, None, None);
        for (at, byte) in text.bytes().enumerate() {
            scanner.step(byte);
            match scanner.place {
                LinePlace::Gap => _ = series_end.get_or_insert(at),
                LinePlace::FieldKey | LinePlace::FieldValue => _ = fields_begin.get_or_insert(at),
                LinePlace::Stamp => _ = fields_end.get_or_insert(at),
                _ => {}
            }
        }
        if scanner.is_in_text() {
            return Err(LineFault::UnbalancedQuotes);
        }
        let end = text.len();
        let (series, rest) = text.split_at(series_end.unwrap_or(end));
        let point = Self {
            series,
            fields: &text[fields_begin.unwrap_or(end)..fields_end.unwrap_or(end)],
            stamp: text[fields_end.unwrap_or(end)..].trim(),
        };
        if series.is_empty() || series.starts_with(',') {
            return Err(LineFault::MissingMeasurement);
        }
        if rest.is_empty() || !point.fields.contains('=') {
            return Err(LineFault::MissingFields);
        }
        if point.stamp.contains(' ') {
            return Err(LineFault::BadStamp);
        }
        Ok(point)
    }

    /// The measurement.
    pub(super) fn measurement(&self) -> Cow<'t, str> {
        let mut parts = split(self.series, b',');
        unescaped(parts.next().unwrap_or_default(), b", ")
    }

    /// The tags by their keys.
    pub(super) fn tags(&self) -> Result<BTreeMap<Cow<'t, str>, Cow<'t, str>>, LineFault> {
        let tags = split(self.series, b',').skip(1).map(|tag| {
            let mut halves = split(tag, b'=');
            let key = halves.next().unwrap_or_default();
            let value = halves.next().unwrap_or_default();
            match (key, value, halves.next()) {
                ("", ..) => Err(LineFault::MissingTagKey),
                (_, "", _) | (_, _, Some(_)) => Err(LineFault::MissingTagValue),
                (key, value, None) => Ok((unescaped(key, b", ="), unescaped(value, b", ="))),
            }
        });
        tags.collect()
    }

    /// The keys and the values of the fields, the values as they are written.
    pub(super) fn fields(
        &self,
    ) -> impl Iterator<Item = Result<(Cow<'t, str>, &'t str), LineFault>> + use<'t> {
        let mut rest = Some(self.fields);
        std::iter::from_fn(move || {
            let text = rest.take()?;
            let ends = FieldEnds::of(text);
            rest = ends.field.map(|end| &text[end + 1..]);
            let Some(key_end) = ends.key else {
                return Some(Err(LineFault::MissingFieldValue));
            };
            let end = ends.field.unwrap_or(text.len());
            let (key, value) = (&text[..key_end], &text[key_end + 1..end]);
            Some(match (key, value) {
                ("", _) => Err(LineFault::MissingFieldKey),
                (_, "") => Err(LineFault::MissingFieldValue),
                (key, _) if split(key, b',').nth(1).is_some() => Err(LineFault::MissingFieldValue),
                _ => Ok((unescaped(key, b", ="), value)),
            })
        })
    }
}

/// Where the first field of a text ends, and its key.
struct FieldEnds {
    /// The place of the `=` behind the key; none where there is none.
    key: Option<usize>,
    /// The place of the comma behind the field; none where the field is the last.
    field: Option<usize>,
}

impl FieldEnds {
    fn of(text: &str) -> FieldEnds {
        let mut scanner = LineScanner::at(LinePlace::FieldKey);
        let mut ends = FieldEnds {
            key: None,
            field: None,
        };
        for (at, byte) in text.bytes().enumerate() {
            scanner.step(byte);
            if scanner.place == LinePlace::FieldValue {
                ends.key.get_or_insert(at);
            } else if scanner.place == LinePlace::FieldKey && ends.key.is_some() {
                ends.field = Some(at);
                break;
            }
        }
        ends
    }
}

/// The value of a field that is written so.
pub(super) fn field_value(text: &str) -> Result<FieldValue<'_>, LineFault> {
    if let Some(rest) = text.strip_prefix('"') {
        let inner = rest.strip_suffix('"').ok_or(LineFault::InvalidNumber)?;
        return Ok(FieldValue::Text(unescaped(inner, b"\"\\")));
    }
    match text {
        "t" | "T" | "true" | "True" | "TRUE" => return Ok(FieldValue::Boolean(true)),
        "f" | "F" | "false" | "False" | "FALSE" => return Ok(FieldValue::Boolean(false)),
        _ => {}
    }
    let number = if let Some(digits) = text.strip_suffix('i') {
        digits.parse::<i64>().ok().map(|whole| whole as f64)
    } else if let Some(digits) = text.strip_suffix('u') {
        digits.parse::<u64>().ok().map(|whole| whole as f64)
    } else {
        let is_numeric = |byte: u8| byte.is_ascii_digit() || b"+-.eE".contains(&byte);
        let number = text.bytes().all(is_numeric).then(|| text.parse().ok());
        number.flatten().filter(|number: &f64| number.is_finite())
    };
    number
        .map(FieldValue::Number)
        .ok_or(LineFault::InvalidNumber)
}

/// Parts between separators that are not escaped.
fn split(text: &str, separator: u8) -> impl Iterator<Item = &str> {
    let mut is_escaped = false;
    text.split(move |symbol: char| {
        if std::mem::take(&mut is_escaped) {
            return false;
        }
        is_escaped = symbol == '\\';
        symbol == char::from(separator)
    })
}

/// A text without the backslashes before special characters; other backslashes stay.
fn unescaped<'t>(text: &'t str, special: &[u8]) -> Cow<'t, str> {
    if !text.contains('\\') {
        return Cow::Borrowed(text);
    }
    let mut plain = String::with_capacity(text.len());
    let mut symbols = text.chars();
    while let Some(symbol) = symbols.next() {
        if symbol != '\\' {
            plain.push(symbol);
            continue;
        }
        let next = symbols.next();
        let is_special =
            next.is_some_and(|next| u8::try_from(next).is_ok_and(|byte| special.contains(&byte)));
        if !is_special {
            plain.push('\\');
        }
        plain.extend(next);
    }
    Cow::Owned(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields<'t>(point: &ProtocolLine<'t>) -> Vec<(String, &'t str)> {
        let fields = point.fields().map(Result::unwrap);
        fields
            .map(|(key, value)| (key.into_owned(), value))
            .collect()
    }

    #[test]
    fn separators_that_are_escaped_or_quoted_separate_nothing() {
        let text = r#"oil\ rig,a=b\ c,path=C:\data,q="x" pos\ x=1.5,s="a, b=c \"d\"",n=5i 1465839830100400200"#;
        let point = ProtocolLine::parse(text).unwrap();
        assert_eq!(point.measurement(), "oil rig");
        let tags = point.tags().unwrap();
        let tags: Vec<(&str, &str)> = tags.iter().map(|(key, value)| (&**key, &**value)).collect();
        assert_eq!(tags, [("a", "b c"), ("path", r"C:\data"), ("q", "\"x\"")]);
        let expected = [("pos x", "1.5"), ("s", r#""a, b=c \"d\"""#), ("n", "5i")];
        let expected = expected.map(|(name, value)| (name.to_owned(), value));
        assert_eq!(fields(&point), expected);
        assert_eq!(point.stamp, "1465839830100400200");
        let text = field_value(fields(&point)[1].1).unwrap();
        assert_eq!(text, FieldValue::Text("a, b=c \"d\"".into()));
    }

    #[test]
    fn a_line_that_is_none_says_why() {
        for (text, fault) in [
            ("rig", LineFault::MissingFields),
            ("rig position", LineFault::MissingFields),
            (",hall=2 position=1", LineFault::MissingMeasurement),
            ("rig position=\"open 1", LineFault::UnbalancedQuotes),
            ("rig position=1 2 3", LineFault::BadStamp),
        ] {
            assert_eq!(ProtocolLine::parse(text), Err(fault), "{text}");
        }
        let tags = |text| ProtocolLine::parse(text).unwrap().tags().unwrap_err();
        assert_eq!(tags("rig,=2 a=1"), LineFault::MissingTagKey);
        assert_eq!(tags("rig,hall= a=1"), LineFault::MissingTagValue);
        let field = |text| ProtocolLine::parse(text).unwrap().fields().next().unwrap();
        assert_eq!(field("rig =1"), Err(LineFault::MissingFieldKey));
        assert_eq!(field("rig a=,b=2"), Err(LineFault::MissingFieldValue));
        assert_eq!(field("rig a,b=2"), Err(LineFault::MissingFieldValue));
    }

    #[test]
    fn values_are_numbers_truths_and_texts() {
        let number = |text| field_value(text).unwrap();
        for (text, expected) in [
            ("1", 1.0),
            ("-0.25", -0.25),
            ("1e-3", 1e-3),
            ("8.31E6", 8.31e6),
            ("5i", 5.0),
            ("-9223372036854775808i", -9_223_372_036_854_775_808.0),
            ("18446744073709551615u", 18_446_744_073_709_551_615.0),
        ] {
            assert_eq!(number(text), FieldValue::Number(expected), "{text}");
        }
        assert_eq!(number("True"), FieldValue::Boolean(true));
        assert_eq!(number("f"), FieldValue::Boolean(false));
        for text in ["NaN", "inf", "1e999", "-1u", "1.5i", "on", "\"a", "1_000"] {
            assert_eq!(field_value(text), Err(LineFault::InvalidNumber), "{text}");
        }
    }
}
