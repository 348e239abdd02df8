//! The names of the samples at a place of a document, by the keys and the objects on the way there.

use super::super::leaf::{Fields, JsonLeaf};
use super::super::walk::NestingLevel;
use super::instants;
use super::keys::{is_any, is_called};

/// Keys of fields that name the object that they are in, the surest first, in small letters without signs.
const NAMES: [&str; 30] = [
    "target",
    "tagname",
    "tag",
    "propertyalias",
    "externalid",
    "entityid",
    "statisticid",
    "topic",
    "itemid",
    "tagid",
    "metric",
    "signal",
    "series",
    "channel",
    "variable",
    "sensor",
    "sensorname",
    "sensorid",
    "deviceid",
    "devicename",
    "device",
    "serialnumber",
    "serial",
    "field",
    "measurement",
    "name",
    "entryid",
    "propertyid",
    "nodeid",
    "n",
];

/// Keys of fields whose samples are called as the object is that the field is in.
const HOLDERS: [&str; 30] = [
    "assetpropertyvaluehistory",
    "body",
    "content",
    "data",
    "datapoints",
    "dps",
    "entries",
    "fields",
    "history",
    "items",
    "measurements",
    "message",
    "metrics",
    "observations",
    "payload",
    "points",
    "properties",
    "propertyvalues",
    "readings",
    "records",
    "result",
    "results",
    "rows",
    "samples",
    "series",
    "successentries",
    "tables",
    "telemetry",
    "value",
    "values",
];

/// Keys of objects whose texts tell apart series of one name.
const LABELS: [&str; 3] = ["metric", "tags", "labels"];

/// The key of the label that is the name of a series of Prometheus.
const NAME_LABEL: &str = "__name__";

/// The name of samples, and the names and labels around them that tell them from others of that name.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct LabelledName {
    /// The nearest name, where there is one.
    pub(super) short: Option<String>,
    /// The names farther out, and the keys that name nothing, from the outermost.
    pub(super) outer: Vec<String>,
    /// Labels, written as `key=text`.
    pub(super) labels: Vec<String>,
    /// The places of the objects around in their lists.
    pub(super) places: Vec<usize>,
}

impl LabelledName {
    /// The name that the objects around give, from the innermost. `is_listed` says that the samples are a list.
    pub(super) fn of(levels: &[NestingLevel<'_>], is_listed: bool) -> Self {
        let mut name = Self::default();
        let mut has_list = is_listed;
        for level in levels {
            name.places.extend(level.index);
            // Around a lone sample stands what numbers it.
            let of_object = match has_list {
                true => name_of(level.fields).or_else(|| id_of(level.fields)),
                false => name_of(level.fields),
            };
            has_list = level.index.is_some();
            let of_key = (!instants::is_instant_text(level.key)).then(|| level.key.to_owned());
            let is_name = !is_holder(level.key);
            for (text, is_name) in of_key
                .map(|key| (key, is_name))
                .into_iter()
                .chain(of_object.map(|text| (text, true)))
            {
                match name.short {
                    None if is_name => name.short = Some(text),
                    _ => name.outer.push(text),
                }
            }
            name.labels.extend(labels_of(level.fields));
        }
        name.outer.reverse();
        name
    }

    /// The name of what is called `short` within what has this name.
    pub(super) fn inner(mut self, short: &str) -> Self {
        self.outer.extend(self.short.take());
        self.short = Some(short.to_owned());
        self
    }

    /// The name of what has another name beside this one.
    pub(super) fn beside(mut self, name: String) -> Self {
        self.outer.push(name);
        self
    }

    /// The name with what the fields of a record of several values say of it.
    pub(super) fn labelled(mut self, fields: &Fields) -> Self {
        self.outer.extend(self.short.take());
        // A record may be numbered, and a number of its own names no series.
        let mut names = NAMES.iter().filter(|name| **name != "id");
        self.outer
            .extend(names.find_map(|name| text_of(fields, name)));
        self.labels.extend(labels_of(fields));
        self
    }

    /// The whole name, with what stands around the short one.
    pub(super) fn key(&self) -> String {
        let short = self.short.as_deref().unwrap_or_default();
        let outer: String = self.outer.iter().map(|name| format!("{name} ")).collect();
        let labels: String = self
            .labels
            .iter()
            .map(|label| format!(",{label}"))
            .collect();
        format!("{outer}{short}{labels}")
    }

    /// The name without what all of `neighbours` say too.
    pub(super) fn apart_from(&self, neighbours: &[&LabelledName]) -> Self {
        let labels = self.labels.iter().filter(|label| {
            let mut all = neighbours.iter();
            !all.all(|name| name.labels.contains(label))
        });
        let outer = self.outer.iter().filter(|text| {
            let mut all = neighbours.iter();
            !all.all(|name| name.outer.contains(text))
        });
        Self {
            short: self.short.clone(),
            outer: outer.cloned().collect(),
            labels: labels.cloned().collect(),
            places: Vec::new(),
        }
    }
}

/// Whether a key holds what belongs to the object around it.
pub(super) fn is_holder(key: &str) -> bool {
    is_any(key, &HOLDERS)
}

/// Whether a key holds texts about an object.
pub(super) fn is_label(key: &str) -> bool {
    is_any(key, &LABELS)
}

/// The name that an object says it has.
pub(super) fn name_of(fields: &Fields) -> Option<String> {
    NAMES.iter().find_map(|name| {
        let mut named = fields.0.iter().filter(|(key, _)| is_called(key, name));
        named.find_map(|(_, leaf)| match leaf {
            JsonLeaf::Object(labels) => labels.get(NAME_LABEL)?.text(),
            leaf => leaf.text().filter(|text| !text.is_empty()),
        })
    })
}

/// The number or text that tells an object from others, where nothing names it.
pub(super) fn id_of(fields: &Fields) -> Option<String> {
    fields.get("id")?.text()
}

/// The text by which a record names itself.
pub(super) fn text_name_of(fields: &Fields) -> Option<String> {
    NAMES.iter().find_map(|name| text_of(fields, name))
}

/// The text of a field, where it has one.
fn text_of(fields: &Fields, name: &str) -> Option<String> {
    let mut named = fields.0.iter().filter(|(key, _)| is_called(key, name));
    named.find_map(|(_, leaf)| match leaf {
        JsonLeaf::Text(text) => Some(text.clone()),
        _ => None,
    })
}

/// Whether a field may be the name of its object.
pub(super) fn is_name_field(key: &str) -> bool {
    is_any(key, &NAMES) || is_called(key, "id")
}

/// The name and the labels of an object that stand in its fields from this one on.
pub(super) fn told_behind(fields: &Fields, first: usize) -> String {
    let (before, behind) = fields.0.split_at(first.min(fields.0.len()));
    let [before, behind] = [before, behind].map(|part| Fields(part.to_vec()));
    let name = name_of(&behind).filter(|_| name_of(&before).is_none());
    let labels = labels_of(&behind);
    name.into_iter()
        .chain(labels)
        .collect::<Vec<String>>()
        .join(",")
}

/// The labels of an object, written as `key=text`.
fn labels_of(fields: &Fields) -> Vec<String> {
    let mut labels = Vec::new();
    for (key, leaf) in &fields.0 {
        if let JsonLeaf::Object(object) = leaf
            && is_label(key)
        {
            let texts = object.0.iter().filter(|(key, _)| &**key != NAME_LABEL);
            labels.extend(texts.filter_map(|(key, leaf)| Some(format!("{key}={}", leaf.text()?))));
        }
    }
    labels
}
