//! Values of containers, and their way into streams.

use super::definitions::DefinedContainer;
use crate::intake::error::ReadError;
use crate::intake::memory::Memory;
use crate::intake::spread::{
    FieldValue, Mapping, MappingRule, PointFault, PointField, RefusedPoints, Route, Spreading,
    WrittenSamples, shown,
};
use crate::intake::units;
use jiff::Timestamp;
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::io;

/// Values of one or more containers.
#[derive(Debug, Default)]
pub struct OmfData {
    /// The values in the order of the body.
    pub values: Vec<ContainerValues>,
    /// Messages with static data and links, which are no samples and not looked at.
    pub passed_over: u64,
    /// Messages and values that are wrong.
    pub refused: RefusedPoints,
}

/// Values of one container.
#[derive(Debug)]
pub struct ContainerValues {
    /// The id of the container.
    pub container: String,
    /// The values by properties.
    values: Vec<Map<String, Value>>,
}

impl OmfData {
    /// Takes a message.
    pub(super) fn add(&mut self, message: Value) {
        let Value::Object(mut message) = message else {
            return self.refused.refuse("a message", "it is no object");
        };
        let container = match message.remove("containerid") {
            Some(Value::String(container)) => container,
            Some(_) => return self.refused.refuse("a message", "`containerid` is no text"),
            None if message.contains_key("typeid") || message.contains_key("properties") => {
                self.passed_over += 1;
                return;
            }
            None => return self.refused.refuse("a message", "`containerid` is missing"),
        };
        let Some(Value::Array(written)) = message.remove("values") else {
            return self
                .refused
                .refuse(&named(&container), "`values` is no array");
        };
        let mut values = Vec::with_capacity(written.len());
        for value in written {
            match value {
                Value::Object(properties) => values.push(properties),
                _ => self
                    .refused
                    .refuse(&named(&container), "a value is no object"),
            }
        }
        self.values.push(ContainerValues { container, values });
    }

    /// The containers that have values here.
    #[must_use]
    pub fn containers(&self) -> BTreeSet<String> {
        let ids = self.values.iter().map(|values| values.container.clone());
        ids.collect()
    }
}

/// Spreads values over streams. `containers` are those of [`OmfData::containers`] that are defined; `latest_ns` is the
/// latest instant that a sample may have, nanoseconds since 1970.
///
/// # Errors
/// The samples would take too much memory.
pub fn spread(
    data: OmfData,
    mapping: Mapping,
    containers: &BTreeMap<String, DefinedContainer>,
    latest_ns: i64,
) -> Result<WrittenSamples, ReadError> {
    // The body was bounded when it was read.
    let (memory, _) = Memory::counting(io::empty());
    let Completed { mapping, unfit } = complete(mapping, containers);
    let mut spreading = Spreading::new(&mapping, latest_ns, &memory);
    let mut refused = data.refused;
    for ContainerValues { container, values } in data.values {
        let fault = match (containers.get(&container), unfit.get(&container)) {
            (None, _) => {
                "it is not defined here: have its sender send its type and its container again"
            }
            (_, Some(fault)) => fault,
            (Some(defined), None) => {
                let route = spreading.route(&container, || {
                    Ok::<_, PointFault>((container.clone(), BTreeMap::new()))
                });
                let point = ContainerPoint {
                    defined,
                    route: &route.expect("a container is its measurement"),
                };
                let taken = values.iter().map(|value| point.take(&mut spreading, value));
                let faults = taken.filter_map(Result::err);
                faults.for_each(|fault| refused.refuse(&named(&container), &fault.to_string()));
                spreading.check_memory()?;
                continue;
            }
        };
        let values = values.iter();
        values.for_each(|_| refused.refuse(&named(&container), fault));
    }
    spreading.finish(refused)
}

fn named(container: &str) -> String {
    format!("container \"{}\"", shown(container))
}

/// Rules with what containers declare where the rules leave it open.
struct Completed {
    mapping: Mapping,
    /// Why containers cannot be taken.
    unfit: HashMap<String, String>,
}

