//! JSON merge patches (RFC 7396).

use serde_json::{Map, Value};

/// The patch that makes `after` of `before`; none where the two are equal. A member that is `null`
/// counts as absent.
pub(super) fn between(before: &Value, after: &Value) -> Option<Value> {
    let (Value::Object(from), Value::Object(to)) = (before, after) else {
        return (before != after).then(|| after.clone());
    };
    let mut patch = Map::new();
    for name in from.keys().filter(|name| !to.contains_key(*name)) {
        patch.insert(name.clone(), Value::Null);
    }
    for (name, value) in to {
        let former = from.get(name).unwrap_or(&Value::Null);
        patch.extend(between(former, value).map(|part| (name.clone(), part)));
    }
    (!patch.is_empty()).then_some(Value::Object(patch))
}

#[cfg(test)]
pub(super) fn applied(target: &Value, patch: &Value) -> Value {
    let Value::Object(members) = patch else {
        return patch.clone();
    };
    let mut result = target.as_object().cloned().unwrap_or_default();
    for (name, part) in members {
        if part.is_null() {
            result.remove(name);
        } else {
            let former = result.get(name).unwrap_or(&Value::Null);
            let value = applied(former, part);
            result.insert(name.clone(), value);
        }
    }
    Value::Object(result)
}
