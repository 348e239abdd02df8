//! The claims of a provider about a person.

use serde_json::{Map, Value};

/// The characters of a person's name that are kept.
const NAME_CHARS: usize = 80;
/// The groups of a person that are kept.
const MOST_GROUPS: usize = 1000;

/// A person who has signed in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Person {
    /// The name of the person.
    pub name: String,
    /// The groups that the person is in.
    pub groups: Vec<String>,
}

/// The claims of an ID token, or of an answer of the provider to `userinfo`.
#[derive(Clone, Debug, Default)]
pub(super) struct Claims(Map<String, Value>);

impl Claims {
    /// The claims of a JSON object.
    pub(super) fn read(json: &[u8]) -> Option<Self> {
        serde_json::from_slice(json).ok().map(Self)
    }

    /// A claim that is one text.
    pub(super) fn text(&self, name: &str) -> Option<&str> {
        self.0.get(name)?.as_str()
    }

    /// A claim that is one text or a list of texts.
    pub(super) fn texts(&self, name: &str) -> Vec<&str> {
        match self.0.get(name) {
            Some(Value::String(text)) => vec![text],
            Some(Value::Array(texts)) => texts.iter().filter_map(Value::as_str).collect(),
            _ => Vec::new(),
        }
    }

    /// A claim that is a time, in whole seconds since 1970.
    pub(super) fn seconds(&self, name: &str) -> Option<i64> {
        let value = self.0.get(name)?;
        let rounded = |seconds: f64| (seconds.abs() < 1e15).then_some(seconds as i64);
        value.as_i64().or_else(|| value.as_f64().and_then(rounded))
    }

    /// Whether there is a claim.
    pub(super) fn have(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// Adds the claims of another document that are not here.
    pub(super) fn complete(&mut self, other: Self) {
        for (name, value) in other.0 {
            self.0.entry(name).or_insert(value);
        }
    }

    /// The person of the claims: the name in one claim, or the subject where there is none, and the groups in another.
    pub(super) fn person(&self, name: &str, groups: &str) -> Option<Person> {
        let shown = self.text(name).filter(|name| !name.trim().is_empty());
        let shown = shown.or_else(|| self.text("sub"))?.trim();
        let name: String = shown
            .chars()
            .filter(|c| !c.is_control())
            .take(NAME_CHARS)
            .collect();
        let groups = self.texts(groups).into_iter().take(MOST_GROUPS);
        (!name.is_empty()).then(|| Person {
            name,
            groups: groups.map(str::to_owned).collect(),
        })
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn claims(document: &Value) -> Claims {
        Claims::read(document.to_string().as_bytes()).expect("an object")
    }

    #[test]
    fn a_person_is_called_by_a_claim_or_by_the_subject() {
        let document =
            json!({"sub": "7", "preferred_username": "ada\n", "groups": ["it", 3], "role": "op"});
        let claims = claims(&document);
        let ada = claims.person("preferred_username", "groups");
        let ada = ada.expect("a person");
        assert_eq!(
            (&*ada.name, &ada.groups[..]),
            ("ada", &["it".to_owned()][..])
        );
        let by_subject = claims.person("email", "role").expect("a person");
        assert_eq!(
            (&*by_subject.name, &by_subject.groups[..]),
            ("7", &["op".to_owned()][..])
        );
        assert_eq!(
            claims.person("email", "none").map(|p| p.groups),
            Some(Vec::new())
        );
        assert!(Claims::read(b"[]").is_none());
    }

    #[test]
    fn what_a_token_says_is_not_said_otherwise_by_what_completes_the_token() {
        let mut token = claims(&json!({"sub": "7"}));
        token.complete(claims(&json!({"sub": "8", "groups": "op"})));
        assert_eq!(token.text("sub"), Some("7"));
        assert_eq!(token.texts("groups"), ["op"]);
    }
}
