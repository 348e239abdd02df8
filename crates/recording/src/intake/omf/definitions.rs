//! Types and containers: read from a body, kept as far as they are needed, and put together.

use super::header::OmfAction;
use crate::Interpolation;
use crate::intake::spread::{RefusedPoints, shown};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// The bytes of an id, a name or a unit at the most.
const LONGEST_NAME: usize = 500;
/// The properties of a type, the values of an enumeration and the overrides of a container at the most.
const MOST_ENTRIES: usize = 1000;

/// The types and containers of a body.
#[derive(Debug, Default)]
pub struct OmfDefinitions {
    /// The definitions that come and go, in the order of the body.
    pub changes: Vec<DefinitionChange>,
    /// Definitions that are wrong.
    pub refused: RefusedPoints,
}

/// A definition that comes, or goes.
#[derive(Clone, Debug, PartialEq)]
pub enum DefinitionChange {
    /// The definition is stored, in the place of the one of its key.
    Stored(DefinitionKey, OmfDefinition),
    /// The definition is removed.
    Removed(DefinitionKey),
}

/// The key of a definition.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct DefinitionKey {
    /// Types and containers have ids of their own.
    pub kind: DefinitionKind,
    /// The id that the sender chose.
    pub id: String,
}

/// A type or a container, as a kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DefinitionKind {
    /// A type.
    Type,
    /// A container.
    Container,
}

impl DefinitionKind {
    /// The kind in one word.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Type => "type",
            Self::Container => "container",
        }
    }
}

/// A type or a container, without its id.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OmfDefinition {
    /// A type.
    Type(TypeDefinition),
    /// A container.
    Container(ContainerDefinition),
}

impl OmfDefinition {
    /// The type; nothing where it is a container.
    #[must_use]
    pub fn into_type(self) -> Option<TypeDefinition> {
        match self {
            Self::Type(definition) => Some(definition),
            Self::Container(_) => None,
        }
    }

    /// The container; nothing where it is a type.
    #[must_use]
    pub fn into_container(self) -> Option<ContainerDefinition> {
        match self {
            Self::Container(definition) => Some(definition),
            Self::Type(_) => None,
        }
    }
}

/// A type: the properties of a value, or the names of an enumeration.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TypeDefinition {
    /// The property that is the instant.
    #[serde(skip_serializing_if = "Option::is_none")]
    index: Option<String>,
    /// The properties that say how good a value is.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    quality: Vec<String>,
    /// The types of properties that have a type by its id.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    types: BTreeMap<String, String>,
    /// The declarations of signals, by properties.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    signals: BTreeMap<String, DeclaredSignal>,
    /// The numbers of an enumeration by their names.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    names: BTreeMap<String, f64>,
}

impl TypeDefinition {
    /// The ids of the types that properties are of.
    pub fn types(&self) -> impl Iterator<Item = &str> {
        self.types.values().map(String::as_str)
    }
}

/// A container: its type, and what the container says otherwise.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ContainerDefinition {
    /// The id of the type.
    #[serde(rename = "type")]
    pub type_id: String,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    signals: BTreeMap<String, DeclaredSignal>,
}

/// The declaration of a signal by a sender.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct DeclaredSignal {
    /// The unit as the sender writes it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) unit: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) interpolation: Option<Interpolation>,
}

impl DeclaredSignal {
    fn new(unit: Option<String>, interpolation: Option<&str>) -> Self {
        let interpolation = interpolation.map(str::to_ascii_lowercase);
        Self {
            unit: unit.filter(|unit| !unit.trim().is_empty()),
            interpolation: match interpolation.as_deref() {
                Some("continuous") => Some(Interpolation::Linear),
                Some("stepwisecontinuousleading") => Some(Interpolation::Hold),
                _ => None,
            },
        }
    }

    fn says_something(&self) -> bool {
        *self != Self::default()
    }

    /// The declaration, with another one for the parts that are left out.
    fn or(self, other: Self) -> Self {
        Self {
            unit: self.unit.or(other.unit),
            interpolation: self.interpolation.or(other.interpolation),
        }
    }
}

/// A container with all that its type says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DefinedContainer {
    /// The property that is the instant.
    pub(super) index: String,
    /// The properties that say how good a value is.
    pub(super) quality: Vec<String>,
    /// The declarations of signals, by properties.
    pub(super) signals: BTreeMap<String, DeclaredSignal>,
    /// The numbers of enumerations by properties and names.
    pub(super) names: BTreeMap<String, BTreeMap<String, f64>>,
}

impl DefinedContainer {
    /// Puts a container and types together. Nothing where the container's type is not there or has no property that is
    /// the instant.
    #[must_use]
    pub fn of(
        container: &ContainerDefinition,
        types: &BTreeMap<String, TypeDefinition>,
    ) -> Option<Self> {
        let of_type = types.get(&container.type_id)?;
        let mut signals = of_type.signals.clone();
        for (property, declared) in &container.signals {
            let by_type = signals.remove(property).unwrap_or_default();
            signals.insert(property.clone(), declared.clone().or(by_type));
        }
        let names = of_type.types.iter().filter_map(|(property, id)| {
            let names = &types.get(id)?.names;
            (!names.is_empty()).then(|| (property.clone(), names.clone()))
        });
        Some(Self {
            index: of_type.index.clone()?,
            quality: of_type.quality.clone(),
            signals,
            names: names.collect(),
        })
    }
}

