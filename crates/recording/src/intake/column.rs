//! The values of one signal on their way in: to SI, with what was met among them.

mod negative;
mod sentinels;
mod statuses;

use super::cell::Cell;
use super::error::{ReadingFaults, excerpt};
use super::options::{Decimal, Options};
use super::title;
use super::units::{self, RecordedUnit};
use super::value::{self, CellValue};
use crate::{Class, ClassSpan, Interpolation, NamedSignal, Warning, shown};
use greybox_numerics::parsing::Fault;
use negative::{NegativeForm, Negatives};
use sentinels::Sentinels;
use statuses::Statuses;

/// The values of one signal.
#[derive(Debug)]
pub(super) struct SignalColumn {
    pub(super) name: String,
    pub(super) recorded_unit: String,
    pub(super) unit: RecordedUnit,
    pub(super) interpolation: Option<Interpolation>,
    /// The unit stood at the end of the name.
    unit_from_name: bool,
    /// The unit stood in the cells.
    unit_from_cells: bool,
    ignored: bool,
    numbers: usize,
    bools: usize,
    words: Words,
    declared_missing: usize,
    negatives: Negatives,
    /// Texts that are no numbers: all of a column of text, faults in one of numbers.
    texts: usize,
    /// Whether some of the texts are numbers where their comma or point is another one.
    has_commas: bool,
    faults: ReadingFaults,
    statuses: Statuses,
    sentinels: Sentinels,
}

/// Words for a missing value, with the first of them.
#[derive(Debug, Default)]
struct Words {
    count: usize,
    examples: Vec<String>,
}

impl Words {
    fn take(&mut self, cell: &Cell<'_>) {
        /// Different words that are named.
        const NAMED: usize = 5;
        self.count += 1;
        let text = match cell {
            Cell::Text(text) => excerpt(text.trim()),
            Cell::Number(number) => shown(*number),
            _ => return,
        };
        if self.examples.len() < NAMED && !self.examples.contains(&text) {
            self.examples.push(text);
        }
    }

    fn listed(&self) -> String {
        let quoted: Vec<String> = self
            .examples
            .iter()
            .map(|word| format!("`{word}`"))
            .collect();
        quoted.join(", ")
    }
}

impl SignalColumn {
    /// The signal that a title names, e.g. `position [mm]`. A unit that is not known is a fault.
    pub(super) fn titled(title: &str, options: &Options) -> Result<Self, Box<(Self, String)>> {
        let (name, unit) = title::name_and_unit(title);
        let unit_from_name = !unit.is_empty() && name == title;
        let mut column = Self::named(name, options);
        let given_unit = options.units.get(name).map(String::as_str);
        match column.set_unit(given_unit.unwrap_or(unit)) {
            Ok(()) => {
                column.unit_from_name = unit_from_name && given_unit.is_none();
                Ok(column)
            }
            Err(detail) => Err(Box::new((column, detail))),
        }
    }

    /// The signal of that name, whose unit may be an option's.
    pub(super) fn named(name: &str, options: &Options) -> Self {
        let mut column = Self {
            name: options
                .rename
                .get(name)
                .map_or(name, String::as_str)
                .to_owned(),
            recorded_unit: String::new(),
            unit: RecordedUnit::NONE,
            interpolation: options
                .interpolation_of(name)
                .or_else(|| options.interpolation_of(options.rename.get(name)?)),
            unit_from_name: false,
            unit_from_cells: false,
            ignored: options.ignore.iter().any(|ignored| ignored == name),
            numbers: 0,
            bools: 0,
            words: Words::default(),
            declared_missing: 0,
            negatives: Negatives::default(),
            texts: 0,
            has_commas: false,
            faults: ReadingFaults::default(),
            statuses: Statuses::default(),
            sentinels: Sentinels::new(options),
        };
        if let Some(unit) = options.units.get(name) {
            column
                .set_unit(unit)
                .expect("the units of options are known ones");
        }
        column
    }

    /// Whether an option says to leave it out.
    pub(super) fn is_ignored(&self) -> bool {
        self.ignored
    }

    /// Gives it the unit that `text` names.
    pub(super) fn set_unit(&mut self, text: &str) -> Result<(), String> {
        let unit = units::parse(text).ok_or_else(|| units::unknown(text, units::UNITS_OPTION))?;
        self.unit = unit;
        text.clone_into(&mut self.recorded_unit);
        Ok(())
    }

    /// Gives it a unit that its name ends with.
    pub(super) fn set_unit_of_name(&mut self, unit: &str) {
        self.unit_from_name = self.set_unit(unit).is_ok();
    }

