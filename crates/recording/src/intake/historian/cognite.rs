//! Values and units of datapoints of Cognite Data Fusion.

use super::leaf::Fields;

/// Aggregates that a datapoint may have in place of its value.
const AGGREGATES: [&str; 10] = [
    "average",
    "max",
    "min",
    "interpolation",
    "stepInterpolation",
    "sum",
    "count",
    "totalVariation",
    "continuousVariance",
    "discreteVariance",
];

/// Aggregates in the unit of the values.
const IN_UNIT: [&str; 6] = [
    "value",
    "average",
    "max",
    "min",
    "interpolation",
    "stepInterpolation",
];

/// Units of the catalog behind the quantity, as plants spell them.
const UNITS: [(&str, &str); 26] = [
    ("a", "A"),
    ("bar", "bar"),
    ("deg_c", "°C"),
    ("deg_f", "°F"),
    ("hz", "Hz"),
    ("k", "K"),
    ("kg", "kg"),
    ("kg-per-hr", "kg/h"),
    ("kg-per-sec", "kg/s"),
    ("kilopa", "kPa"),
    ("kilow", "kW"),
    ("l-per-min", "l/min"),
    ("m", "m"),
    ("m-per-sec", "m/s"),
    ("m3-per-hr", "m³/h"),
    ("m3-per-sec", "m³/s"),
    ("megapa", "MPa"),
    ("megaw", "MW"),
    ("millibar", "mbar"),
    ("millim", "mm"),
    ("n-m", "N·m"),
    ("pa", "Pa"),
    ("percent", "%"),
    ("psi", "psi"),
    ("v", "V"),
    ("w", "W"),
];

/// The fields of a datapoint that are its values: its value, its one aggregate, or those that the option `value` names.
/// A sentence where there are several aggregates and nothing says which.
pub(super) fn values<'f>(fields: &'f Fields, named: &'f [String]) -> Result<Vec<&'f str>, String> {
    if !named.is_empty() {
        return Ok(named.iter().map(String::as_str).collect());
    }
    if fields.has("value") {
        return Ok(vec!["value"]);
    }
    let keys = fields.0.iter().map(|(key, _)| &**key);
    let aggregates: Vec<&str> = keys.filter(|key| AGGREGATES.contains(key)).collect();
    match aggregates[..] {
        [] => Ok(vec!["value"]),
        [first, _, ..] => Err(format!(
            "each sample has {}: say which is the value, such as value={first}",
            aggregates.join(", ")
        )),
        [_] => Ok(aggregates),
    }
}

/// Whether a value has the unit of its signal.
pub(super) fn has_unit(key: &str) -> bool {
    IN_UNIT.contains(&key)
}

/// The unit of a signal: its text, or the one of the catalog that its identifier names, such as `pressure:bar`.
pub(super) fn unit_of(signal: &Fields) -> Option<&str> {
    let text = |key: &str| signal.get(key)?.as_text();
    let of_catalog = || {
        let (_, unit) = text("unitExternalId")?.split_once(':')?;
        let row = UNITS.iter().find(|(name, _)| *name == unit);
        row.map(|(_, spelled)| *spelled)
    };
    text("unit").or_else(of_catalog)
}
