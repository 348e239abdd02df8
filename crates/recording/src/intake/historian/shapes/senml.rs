//! Sensor measurement lists (RFC 8428): what the first records say is the base of those behind them.

use super::super::leaf::{Fields, JsonLeaf};

/// The keys of a record; base values and sums are not read.
const KEYS: [&str; 12] = [
    "bn", "bt", "bu", "bver", "n", "u", "v", "vb", "vs", "t", "s", "ut",
];

/// Units that the standard writes otherwise than plants.
const UNITS: [(&str, &str); 3] = [("Cel", "°C"), ("%RH", "%"), ("/", "1")];

/// The base of the records of a list.
#[derive(Default)]
pub(super) struct SenmlBase {
    name: String,
    time: f64,
    unit: Option<String>,
}

/// A measurement of a list.
pub(super) struct SenmlSample<'f> {
    pub(super) name: String,
    /// The time of the measurement `[s]`.
    pub(super) time: f64,
    pub(super) unit: Option<String>,
    pub(super) value: &'f JsonLeaf,
}

impl SenmlBase {
    /// The measurement that a record is. None where the record is none of such a list.
    pub(super) fn sample<'f>(&mut self, fields: &'f Fields) -> Option<SenmlSample<'f>> {
        let mut keys = fields.0.iter().map(|(key, _)| &**key);
        if !keys.all(|key| KEYS.contains(&key)) {
            return None;
        }
        let text = |key: &str| fields.get(key).and_then(JsonLeaf::as_text);
        let number = |key: &str| match fields.get(key) {
            Some(JsonLeaf::Number(number)) => Some(*number),
            Some(JsonLeaf::Integer(number)) => Some(*number as f64),
            _ => None,
        };
        let name = text("bn").unwrap_or(&self.name).to_owned();
        let whole_name = format!("{name}{}", text("n").unwrap_or_default());
        let value = ["v", "vb", "vs"].iter().find_map(|key| fields.get(key));
        let value = value.filter(|_| !whole_name.is_empty())?;
        self.name = name;
        self.time = number("bt").unwrap_or(self.time);
        self.unit = text("bu").map(str::to_owned).or(self.unit.take());
        let unit = text("u").or(self.unit.as_deref());
        let spelled = |unit: &str| {
            let row = UNITS.iter().find(|(name, _)| *name == unit);
            row.map_or(unit, |(_, spelled)| spelled).to_owned()
        };
        Some(SenmlSample {
            name: whole_name,
            time: self.time + number("t").unwrap_or(0.0),
            unit: unit.map(spelled),
            value,
        })
    }
}