    /// The value in a cell in SI, NaN where it is missing; what is no value is a fault at its
    /// place, unless there is no value at all.
    pub(super) fn take(
        &mut self,
        cell: &Cell<'_>,
        options: &Options,
        place: impl FnOnce(&'static str, String) -> Fault,
    ) -> f64 {
        match CellValue::of(cell, options) {
            CellValue::Number(number) if self.unit_from_cells && !self.ignored => {
                let detail = format!("`{number}` has no unit where the samples before have one");
                self.faults.invalid(place("units_differ", detail));
                f64::NAN
            }
            CellValue::Number(number) if sentinels::is_surely_none(number) => {
                self.words.take(cell);
                f64::NAN
            }
            CellValue::Number(number) if number < 0.0 => {
                self.signed(number, NegativeForm::Minus, place)
            }
            CellValue::Number(number) => self.number(number, place),
            CellValue::Empty => f64::NAN,
            CellValue::Bool(value) => {
                self.bools += 1;
                self.number(f64::from(u8::from(value)), place)
            }
            CellValue::Word => {
                self.words.take(cell);
                f64::NAN
            }
            CellValue::Said => {
                self.declared_missing += 1;
                f64::NAN
            }
            CellValue::Text => self.text(cell, options, place),
        }
    }

    /// The value in a text that is no plain number.
    fn text(
        &mut self,
        cell: &Cell<'_>,
        options: &Options,
        place: impl FnOnce(&'static str, String) -> Fault,
    ) -> f64 {
        if let Some((number, form)) = negative(cell, options) {
            return self.signed(number, form, place);
        }
        if let Some((number, class)) = value::with_status(cell, options.decimal) {
            self.statuses.take(class);
            return match class {
                Class::Bad => f64::NAN,
                _ => self.number(number, place),
            };
        }
        match self.measured(cell, options) {
            Some(Ok(number)) => self.number(number, place),
            Some(Err(detail)) => {
                self.faults.invalid(place("units_differ", detail));
                f64::NAN
            }
            None => {
                self.texts += 1;
                self.has_commas |= has_comma(cell);
                if !self.ignored {
                    self.faults
                        .invalid(place("not_a_number", not_a_number(cell)));
                }
                f64::NAN
            }
        }
    }

    /// The number in a cell that has its unit too; a sentence where the samples before have another one.
    fn measured(&mut self, cell: &Cell<'_>, options: &Options) -> Option<Result<f64, String>> {
        let Cell::Text(text) = cell else {
            return None;
        };
        let (number, unit) = value::with_unit(text.trim())?;
        let number = value::number(number, options.decimal)?;
        if self.recorded_unit.is_empty() && self.numbers == 0 {
            self.set_unit(unit).ok()?;
            self.unit_from_cells = true;
        }
        let is_same = units::parse(unit).as_ref() == Some(&self.unit);
        let before = match self.recorded_unit.as_str() {
            "" => "without a unit",
            unit => &format!("in `{unit}`"),
        };
        let detail = || format!("`{unit}` where the samples before are {before}; write one unit");
        Some(is_same.then_some(number).ok_or_else(detail))
    }

    /// Takes a negative number that is written in a form.
    fn signed(
        &mut self,
        number: f64,
        form: NegativeForm,
        place: impl FnOnce(&'static str, String) -> Fault,
    ) -> f64 {
        if self.negatives.take(form) || self.ignored {
            return self.number(number, place);
        }
        self.numbers += 1;
        let detail = "negative numbers stand in parentheses, have a minus behind them or one before them: write all \
                      of a column one way";
        self.faults
            .invalid(place("signs_differ", detail.to_owned()));
        f64::NAN
    }

    fn number(&mut self, number: f64, place: impl FnOnce(&'static str, String) -> Fault) -> f64 {
        self.numbers += 1;
        self.sentinels.take(number);
        let value = self.unit.to_si(number);
        if !value.is_finite() && !self.ignored {
            let detail = format!(
                "`{number}` is not a finite number in {}; where it stands for a missing sample, say missing={number}",
                self.unit.si
            );
            self.faults.invalid(place("not_finite", detail));
        }
        value
    }

    /// Whether there is anything but text in it.
    pub(super) fn is_signal(&self) -> bool {
        let has_numbers = self.numbers > self.negatives.without_minus() || self.has_commas;
        !self.ignored && (self.texts == 0 || has_numbers)
    }

    /// The first text that is no number, as a fault.
    pub(super) fn first_text(&self) -> Option<&Fault> {
        self.faults.first()
    }

    /// The signal of these samples, which the `column` of a received recording holds.
    pub(super) fn into_named(self, classes: Vec<ClassSpan>, column: usize) -> NamedSignal {
        NamedSignal {
            name: self.name,
            unit: self.unit.si.into_owned(),
            recorded_unit: self.recorded_unit,
            interpolation: self.interpolation,
            classes,
            column,
        }
    }

    /// The faults of a column of numbers.
    pub(super) fn faults(&mut self) -> ReadingFaults {
        match self.is_signal() {
            true => std::mem::take(&mut self.faults),
            false => ReadingFaults::default(),
        }
    }

    /// Warnings about the values of the column and how they were read.
    pub(super) fn notes(&self) -> Vec<Warning> {
        let note = |code: &str, detail: String| Warning::of_signal(code, &self.name, detail);
        if self.ignored {
            return Vec::new();
        }
        if !self.is_signal() {
            let detail = format!(
                "{} texts and no number: the column was kept aside",
                self.texts
            );
            return vec![note("text_column", detail)];
        }
        let mut notes = Vec::new();
        if self.unit_from_name {
            let unit = &self.recorded_unit;
            let detail = format!("taken to be in {unit}, from its name; `units` says otherwise");
            notes.push(note("unit_from_name", detail));
        }
        if self.unit_from_cells {
            let detail = format!("its cells have a unit, {}", self.recorded_unit);
            notes.push(note("unit_from_cells", detail));
        }
        if !self.unit.remark.is_empty() {
            notes.push(note("unit_remark", self.unit.remark.to_owned()));
        }
        if let Some(detail) = self.negatives.assumption() {
            notes.push(note("negative_numbers", detail));
        }
        if self.words.count > 0 {
            let (count, words) = (self.words.count, self.words.listed());
            notes.push(note(
                "words_for_missing",
                format!("{count} samples are {words}: missing"),
            ));
        }
        if self.declared_missing > 0 {
            let count = self.declared_missing;
            let detail = format!("{count} samples are what `missing` says stands for none");
            notes.push(note("said_missing", detail));
        }
        if self.bools > 0 {
            let count = self.bools;
            let detail = format!("{count} samples were true or false and were read as 1 and 0");
            notes.push(note("booleans", detail));
        }
        if let Some(detail) = self.statuses.told() {
            notes.push(note("status_in_cells", detail));
        }
        let sentinels = self.sentinels.told(self.numbers).into_iter();
        notes.extend(sentinels.map(|detail| note("likely_sentinel", detail)));
        notes
    }

    /// The values in SI that stand for missing samples.
    pub(super) fn stand_ins(&self) -> Vec<f64> {
        let stand_ins = self.sentinels.stand_ins(self.numbers);
        stand_ins.map(|value| self.unit.to_si(value)).collect()
    }
}

/// The negative number in a cell that has no minus before it.
fn negative(cell: &Cell<'_>, options: &Options) -> Option<(f64, NegativeForm)> {
    let Cell::Text(text) = cell else {
        return None;
    };
    negative::number(text.trim(), options.decimal)
}

/// Whether a text is a number by some separator of its fraction.
fn has_comma(cell: &Cell<'_>) -> bool {
    let Cell::Text(text) = cell else {
        return false;
    };
    let text = text.trim();
    let is_number = |decimal| {
        value::number(text, Some(decimal)).is_some()
            || negative::number(text, Some(decimal)).is_some()
    };
    is_number(Decimal::Comma) || is_number(Decimal::Point)
}

fn not_a_number(cell: &Cell<'_>) -> String {
    let Cell::Text(text) = cell else {
        let kind = match cell {
            Cell::Other(kind) => kind,
            _ => "something else",
        };
        return format!("expected a number, found {kind}");
    };
    let has_points = || value::number(text.trim(), Some(Decimal::Comma)).is_some();
    let advice = if text.contains(',') {
        "; its comma may stand before a fraction or between thousands: say decimal=, or decimal=."
    } else if has_points() {
        "; its points may stand between thousands: say decimal=,"
    } else {
        ""
    };
    let text = excerpt(text.trim());
    // A word is a value that is missing more often than a number that is written wrong.
    let is_word = text.contains(char::is_alphabetic) || !text.contains(char::is_numeric);
    let missing = match is_word {
        false => String::new(),
        true => format!("; where it stands for a missing sample, say missing={text}"),
    };
    format!("`{text}` is not a number{advice}{missing}")
}