fn complete(mut mapping: Mapping, containers: &BTreeMap<String, DefinedContainer>) -> Completed {
    let mut unfit = HashMap::new();
    let mut units_before: HashMap<(String, String), String> = HashMap::new();
    // A rule of another container would give a signal its unit before the declared unit does.
    let is_here = |rule: &MappingRule| containers.contains_key(&rule.measurement);
    mapping.rules.retain(is_here);
    for rule in &mut mapping.rules {
        let Some(defined) = containers.get(&rule.measurement) else {
            continue;
        };
        defined.complete(rule);
        for (property, mapped) in &rule.signals {
            let Some(unit) = units::parse(&mapped.unit) else {
                let fault = format!(
                    "its property \"{property}\" is in `{}`, which is no unit that is known here: say one in the \
                     mapping",
                    shown(&mapped.unit)
                );
                unfit.insert(rule.measurement.clone(), fault);
                continue;
            };
            let key = (rule.stream.clone(), mapped.signal.clone());
            let before = units_before
                .entry(key)
                .or_insert_with(|| unit.si.clone().into());
            if *before != unit.si {
                let fault = format!(
                    "its property \"{property}\" is in `{}`, and signal \"{}\" of stream \"{}\" in `{before}`",
                    mapped.unit, mapped.signal, rule.stream
                );
                unfit.insert(rule.measurement.clone(), fault);
            }
        }
    }
    Completed { mapping, unfit }
}

impl DefinedContainer {
    /// Fills in what a rule of the container leaves open.
    fn complete(&self, rule: &mut MappingRule) {
        if !self.quality.is_empty() {
            let quality = rule.quality.get_or_insert_default();
            if quality.fields.is_empty() {
                quality.fields.clone_from(&self.quality);
            }
        }
        for (property, mapped) in &mut rule.signals {
            let Some(declared) = self.signals.get(property) else {
                continue;
            };
            mapped.interpolation = mapped.interpolation.or(declared.interpolation);
            if let Some(unit) = declared.unit.as_ref().filter(|_| mapped.unit.is_empty()) {
                mapped.unit.clone_from(unit);
            }
        }
    }
}

/// Takes values of one container.
struct ContainerPoint<'c> {
    defined: &'c DefinedContainer,
    route: &'c Route,
}

impl ContainerPoint<'_> {
    /// Takes a value, all of it or nothing.
    fn take(
        &self,
        spreading: &mut Spreading<'_>,
        value: &Map<String, Value>,
    ) -> Result<(), ValueFault> {
        let index = &self.defined.index;
        let instant = match value.get(index) {
            None => return Err(ValueFault::MissingInstant(shown(index))),
            Some(instant) => instant_of(instant).ok_or_else(|| ValueFault::NoInstant {
                property: shown(index),
                value: shown(&instant.to_string()),
            })?,
        };
        let properties = value.iter().filter(|(property, _)| *property != index);
        let fields = properties.filter_map(|(property, value)| {
            let value = self.field_value(property, value)?;
            Some(Ok(PointField {
                name: Cow::Borrowed(property.as_str()),
                value,
            }))
        });
        spreading.take(self.route, instant, fields)
    }

    /// The value of a property; nothing where it is missing.
    fn field_value<'v>(&self, property: &str, value: &'v Value) -> Option<FieldValue<'v>> {
        Some(match value {
            Value::Null => return None,
            Value::Bool(value) => FieldValue::Boolean(*value),
            Value::Number(number) => FieldValue::Number(number.as_f64()?),
            Value::String(text) => {
                let names = self.defined.names.get(property);
                let is_quality = self.defined.quality.iter().any(|name| name == property);
                match names.and_then(|names| names.get(text.as_str())) {
                    Some(number) if !is_quality => FieldValue::Number(*number),
                    _ if ["NaN", "Infinity", "-Infinity"].contains(&text.as_str()) => return None,
                    _ => FieldValue::Text(Cow::Borrowed(text)),
                }
            }
            Value::Array(_) | Value::Object(_) => FieldValue::Text(Cow::Owned(value.to_string())),
        })
    }
}

/// Nanoseconds since 1970 of a text with its offset.
fn instant_of(value: &Value) -> Option<i64> {
    let instant: Timestamp = value.as_str()?.trim().parse().ok()?;
    i64::try_from(instant.as_nanosecond()).ok()
}

/// Why a value is not taken.
#[derive(Debug, thiserror::Error)]
enum ValueFault {
    #[error("a value has no `{0}`, which is its instant")]
    MissingInstant(String),
    #[error(
        "`{property}` is {value}, which is no instant with its offset, as 2026-03-02T08:15:00Z"
    )]
    NoInstant { property: String, value: String },
    #[error("{0}")]
    Unfit(#[from] PointFault),
}
