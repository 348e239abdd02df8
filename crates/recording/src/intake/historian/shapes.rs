//! Series and rows of any document, by how it is built.
//!
//! | built so | its samples |
//! |---|---|
//! | an object with a time | one of each of its numbers, or of the signal that it or the objects around it name |
//! | an object whose keys are times | of the signal that the key or the object around it names |
//! | lists or objects of one length side by side, one of them times | of each of the others |
//! | pairs of a time and a value | of the signal that the key or the object around them names |
//! | rows below the names of their columns | as those of an object with a time |
//!
//! A sample whose name may still come waits for the object around it. Series of one name are told apart by the names
//! and labels farther out.

mod instants;
mod keys;
mod lists;
mod measured;
mod mixture;
mod naming;
mod place;
mod rows;
mod senml;
mod series;
mod table;

use super::super::Format;
use super::super::tags::Tags;
use super::leaf::{Fields, JsonLeaf};
use super::walk::{Surroundings, Visit};
use crate::Warning;
use greybox_numerics::parsing::Fault;
use lists::SideBySide;
use naming::LabelledName;
use place::DocumentPlace;
use rows::RecordRows;
use series::{SampleTime, plain_value};
use std::rc::Rc;
use table::{PairOrder, TableHeader};

/// The fault of a document in which no samples are.
const NO_SAMPLES: &str = "no times beside values that are read here are in it; send an object for each row, such as \
    [{\"time\": \"2026-03-02T08:15:00Z\", \"PT [bar]\": 3.2}], lists of one length, such as {\"time\": [0, 0.1], \
    \"PT [bar]\": [3.2, 3.3]}, or {\"sample_time_s\": 0.1, \"signals\": {\"PT\": {\"unit\": \"bar\", \"values\": \
    [3.2, 3.3]}}}; where a field is the time, say `time`";

/// Samples of a document on their way to their series.
pub(super) struct Shapes<'o> {
    rows: RecordRows<'o>,
    /// Around how many objects the last samples stood.
    depth: Option<usize>,
    header: Option<TableHeader>,
    pairs: Option<PairOrder>,
    /// Elements that were left out, and the place of the first.
    left_out: (usize, String),
    /// How many fields of each object around were read before its first samples, from the outermost.
    first_fields: Vec<usize>,
    /// The names of an object that came behind its samples.
    late_name: Option<String>,
    /// The number that the key of the next row has, where rows are numbered by their keys.
    next_row: u64,
}

impl<'o> Shapes<'o> {
    pub(super) fn new(format: Format, tags: Tags<'o>) -> Self {
        Self {
            rows: RecordRows::new(tags, format == Format::PandasRecords),
            depth: None,
            header: None,
            pairs: None,
            left_out: (0, String::new()),
            first_fields: Vec::new(),
            late_name: None,
            next_row: 0,
        }
    }

