//! YAML text to a JSON value: the core schema of YAML 1.2, as strict as the JSON reader.
//!
//! One document of mappings with text keys, sequences, texts, numbers, truths and nulls. A key
//! that appears twice is an error, anchors and aliases are refused (a few bytes of them can stand
//! for gigabytes), as are tags, and depth is bounded as in JSON.

use saphyr_parser::{Event, Marker, Parser, ScalarStyle, ScanError, Span, StrInput};
use serde_json::{Map, Number, Value};
use std::fmt;

use super::Fault;

/// How deep mappings and sequences may stand in each other.
const MAX_DEPTH: usize = 128;

/// The values and the keys that one document may have: more than the largest model needs, and
/// read in a tenth of a second.
const MAX_VALUES: usize = 50_000;
const MAX_KEYS: usize = 10_000;

/// Why a text is not a document, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    /// The line, from 1.
    pub line: u64,
    /// The character within the line, from 1.
    pub column: u64,
    /// What is wrong.
    pub detail: String,
}

impl Error {
    fn at(marker: &Marker, detail: impl Into<String>) -> Error {
        Error {
            line: marker.line() as u64,
            column: marker.col() as u64 + 1,
            detail: detail.into(),
        }
    }
}

impl From<ScanError> for Error {
    fn from(error: ScanError) -> Error {
        Error::at(error.marker(), error.info())
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Error {
            line,
            column,
            detail,
        } = self;
        write!(f, "{detail} at line {line} column {column}")
    }
}

impl std::error::Error for Error {}

impl From<Error> for Fault {
    /// The fault of a text that is no document.
    fn from(error: Error) -> Fault {
        Fault::of_whole(
            "not_yaml",
            format!("not YAML that is understood here: {error}"),
        )
        .within((error.line, error.column))
    }
}

/// Parses one YAML document.
///
/// # Errors
/// The first thing that is wrong with it, with its line and column.
pub fn parse(text: &str) -> Result<Value, Error> {
    let mut reader = Reader {
        events: Parser::new_from_str(text),
        last: Marker::new(0, 1, 0),
        n_values: 0,
        n_keys: 0,
    };
    loop {
        match reader.next()? {
            (Event::StreamStart | Event::DocumentStart(_), _) => {}
            (Event::StreamEnd, span) => return Err(Error::at(&span.start, "there is no document")),
            (event, span) => {
                let value = reader.value(event, span, 0)?;
                reader.end()?;
                return Ok(value);
            }
        }
    }
}

struct Reader<'t> {
    events: Parser<'t, StrInput<'t>>,
    /// Where the last event ended.
    last: Marker,
    n_values: usize,
    n_keys: usize,
}

impl<'t> Reader<'t> {
    fn next(&mut self) -> Result<(Event<'t>, Span), Error> {
        match self.events.next_event() {
            Some(event) => {
                let (event, span) = event?;
                self.last = span.end;
                Ok((event, span))
            }
            None => Err(Error::at(&self.last, "the text ends early")),
        }
    }

    /// Nothing may follow the document.
    fn end(&mut self) -> Result<(), Error> {
        loop {
            match self.next()? {
                (Event::StreamEnd, _) => return Ok(()),
                (Event::DocumentEnd, _) => {}
                (_, span) => return Err(Error::at(&span.start, "a second document")),
            }
        }
    }

    fn value(&mut self, event: Event<'t>, span: Span, depth: usize) -> Result<Value, Error> {
        if depth >= MAX_DEPTH {
            return Err(Error::at(&span.start, "nested too deeply"));
        }
        self.n_values += 1;
        if self.n_values > MAX_VALUES {
            return Err(Error::at(
                &span.start,
                format!("more than {MAX_VALUES} values"),
            ));
        }
        if let Some(why) = refused(&event) {
            return Err(Error::at(&span.start, why));
        }
        match event {
            Event::Scalar(text, ScalarStyle::Plain, ..) => plain(&text)
                .ok_or_else(|| Error::at(&span.start, format!("`{text}` is out of range"))),
            Event::Scalar(text, ..) => Ok(Value::String(text.into_owned())),
            Event::SequenceStart(..) => self.sequence(depth),
            Event::MappingStart(..) => self.mapping(depth),
            _ => Err(Error::at(&span.start, "a value is needed here")),
        }
    }

    fn sequence(&mut self, depth: usize) -> Result<Value, Error> {
        let mut items = Vec::new();
        loop {
            match self.next()? {
                (Event::SequenceEnd, _) => return Ok(Value::Array(items)),
                (event, span) => items.push(self.value(event, span, depth + 1)?),
            }
        }
    }

    fn mapping(&mut self, depth: usize) -> Result<Value, Error> {
        let mut map = Map::new();
        loop {
            let (event, span) = self.next()?;
            if let Some(why) = refused(&event) {
                return Err(Error::at(&span.start, why));
            }
            let key = match event {
                Event::MappingEnd => return Ok(Value::Object(map)),
                Event::Scalar(text, ..) => text.into_owned(),
                _ => return Err(Error::at(&span.start, "a key is a text")),
            };
            self.n_keys += 1;
            if self.n_keys > MAX_KEYS {
                return Err(Error::at(&span.start, format!("more than {MAX_KEYS} keys")));
            }
            if map.contains_key(&key) {
                let detail = format!("key `{key}` appears twice");
                return Err(Error::at(&span.start, detail));
            }
            let (event, span) = self.next()?;
            let value = self.value(event, span, depth + 1)?;
            map.insert(key, value);
        }
    }
}

