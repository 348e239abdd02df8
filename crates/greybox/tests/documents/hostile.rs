//! Documents that were written to hurt are told what is wrong with them, briefly, and nothing that
//! they ask for is built. How long it takes is measured by `cargo bench --bench hostile`.

use crate::bodies::{Body, LIMIT, bodies};
use greybox::model::document;
use greybox::parsing::reader::MAX_FAULTS;
use greybox::parsing::{Fault, json, yaml};

/// What a body is told, nothing where it is sound.
fn told(body: &Body) -> Vec<String> {
    let parsed = if body.is_yaml {
        yaml::parse(&body.text).map_err(|error| error.to_string())
    } else {
        json::parse(body.text.as_bytes()).map_err(|error| error.to_string())
    };
    match parsed.map(|value| document::referenced(&value)) {
        Ok(Ok(_)) => Vec::new(),
        Ok(Err(faults)) => faults.iter().map(Fault::to_string).collect(),
        Err(error) => vec![error],
    }
}

/// The bound that each body runs into, in the words of a fault.
const BOUNDS: &[(bool, &str, &str)] = &[
    (false, "lists in lists", "recursion limit exceeded"),
    (false, "objects in objects", "recursion limit exceeded"),
    (false, "objects 120 deep", "`a` is not a field here"),
    (false, "many constants", "are more than 128"),
    (
        false,
        "entries that are no names",
        "is not a name: a letter",
    ),
    (false, "unknown fields", "did you mean `delay`?"),
    (false, "kinks", "are more than 64"),
    (false, "one expression of 1 MB", "are more than 4096"),
    (false, "sums of 84 terms", "more than 1024 operations"),
    (false, "sums of unknown names", "` is not a name here"),
    (false, "sums of unknown functions", "` is not a function"),
    (false, "a chain of names", "nested too deeply"),
    (
        false,
        "names close to 240 others",
        "; did you mean `a_name_",
    ),
    (false, "a field of 1 MB", "is not a field here"),
    (false, "a name of 1 MB", "at most 64 characters"),
    (
        false,
        "a unit of 1 MB",
        "exponents of the unit are too large",
    ),
    (false, "a text of 1 MB", "characters are more than 4000"),
    (true, "lists in lists", "recursion limit exceeded"),
    (true, "dashes", "nested too deeply"),
    (true, "a staircase of mappings", "nested too deeply"),
    (true, "aliases of aliases", "an anchor is not understood"),
    (true, "tags", "a tag is not understood"),
    (true, "documents", "a second document"),
    (true, "keys on lines", "more than 10000 keys"),
    (true, "keys in braces", "more than 10000 keys"),
    (true, "items", "more than 50000 values"),
    (true, "items on lines", "more than 50000 values"),
];

#[test]
fn every_hostile_body_is_told_its_bound_and_no_more_than_anyone_reads() {
    let bodies = bodies();
    for body in &bodies {
        let told = told(body);
        let place = format!("{} (YAML: {})", body.name, body.is_yaml);
        let only_comments = body.name.contains("comment");
        assert_eq!(told.is_empty(), only_comments, "{place}: {told:?}");
        assert!(told.len() <= MAX_FAULTS, "{place}: {} faults", told.len());
        let bytes: usize = told.iter().map(String::len).sum();
        assert!(bytes <= 2 * LIMIT, "{place}: {bytes} bytes of faults");
        let mut bounds = BOUNDS.iter();
        if let Some((.., words)) =
            bounds.find(|(is_yaml, name, _)| *is_yaml == body.is_yaml && *name == body.name)
        {
            let is_told = told.iter().any(|fault| fault.contains(words));
            assert!(is_told, "{place}: {words} is not in {:?}", told.first());
        }
    }
    for (is_yaml, name, _) in BOUNDS {
        let is_there = |body: &Body| body.is_yaml == *is_yaml && body.name == *name;
        assert!(bodies.iter().any(is_there), "{name}");
    }
}