    /// The tags, with what is to be said of all of them.
    pub(super) fn into_tags(mut self) -> Tags<'o> {
        let series = &mut self.rows.series;
        if series.is_empty() && series.tags.faults.is_empty() {
            series.fault(Fault::of_whole("no_signals", NO_SAMPLES.to_owned()));
        }
        let (count, first) = &self.left_out;
        if *count > 0 {
            let detail = format!(
                "{count} objects or elements beside samples have numbers that belong to none and were left out, the first \
                 at `{first}`"
            );
            let note = Warning::of_recording("left_out_elements", detail);
            series.tags.notes.push(note);
        }
        self.rows.series.into_tags()
    }

    /// Takes what an object at a place is, in the order in which that is least in doubt.
    fn take(&mut self, place: DocumentPlace<'_>, fields: &Fields) -> bool {
        if place.is_too_deep() {
            return false;
        }
        if self.take_times(&place, fields) || self.take_lists(&place, fields) {
            return true;
        }
        let is_next = place.number() == Some(self.next_row);
        let place = match is_next {
            true => place.of_numbered(),
            false => place,
        };
        if self.rows.take(&place, fields) {
            self.next_row += u64::from(is_next);
            return true;
        }
        self.take_objects(&place, fields)
    }

    /// Takes an object whose keys are times.
    fn take_times(&mut self, place: &DocumentPlace<'_>, fields: &Fields) -> bool {
        let mut all = fields.0.iter();
        let are_times = !fields.0.is_empty()
            && all.all(|(key, leaf)| {
                instants::is_instant_text(key) && measured::scalar(leaf).is_some()
            });
        let name = are_times.then(|| place.name_of_list()).flatten();
        let Some(name) = name else {
            return false;
        };
        for (key, leaf) in &fields.0 {
            let value = plain_value("value", leaf);
            self.rows
                .series
                .push(place, name.clone(), &SampleTime::of_key(key), &value);
        }
        true
    }

    /// Takes the series that the lists of an object are.
    fn take_lists(&mut self, place: &DocumentPlace<'_>, fields: &Fields) -> bool {
        let has_lists = |(_, leaf): &(Rc<str>, JsonLeaf)| matches!(leaf, JsonLeaf::List(_));
        if self.take_side_by_side(place, fields) {
            return true;
        }
        if !fields.0.iter().any(has_lists) {
            return false;
        }
        let names = table::columns_of(fields);
        let mut is_taken = false;
        for (key, leaf) in &fields.0 {
            let JsonLeaf::List(elements) = leaf else {
                continue;
            };
            let inner = place.within(key, fields, None).listed();
            is_taken |= self.take_table(&inner, names.as_deref(), elements)
                || self.take_pairs(&inner, key, elements)
                || self.take_elements(place, key, fields, elements);
        }
        is_taken
    }

    /// Takes the objects of a list, each for itself.
    fn take_elements(
        &mut self,
        place: &DocumentPlace<'_>,
        key: &str,
        fields: &Fields,
        elements: &[JsonLeaf],
    ) -> bool {
        let mut taken = 0;
        for (index, element) in elements.iter().enumerate() {
            if let JsonLeaf::Object(object) = element
                && self.take(place.within(key, fields, Some(index)), object)
            {
                taken += 1;
            }
        }
        if taken > 0 && taken < elements.len() {
            self.left_over(place.around, elements.len() - taken);
        }
        taken > 0
    }

    /// Takes the objects that are fields of an object, each for itself.
    fn take_objects(&mut self, place: &DocumentPlace<'_>, fields: &Fields) -> bool {
        let mut is_taken = false;
        for (key, leaf) in &fields.0 {
            if let JsonLeaf::Object(object) = leaf {
                is_taken |= self.take(place.within(key, fields, None), object);
            }
        }
        is_taken
    }

    /// Takes columns that stand side by side in an object.
    fn take_side_by_side(&mut self, place: &DocumentPlace<'_>, fields: &Fields) -> bool {
        let option = self.rows.series.tags.options.time.as_deref();
        let Some(columns) = SideBySide::of(fields, option) else {
            return false;
        };
        let inner = place.within("values", fields, None).listed();
        let by_keys = || (!columns.is_lone_value()).then(|| inner.name_by_now());
        let Some(name) = inner.name().or_else(by_keys) else {
            return false;
        };
        for column in &columns.values {
            if column.leaves.len() != columns.time.leaves.len() {
                let detail = format!(
                    "`{}` has {} values where `{}` has {} times",
                    column.key,
                    column.leaves.len(),
                    columns.time.key,
                    columns.time.leaves.len()
                );
                self.rows.series.fault(place.fault("wrong_length", &detail));
                continue;
            }
            let name = match columns.is_lone_value() {
                true => name.clone(),
                false => name.clone().inner(column.key),
            };
            for (time, leaf) in columns.time.leaves.iter().zip(&column.leaves) {
                let mut value = plain_value(column.key, leaf);
                value.unit = column.unit;
                let time = SampleTime::of(columns.time.key, time);
                self.rows.series.push(place, name.clone(), &time, &value);
            }
        }
        true
    }

    /// Takes rows below the names of their columns, which the object around has or the first row is.
    fn take_table(
        &mut self,
        place: &DocumentPlace<'_>,
        names: Option<&[Rc<str>]>,
        rows: &[JsonLeaf],
    ) -> bool {
        let mut cells = rows.iter().map_while(table::cells_of).peekable();
        let first_row = cells.peek().and_then(|cells| table::titles(cells));
        let titles = names.is_none().then_some(first_row).flatten();
        let skipped = usize::from(titles.is_some());
        let Some(names) = names.or(titles.as_deref()) else {
            return false;
        };
        let mut taken = 0;
        for cells in cells.skip(skipped) {
            let Some(row) =
                table::named_row(names, &cells).filter(|row| self.rows.take_of_table(place, row))
            else {
                break;
            };
            taken += usize::from(!row.0.is_empty());
        }
        if taken > 0 && taken + skipped < rows.len() {
            self.left_over(place.around, rows.len() - skipped - taken);
        }
        taken > 0
    }

    /// Takes pairs of a time and a value under this key.
    fn take_pairs(&mut self, place: &DocumentPlace<'_>, key: &str, pairs: &[JsonLeaf]) -> bool {
        let lists = pairs.iter().map_while(|pair| match pair {
            JsonLeaf::List(cells) => Some(&cells[..]),
            _ => None,
        });
        let lists: Vec<&[JsonLeaf]> = match lists.collect::<Vec<_>>() {
            // An answer on one instant has the pair alone.
            lists if lists.is_empty() && key == "value" => vec![pairs],
            lists => lists,
        };
        let Some(first) = lists.first() else {
            return false;
        };
        let order = match PairOrder::of(key, first, &[]) {
            Some(Ok(order)) => order,
            Some(Err(detail)) => {
                self.rows
                    .series
                    .fault(place.fault("layout_unclear", &detail));
                return true;
            }
            None => return false,
        };
        let Some(name) = place.name() else {
            return false;
        };
        for pair in lists {
            self.take_pair(place, &name, &order, pair);
        }
        true
    }

    fn take_pair(
        &mut self,
        place: &DocumentPlace<'_>,
        name: &LabelledName,
        order: &PairOrder,
        pair: &[JsonLeaf],
    ) {
        let (Some(time), Some(value), 2) =
            (pair.get(order.time), pair.get(1 - order.time), pair.len())
        else {
            let detail = "the pairs before have a time and a value";
            return self.rows.series.fault(place.fault("ragged_row", detail));
        };
        if order.are_instants && !instants::is_instant(time) {
            let detail = format!(
                "`{}` is no time where the pairs before have one",
                time.cell()
            );
            return self.rows.series.fault(place.fault("not_a_time", &detail));
        }
        let value = plain_value("value", value);
        self.rows
            .series
            .push(place, name.clone(), &SampleTime::of("", time), &value);
    }

    /// Takes a row of a list that is not complete. Answers whether samples were taken of it; none where it waits for
    /// the object around it.
    fn take_row(&mut self, place: &DocumentPlace<'_>, cells: &[JsonLeaf]) -> Option<bool> {
        let (list, _) = place.around.list();
        let is_first = place.around.index() == 0;
        if self
            .header
            .as_ref()
            .is_none_or(|header| header.list != *list)
        {
            let around = place.levels.first();
            let names = around.and_then(|level| table::columns_of(level.fields));
            let is_titled = names.is_none() && is_first;
            let titles = is_titled.then(|| table::titles(cells)).flatten();
            let (is_titles, list) = (titles.is_some(), list.to_vec());
            self.header = names.or(titles).map(|names| TableHeader { list, names });
            if is_titles {
                return Some(false);
            }
        }
        if let Some(header) = &self.header {
            let row = table::named_row(&header.names, cells)?;
            return self.rows.take_of_table(place, &row).then_some(true);
        }
        let key = place.levels.first().map_or("", |level| level.key);
        let name = place.name()?;
        if is_first || self.pairs.as_ref().is_none_or(|pairs| pairs.list != *list) {
            self.pairs = match PairOrder::of(key, cells, list)? {
                Ok(order) => Some(order),
                Err(detail) => {
                    self.rows
                        .series
                        .fault(place.fault("layout_unclear", &detail));
                    return Some(true);
                }
            };
        }
        let order = self.pairs.clone()?;
        self.take_pair(place, &name, &order, cells);
        Some(true)
    }

    /// Looks at an object in which samples were taken already.
    fn check_around(&mut self, around: &Surroundings<'_>, fields: &Fields) {
        let is_number =
            |leaf: &JsonLeaf| matches!(leaf, JsonLeaf::Integer(_) | JsonLeaf::Number(_));
        if let Some(time) = instants::time_key(fields, None)
            && fields
                .0
                .iter()
                .any(|(key, leaf)| **key != *time && is_number(leaf))
        {
            self.left_over(around, 1);
        }
        let depth = around.objects.len();
        let late = self
            .first_fields
            .get(depth)
            .map(|first| naming::told_behind(fields, *first));
        let Some(late) = late.filter(|late| !late.is_empty()) else {
            return;
        };
        if let Some(before) = self.late_name.as_ref().filter(|before| **before != late) {
            let detail = format!(
                "`{late}` stands behind its samples, and `{before}` behind others: put the names before the samples"
            );
            self.rows
                .series
                .fault(around.fault("layout_unclear", &detail));
        }
        self.late_name = Some(late);
    }

    /// Keeps how much of the objects around was read before their first samples.
    fn keep_first_fields(&mut self, around: &Surroundings<'_>) {
        let objects = around.objects.iter().skip(self.first_fields.len());
        self.first_fields
            .extend(objects.map(|fields| fields.0.len()));
    }
}

