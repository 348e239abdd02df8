//! Mappings: where the series that collecting agents write go, as the operator says it.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::str::FromStr;

use axum::extract::State;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use jiff::Timestamp;
use serde::Serialize;
use utoipa::ToSchema;

use super::body::JsonDocument;
use super::client::Client;
use super::error::{Answer, Kind, Problem};
use super::extract::{Named, PathName, chosen_name};
use super::http_headers::json;
use super::query::{NoQuery, Params};
use crate::access::{Project, is_stream_name};
use crate::monitor::state::instant;
use crate::store::{MAX_MAPPINGS, MappingPut, MappingRow, Mappings, Store, StoreError};
use greybox::intake::spread::{
    LastValue, MappedQuality, MappedSignal, Mapping, MappingRule, UnmappedSeries,
};
use greybox::intake::{quality_schemes, units};
use greybox::parsing::reader::{Field, read_document};
use greybox::recording::{Interpolation, MAX_NAME_CHARACTERS, MAX_SIGNALS};

/// The characters of a mapping's name at the most.
const MAX_NAME: usize = 100;
/// Rules of a mapping at the most.
const MAX_RULES: usize = 1000;
/// Fields of a rule that say how good values are, at the most.
const MAX_QUALITY_FIELDS: usize = 10;
/// The characters of a measurement, a tag or a field at the most.
const MAX_KEY_CHARS: usize = 500;

/// The name of a mapping: what agents name as their database or bucket.
pub struct MappingName(pub(super) String);

impl FromStr for MappingName {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        chosen_name(text, MAX_NAME).map(Self).ok_or(())
    }
}

impl PathName for MappingName {
    const WHAT: &'static str =
        "mapping (its name has no slash and 100 characters at the most) called";

    async fn project(&self, _store: &Store) -> Result<Option<Project>, StoreError> {
        Ok(None)
    }
}

/// A mapping.
#[derive(Serialize, ToSchema)]
#[schema(as = NamedMapping)]
pub struct ShownMapping {
    /// The database or bucket that agents name.
    #[schema(example = "plant")]
    name: String,
    /// The rules. Where several fit, the first decides.
    rules: Vec<MappingRule>,
    /// When the mapping was made.
    #[schema(value_type = String, format = DateTime)]
    created_at: Timestamp,
    /// When the rules were last changed.
    #[schema(value_type = String, format = DateTime)]
    changed_at: Timestamp,
}

impl From<MappingRow> for ShownMapping {
    fn from(row: MappingRow) -> Self {
        Self {
            name: row.name,
            rules: row.mapping.rules,
            created_at: row.created_at,
            changed_at: row.changed_at,
        }
    }
}

/// All mappings of the project.
#[derive(Serialize, ToSchema)]
#[schema(as = Mappings)]
pub struct MappingList {
    /// The mappings by name.
    items: Vec<ShownMapping>,
}

/// A mapping with the series that came and that no rule names.
#[derive(Serialize, ToSchema)]
pub struct MappingWithSeries {
    /// The mapping.
    #[serde(flatten)]
    mapping: ShownMapping,
    /// Series that came since the rules were last changed and that no rule names, 1000 at the most. Their
    /// samples are not stored.
    unmapped: Vec<SeenSeries>,
    /// Samples of further series that no rule names.
    unlisted: u64,
}

/// A series that no rule names.
#[derive(Serialize, ToSchema)]
pub struct SeenSeries {
    /// The measurement of the series.
    #[schema(example = "rig")]
    measurement: String,
    /// The tags of the series.
    #[schema(example = json!({"hall": "2"}))]
    tags: BTreeMap<String, String>,
    /// The field.
    #[schema(example = "speed")]
    field: String,
    /// How many samples came.
    samples: u64,
    /// The value of the sample with the latest instant, a text cut to 100 characters.
    last_value: LastValue,
    /// The latest instant.
    #[schema(value_type = String, format = DateTime)]
    last_at: Timestamp,
}

impl From<UnmappedSeries> for SeenSeries {
    fn from(series: UnmappedSeries) -> Self {
        Self {
            measurement: series.measurement,
            tags: series.tags,
            field: series.field,
            samples: series.samples,
            last_value: series.last_value,
            last_at: instant(series.last_ns),
        }
    }
}

