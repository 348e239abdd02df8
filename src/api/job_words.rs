//! What people call a job, changed later: its name, its labels and its note.

use std::collections::BTreeMap;

use axum::extract::State;
use axum::http::StatusCode;
use serde::Serialize;
use utoipa::ToSchema;

use super::body::JsonDocument;
use super::error::{Answer, Kind, Problem};
use super::extract::Named;
use super::jobs::{Job, answer, no_job};
use super::query::{NoQuery, Params};
use crate::store::{JobWords, Jobs, LabelChange, Renamed};
use greybox::identification::JobId;
use greybox::identification::spec::{MAX_LABELS, label, name, note};
use greybox::parsing::reader::{Field, read_document};

/// A change of what a job is called, as a JSON merge patch: what is left out stays, `null` removes.
#[derive(Serialize, ToSchema)]
#[schema(as = JobChange)]
#[schema(example = json!({"labels": {"site": "hall 2", "draft": null}, "note": "valve 7 was replaced before this"}))]
#[allow(
    dead_code,
    reason = "it describes a document that is read field by field"
)]
pub struct JobChange {
    /// A name for people.
    #[schema(max_length = 200)]
    name: Option<String>,
    /// Labels by their names; a job has 16 at the most. `null` removes every label.
    labels: Option<BTreeMap<String, Option<String>>>,
    /// What people should know of the job, in lines of text.
    #[schema(max_length = 4000)]
    note: Option<String>,
}

/// Change what a job is called: its name, its labels and its note, in any state of the job.
///
/// The body is a JSON merge patch. The specification of an identification has the same name, labels and note from then
/// on; nothing else of a job changes.
#[utoipa::path(
    patch, path = "/v1/jobs/{id}", operation_id = "rename_job", tag = "jobs",
    params(("id" = JobId, Path, description = "The job")),
    request_body(content = JobChange, content_type = "application/json"),
    responses((status = 200, description = "The job as it stands", body = Job))
)]
pub async fn rename(
    State(jobs): State<Jobs>,
    Named(id): Named<JobId>,
    _query: Params<NoQuery>,
    document: JsonDocument,
) -> Answer {
    let words = read_document(&document.value, read).map_err(Problem::of_document)?;
    match jobs.rename(id, words).await? {
        Renamed::Done(row) => Ok(answer(StatusCode::OK, &row)),
        Renamed::NotFound => Err(no_job(id)),
        Renamed::TooManyLabels => {
            let detail = format!("a job has {MAX_LABELS} labels at the most");
            Err(Problem::new(Kind::Invalid, detail))
        }
    }
}

fn read(root: &Field<'_>) -> Option<JobWords> {
    let mut object = root.object()?;
    let name = object.present("name").map(|field| or_null(&field, name));
    let labels = object
        .present("labels")
        .map(|field| Some(or_null(&field, label_changes)?.unwrap_or(LabelChange::RemoveAll)));
    let note = object.present("note").map(|field| or_null(&field, note));
    object.finish();
    Some(JobWords {
        name: name.map_or(Some(None), |name| name.map(Some))?,
        labels: labels.unwrap_or_else(|| Some(LabelChange::default()))?,
        note: note.map_or(Some(None), |note| note.map(Some))?,
    })
}

fn label_changes(field: &Field<'_>) -> Option<LabelChange> {
    let entries = field.object()?.entries();
    let changes: Option<BTreeMap<_, _>> = entries
        .map(|(key, value)| Some((key.to_owned(), or_null(&value, |field| label(key, field))?)))
        .collect();
    changes.map(LabelChange::Each)
}

/// Reads a value, or `null` for the removal of the value.
fn or_null<T>(field: &Field<'_>, read: impl FnOnce(&Field<'_>) -> Option<T>) -> Option<Option<T>> {
    match field.value.is_null() {
        true => Some(None),
        false => read(field).map(Some),
    }
}
