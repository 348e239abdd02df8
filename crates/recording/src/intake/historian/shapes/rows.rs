//! Objects with a time: each is a row of several signals, or a sample of one.

use super::super::super::cell::Cell;
use super::super::super::csv::{LongColumns, ValueColumns};
use super::super::super::tags::Tags;
use super::super::leaf::{Fields, JsonLeaf};
use super::super::time_names;
use super::super::walk::PathStep;
use super::instants;
use super::keys::is_any;
use super::measured::{self, MeasuredValue, ValueFields, values_of};
use super::naming::{self, LabelledName};
use super::place::DocumentPlace;
use super::senml::SenmlBase;
use super::series::{SampleTime, SeriesTags, plain_value};
use std::rc::Rc;

/// Keys of tags beside those of tables, in small letters without signs.
const TAGS: [&str; 2] = ["entityid", "statisticid"];

/// Rows and samples on their way to their series.
pub(super) struct RecordRows<'o> {
    pub(super) series: SeriesTags<'o>,
    /// The document is a list of objects or has one on each line.
    are_rows: bool,
    /// The field that is the time of the rows of a document, once one was seen.
    time: Option<String>,
    /// The last signal that a sample of a list of a list named.
    sender: Option<(Vec<PathStep>, LabelledName)>,
    is_told_left_out: bool,
    senml: SenmlBase,
    keys: Option<RowKeys>,
}

/// What the fields of rows are by their keys.
struct RowKeys {
    keys: Vec<Rc<str>>,
    /// The key of the time.
    time: String,
    long: Option<LongColumns>,
    values: ValueColumns,
}

impl RowKeys {
    fn of(fields: &Fields, time: &str) -> Self {
        let titles: Vec<&str> = fields.0.iter().map(|(key, _)| &**key).collect();
        Self {
            keys: fields.0.iter().map(|(key, _)| Rc::clone(key)).collect(),
            time: time.to_owned(),
            long: LongColumns::of(&titles).filter(|long| titles[long.time] == time),
            values: measured::columns_of(fields, Some(time)),
        }
    }

    fn are_of(&self, fields: &Fields, time: &str) -> bool {
        let mut pairs = self.keys.iter().zip(&fields.0);
        self.time == time
            && self.keys.len() == fields.0.len()
            && pairs.all(|(key, (field, _))| key == field)
    }
}

/// A row, and what its fields are.
struct TimedRow<'f> {
    fields: &'f Fields,
    time: SampleTime<'f>,
    long: Option<LongColumns>,
    values: ValueColumns,
    tag: Option<&'f str>,
}

impl<'o> RecordRows<'o> {
    pub(super) fn new(tags: Tags<'o>, are_rows: bool) -> Self {
        Self {
            series: SeriesTags::new(tags),
            are_rows,
            time: None,
            sender: None,
            is_told_left_out: false,
            senml: SenmlBase::default(),
            keys: None,
        }
    }

    /// Takes a row below the names of its columns. Answers whether it has a time.
    pub(super) fn take_of_table(&mut self, place: &DocumentPlace<'_>, fields: &Fields) -> bool {
        let option = self.series.tags.options.time.as_deref();
        let by_look = || {
            let mut cells = fields.0.iter();
            cells
                .find(|(key, leaf)| instants::is_instant_field(key, leaf))
                .map(|(key, _)| &**key)
        };
        let key = instants::time_key(fields, option).or_else(by_look);
        let Some((key, leaf)) =
            key.and_then(|time| fields.0.iter().find(|(key, _)| **key == *time))
        else {
            return false;
        };
        self.take_timed(place, fields, SampleTime::of(key, leaf))
    }

    /// Takes an object that has a time and a value. Answers whether it is one.
    pub(super) fn take(&mut self, place: &DocumentPlace<'_>, fields: &Fields) -> bool {
        if place.levels.is_empty()
            && let Some(sample) = self.senml.sample(fields)
        {
            let time = SampleTime::of_number("t [s]", sample.time);
            let value = MeasuredValue {
                unit: sample.unit.as_deref(),
                ..plain_value("v", sample.value)
            };
            let name = LabelledName::default().inner(&sample.name);
            self.series.push(place, name, &time, &value);
            return true;
        }
        match self.time_of(place, fields) {
            Some(time) => self.take_timed(place, fields, time),
            None => false,
        }
    }