/// Say where the series of agents go.
///
/// Agents that write to `POST /write?db={name}`, `POST /api/v2/write?bucket={name}` or `POST /omf/{name}` write by these
/// rules. The
/// rules take the place of earlier ones as a whole, and the list of series that no rule names begins anew. Samples
/// that are stored stay where they are.
#[utoipa::path(
    put, path = "/v1/mappings/{name}", operation_id = "put_mapping", tag = "agents",
    params(("name" = String, Path, description = "The database or bucket that agents name",
            example = "plant")),
    request_body(content = Mapping, content_type = "application/json"),
    responses(
        (status = 201, description = "It is stored, and new", body = MappingWithSeries),
        (status = 200, description = "It is stored in the place of the one before", body = MappingWithSeries),
        (status = 409, description = "The project has as many mappings as it may")
    )
)]
pub async fn put(
    State(mappings): State<Mappings>,
    client: Client,
    Named(MappingName(name)): Named<MappingName>,
    _query: Params<NoQuery>,
    document: JsonDocument,
) -> Answer {
    let mapping = read_document(&document.value, read).map_err(Problem::of_document)?;
    let status = match mappings.put(&client.project, &name, mapping).await? {
        MappingPut::Created => StatusCode::CREATED,
        MappingPut::Replaced => StatusCode::OK,
        MappingPut::TooMany => {
            let detail = format!("a project has {MAX_MAPPINGS} mappings at the most");
            return Err(Problem::new(Kind::WrongState, detail));
        }
    };
    let shown = shown(&mappings, &client.project, &name).await?;
    Ok(json(status, &shown))
}

/// List the mappings of the project, without the series that no rule names.
#[utoipa::path(
    get, path = "/v1/mappings", operation_id = "list_mappings", tag = "agents",
    responses((status = 200, description = "All mappings", body = MappingList))
)]
pub async fn list(
    State(mappings): State<Mappings>,
    client: Client,
    _query: Params<NoQuery>,
) -> Answer {
    let rows = mappings.list(&client.project).await?;
    let items = rows.into_iter().map(ShownMapping::from).collect();
    Ok(json(StatusCode::OK, &MappingList { items }))
}

/// Show a mapping, and the series that came and that no rule names.
#[utoipa::path(
    get, path = "/v1/mappings/{name}", operation_id = "show_mapping", tag = "agents",
    params(("name" = String, Path, description = "The mapping")),
    responses((status = 200, description = "The mapping", body = MappingWithSeries))
)]
pub async fn show(
    State(mappings): State<Mappings>,
    client: Client,
    Named(MappingName(name)): Named<MappingName>,
    _query: Params<NoQuery>,
) -> Answer {
    let shown = shown(&mappings, &client.project, &name).await?;
    Ok(json(StatusCode::OK, &shown))
}

async fn shown(mappings: &Mappings, project: &Project, name: &str) -> Answer<MappingWithSeries> {
    let row = mappings.find(project, name).await?;
    let row = row.ok_or_else(|| Problem::not_found("mapping", name))?;
    let unmapped = mappings.unmapped(project, name).await?;
    Ok(MappingWithSeries {
        unlisted: row.unlisted,
        mapping: row.into(),
        unmapped: unmapped.into_iter().map(SeenSeries::from).collect(),
    })
}

/// Remove a mapping; agents that name it are answered 404 from then on. Streams and their samples stay.
#[utoipa::path(
    delete, path = "/v1/mappings/{name}", operation_id = "remove_mapping", tag = "agents",
    params(("name" = String, Path, description = "The mapping")),
    responses((status = 204, description = "It is removed"))
)]
pub async fn remove(
    State(mappings): State<Mappings>,
    client: Client,
    Named(MappingName(name)): Named<MappingName>,
    _query: Params<NoQuery>,
) -> Answer<Response> {
    match mappings.delete(&client.project, &name).await? {
        true => Ok(StatusCode::NO_CONTENT.into_response()),
        false => Err(Problem::not_found("mapping", &name)),
    }
}