/// Whether an object is a field of another one, which may be a row itself, and no row by its key.
fn is_field(around: &Surroundings<'_>, next_row: u64) -> bool {
    let is_row = |key: &str| key.parse() == Ok(next_row) || instants::is_instant_text(key);
    around.field_key().is_some_and(|key| !is_row(key))
}

impl Visit for Shapes<'_> {
    fn object(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool {
        let depth = around.objects.len();
        let has_samples = self.depth.is_some_and(|samples| samples > depth);
        let place = DocumentPlace::of(around);
        let is_taken = if has_samples {
            self.check_around(around, fields);
            self.take_lists(&place, fields);
            true
        } else if is_field(around, self.next_row) {
            self.take_times(&place, fields) || self.take_lists(&place, fields)
        } else {
            self.take(place, fields)
        };
        self.first_fields.truncate(depth);
        if is_taken {
            self.depth = Some(depth);
            self.keep_first_fields(around);
        }
        is_taken
    }

    fn row(&mut self, around: &Surroundings<'_>, cells: &[JsonLeaf]) -> bool {
        let place = DocumentPlace::of(around).listed();
        let taken = self.take_row(&place, cells);
        if taken == Some(true) {
            self.depth = Some(around.objects.len());
            self.keep_first_fields(around);
        }
        taken.is_some()
    }

    fn left_over(&mut self, around: &Surroundings<'_>, elements: usize) {
        if self.left_out.0 == 0 {
            self.left_out.1 = around.pointer();
        }
        self.left_out.0 += elements;
    }

    fn keeps_lists(&self) -> bool {
        true
    }

    fn is_full(&self) -> bool {
        self.rows.series.tags.is_full()
    }
}

#[cfg(test)]
mod tests;