    fn take_timed<'f>(
        &mut self,
        place: &DocumentPlace<'_>,
        fields: &'f Fields,
        time: SampleTime<'f>,
    ) -> bool {
        let keys = self
            .keys
            .take()
            .filter(|keys| keys.are_of(fields, time.key));
        let keys = self
            .keys
            .insert(keys.unwrap_or_else(|| RowKeys::of(fields, time.key)));
        let (long, values) = (keys.long.clone(), keys.values);
        let key_of = |long: &LongColumns| fields.0.get(long.tag).map(|(key, _)| &**key);
        let row = TimedRow {
            tag: self.tag_of(fields, long.as_ref().and_then(key_of)),
            fields,
            time,
            long,
            values,
        };
        if row.tag.is_some() || self.series.tags.options.table.tag.is_some() {
            return self.take_tagged(place, &row);
        }
        self.take_single(place, &row)
            .unwrap_or_else(|| self.take_wide(place, &row))
    }

    /// The time of an object, where it has one: a field, or its own key.
    fn time_of<'f>(
        &mut self,
        place: &DocumentPlace<'_>,
        fields: &'f Fields,
    ) -> Option<SampleTime<'f>> {
        let option = self.series.tags.options.time.as_deref();
        let field = |key: &str| fields.0.iter().find(|(name, _)| **name == *key);
        let timed = |(key, leaf): &'f (Rc<str>, JsonLeaf)| SampleTime::of(key, leaf);
        if !(self.are_rows && place.levels.is_empty()) {
            let by_field = instants::time_key(fields, option)
                .and_then(field)
                .map(timed);
            let are_scalars = || fields.0.iter().all(|(_, leaf)| leaf.is_scalar());
            let field_key = place
                .around
                .field_key()
                .filter(|key| instants::is_instant_text(key));
            let by_key = || field_key.filter(|_| are_scalars()).map(SampleTime::of_key);
            return by_field.or_else(by_key);
        }
        let key = match &self.time {
            Some(key) => key.clone(),
            None => {
                let titles: Vec<&str> = fields.0.iter().map(|(key, _)| &**key).collect();
                let of_long = || Some(titles[LongColumns::of(&titles)?.time]);
                let key = option
                    .or_else(of_long)
                    .or_else(|| row_time(fields))?
                    .to_owned();
                self.time = Some(key.clone());
                key
            }
        };
        let missing = || SampleTime::of_missing(fields.0.first().map_or("", |(key, _)| &**key));
        Some(field(&key).map_or_else(missing, timed))
    }

    /// The field that names the signal of a row.
    fn tag_of<'f>(&self, fields: &'f Fields, of_long: Option<&str>) -> Option<&'f str> {
        let option = self.series.tags.options.table.tag.as_deref();
        let mut keys = fields.0.iter().map(|(key, _)| &**key);
        let is_tag = |key: &&str| match option.or(of_long) {
            Some(tag) => *key == tag,
            None => is_any(key, &TAGS),
        };
        keys.find(is_tag)
    }

    /// Takes a row that names its signal.
    fn take_tagged(&mut self, place: &DocumentPlace<'_>, row: &TimedRow<'_>) -> bool {
        let options = self.series.tags.options;
        let tag = row.tag.and_then(|tag| row.fields.get(tag)?.text());
        let Some(tag) = tag else {
            let tag = row.tag.or(options.table.tag.as_deref()).unwrap_or_default();
            let detail = format!("there is no `{tag}` that names the signal of this row");
            self.series.fault(place.fault("missing_tag", &detail));
            return true;
        };
        let name = place.name_by_now().inner(&tag);
        let (list, in_list) = place.around.list();
        if in_list.is_some() {
            self.sender = Some((list.to_vec(), name.clone()));
        }
        let (values, is_single) = self.values_of_tag(row);
        self.tell_left_out(row);
        if let (true, [value]) = (is_single, &values[..]) {
            self.observe(&name.key(), &words_of(row, value), row);
        }
        for value in &values {
            let name = match (is_single, value.is_nested) {
                (true, _) => name.clone(),
                (false, true) => name.clone().inner(&value.key),
                (false, false) => place.name_by_now().inner(&format!("{tag}.{}", value.key)),
            };
            self.series.push(place, name, &row.time, value);
        }
        true
    }

    /// The values of a row that names its signal, and whether the row has but one.
    fn values_of_tag<'f>(&self, row: &TimedRow<'f>) -> (Vec<MeasuredValue<'f>>, bool) {
        let options = &self.series.tags.options.table;
        let told = ValueFields::at(row.fields, row.values);
        let quality = match options.quality.as_deref() {
            Some("none") => None,
            Some(key) => row.fields.get(key),
            None => told.as_ref().and_then(|told| told.quality),
        };
        let unit = told.as_ref().and_then(|told| told.unit);
        let single = told.filter(|_| options.values.is_empty());
        if let Some(value) = single.and_then(ValueFields::measured) {
            return (vec![MeasuredValue { quality, ..value }], true);
        }
        let is_quality = |key: &str| {
            let leaf = row.fields.get(key);
            quality
                .zip(leaf)
                .is_some_and(|(quality, leaf)| std::ptr::eq(quality, leaf))
        };
        let mut values = values_of(row.fields, &|key| {
            key == row.time.key || Some(key) == row.tag || is_quality(key)
        });
        if !options.values.is_empty() {
            values.retain(|value| options.values.iter().any(|key| *key == value.key));
        }
        values.retain(|value| value.is_number() || !options.values.is_empty());
        for value in &mut values {
            value.quality = value.quality.or(quality);
            value.unit = value.unit.or(unit.filter(|_| options.values.len() == 1));
        }
        (values, options.values.len() == 1)
    }

    /// Tells once of the fields of samples that hold nothing of them.
    fn tell_left_out(&mut self, row: &TimedRow<'_>) {
        let long = row.long.as_ref().filter(|_| !self.is_told_left_out);
        let Some(long) = long.filter(|_| !self.series.tags.options.table.has_signals_in_rows())
        else {
            return;
        };
        self.is_told_left_out = true;
        let titles: Vec<&str> = row.fields.0.iter().map(|(key, _)| &**key).collect();
        self.series.tags.notes.extend(long.left_out(&titles));
    }

    /// Takes a sample of the signal that the objects around it name. None where the object is no such sample; false
    /// where the name may still come.
    fn take_single(&mut self, place: &DocumentPlace<'_>, row: &TimedRow<'_>) -> Option<bool> {
        let told = ValueFields::at(row.fields, row.values)?;
        let (list, in_list) = place.around.list();
        let is_flat = place.levels.is_empty() && in_list.is_none();
        if !told.is_alone(row.fields, row.time.key) || is_flat && told.says_nothing() {
            return None;
        }
        let mut value = told.measured()?;
        if self.series.tags.options.table.quality.as_deref() == Some("none") {
            value.quality = None;
        }
        let by_now = place.name_by_now();
        let id = || naming::id_of(row.fields).filter(|_| by_now.short.is_none());
        let by_row = naming::text_name_of(row.fields).or_else(id);
        let sender = self.sender.as_ref().filter(|(of, _)| *of == *list);
        let mut name = match (by_row, sender) {
            (Some(name), _) if by_now.short.is_none() => by_now.inner(&name),
            (Some(name), _) => by_now.beside(name),
            (None, Some((_, name))) => name.clone(),
            (None, None) => match place.name() {
                Some(name) => name,
                None => return Some(false),
            },
        };
        name.places.extend(in_list.filter(|_| sender.is_none()));
        let words = words_of(row, &value);
        self.observe(&name.key(), &words, row);
        self.series.push(place, name, &row.time, &value);
        Some(true)
    }

    /// Looks whether words of rows of this name tell them apart.
    fn observe(&mut self, name: &str, values: &[MeasuredValue<'_>], row: &TimedRow<'_>) {
        let ignore = &self.series.tags.options.ignore;
        for value in values {
            if let Some(word) = value.word()
                && !ignore.iter().any(|key| *key == value.key)
            {
                let mixture = &mut self.series.mixture;
                mixture.observe(name, [&value.key, word], &row.time.leaf);
            }
        }
    }

    /// Takes a row of several signals, which its keys name.
    fn take_wide(&mut self, place: &DocumentPlace<'_>, row: &TimedRow<'_>) -> bool {
        let mut values = values_of(row.fields, &|key| key == row.time.key);
        let is_flat = self.are_rows && place.levels.is_empty();
        let is_missing =
            |value: &MeasuredValue<'_>| value.value == Cell::Empty && !self.series.is_empty();
        let is_value = |value: &MeasuredValue<'_>| value.is_number() || is_missing(value);
        if !is_flat && !values.iter().any(is_value) {
            return false;
        }
        let mut name = place.name_by_now();
        if values.iter().any(|value| value.is_nested) {
            name = name.labelled(row.fields);
            values.retain(|value| {
                value.is_nested || value.word().is_none() || !naming::is_name_field(&value.key)
            });
        }
        self.observe(&name.key(), &values, row);
        for value in &values {
            self.series
                .push(place, name.clone().inner(&value.key), &row.time, value);
        }
        true
    }
}

