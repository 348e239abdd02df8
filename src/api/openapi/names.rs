//! A name for each form of data: what stands inline where it is used gets a name of its own among the
//! schemas, so that generators of clients make one class of it, with a name that says something.

use serde_json::{Map, Value, json};

/// Where the schemas stand.
const SCHEMAS: &str = "/components/schemas";

/// Names what has none.
pub(super) fn name_all(description: &mut Value) {
    let originals = description.pointer(SCHEMAS).and_then(Value::as_object);
    let originals = originals.cloned().unwrap_or_default();
    if let Some(schemas) = schemas(description) {
        for (_, schema) in schemas.iter_mut() {
            below(schema, &mut |part| refer(part, &originals));
        }
    }
    if let Some(paths) = description.get_mut("paths") {
        within(paths, &mut |part| refer(part, &originals));
    }
    let mut named = Map::new();
    if let Some(schemas) = schemas(description) {
        for (name, schema) in schemas.iter_mut() {
            name_parts(schema, name, &mut named);
        }
        schemas.extend(named);
        schemas.sort_keys();
    }
}

/// Says of bodies that are no JSON that they are sent as they are: generators of clients take files for
/// them.
pub(super) fn name_files(description: &mut Value) {
    let paths = description.get_mut("paths").and_then(Value::as_object_mut);
    let operations = paths
        .into_iter()
        .flat_map(Map::values_mut)
        .filter_map(Value::as_object_mut)
        .flat_map(Map::values_mut);
    let contents = operations.filter_map(|operation| {
        let content = operation.pointer_mut("/requestBody/content")?;
        content.as_object_mut()
    });
    for (media_type, body) in contents.flatten() {
        if media_type != "application/json" {
            body["schema"]["format"] = "binary".into();
        }
    }
}

fn schemas(description: &mut Value) -> Option<&mut Map<String, Value>> {
    description.pointer_mut(SCHEMAS)?.as_object_mut()
}

/// Visits every schema that stands within a value.
fn within(value: &mut Value, visit: &mut dyn FnMut(&mut Value)) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(|item| within(item, visit)),
        Value::Object(members) => {
            for (name, member) in members {
                if name == "schema" {
                    visit(member);
                    below(member, visit);
                } else if name != "example" {
                    within(member, visit);
                }
            }
        }
        _ => {}
    }
}

/// Visits every schema below one, but not the schema itself.
fn below(schema: &mut Value, visit: &mut dyn FnMut(&mut Value)) {
    for part in parts(schema) {
        visit(part.schema);
        below(part.schema, visit);
    }
}

/// A schema within another.
struct Part<'s> {
    /// The name of the property that refers to the schema, or nothing.
    property: Option<&'s str>,
    /// Whether the other is this and more.
    is_share: bool,
    schema: &'s mut Value,
}

fn parts(schema: &mut Value) -> Vec<Part<'_>> {
    let mut parts = Vec::new();
    let Some(members) = schema.as_object_mut() else {
        return parts;
    };
    for (key, member) in members {
        let part = |property, schema| Part {
            property,
            is_share: key == "allOf",
            schema,
        };
        match (key.as_str(), member) {
            ("oneOf" | "anyOf" | "allOf", Value::Array(forms)) => {
                parts.extend(forms.iter_mut().map(|schema| part(None, schema)));
            }
            ("properties", Value::Object(properties)) => {
                let properties = properties.iter_mut();
                parts.extend(properties.map(|(name, schema)| part(Some(name.as_str()), schema)));
            }
            ("items" | "additionalProperties", schema @ Value::Object(_)) => {
                parts.push(part(None, schema));
            }
            _ => {}
        }
    }
    parts
}

/// What a schema says, without what it says about itself.
fn form(schema: &Value) -> Value {
    let mut form = schema.clone();
    if let Some(members) = form.as_object_mut() {
        members.remove("description");
        members.remove("example");
    }
    form
}

/// Puts a reference in the place of a schema that is one of the known.
fn refer(part: &mut Value, known: &Map<String, Value>) {
    let says_much = ["properties", "enum", "oneOf", "allOf"];
    if !says_much.iter().any(|key| part.get(key).is_some()) {
        return;
    }
    let shape = form(part);
    if let Some((name, _)) = known.iter().find(|(_, schema)| form(schema) == shape) {
        *part = reference(name);
    }
}

fn reference(name: &str) -> Value {
    json!({"$ref": format!("#{SCHEMAS}/{name}")})
}

/// Names the objects within a schema that has a name: by their title, or by their place.
fn name_parts(schema: &mut Value, name: &str, named: &mut Map<String, Value>) {
    for part in parts(schema) {
        let new_name = own_name(&part, name);
        name_parts(part.schema, &new_name, named);
        let is_object = part.schema.get("properties").is_some();
        if is_object && !part.is_share {
            let taken = named.get(&new_name);
            assert!(
                taken.is_none_or(|taken| taken == part.schema),
                "two forms of data are called {new_name}; give one a title"
            );
            let schema = std::mem::replace(part.schema, reference(&new_name));
            named.insert(new_name, schema);
        }
    }
}

fn own_name(part: &Part<'_>, name: &str) -> String {
    if let Some(title) = part.schema.get("title").and_then(Value::as_str) {
        return title.to_owned();
    }
    let only = part.schema.get("properties").and_then(Value::as_object);
    let only = only.filter(|properties| properties.len() == 1);
    let only = only.and_then(|properties| properties.keys().next());
    match (part.property, only) {
        // What an alternative holds stands under the name of the alternative.
        (None, Some(only)) => format!("{name}{}", capitals(only)),
        (Some(property), _) if name.ends_with(&capitals(property)) => format!("{name}Value"),
        (Some(property), _) => format!("{name}{}", capitals(property)),
        (None, None) => format!("{name}Item"),
    }
}

/// `first_sample` as `FirstSample`.
fn capitals(name: &str) -> String {
    let words = name.split('_').filter(|word| !word.is_empty());
    words
        .map(|word| word[..1].to_uppercase() + &word[1..])
        .collect()
}
