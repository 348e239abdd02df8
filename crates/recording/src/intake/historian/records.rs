//! Formats in which each sample is an object of its own.
//!
//! | format | a sample | its tag |
//! |---|---|---|
//! | PI Web API | `{"Timestamp", "Value", "Good", "Questionable", "Substituted"}` | `Name` around it |
//! | OMF | `{"timestamp", "value", …}`, a tag for each other field | `containerid` or `id` around it |
//! | AVEVA OData | `{"FQN", "DateTime", "OpcQuality", "Value"}` | `FQN` |
//! | Canary | `{"t", "v", "q"}` or `[t, v, q]` | the key of the array |
//! | OPC UA | `{"Value", "SourceTimestamp", "Status"}`; no status is good | a name around it, or the key |
//! | Cognite | `{"timestamp", "value", "status"}`, or an aggregate for the value; no status is good | `externalId` or `id` around it |

use super::super::Format;
use super::super::cell::Cell;
use super::super::quality::Scheme;
use super::super::tags::{Quality, RawSample, Tags};
use super::cognite;
use super::leaf::{Fields, JsonLeaf};
use super::walk::{Surroundings, Visit};
use crate::{Class, Interpolation, Warning};
use greybox_numerics::parsing::Fault;

/// PI Web API answers so many values when nobody says how many.
const PI_MOST_VALUES: usize = 1000;

/// The name of a tag that the source does not name.
const UNNAMED: &str = "value";

/// Samples on their way to their tags.
pub(super) struct Records<'o> {
    format: Format,
    tags: Tags<'o>,
    /// How many samples came for each tag.
    counts: Vec<usize>,
    /// The source says that there is more.
    goes_on: bool,
    /// The last sample has the unit of its signal.
    has_unit: bool,
}

/// A sample and where it belongs.
struct HistorianSample<'f> {
    key: String,
    name: String,
    time: Option<&'f JsonLeaf>,
    value: Cell<'f>,
    quality: Quality<'f>,
    unit: Option<&'f str>,
    interpolation: Option<Interpolation>,
}

impl<'o> Records<'o> {
    pub(super) fn new(format: Format, tags: Tags<'o>) -> Self {
        Self {
            format,
            tags,
            counts: Vec::new(),
            goes_on: false,
            has_unit: true,
        }
    }

    /// What the format's codes of quality mean.
    pub(super) fn scheme(format: Format) -> Option<Scheme> {
        match format {
            Format::AvevaOdata | Format::Canary => Some(Scheme::OpcDa),
            Format::OpcUaJson => Some(Scheme::OpcUa),
            Format::Cognite => Some(Scheme::Cognite),
            _ => None,
        }
    }

