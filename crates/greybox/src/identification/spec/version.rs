//! The `version` of an experiment's recording: what people marked as bad in it, each with a reason.

use std::collections::BTreeMap;

use serde_json::Value;
use utoipa::openapi::{ObjectBuilder, OneOfBuilder, Ref, Schema, Type};

use super::{entries, exclude};
use greybox_numerics::parsing::Fault;
use greybox_numerics::parsing::reader::{Field, read_document};
use greybox_recording::{Mark, RecordingVersion, Summary};

/// Marks of one version at the most.
pub const MAX_MARKS: usize = 1000;
/// Characters of the reason of a mark at the most.
const MAX_REASON_CHARS: usize = 200;
/// The largest number of a version.
pub const MAX_VERSION: u32 = 1000;

/// The versions of a recording that a specification may name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingVersions {
    /// The newest version; 0 where nothing was ever marked.
    pub newest: u32,
    /// The marks of the newest version, and of each version that the specification names.
    pub marks: BTreeMap<u32, Vec<Mark>>,
}

/// Reads the marks that a client wants in a recording, or says everything that is wrong with it. `based_on` is the
/// version that the client changed.
pub fn read_new_version(document: &Value, recording: &Summary) -> Result<NewVersion, Vec<Fault>> {
    read_document(document, |root| {
        let mut object = root.object()?;
        let marks = object.required("marks");
        let marks = marks.and_then(|field| read_marks(&field, Some(recording)));
        let based_on = object.optional("based_on");
        let based_on = based_on.map(|field| number(&field));
        object.finish();
        Some(NewVersion {
            marks: marks?,
            based_on: based_on.map_or(Some(None), |number| number.map(Some))?,
        })
    })
}

/// The marks that a client wants in a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct NewVersion {
    /// Everything that is to be marked.
    pub marks: Vec<Mark>,
    /// The version that the client changed, where it says so.
    pub based_on: Option<u32>,
}

/// The number of the version that an experiment of a document names.
pub(super) fn named(experiment: &Value) -> Option<u32> {
    let version = experiment.get("version")?;
    let number = version.get("number").unwrap_or(version);
    u32::try_from(number.as_u64()?).ok()
}

/// The version of a recording that an experiment uses. Where the document names none, the newest; nothing where
/// nothing of the recording is marked. Without `versions` the marks of the document are taken as they are.
pub(super) fn read(
    field: Option<&Field<'_>>,
    versions: Option<&RecordingVersions>,
    recording: Option<&Summary>,
) -> Option<RecordingVersion> {
    let Some(field) = field else {
        let versions = versions.filter(|versions| versions.newest > 0)?;
        let marks = versions.marks.get(&versions.newest)?.clone();
        return Some(RecordingVersion {
            number: versions.newest,
            marks,
        });
    };
    let version = match field.value.is_object() {
        true => read_whole(field, recording)?,
        false => RecordingVersion {
            number: number(field)?,
            marks: Vec::new(),
        },
    };
    if version.number == 0 && version.marks.is_empty() {
        return Some(version);
    }
    match versions {
        None if field.value.is_object() => Some(version),
        None => {
            let detail = "versions of the recording are not kept here: give `{\"number\": …, \"marks\": […]}`";
            field.fault("unknown_version", detail);
            None
        }
        Some(versions) => stored(field, version, versions),
    }
}

/// The version as it is stored, which must be that of the document where the document gives its marks.
fn stored(
    field: &Field<'_>,
    version: RecordingVersion,
    versions: &RecordingVersions,
) -> Option<RecordingVersion> {
    let number = version.number;
    let Some(marks) = versions.marks.get(&number) else {
        let detail = match versions.newest {
            0 => format!("the recording has no version {number}: nothing of it is marked"),
            newest => format!("the recording has no version {number}: its newest is {newest}"),
        };
        field.fault("unknown_version", detail);
        return None;
    };
    if field.value.is_object() && version.marks != *marks {
        let detail = format!("version {number} of the recording marks something else");
        field.fault("version_differs", detail);
        return None;
    }
    Some(RecordingVersion {
        number,
        marks: marks.clone(),
    })
}

fn read_whole(field: &Field<'_>, recording: Option<&Summary>) -> Option<RecordingVersion> {
    let mut object = field.object()?;
    let version = object.required("number");
    let marks = object.required("marks");
    object.finish();
    let version = version.and_then(|field| number(&field));
    let marks = marks.and_then(|field| read_marks(&field, recording));
    Some(RecordingVersion {
        number: version?,
        marks: marks?,
    })
}

