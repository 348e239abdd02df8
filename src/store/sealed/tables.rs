//! The tables whose rows are sealed, and by which columns.

use super::seal::Column::{Bytes, Integer, Real, Text};
use super::seal::Sealed;

pub(in crate::store) const JOBS: Sealed = Sealed {
    what: "specification",
    table: "jobs",
    key: &[Text("id")],
    content: &[
        Text("project"),
        Text("name"),
        Text("labels"),
        Text("model"),
        Text("spec"),
    ],
    seal: "seal",
};

pub(in crate::store) const DATASETS: Sealed = Sealed {
    what: "description",
    table: "datasets",
    key: &[Text("id")],
    content: &[
        Text("project"),
        Text("name"),
        Text("digest"),
        Text("description"),
        Text("summary"),
        Text("created_at"),
    ],
    seal: "seal",
};

pub(in crate::store) const DATASET_CHUNKS: Sealed = Sealed {
    what: "part of the samples",
    table: "dataset_chunks",
    key: &[Text("dataset"), Integer("position"), Integer("chunk")],
    content: &[Bytes("samples")],
    seal: "seal",
};

pub(in crate::store) const STREAM_BLOCKS: Sealed = Sealed {
    what: "block",
    table: "stream_blocks",
    key: &[Text("stream"), Integer("first_ns")],
    content: &[Integer("last_ns"), Integer("rows"), Bytes("samples")],
    seal: "seal",
};

pub(in crate::store) const STREAM_EXTREMES: Sealed = Sealed {
    what: "list of extremes",
    table: "stream_extremes",
    key: &[Text("stream"), Integer("first_ns")],
    content: &[Integer("rows"), Bytes("samples")],
    seal: "seal",
};

pub(in crate::store) const CHECKPOINTS: Sealed = Sealed {
    what: "checkpoint",
    table: "checkpoints",
    key: &[Text("job")],
    content: &[Bytes("state"), Integer("refinements")],
    seal: "seal",
};

pub(in crate::store) const RESULTS: Sealed = Sealed {
    what: "result",
    table: "results",
    key: &[Text("job")],
    content: &[Text("outcome")],
    seal: "seal",
};

pub(in crate::store) const EVENTS: Sealed = Sealed {
    what: "event",
    table: "events",
    key: &[Text("job"), Integer("id")],
    content: &[Text("name"), Text("data")],
    seal: "seal",
};

pub(in crate::store) const GENERATIONS: Sealed = Sealed {
    what: "generation",
    table: "generations",
    key: &[Text("job"), Integer("generation")],
    content: &[Text("row")],
    seal: "seal",
};

pub(in crate::store) const CANDIDATE_RECORDS: Sealed = Sealed {
    what: "list of candidates",
    table: "candidate_records",
    key: &[Text("job")],
    content: &[
        Text("columns"),
        Integer("kept"),
        Integer("cut_in_generation"),
    ],
    seal: "seal",
};

pub(in crate::store) const CANDIDATES: Sealed = Sealed {
    what: "generation of candidates",
    table: "candidates",
    key: &[Text("job"), Integer("generation")],
    content: &[Bytes("candidates")],
    seal: "seal",
};

pub(in crate::store) const MONITORS: Sealed = Sealed {
    what: "state",
    table: "monitors",
    key: &[Text("id")],
    content: &[
        Text("project"),
        Text("name"),
        Text("stream"),
        Text("spec"),
        Text("state"),
        Integer("due_ns"),
    ],
    seal: "seal",
};

pub(in crate::store) const MONITOR_WINDOWS: Sealed = Sealed {
    what: "window",
    table: "monitor_windows",
    key: &[Text("monitor"), Integer("number")],
    content: &[Text("row")],
    seal: "seal",
};

pub(in crate::store) const MONITOR_ALARMS: Sealed = Sealed {
    what: "alarm",
    table: "monitor_alarms",
    key: &[Text("monitor"), Integer("id")],
    content: &[Text("row")],
    seal: "seal",
};

pub(in crate::store) const MONITOR_EVENTS: Sealed = Sealed {
    what: "event",
    table: "monitor_events",
    key: &[Text("monitor"), Integer("id")],
    content: &[Text("name"), Text("data")],
    seal: "seal",
};

pub(in crate::store) const MODELS: Sealed = Sealed {
    what: "model",
    table: "models",
    key: &[Text("project"), Text("reference")],
    content: &[Text("digest"), Text("document"), Text("created_at")],
    seal: "seal",
};