fn read(root: &Field<'_>) -> Option<Mapping> {
    let mut object = root.object()?;
    let rules = object.required("rules").and_then(|field| {
        let fields = field.array()?;
        if fields.len() > MAX_RULES {
            field.fault("too_many", format!("there are more than {MAX_RULES} rules"));
            return None;
        }
        let rules: Vec<(Field<'_>, Option<MappingRule>)> = fields
            .map(|rule| (rule.clone(), read_rule(&rule)))
            .collect();
        check_signals(&rules);
        rules.into_iter().map(|(_, rule)| rule).collect()
    });
    object.finish();
    Some(Mapping { rules: rules? })
}

/// Refuses members that are `null`: a mapping leaves out what it does not say.
fn refuse_nulls(field: &Field<'_>) {
    let members = field.value.as_object().into_iter().flatten();
    for (name, _) in members.filter(|(_, value)| value.is_null()) {
        field.fault("wrong_type", format!("`{name}` is null: leave it out"));
    }
}

fn read_rule(field: &Field<'_>) -> Option<MappingRule> {
    refuse_nulls(field);
    let mut object = field.object()?;
    let measurement = object
        .required("measurement")
        .and_then(|field| read_key(&field));
    let tags = object.optional("tags").map(|field| {
        let entries = field.object()?.entries();
        entries
            .map(|(name, value)| Some((name.to_owned(), read_key(&value)?)))
            .collect()
    });
    let stream = object.required("stream").and_then(|field| {
        let name = field.text()?;
        if !is_stream_name(name) {
            let detail =
                "a stream's name has letters, digits, `.`, `_` and `-`, 100 of them at the most";
            field.fault("invalid_name", detail);
        }
        Some(name.to_owned())
    });
    let signals = object.required("signals").and_then(|field| {
        let object = field.object()?;
        if object.n_entries() == 0 {
            field.fault("empty", "the rule names no field");
        }
        let entries = object.entries();
        entries
            .map(|(name, signal)| Some((name.to_owned(), read_signal(&signal)?)))
            .collect()
    });
    let quality = object.optional("quality").map(|field| read_quality(&field));
    object.finish();
    Some(MappingRule {
        measurement: measurement?,
        tags: tags.unwrap_or_else(|| Some(BTreeMap::new()))?,
        stream: stream?,
        signals: signals?,
        quality: quality.map_or(Some(None), |quality| quality.map(Some))?,
    })
}

fn read_quality(field: &Field<'_>) -> Option<MappedQuality> {
    refuse_nulls(field);
    let mut object = field.object()?;
    let fields = object.optional("fields").map(|field| {
        let names = field.array()?;
        if !(1..=MAX_QUALITY_FIELDS).contains(&names.len()) {
            field.fault(
                "invalid_length",
                format!("it has 1 to {MAX_QUALITY_FIELDS} fields"),
            );
            return None;
        }
        names.map(|name| read_key(&name)).collect()
    });
    let codes = object.optional("codes").map(|field| {
        let name = field.text()?;
        if !quality_schemes().any(|scheme| scheme == name) {
            let schemes: Vec<&str> = quality_schemes().collect();
            field.fault(
                "unknown_value",
                format!("it is one of {}", schemes.join(", ")),
            );
        }
        Some(name.to_owned())
    });
    object.finish();
    Some(MappedQuality {
        fields: fields.unwrap_or_else(|| Some(Vec::new()))?,
        codes: codes.map_or(Some(None), |codes| codes.map(Some))?,
    })
}

/// A measurement, a field or the value of a tag.
fn read_key(field: &Field<'_>) -> Option<String> {
    let text = field.text()?;
    if text.is_empty() || text.chars().count() > MAX_KEY_CHARS {
        let detail = format!("it has 1 to {MAX_KEY_CHARS} characters");
        field.fault("invalid_length", detail);
    }
    Some(text.to_owned())
}

fn read_signal(field: &Field<'_>) -> Option<MappedSignal> {
    refuse_nulls(field);
    let mut object = field.object()?;
    let signal = object.required("signal").and_then(|field| {
        let name = field.text()?;
        let is_name = (1..=MAX_NAME_CHARACTERS).contains(&name.chars().count());
        if !is_name || name.chars().any(char::is_control) {
            let detail = format!(
                "a signal's name has 1 to {MAX_NAME_CHARACTERS} characters that can be seen"
            );
            field.fault("invalid_name", detail);
        }
        Some(name.to_owned())
    });
    let unit = object.optional("unit").map(|field| {
        let unit = field.text()?;
        if units::parse(unit).is_none() {
            field.fault(
                "unknown_unit",
                units::unknown(unit, "write a name that is known"),
            );
        }
        Some(unit.to_owned())
    });
    let choices = [
        ("hold", Interpolation::Hold),
        ("linear", Interpolation::Linear),
    ];
    let interpolation = object
        .optional("interpolation")
        .map(|field| field.choice(&choices));
    object.finish();
    Some(MappedSignal {
        signal: signal?,
        unit: unit.unwrap_or_else(|| Some(String::new()))?,
        interpolation: interpolation.map_or(Some(None), |chosen| chosen.map(Some))?,
    })
}

/// One signal of a stream has one unit in SI, and a stream has only so many signals.
fn check_signals(rules: &[(Field<'_>, Option<MappingRule>)]) {
    let mut units_before: HashMap<(&str, &str), String> = HashMap::new();
    let mut names: HashMap<&str, HashSet<&str>> = HashMap::new();
    for (field, rule) in rules {
        let Some(rule) = rule else {
            continue;
        };
        let of_stream = names.entry(&rule.stream).or_default();
        for mapped in rule.signals.values() {
            of_stream.insert(&mapped.signal);
            let unit = units::parse(&mapped.unit).map_or_else(String::new, |unit| unit.si.into());
            let key = (rule.stream.as_str(), mapped.signal.as_str());
            let before = units_before.entry(key).or_insert_with(|| unit.clone());
            if *before != unit {
                let detail = format!(
                    "`{}` of `{}` is in `{before}` by a rule before and in `{unit}` by this one",
                    mapped.signal, rule.stream
                );
                field.fault("units_differ", detail);
            }
        }
        if of_stream.len() > MAX_SIGNALS {
            let detail = format!(
                "`{}` would have more than {MAX_SIGNALS} signals",
                rule.stream
            );
            field.fault("too_many_signals", detail);
        }
    }
}