fn number(field: &Field<'_>) -> Option<u32> {
    let number = field.integer(0, u64::from(MAX_VERSION))?;
    u32::try_from(number).ok()
}

fn read_marks(field: &Field<'_>, recording: Option<&Summary>) -> Option<Vec<Mark>> {
    let items = entries::at_most(field, MAX_MARKS, "marks")?;
    let read: Vec<_> = items.map(|mark| read_mark(&mark, recording)).collect();
    read.into_iter().collect()
}

fn read_mark(field: &Field<'_>, recording: Option<&Summary>) -> Option<Mark> {
    let mut object = field.object()?;
    let span = exclude::read_bounds(field, &mut object, recording);
    let reason = object.required("reason");
    object.finish();
    let reason = reason.and_then(|field| read_reason(&field));
    let (span, reason) = (span?, reason?);
    Some(Mark {
        from_s: span.from_s,
        to_s: span.to_s,
        signals: span.signals,
        reason,
    })
}

/// Reads why something is marked as bad.
pub fn read_reason(field: &Field<'_>) -> Option<String> {
    let reason = field.text()?;
    let length = reason.chars().count();
    if reason.trim().is_empty() || length > MAX_REASON_CHARS || reason.contains('\0') {
        let detail = format!("a reason has 1 to {MAX_REASON_CHARS} characters, none of them NUL");
        field.fault("out_of_range", detail);
        return None;
    }
    Some(reason.to_owned())
}

/// A version in a submission: its number, or its number and its marks.
pub(super) fn version_schema() -> Schema {
    let number = ObjectBuilder::new()
        .schema_type(Type::Integer)
        .minimum(Some(0))
        .maximum(Some(MAX_VERSION))
        .description(Some("The number of a version."));
    let nothing = ObjectBuilder::new().schema_type(Type::Null);
    let forms = OneOfBuilder::new()
        .description(Some(
            "The version of the recording, whose marked samples are left out: its number, or as the completed \
             specification has it with what it marks. Left out, the newest version; 0 is the recording as it came.",
        ))
        .item(number)
        .item(Ref::from_schema_name("RecordingVersion"))
        .item(nothing);
    Schema::OneOf(forms.build())
}

#[cfg(test)]
mod tests {
    use super::super::JobSpec;
    use super::super::tests::{DATASET, faults, pair, read};
    use serde_json::json;
    use std::collections::BTreeSet;

    #[test]
    fn every_recording_and_version_that_is_named_is_listed_beforehand() {
        let document = json!({"experiments": [
            {"dataset": DATASET, "version": 2}, {"dataset": 5, "version": 7}, 7, {"dataset": DATASET},
            {"dataset": DATASET, "version": {"number": 3, "marks": []}}, {"dataset": DATASET, "version": "newest"}
        ]});
        let id = DATASET.parse().unwrap();
        assert_eq!(JobSpec::datasets_named(&document), [id]);
        assert_eq!(
            JobSpec::versions_named(&document, id),
            BTreeSet::from([2, 3])
        );
        assert_eq!(JobSpec::datasets_named(&json!("x")), []);
    }

    #[test]
    fn where_versions_are_not_kept_the_marks_of_the_document_are_taken() {
        let marks = json!([{"from_s": 1.0, "to_s": 2.0, "signals": ["x"], "reason": "loose"}]);
        let version = json!({"number": 3, "marks": marks});
        let document = json!({
            "model": "cart",
            "experiments": [{"dataset": DATASET, "version": version, "exclude": {"spans": [{"from_s": 4, "to_s": 5}]}}]
        });
        let spec = read(&document).unwrap();
        let left_out = spec.experiments[0].left_out().unwrap().into_owned();
        let spans = left_out.spans.iter().map(|span| (span.from_s, span.to_s));
        assert_eq!(spans.collect::<Vec<_>>(), [(4.0, 5.0), (1.0, 2.0)]);
        assert_eq!(left_out.spans[1].signals, Some(vec!["x".to_owned()]));
        let number_alone =
            |document: &mut serde_json::Value| document["experiments"][0]["version"] = json!(3);
        let place = "/experiments/0/version";
        assert_eq!(faults(number_alone), [pair(place, "unknown_version")]);
        let outside = |document: &mut serde_json::Value| {
            let mark = json!({"from_s": 1, "to_s": 99, "reason": "loose"});
            document["experiments"][0]["version"] = json!({"number": 1, "marks": [mark]});
        };
        let place = "/experiments/0/version/marks/0/to_s";
        assert_eq!(faults(outside), [pair(place, "outside_recording")]);
    }
}