pub(in crate::store) const TOKENS: Sealed = Sealed {
    what: "token",
    table: "tokens",
    key: &[Text("digest")],
    // When a token was revoked and last used is written later, by older nodes too.
    content: &[
        Text("name"),
        Text("scope"),
        Text("streams"),
        Text("project"),
        Text("created_at"),
        Text("expires_at"),
    ],
    seal: "seal",
};

pub(in crate::store) const SHARED_PARTS: Sealed = Sealed {
    what: "part",
    table: "shared_parts",
    key: &[Text("job"), Text("name")],
    content: &[Text("part")],
    seal: "seal",
};

/// What of a job changes.
pub(in crate::store) const JOB_STATES: Sealed = Sealed {
    what: "state",
    table: "jobs",
    key: &[Text("id")],
    content: &[
        Text("status"),
        Text("request"),
        Integer("epoch"),
        Integer("attempt"),
        Integer("queue_entry"),
        Integer("running_ms"),
        Text("progress"),
        Integer("told_generation"),
        Integer("told_refinements"),
        Integer("told_at_ms"),
        Text("error"),
        Integer("last_event"),
        Integer("revision"),
        Text("created_at"),
        Text("started_at"),
        Text("finished_at"),
        Integer("deaths"),
        Integer("at_work_in"),
        Integer("is_shared"),
    ],
    seal: "state_seal",
};

pub(in crate::store) const JOB_LABELS: Sealed = Sealed {
    what: "label",
    table: "job_labels",
    key: &[Text("job"), Text("label")],
    content: &[Text("value")],
    seal: "seal",
};

pub(in crate::store) const JOB_DATASETS: Sealed = Sealed {
    what: "reference to a recording",
    table: "job_datasets",
    key: &[Text("job"), Text("dataset")],
    content: &[],
    seal: "seal",
};

pub(in crate::store) const DATASET_SIZES: Sealed = Sealed {
    what: "size",
    table: "datasets",
    key: &[Text("id")],
    content: &[Text("identity"), Integer("bytes")],
    seal: "state_seal",
};

pub(in crate::store) const MODEL_SOURCES: Sealed = Sealed {
    what: "source",
    table: "models",
    key: &[Text("project"), Text("reference")],
    content: &[Text("name"), Text("client")],
    seal: "state_seal",
};

pub(in crate::store) const COMPARISONS: Sealed = Sealed {
    what: "comparison",
    table: "comparisons",
    key: &[Text("id")],
    content: &[Text("created_at"), Text("project")],
    seal: "seal",
};

pub(in crate::store) const COMPARISON_JOBS: Sealed = Sealed {
    what: "run",
    table: "comparison_jobs",
    key: &[Text("comparison"), Integer("position")],
    content: &[Text("job")],
    seal: "seal",
};

pub(in crate::store) const KEYS: Sealed = Sealed {
    what: "key",
    table: "idempotency",
    key: &[Text("project"), Text("key")],
    content: &[Text("body_digest"), Text("made"), Text("created_at")],
    seal: "seal",
};

pub(in crate::store) const SIGNAL_LISTS: Sealed = Sealed {
    what: "list of signals",
    table: "signal_lists",
    key: &[Text("id")],
    content: &[Text("project"), Text("signals")],
    seal: "seal",
};

pub(in crate::store) const STREAM_BATCHES: Sealed = Sealed {
    what: "answer",
    table: "stream_batches",
    key: &[Text("id")],
    content: &[Text("answer"), Text("signals")],
    seal: "seal",
};

pub(in crate::store) const STREAMS: Sealed = Sealed {
    what: "stream",
    table: "streams",
    key: &[Text("identity")],
    content: &[
        Text("project"),
        Text("name"),
        Text("signals"),
        Text("zone"),
        Integer("samples"),
        Integer("bytes"),
        Integer("first_ns"),
        Integer("last_ns"),
        Real("keep_s"),
        Integer("keep_mib"),
        Text("created_at"),
        Text("received_at"),
    ],
    seal: "seal",
};

/// How far a monitor has come.
pub(in crate::store) const MONITOR_STATES: Sealed = Sealed {
    what: "progress",
    table: "monitors",
    key: &[Text("id")],
    content: &[
        Text("job"),
        Integer("patience_ms"),
        Integer("silent"),
        Integer("revision"),
        Integer("last_event"),
        Integer("last_alarm"),
        Text("created_at"),
    ],
    seal: "state_seal",
};

