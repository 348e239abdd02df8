//! Reading a JSON document into types while collecting every fault on the way.
//!
//! A [`Field`] knows its place; asking it for a type it does not have records a fault and answers
//! `None`. An [`Object`] remembers which of its fields were asked for, so that [`Object::finish`]
//! can refuse the others: a typo must not run a wrong job.

use std::borrow::Cow;
use std::cell::RefCell;

use jiff::Timestamp;
use serde_json::{Map, Value};

use super::fault::{Fault, pointer_to};

/// The faults of one document that are reported at the most; what comes after them is not looked for.
pub const MAX_FAULTS: usize = 100;

/// The faults found so far in one document, the first [`MAX_FAULTS`] of them.
#[derive(Default)]
pub struct Faults(RefCell<Vec<Fault>>);

impl Faults {
    /// Records a fault.
    pub fn add(
        &self,
        pointer: impl Into<String>,
        code: impl Into<Cow<'static, str>>,
        detail: impl Into<String>,
    ) {
        self.push(Fault::new(pointer, code, detail));
    }

    /// Records a fault that is spelled out already.
    pub fn push(&self, fault: Fault) {
        if !self.are_full() {
            self.0.borrow_mut().push(fault);
        }
    }

    /// Whether one more would not be reported.
    pub fn are_full(&self) -> bool {
        self.count() >= MAX_FAULTS
    }

    /// How many faults there are.
    pub fn count(&self) -> usize {
        self.0.borrow().len()
    }

    /// All faults, in the order in which they were found.
    pub fn into_vec(self) -> Vec<Fault> {
        self.0.into_inner()
    }
}

/// What `read` makes of a whole document.
///
/// # Errors
/// Everything that is wrong with the document.
pub fn read_document<T>(
    document: &Value,
    read: impl FnOnce(&Field<'_>) -> Option<T>,
) -> Result<T, Vec<Fault>> {
    let faults = Faults::default();
    let read = read(&Field::root(document, &faults));
    let faults = faults.into_vec();
    match read {
        Some(read) if faults.is_empty() => Ok(read),
        _ => Err(faults),
    }
}

/// A value at its place in the document.
#[derive(Clone)]
pub struct Field<'v> {
    /// Where the value stands.
    pub pointer: String,
    /// The value.
    pub value: &'v Value,
    faults: &'v Faults,
}

impl<'v> Field<'v> {
    /// The whole document.
    pub fn root(value: &'v Value, faults: &'v Faults) -> Self {
        Self {
            pointer: String::new(),
            value,
            faults,
        }
    }

    /// Records a fault at this place.
    pub fn fault(&self, code: impl Into<Cow<'static, str>>, detail: impl Into<String>) {
        self.faults.add(&*self.pointer, code, detail);
    }

    /// Records a fault that is spelled out already.
    pub fn push(&self, fault: Fault) {
        self.faults.push(fault);
    }

    fn wrong_type<T>(&self, expected: &str) -> Option<T> {
        self.fault(
            "wrong_type",
            format!("{} is not {expected}", shown(self.value)),
        );
        None
    }

