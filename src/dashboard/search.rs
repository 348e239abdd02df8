//! What the search on the pages of the guides looks through: the chapters of the guides and the operations of the
//! API.

use serde::Serialize;
use serde_json::Value;

use super::guides::{Chapter, GUIDES, Guide, chapters};

/// The index of the search.
#[derive(Serialize)]
struct Index {
    guides: Vec<GuideEntry>,
    operations: Vec<ReferenceEntry>,
}

/// A guide as the search looks through it.
#[derive(Serialize)]
struct GuideEntry {
    title: &'static str,
    /// The address of the guide.
    to: String,
    chapters: Vec<Chapter>,
}

/// An operation of the API as the search shows it.
#[derive(Serialize)]
struct ReferenceEntry {
    /// The method and the path.
    title: String,
    /// The address of the operation in the reference.
    to: String,
    /// What the description says of the operation.
    text: String,
}

/// Writes the index as JSON, from the guides and a description of the API (OpenAPI 3.1).
pub fn index(description: &Value) -> Vec<u8> {
    let paths = description["paths"].as_object().into_iter().flatten();
    let operations = paths.flat_map(|(path, item)| {
        let operations = item.as_object().into_iter().flatten();
        let described = operations.filter(|(_, operation)| operation["operationId"].is_string());
        described.map(|(method, operation)| ReferenceEntry::new(method, path, operation))
    });
    let index = Index {
        guides: GUIDES.iter().map(GuideEntry::new).collect(),
        operations: operations.collect(),
    };
    serde_json::to_vec(&index).expect("texts are JSON")
}

impl GuideEntry {
    fn new(guide: &'static Guide) -> Self {
        Self {
            title: guide.title,
            to: format!("/docs/{}", guide.name),
            chapters: chapters(guide),
        }
    }
}

impl ReferenceEntry {
    fn new(method: &str, path: &str, operation: &Value) -> Self {
        let word = |value: &Value| value.as_str().unwrap_or_default().replace('\n', " ");
        let text = [&operation["summary"], &operation["description"]];
        let parameters = operation["parameters"].as_array().into_iter().flatten();
        let parameters = parameters.filter(|parameter| parameter["in"] == "query");
        let names: Vec<String> = parameters
            .map(|parameter| word(&parameter["name"]))
            .collect();
        let [summary, more] = text.map(word);
        // The first sentence says what the operation is for.
        let more = more.split_inclusive(". ").next().unwrap_or_default();
        Self {
            title: format!("{} {path}", method.to_uppercase()),
            // The viewer of the reference writes a dash for each brace.
            to: format!("/docs#{method}-{}", path.replace(['{', '}'], "-")),
            text: format!("{summary} {more} {}", names.join(" "))
                .trim_end()
                .to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_index_holds_guides_and_operations_and_is_small() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/openapi/openapi.json");
        let description = std::fs::read(file).unwrap();
        let written = index(&serde_json::from_slice(&description).unwrap());
        assert!(written.len() <= 150_000, "{} bytes", written.len());
        let index: Value = serde_json::from_slice(&written).unwrap();
        let says = |entries: &Value, place: [&str; 2], words: &str| {
            let mut entries = entries.as_array().unwrap().iter();
            let entry = entries.find(|entry| entry[place[0]] == place[1]);
            let text = entry.map(|entry| entry["text"].as_str().unwrap());
            let is_said = text.is_some_and(|text| text.contains(words));
            assert!(is_said, "{place:?}: {text:?}");
        };
        let mut guides = index["guides"].as_array().unwrap().iter();
        let verdicts = guides
            .find(|guide| guide["to"] == "/docs/verdicts")
            .unwrap();
        says(
            &verdicts["chapters"],
            ["anchor", "at_bound"],
            "search range",
        );
        let operations = &index["operations"];
        says(
            operations,
            ["to", "/docs#get-/v1/jobs/-id-/result"],
            "estimate",
        );
        says(operations, ["to", "/docs#post-/v1/datasets"], " skip");
    }
}