/// What a window of a monitor refers to.
pub(in crate::store) const MONITOR_WINDOW_JOBS: Sealed = Sealed {
    what: "job and recording",
    table: "monitor_windows",
    key: &[Text("monitor"), Integer("number")],
    content: &[Text("job"), Text("dataset")],
    seal: "state_seal",
};

pub(in crate::store) const MAPPINGS: Sealed = Sealed {
    what: "mapping",
    table: "mappings",
    key: &[Text("project"), Text("name")],
    content: &[
        Text("rules"),
        Integer("unlisted"),
        Text("created_at"),
        Text("changed_at"),
    ],
    seal: "seal",
};

pub(in crate::store) const UNMAPPED_SERIES: Sealed = Sealed {
    what: "series",
    table: "unmapped_series",
    key: &[Text("project"), Text("mapping"), Text("series")],
    content: &[Integer("samples"), Text("last_value"), Integer("last_ns")],
    seal: "seal",
};

pub(in crate::store) const OMF_DEFINITIONS: Sealed = Sealed {
    what: "definition",
    table: "omf_definitions",
    key: &[Text("project"), Text("mapping"), Text("kind"), Text("id")],
    content: &[Text("definition")],
    seal: "seal",
};

pub(in crate::store) const DATASET_VERSIONS: Sealed = Sealed {
    what: "version of a recording",
    table: "dataset_versions",
    key: &[Text("dataset"), Integer("number")],
    content: &[Text("marks"), Text("made_by"), Text("created_at")],
    seal: "seal",
};

pub(in crate::store) const LAYOUTS: Sealed = Sealed {
    what: "layout",
    table: "layouts",
    key: &[Text("project"), Text("name")],
    content: &[Text("options"), Text("created_at"), Text("changed_at")],
    seal: "seal",
};

pub(in crate::store) const STREAM_MARKS: Sealed = Sealed {
    what: "marks of a stream",
    table: "stream_marks",
    key: &[Text("project"), Text("name")],
    content: &[
        Integer("number"),
        Text("marks"),
        Text("changed_by"),
        Text("changed_at"),
    ],
    seal: "seal",
};

pub(in crate::store) const SOURCES: Sealed = Sealed {
    what: "source",
    table: "sources",
    key: &[Text("project"), Text("name")],
    content: &[Text("state"), Text("first_heard_at"), Text("heard_at")],
    seal: "seal",
};

/// What of a token changes.
pub(in crate::store) const TOKEN_STATES: Sealed = Sealed {
    what: "state",
    table: "tokens",
    key: &[Text("digest")],
    content: &[Integer("id"), Text("revoked_at"), Text("last_used_at")],
    seal: "state_seal",
};

pub(in crate::store) const SESSIONS: Sealed = Sealed {
    what: "session",
    table: "sessions",
    key: &[Text("digest")],
    content: &[
        Integer("token"),
        Text("person"),
        Text("in_groups"),
        Text("created_at"),
        Text("expires_at"),
    ],
    seal: "seal",
};

pub(in crate::store) const PROJECT_DAYS: Sealed = Sealed {
    what: "time at work",
    table: "project_days",
    key: &[Text("project"), Text("day")],
    content: &[Integer("worked_ms")],
    seal: "seal",
};

pub(in crate::store) const WEBHOOKS: Sealed = Sealed {
    what: "webhook",
    table: "webhooks",
    key: &[Text("id")],
    content: &[
        Text("project"),
        Text("url"),
        Text("events"),
        Text("secret"),
        Text("created_at"),
    ],
    seal: "seal",
};

pub(in crate::store) const DELIVERIES: Sealed = Sealed {
    what: "delivery",
    table: "deliveries",
    key: &[Text("id")],
    content: &[
        Text("webhook"),
        Text("event"),
        Text("payload"),
        Text("state"),
        Integer("attempts"),
        Integer("due_at_ms"),
        Integer("tried_from_ms"),
        Integer("last_status"),
        Text("last_error"),
        Text("created_at"),
        Text("delivered_at"),
    ],
    seal: "seal",
};

/// A life of a server, without the counters by which other servers see that it lives.
pub(in crate::store) const NODES: Sealed = Sealed {
    what: "life of a server",
    table: "nodes",
    key: &[Integer("life")],
    content: &[
        Text("name"),
        Integer("beat_ms"),
        Text("state"),
        Text("begun_at"),
    ],
    seal: "seal",
};
