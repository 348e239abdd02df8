//! Marks of streams: stretches that people mark as bad. The stream keeps its samples; what is cut out of it does
//! without them.

use std::ops::Range;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use sqlx::FromRow;
use utoipa::ToSchema;

use super::columns::{from_json, json, optional_time};
use super::database::{self, Row};
use super::sealed::STREAM_MARKS;
use super::streams::{StreamRow, Streams};
use super::writer::{Tx, in_transaction};
use super::{StoreError, named_rows};
use crate::access::Project;
use greybox::recording::{RowSignal, Rows, Warning};

/// Marks of a stream at the most.
pub const MAX_STREAM_MARKS: usize = 1000;

/// A stretch of a stream that somebody marked as bad, both ends included; one instant where both are equal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct StreamMark {
    /// The first instant.
    #[schema(value_type = String, format = DateTime)]
    pub from: Timestamp,
    /// The last instant.
    #[schema(value_type = String, format = DateTime)]
    pub to: Timestamp,
    /// The stream's signals that are bad there; all when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub signals: Option<Vec<String>>,
    /// Why the stretch is bad, for people.
    #[schema(min_length = 1, max_length = 200, example = "sensor unplugged")]
    pub reason: String,
}

impl StreamMark {
    /// Marks the samples of the stretch as bad. Says whether there were any.
    fn leave_out(&self, rows: &mut Rows, signals: &[RowSignal]) -> bool {
        let [from, to] = [self.from, self.to].map(nanoseconds);
        let is_meant = |signal: &RowSignal| {
            let names = self.signals.as_ref();
            names.is_none_or(|names| names.contains(&signal.name))
        };
        let places = (0..signals.len()).filter(|place| is_meant(&signals[*place]));
        rows.mark_bad(from..=to, places) > 0
    }

    /// What the report of a recording says of the mark.
    fn warning(&self) -> Warning {
        let signals = match &self.signals {
            Some(names) => names.join(", "),
            None => "all signals".to_owned(),
        };
        let detail = format!(
            "{signals} from {} to {}: {}",
            self.from, self.to, self.reason
        );
        Warning::of_recording("marked_in_stream", detail)
    }
}

fn nanoseconds(instant: Timestamp) -> i64 {
    let open = if instant < Timestamp::UNIX_EPOCH {
        i64::MIN
    } else {
        i64::MAX
    };
    i64::try_from(instant.as_nanosecond()).unwrap_or(open)
}

/// All marks of a stream.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StreamMarks {
    /// How often the marks were changed.
    pub number: u32,
    /// Everything that is marked.
    pub marks: Vec<StreamMark>,
    /// Who changed the marks last; nothing before the first change.
    pub changed_by: Option<String>,
    /// When the marks were changed last; nothing before the first change.
    pub changed_at: Option<Timestamp>,
}

/// The marks that a client wants in a stream.
#[derive(Clone, Debug, PartialEq)]
pub struct NewStreamMarks {
    /// Everything that is to be marked.
    pub marks: Vec<StreamMark>,
    /// The number of the marks that the client changed, where it says so.
    pub based_on: Option<u32>,
}

/// The outcome of storing marks of a stream.
#[derive(Clone, Debug, PartialEq)]
pub enum StreamMarked {
    /// The marks are on disk.
    Stored(StreamMarks),
    /// The client changed marks of another number than this; nothing is stored.
    NotNewest(u32),
}

/// Samples of a stream without those that are marked.
pub struct UnmarkedRows {
    /// The samples; those that are marked are bad and have no value.
    pub rows: Rows,
    /// What the report of a recording of the samples says of the marks.
    pub told: Vec<Warning>,
}

#[derive(FromRow)]
struct MarksColumns {
    name: String,
    number: i64,
    marks: String,
    changed_by: String,
    changed_at: String,
}

fn read(row: &Row) -> Result<StreamMarks, StoreError> {
    STREAM_MARKS.verify(row)?;
    let row: MarksColumns = row.read()?;
    Ok(StreamMarks {
        number: u32::try_from(row.number).unwrap_or(u32::MAX),
        marks: from_json("marks", &row.name, &row.marks)?,
        changed_by: Some(row.changed_by),
        changed_at: optional_time(&row.name, Some(&row.changed_at))?,
    })
}

impl Streams {
    /// The marks of a stream of a project.
    pub async fn marks(&self, project: &Project, name: &str) -> Result<StreamMarks, StoreError> {
        let row = named_rows::find(&self.database, &STREAM_MARKS, project, name).await?;
        let marks = row.as_ref().map(read).transpose()?;
        Ok(marks.unwrap_or_default())
    }

    /// Stores the marks of a stream in the place of those that it has, unless the client changed others than these.
    pub async fn put_marks(
        &self,
        stream: &StreamRow,
        new: NewStreamMarks,
        by: String,
    ) -> Result<StreamMarked, StoreError> {
        let (project, name) = (stream.project.clone(), stream.name.clone());
        in_transaction!(self.database, |tx| put(tx, project, name, new, by)).await
    }

    /// As [`Streams::rows`], without the samples that are marked.
    pub async fn unmarked_rows(
        &self,
        stream: &StreamRow,
        span: Range<i64>,
        most: usize,
    ) -> Result<Option<UnmarkedRows>, StoreError> {
        let Some(mut rows) = self.rows(stream, span, most).await? else {
            return Ok(None);
        };
        let marks = self.marks(&stream.project, &stream.name).await?.marks;
        let mut told = Vec::new();
        for mark in marks {
            if mark.leave_out(&mut rows, &stream.signals) {
                told.push(mark.warning());
            }
        }
        Ok(Some(UnmarkedRows { rows, told }))
    }
}

async fn put(
    tx: &mut Tx,
    project: Project,
    name: String,
    new: NewStreamMarks,
    by: String,
) -> Result<StreamMarked, StoreError> {
    let before = named_rows::select_named(&STREAM_MARKS, &project, &name);
    let before = before.build().fetch_optional(&mut **tx).await?;
    let before = before.as_ref().map(read).transpose()?.unwrap_or_default();
    if new
        .based_on
        .is_some_and(|based_on| based_on != before.number)
    {
        return Ok(StreamMarked::NotNewest(before.number));
    }
    if new.marks == before.marks {
        return Ok(StreamMarked::Stored(before));
    }
    let now = Timestamp::now();
    let marks = StreamMarks {
        number: before.number.saturating_add(1),
        marks: new.marks,
        changed_by: Some(by.clone()),
        changed_at: Some(now),
    };
    database::query(
        "insert into stream_marks (project, name, number, marks, changed_by, changed_at) \
         values ($1, $2, $3, $4, $5, $6) on conflict (project, name) \
         do update set number = excluded.number, marks = excluded.marks, changed_by = excluded.changed_by, \
         changed_at = excluded.changed_at",
    )
    .bind(project.as_str())
    .bind(&name)
    .bind(i64::from(marks.number))
    .bind(json(&marks.marks))
    .bind(&by)
    .bind(now.to_string())
    .execute(&mut **tx)
    .await?;
    Ok(StreamMarked::Stored(marks))
}