/// A type as OMF writes it. What is not named here is not looked at.
#[derive(Deserialize)]
struct WrittenType {
    #[serde(default)]
    properties: BTreeMap<String, WrittenProperty>,
    #[serde(rename = "enum")]
    enumeration: Option<WrittenEnumeration>,
}

#[derive(Deserialize)]
#[serde(default)]
#[derive(Default)]
struct WrittenProperty {
    format: Option<String>,
    isindex: bool,
    isquality: bool,
    reftypeid: Option<String>,
    uom: Option<String>,
    interpolation: Option<String>,
}

#[derive(Deserialize)]
struct WrittenEnumeration {
    values: Vec<WrittenName>,
}

#[derive(Deserialize)]
struct WrittenName {
    name: String,
    value: f64,
}

/// A container as OMF writes it.
#[derive(Deserialize)]
struct WrittenContainer {
    typeid: String,
    #[serde(default)]
    propertyoverrides: BTreeMap<String, WrittenProperty>,
}

impl OmfDefinitions {
    /// Takes types or containers, each of them whole or not at all.
    pub(super) fn add(&mut self, kind: DefinitionKind, action: OmfAction, written: Vec<Value>) {
        for (place, written) in written.into_iter().enumerate() {
            match read_change(kind, action, written) {
                Ok(change) => self.changes.push(change),
                Err(fault) => self
                    .refused
                    .refuse(&format!("{} {place}", kind.name()), &fault),
            }
        }
    }
}

fn read_change(
    kind: DefinitionKind,
    action: OmfAction,
    written: Value,
) -> Result<DefinitionChange, String> {
    let id = written.get("id").and_then(Value::as_str);
    let id = id.ok_or("`id` is missing")?;
    check_name(id)?;
    let key = DefinitionKey {
        kind,
        id: id.to_owned(),
    };
    if action == OmfAction::Delete {
        return Ok(DefinitionChange::Removed(key));
    }
    let definition = match kind {
        DefinitionKind::Type => read_type(written).map(OmfDefinition::Type),
        DefinitionKind::Container => read_container(written).map(OmfDefinition::Container),
    };
    let definition = definition.map_err(|fault| format!("`{}`: {fault}", shown(&key.id)))?;
    Ok(DefinitionChange::Stored(key, definition))
}

fn read_type(written: Value) -> Result<TypeDefinition, String> {
    let written: WrittenType = serde_json::from_value(written).map_err(|e| e.to_string())?;
    check_properties(&written.properties)?;
    let is_instant = |property: &WrittenProperty| property.format.as_deref() == Some("date-time");
    let indices = written.properties.iter();
    let indices = indices.filter(|(_, property)| property.isindex);
    // A compound index has an instant and something else.
    let index = indices.max_by_key(|(_, property)| is_instant(property));
    let names = written.enumeration.map(|enumeration| enumeration.values);
    let names = names.unwrap_or_default();
    if names.len() > MOST_ENTRIES {
        return Err(format!("there are more than {MOST_ENTRIES} values"));
    }
    for name in &names {
        check_name(&name.name)?;
    }
    let mut definition = TypeDefinition {
        index: index.map(|(id, _)| id.clone()),
        names: names
            .into_iter()
            .map(|name| (name.name, name.value))
            .collect(),
        ..TypeDefinition::default()
    };
    for (id, property) in written.properties {
        if property.isquality {
            definition.quality.push(id.clone());
        }
        let declared = DeclaredSignal::new(property.uom, property.interpolation.as_deref());
        if declared.says_something() {
            definition.signals.insert(id.clone(), declared);
        }
        if let Some(type_id) = property.reftypeid {
            definition.types.insert(id, type_id);
        }
    }
    Ok(definition)
}

fn read_container(written: Value) -> Result<ContainerDefinition, String> {
    let written: WrittenContainer = serde_json::from_value(written).map_err(|e| e.to_string())?;
    check_name(&written.typeid)?;
    check_properties(&written.propertyoverrides)?;
    let signals = written.propertyoverrides.into_iter();
    let signals = signals.map(|(id, property)| {
        let declared = DeclaredSignal::new(property.uom, property.interpolation.as_deref());
        (id, declared)
    });
    Ok(ContainerDefinition {
        type_id: written.typeid,
        signals: signals
            .filter(|(_, declared)| declared.says_something())
            .collect(),
    })
}

fn check_properties(properties: &BTreeMap<String, WrittenProperty>) -> Result<(), String> {
    if properties.len() > MOST_ENTRIES {
        return Err(format!("there are more than {MOST_ENTRIES} properties"));
    }
    for (id, property) in properties {
        let names = [Some(id), property.reftypeid.as_ref(), property.uom.as_ref()];
        names
            .into_iter()
            .flatten()
            .try_for_each(|name| check_name(name))?;
    }
    Ok(())
}

fn check_name(name: &str) -> Result<(), String> {
    match name.len() {
        0..=LONGEST_NAME => Ok(()),
        _ => Err(format!(
            "`{}` has more than {LONGEST_NAME} bytes",
            shown(name)
        )),
    }
}