    /// The tags, with what is to be said of all of them.
    pub(super) fn into_tags(mut self) -> Tags<'o> {
        let is_cut = |count: &&usize| **count > 0 && count.is_multiple_of(PI_MOST_VALUES);
        let cut = self.counts.iter().filter(is_cut).count();
        if self.format == Format::PiWebApi && cut > 0 {
            let detail = format!(
                "{cut} streams have a multiple of {PI_MOST_VALUES} values: the answer was probably \
                 cut there; ask for more with maxCount"
            );
            self.tags
                .notes
                .push(Warning::of_recording("probably_truncated", detail));
        }
        if self.goes_on {
            let detail = "the source says that there are more samples than it sent".to_owned();
            self.tags
                .notes
                .push(Warning::of_recording("truncated", detail));
        }
        self.tags
    }

    fn push(&mut self, around: &Surroundings<'_>, record: &HistorianSample<'_>) {
        let place = |code, detail: String| around.fault(code, &detail);
        let Some(tag) = self.tags.series(&record.key, &record.name, &place) else {
            return;
        };
        if tag == self.counts.len() {
            self.counts.push(0);
        }
        self.counts[tag] += 1;
        self.tags
            .describe(tag, record.unit, record.interpolation, &place);
        let sample = RawSample {
            tag,
            time: record.time.map_or(Cell::Empty, JsonLeaf::cell),
            value: record.value.clone(),
            quality: match &record.quality {
                Quality::Unsaid => Quality::Unsaid,
                Quality::Code(code) => Quality::Code(code.clone()),
                Quality::Of(class) => Quality::Of(*class),
            },
        };
        self.tags.push(&sample, &place);
    }

    fn fault(&mut self, fault: Fault) {
        self.tags.faults.invalid(fault);
    }

    fn pi(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool {
        if !fields.has("Timestamp") {
            let errors = fields
                .get("Errors")
                .filter(|errors| **errors != JsonLeaf::List(Vec::new()));
            if errors.is_some() {
                let detail = "the source answered errors instead of values";
                self.fault(around.fault("source_errors", detail));
            }
            return false;
        }
        let is_set = |name| fields.get(name).is_some_and(JsonLeaf::is_true);
        let is_bad = fields.get("Good") == Some(&JsonLeaf::Bool(false));
        let (value, is_system) = match fields.get("Value") {
            Some(JsonLeaf::Object(state)) => {
                let is_system = state.get("IsSystem").is_some_and(JsonLeaf::is_true);
                (state.get("Value"), is_system)
            }
            value => (value, false),
        };
        let class = match () {
            () if is_bad || is_system => Class::Bad,
            () if is_set("Substituted") => Class::Substituted,
            () if is_set("Questionable") => Class::Uncertain,
            () => Class::Good,
        };
        let text = |name: &str| around.field(&[name]).and_then(JsonLeaf::text);
        let name = text("Name").unwrap_or_else(|| UNNAMED.to_owned());
        let unit = fields
            .get("UnitsAbbreviation")
            .or(around.field(&["UnitsAbbreviation"]));
        let record = HistorianSample {
            key: text("Path").unwrap_or_else(|| name.clone()),
            name,
            time: fields.get("Timestamp"),
            value: value.map_or(Cell::Empty, JsonLeaf::cell),
            quality: Quality::Of(class),
            unit: unit.and_then(JsonLeaf::as_text),
            interpolation: None,
        };
        self.push(around, &record);
        true
    }

    fn omf(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool {
        let times = [
            "timestamp",
            "Timestamp",
            "Time",
            "time",
            "DateTime",
            "dateTime",
        ];
        let time = times.iter().find(|name| fields.has(name));
        let Some(time_key) = time.filter(|_| around.keys().next_back() == Some("values")) else {
            return false;
        };
        let container = around
            .field(&["containerid", "id"])
            .and_then(JsonLeaf::text);
        let container = container.unwrap_or_else(|| UNNAMED.to_owned());
        let is_value = |key: &str| key.eq_ignore_ascii_case("value");
        let has_value = fields.0.iter().any(|(key, _)| is_value(key));
        let rates = |key: &str| has_value && key.eq_ignore_ascii_case("quality");
        let quality = fields.0.iter().find(|(key, _)| rates(key));
        let is_time = |key: &str| key == *time_key;
        let properties = fields
            .0
            .iter()
            .filter(|(key, _)| !is_time(key) && !rates(key));
        for (field, leaf) in properties {
            let name = match is_value(field) {
                true => container.clone(),
                false => format!("{container}.{field}"),
            };
            let record = HistorianSample {
                key: name.clone(),
                name,
                time: fields.get(time_key),
                value: leaf.cell(),
                quality: code(quality.map(|(_, leaf)| leaf).filter(|_| is_value(field))),
                unit: None,
                interpolation: None,
            };
            self.push(around, &record);
        }
        true
    }

    fn odata(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool {
        let Some(name) = ["FQN", "TagName"]
            .iter()
            .find_map(|name| fields.get(name)?.text())
        else {
            return false;
        };
        if !fields.has("DateTime") {
            return false;
        }
        let record = HistorianSample {
            key: name.clone(),
            name,
            time: fields.get("DateTime"),
            value: fields.get("Value").map_or(Cell::Empty, JsonLeaf::cell),
            quality: code(fields.get("OpcQuality")),
            unit: ["Unit", "EngUnit"]
                .iter()
                .find_map(|name| fields.get(name)?.as_text()),
            interpolation: None,
        };
        self.push(around, &record);
        true
    }

    fn canary(
        &mut self,
        around: &Surroundings<'_>,
        [time, value, quality]: [Option<&JsonLeaf>; 3],
    ) {
        let name = around.keys().next_back().unwrap_or(UNNAMED).to_owned();
        let record = HistorianSample {
            key: name.clone(),
            name,
            time,
            value: value.map_or(Cell::Empty, JsonLeaf::cell),
            quality: code(quality),
            unit: None,
            interpolation: None,
        };
        self.push(around, &record);
    }

    fn opc_ua(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool {
        let stamps = ["SourceTimestamp", "ServerTimestamp"];
        let time = stamps.iter().find_map(|name| fields.get(name));
        if time.is_none() {
            return false;
        }
        /// Keys that hold values, not names.
        const HOLDERS: [&str; 7] = [
            "DataValues",
            "Values",
            "HistoryData",
            "Results",
            "Value",
            "Payload",
            "Messages",
        ];
        let names = ["DisplayName", "Name", "BrowseName", "NodeId", "Id"];
        let name = around.field(&names).and_then(JsonLeaf::text);
        let key = || around.keys().rev().find(|key| !HOLDERS.contains(key));
        let name = name.or_else(|| key().map(str::to_owned));
        let name = name.unwrap_or_else(|| UNNAMED.to_owned());
        let value = match fields.get("Value") {
            Some(JsonLeaf::Object(variant)) => {
                ["Body", "Value"].iter().find_map(|n| variant.get(n))
            }
            value => value,
        };
        let status = match fields.get("Status").or(fields.get("StatusCode")) {
            Some(JsonLeaf::Object(status)) => status.get("Code"),
            status => status,
        };
        let record = HistorianSample {
            key: name.clone(),
            name,
            time,
            value: value.map_or(Cell::Empty, JsonLeaf::cell),
            quality: code(status),
            unit: None,
            interpolation: None,
        };
        self.push(around, &record);
        true
    }

    fn cognite(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool {
        if !fields.has("timestamp") {
            self.cognite_series(around, fields);
            return false;
        }
        let name = around.field(&["externalId", "id"]).and_then(JsonLeaf::text);
        let name = name.unwrap_or_else(|| UNNAMED.to_owned());
        let step = around.field(&["isStep"]).map(|step| match step.is_true() {
            true => Interpolation::Hold,
            false => Interpolation::Linear,
        });
        let status = match fields.get("status") {
            Some(JsonLeaf::Object(status)) => status.get("code"),
            status => status,
        };
        let keys = match cognite::values(fields, &self.tags.options.table.values) {
            Ok(keys) => keys,
            Err(detail) => {
                let fault = Fault {
                    parameter: Some("value".into()),
                    ..around.fault("layout_unclear", &detail)
                };
                self.fault(fault);
                return true;
            }
        };
        let unit = around.objects.last().and_then(cognite::unit_of);
        for key in &keys {
            self.has_unit = cognite::has_unit(key);
            let name = match keys.len() {
                1 => name.clone(),
                _ => format!("{name}.{key}"),
            };
            let record = HistorianSample {
                key: name.clone(),
                name,
                time: fields.get("timestamp"),
                value: fields.get(key).map_or(Cell::Empty, JsonLeaf::cell),
                quality: code(status),
                unit: unit.filter(|_| self.has_unit),
                interpolation: step,
            };
            self.push(around, &record);
        }
        true
    }

    /// Takes the unit of a signal of Cognite, which may stand behind its datapoints.
    fn cognite_series(&mut self, around: &Surroundings<'_>, fields: &Fields) {
        let name = ["externalId", "id"]
            .iter()
            .find_map(|name| fields.get(name)?.text());
        let unit = cognite::unit_of(fields).filter(|_| self.has_unit);
        let place = |code, detail: String| around.fault(code, &detail);
        if let (true, Some(name), Some(unit)) = (fields.has("datapoints"), name, unit)
            && let Some(tag) = self.tags.of_key(&name)
        {
            self.tags.describe(tag, Some(unit), None, &place);
        }
    }
}

/// What a source says of a sample; nothing means good in all formats that come here.
fn code(code: Option<&JsonLeaf>) -> Quality<'_> {
    code.map_or(Quality::Unsaid, |code| Quality::Code(code.cell()))
}

impl Visit for Records<'_> {
    fn object(&mut self, around: &Surroundings<'_>, fields: &Fields) -> bool {
        self.goes_on |= ["continuation", "nextCursor", "@odata.nextLink"]
            .iter()
            .any(|name| fields.get(name).is_some());
        match self.format {
            Format::Omf => self.omf(around, fields),
            Format::AvevaOdata => self.odata(around, fields),
            Format::OpcUaJson => self.opc_ua(around, fields),
            Format::Cognite => self.cognite(around, fields),
            Format::Canary if fields.has("t") => {
                self.canary(around, ["t", "v", "q"].map(|name| fields.get(name)));
                true
            }
            Format::Canary => false,
            _ => self.pi(around, fields),
        }
    }

    fn row(&mut self, around: &Surroundings<'_>, cells: &[JsonLeaf]) -> bool {
        if self.format == Format::Canary {
            self.canary(around, [cells.first(), cells.get(1), cells.get(2)]);
        }
        true
    }

    fn is_full(&self) -> bool {
        self.tags.is_full()
    }
}