/// The words of a sample that say neither its name nor how its value is to be read.
fn words_of<'f>(row: &TimedRow<'f>, value: &MeasuredValue<'f>) -> Vec<MeasuredValue<'f>> {
    let is_apart = |key: &str| key == row.time.key || key == value.key || Some(key) == row.tag;
    let mut words = values_of(row.fields, &is_apart);
    let quality = value.quality.map(JsonLeaf::cell);
    words.retain(|word| Some(&word.value) != quality.as_ref() && word.word() != value.unit);
    words
}

/// The field that is the time of the rows of a document: one with the name of a time, an instant with the name of
/// one, else the first field, where the row is no description of something else.
fn row_time(fields: &Fields) -> Option<&str> {
    let (first, leaf) = fields.0.first()?;
    let by_look = || instants::time_key(fields, None).filter(|_| !instants::is_instant(leaf));
    let are_scalars = fields.0.iter().all(|(_, leaf)| leaf.is_scalar());
    let is_word = leaf
        .as_text()
        .is_some_and(|text| !text.contains(char::is_numeric));
    let is_time = are_scalars && !is_word || instants::is_instant(leaf);
    time_names::named(fields.0.iter().map(|(key, _)| &**key))
        .or_else(by_look)
        .or_else(|| is_time.then_some(&**first))
}