/// What YAML has and a document may not.
fn refused(event: &Event<'_>) -> Option<&'static str> {
    let (anchor, tag) = match event {
        Event::Alias(_) => return Some("an alias is not understood here; write the value again"),
        Event::Scalar(_, _, anchor, tag)
        | Event::SequenceStart(anchor, tag)
        | Event::MappingStart(anchor, tag) => (*anchor, tag),
        _ => return None,
    };
    if anchor != 0 {
        return Some("an anchor is not understood here");
    }
    tag.is_some().then_some("a tag is not understood here")
}

/// A plain scalar by the core schema (YAML 1.2.2, section 10.3.2); none where it is a number
/// that JSON cannot hold.
fn plain(text: &str) -> Option<Value> {
    match text {
        "" | "~" | "null" | "Null" | "NULL" => return Some(Value::Null),
        "true" | "True" | "TRUE" => return Some(Value::Bool(true)),
        "false" | "False" | "FALSE" => return Some(Value::Bool(false)),
        ".nan" | ".NaN" | ".NAN" => return None,
        _ => {}
    }
    let unsigned = text.strip_prefix(['-', '+']).unwrap_or(text);
    if matches!(unsigned, ".inf" | ".Inf" | ".INF") {
        return None;
    }
    let prefixed = [("0x", 16), ("0o", 8)]
        .into_iter()
        .find_map(|(prefix, radix)| {
            let digits = text.strip_prefix(prefix)?;
            let good = !digits.is_empty() && digits.chars().all(|c| c.is_digit(radix));
            good.then(|| u64::from_str_radix(digits, radix).ok().map(Value::from))
        });
    if let Some(value) = prefixed {
        return value;
    }
    if !is_number(unsigned) {
        return Some(Value::String(text.to_owned()));
    }
    let digits = text.strip_prefix('+').unwrap_or(text);
    if let Ok(integer) = digits.parse::<u64>() {
        return Some(integer.into());
    }
    if let Ok(integer) = digits.parse::<i64>() {
        return Some(integer.into());
    }
    Number::from_f64(digits.parse().ok()?).map(Value::Number)
}

/// `(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?`
fn is_number(text: &str) -> bool {
    let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, Some(exponent)),
        None => (text, None),
    };
    let exponent = exponent.map(|text| text.strip_prefix(['-', '+']).unwrap_or(text));
    let (whole, part) = match mantissa.split_once('.') {
        Some((whole, part)) => (whole, part),
        None => (mantissa, ""),
    };
    is_digits(whole)
        && is_digits(part)
        && !(whole.is_empty() && part.is_empty())
        && exponent.is_none_or(|text| !text.is_empty() && is_digits(text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    #[test]
    fn a_document_of_yaml_is_that_of_json() {
        let text = "# a lag\nname: lag\ninputs:\n  u: {unit: V}\nstates:\n  y:\n    \
                    derivative: (u - y)/T\n    initial: -1.5e-3\noff: [no, y, ~, true, 0x1f, '1', \
                    +2, 1., -x]\ntext: >-\n  two\n  lines\n";
        let expected = json!({
            "name": "lag",
            "inputs": {"u": {"unit": "V"}},
            "states": {"y": {"derivative": "(u - y)/T", "initial": -1.5e-3}},
            "off": ["no", "y", null, true, 31, "1", 2, 1.0, "-x"],
            "text": "two lines"
        });
        assert_eq!(parse(text).unwrap(), expected);
    }

    #[test]
    fn what_json_has_not_is_refused_with_its_place() {
        for (text, line, column) in [
            ("a: 1\na: 2\n", 2, 1),
            ("a: &x 1\nb: *x\n", 1, 4),
            ("a: !!str 1\n", 1, 4),
            ("a: .inf\n", 1, 4),
            ("? [1]\n: 2\n", 1, 3),
            ("a: 1\n---\nb: 2\n", 2, 1),
            ("a: [1, 2\n", 2, 1),
        ] {
            let error = parse(text).expect_err(text);
            assert_eq!(
                (error.line, error.column),
                (line, column),
                "{text}: {error}"
            );
        }
        assert!(parse("").is_err());
        assert!(parse(&"[".repeat(100_000)).is_err());
        assert!(parse(&"- ".repeat(100_000)).is_err());
    }

    proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(text in "[ -~\n]{0,200}") {
            let _ = parse(&text);
        }

        #[test]
        fn json_is_yaml(number in -1e12..1e12f64, text in "[ -~]{0,20}", key in "[a-z]{1,8}") {
            let value = json!({key: [number, text, {"b": null}]});
            prop_assert_eq!(parse(&value.to_string()).unwrap(), value);
        }
    }
}
