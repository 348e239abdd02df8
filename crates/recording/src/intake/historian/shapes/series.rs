//! The series of a document: tags, each with the names around it.

use super::super::super::cell::Cell;
use super::super::super::clock::Clock;
use super::super::super::csv::time_name_and_unit;
use super::super::super::tags::{Quality, RawSample, Tags};
use super::super::leaf::JsonLeaf;
use super::instants;
use super::measured::MeasuredValue;
use super::mixture::{self, MixedRows};
use super::naming::LabelledName;
use super::place::DocumentPlace;
use greybox_numerics::parsing::Fault;
use std::borrow::Cow;
use std::collections::HashMap;

/// The tags of a document.
pub(super) struct SeriesTags<'o> {
    pub(super) tags: Tags<'o>,
    /// The whole name of each tag.
    names: Vec<LabelledName>,
    has_clock: bool,
    pub(super) mixture: MixedRows,
}

/// The time of a sample.
pub(super) struct SampleTime<'f> {
    /// The key of the field that is the time; empty where none is.
    pub(super) key: &'f str,
    pub(super) leaf: Cow<'f, JsonLeaf>,
}

impl<'f> SampleTime<'f> {
    pub(super) fn of(key: &'f str, leaf: &'f JsonLeaf) -> Self {
        Self {
            key,
            leaf: instants::of_leaf(leaf),
        }
    }

    /// A time that is missing where it should be.
    pub(super) fn of_missing(key: &'f str) -> Self {
        Self {
            key,
            leaf: Cow::Owned(JsonLeaf::Null),
        }
    }

    /// A time that is a sum of several fields.
    pub(super) fn of_number(key: &'f str, number: f64) -> Self {
        Self {
            key,
            leaf: Cow::Owned(JsonLeaf::Number(number)),
        }
    }

    /// The time that a key is.
    pub(super) fn of_key(key: &str) -> SampleTime<'static> {
        SampleTime {
            key: "",
            leaf: Cow::Owned(JsonLeaf::Text(key.to_owned())),
        }
    }
}

impl<'o> SeriesTags<'o> {
    pub(super) fn new(tags: Tags<'o>) -> Self {
        Self {
            tags,
            names: Vec::new(),
            has_clock: false,
            mixture: MixedRows::default(),
        }
    }

    /// Whether no sample came by now.
    pub(super) fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    pub(super) fn fault(&mut self, fault: Fault) {
        self.tags.faults.invalid(fault);
    }

    /// Takes a sample of the signal of that name, or of the key of the value where there is no name.
    pub(super) fn push(
        &mut self,
        place: &DocumentPlace<'_>,
        name: LabelledName,
        time: &SampleTime<'_>,
        value: &MeasuredValue<'_>,
    ) {
        let make_fault = |code, detail: String| place.fault(code, &detail);
        if !std::mem::replace(&mut self.has_clock, true) && !time.key.is_empty() {
            let (_, unit) = time_name_and_unit(time.key);
            self.tags.clock = Clock::new(time.key, unit, self.tags.options);
        }
        let short = name.short.clone().unwrap_or_else(|| value.key.to_string());
        let name = LabelledName {
            short: Some(short.clone()),
            ..name
        };
        let key = name.key();
        if !name.places.is_empty() {
            let places: Vec<String> = name.places.iter().map(usize::to_string).collect();
            self.mixture
                .observe(&key, [mixture::PLACE, &places.join("/")], &time.leaf);
        }
        let Some(tag) = self.tags.series(&key, &short, &make_fault) else {
            return;
        };
        if tag == self.names.len() {
            self.names.push(name);
        }
        self.tags.describe(tag, value.unit, None, &make_fault);
        let sample = RawSample {
            tag,
            time: time.leaf.cell(),
            value: value.value.clone(),
            quality: value
                .quality
                .map_or(Quality::Unsaid, |code| Quality::Code(code.cell())),
        };
        self.tags.push(&sample, &make_fault);
    }

    /// The tags, where it is clear which samples belong together. Those of one short name are called by what tells
    /// them apart, where that is enough.
    pub(super) fn into_tags(mut self) -> Tags<'o> {
        if let Some(question) = self.mixture.question() {
            self.fault(question);
        }
        let mut of_name: HashMap<Option<&str>, Vec<usize>> = HashMap::new();
        for (tag, name) in self.names.iter().enumerate() {
            of_name.entry(name.short.as_deref()).or_default().push(tag);
        }
        for tags in of_name.values().filter(|tags| tags.len() > 1) {
            let names = tags.iter().filter_map(|tag| self.names.get(*tag));
            let names: Vec<&LabelledName> = names.collect();
            let apart: Vec<String> = names
                .iter()
                .map(|name| name.apart_from(&names).key())
                .collect();
            let different: std::collections::HashSet<&String> = apart.iter().collect();
            if different.len() == apart.len() {
                let keys = tags.iter().zip(apart);
                keys.for_each(|(tag, key)| self.tags.set_key(*tag, key));
            }
        }
        self.tags
    }
}

/// A value that is a leaf.
pub(super) fn plain_value<'f>(key: &'f str, leaf: &'f JsonLeaf) -> MeasuredValue<'f> {
    let value = match leaf {
        JsonLeaf::Object(_) => super::measured::scalar(leaf).unwrap_or(Cell::Other("an object")),
        leaf => leaf.cell(),
    };
    MeasuredValue {
        key: Cow::Borrowed(key),
        value,
        unit: None,
        quality: None,
        is_nested: false,
    }
}