    /// The value as an object.
    pub fn object(&self) -> Option<Object<'v>> {
        match self.value {
            Value::Object(map) => Some(Object {
                pointer: self.pointer.clone(),
                map,
                names: Vec::new(),
                faults: self.faults,
            }),
            _ => self.wrong_type("an object"),
        }
    }

    /// The values of an array, each at its place.
    pub fn array(&self) -> Option<impl ExactSizeIterator<Item = Field<'v>> + use<'v>> {
        match self.value {
            Value::Array(items) => {
                let (pointer, faults) = (self.pointer.clone(), self.faults);
                Some(items.iter().enumerate().map(move |(index, value)| Field {
                    pointer: format!("{pointer}/{index}"),
                    value,
                    faults,
                }))
            }
            _ => self.wrong_type("an array"),
        }
    }

    /// The value as text.
    pub fn text(&self) -> Option<&'v str> {
        match self.value {
            Value::String(text) => Some(text),
            _ => self.wrong_type("a string"),
        }
    }

    /// The value as an instant, with its offset.
    pub fn instant(&self) -> Option<Timestamp> {
        let instant = self.text()?.parse();
        if instant.is_err() {
            let detail = "not an instant with its offset, such as 2026-03-02T08:15:00+01:00";
            self.fault("not_a_time", detail);
        }
        instant.ok()
    }

    /// The value as true or false.
    pub fn boolean(&self) -> Option<bool> {
        match self.value {
            Value::Bool(value) => Some(*value),
            _ => self.wrong_type("true or false"),
        }
    }

    /// The value as a finite number.
    pub fn number(&self) -> Option<f64> {
        match self.value.as_f64() {
            Some(number) if number.is_finite() => Some(number),
            _ => self.wrong_type("a number"),
        }
    }

    /// A whole number in `[least, most]`; `1e3` and `1000.0` count as whole.
    pub fn integer(&self, least: u64, most: u64) -> Option<u64> {
        let Value::Number(number) = self.value else {
            return self.wrong_type("a whole number");
        };
        let whole = number.as_u64().or_else(|| {
            let value = number.as_f64()?;
            let exact = value.fract() == 0.0 && (0.0..=LARGEST_EXACT).contains(&value);
            exact.then_some(value as u64)
        });
        match whole {
            Some(value) if (least..=most).contains(&value) => Some(value),
            None if !number.as_f64().is_some_and(|value| value.fract() == 0.0) => {
                self.wrong_type("a whole number")
            }
            _ => {
                let detail = format!("{number} is outside {least} to {most}");
                self.fault("out_of_range", detail);
                None
            }
        }
    }

    /// A number in `[least, most]`.
    pub fn number_within(&self, least: f64, most: f64) -> Option<f64> {
        let number = self.number()?;
        if (least..=most).contains(&number) {
            return Some(number);
        }
        let detail = if most.is_infinite() {
            format!("{number} is below {least}")
        } else {
            format!("{number} is outside {least} to {most}")
        };
        self.fault("out_of_range", detail);
        None
    }

    /// A number above zero.
    pub fn positive(&self) -> Option<f64> {
        let number = self.number()?;
        if number > 0.0 {
            return Some(number);
        }
        self.fault("not_positive", format!("{number} is not above 0"));
        None
    }

    /// One of `choices`, by its name.
    pub fn choice<T: Copy>(&self, choices: &[(&str, T)]) -> Option<T> {
        let text = self.text()?;
        let chosen = choices.iter().find(|(name, _)| *name == text);
        if let Some((_, value)) = chosen {
            return Some(*value);
        }
        let names: Vec<&str> = choices.iter().map(|(name, _)| *name).collect();
        let detail = format!("`{text}` is not one of {}", listed(&names));
        self.fault("unknown_choice", detail);
        None
    }
}

/// Above this, neighbouring doubles are more than 1 apart and a JSON client may lose digits.
pub const LARGEST_EXACT: f64 = 9_007_199_254_740_991.0;

/// An object of which every field must be asked for.
pub struct Object<'v> {
    /// The JSON pointer of the object.
    pub pointer: String,
    map: &'v Map<String, Value>,
    names: Vec<&'static str>,
    faults: &'v Faults,
}

impl<'v> Object<'v> {
    /// The field `name`; absent and `null` are the same.
    pub fn optional(&mut self, name: &'static str) -> Option<Field<'v>> {
        self.names.push(name);
        let value = self.map.get(name).filter(|value| !value.is_null())?;
        Some(self.field(name, value))
    }

    /// The field `name`; absent and `null` are not the same.
    pub fn present(&mut self, name: &'static str) -> Option<Field<'v>> {
        self.names.push(name);
        let value = self.map.get(name)?;
        Some(self.field(name, value))
    }

    /// The field `name`, whose absence is a fault.
    pub fn required(&mut self, name: &'static str) -> Option<Field<'v>> {
        let field = self.optional(name);
        if field.is_none() {
            let detail = format!("`{name}` is missing");
            self.faults
                .add(self.pointer.clone(), "missing_field", detail);
        }
        field
    }

    /// How many entries it has.
    pub fn n_entries(&self) -> usize {
        self.map.len()
    }

    /// Every entry, for objects whose keys are data; none any more once the faults are full.
    pub fn entries(&self) -> impl Iterator<Item = (&'v str, Field<'v>)> + use<'v> {
        let (pointer, faults) = (self.pointer.clone(), self.faults);
        let reported = self.map.iter().take_while(|_| !faults.are_full());
        reported.map(move |(name, value)| {
            let pointer = pointer_to(&pointer, name);
            let field = Field {
                pointer,
                value,
                faults,
            };
            (name.as_str(), field)
        })
    }

    /// Records a fault at this object.
    pub fn fault(&self, code: impl Into<Cow<'static, str>>, detail: impl Into<String>) {
        self.faults.add(self.pointer.clone(), code, detail);
    }

    /// Refuses every field that was not asked for.
    pub fn finish(self) {
        for (name, field) in self.entries() {
            if !self.names.contains(&name) {
                let hint = did_you_mean(name, self.names.iter().copied());
                let detail = format!("`{}` is not a field here{hint}", short(name));
                field.fault("unknown_field", detail);
            }
        }
    }

    fn field(&self, name: &str, value: &'v Value) -> Field<'v> {
        Field {
            pointer: pointer_to(&self.pointer, name),
            value,
            faults: self.faults,
        }
    }
}

/// `; did you mean …?` when one of `candidates` is close to `name`, else nothing.
pub fn did_you_mean<'a>(name: &str, candidates: impl Iterator<Item = &'a str>) -> String {
    /// Jaro-Winkler similarity from which a name passes for a slip of another.
    const CLOSE: f64 = 0.84;
    /// A longer text is not a slip of any name, and would take long to compare.
    const LONGEST: usize = 48;
    if name.len() > LONGEST {
        return String::new();
    }
    let scored = candidates.map(|candidate| (strsim::jaro_winkler(name, candidate), candidate));
    match scored.max_by(|a, b| a.0.total_cmp(&b.0)) {
        Some((similarity, candidate)) if similarity >= CLOSE => {
            format!("; did you mean `{candidate}`?")
        }
        _ => String::new(),
    }
}

/// `` `a`, `b` or `c` ``.
pub fn listed(names: &[&str]) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match quoted.split_last() {
        None => "nothing".into(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} or {last}", rest.join(", ")),
    }
}

/// A value as a fault's sentence shows it: short.
fn shown(value: &Value) -> String {
    match value {
        Value::Object(_) => "an object".into(),
        Value::Array(_) => "an array".into(),
        other => short(&other.to_string()).into_owned(),
    }
}

/// A text as a fault's sentence shows it.
fn short(text: &str) -> Cow<'_, str> {
    /// Longer texts are cut.
    const LONGEST: usize = 40;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]).into(),
        None => text.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn faults_of(value: &Value, read: impl FnOnce(Field<'_>)) -> Vec<Fault> {
        let faults = Faults::default();
        read(Field::root(value, &faults));
        faults.into_vec()
    }

    #[test]
    fn a_field_that_was_not_asked_for_is_a_fault_with_a_suggestion() {
        let value = json!({"populaton": 30});
        let faults = faults_of(&value, |field| {
            let mut object = field.object().unwrap();
            object.optional("population");
            object.finish();
        });
        assert_eq!(
            faults,
            [Fault::new(
                "/populaton",
                "unknown_field",
                "`populaton` is not a field here; did you mean `population`?"
            )]
        );
    }

    #[test]
    fn whole_numbers_may_be_written_as_floats_and_others_are_told_apart() {
        assert!(faults_of(&json!(1e3), |f| assert_eq!(f.integer(1, 2000), Some(1000))).is_empty());
        let code = |value: Value| {
            let faults = faults_of(&value, |field| assert_eq!(field.integer(1, 10), None));
            faults[0].code.to_string()
        };
        assert_eq!(code(json!(1.5)), "wrong_type");
        assert_eq!(code(json!("3")), "wrong_type");
        assert_eq!(code(json!(0)), "out_of_range");
        assert_eq!(code(json!(-3)), "out_of_range");
        assert_eq!(code(json!(1e300)), "out_of_range");
    }

    #[test]
    fn long_values_are_cut_at_a_character() {
        let faults = faults_of(&json!("ä".repeat(100)), |field| {
            field.number();
        });
        assert!(faults[0].detail.chars().count() < 70);
    }
}
