//! The only SQL: jobs, queue entries, events, candidates, checkpoints, results,
//! datasets, streams and monitors, in SQLite or PostgreSQL (see `database`).
//!
//! One task writes, several connections read. The writer runs many changes in one transaction (see
//! `writer`), with full sync; River, the queue, writes beside it, on the same connection in SQLite. A
//! method returns when what it wrote is on disk, and only then are listeners told, those of other nodes
//! too (see `nodes` and `cluster_notifications`).
//!
//! Writes of a worker carry a [`Lease`]: they change nothing once another slice of the job began.

mod audit;
pub mod backup;
mod candidates;
mod change;
mod checkpoints;
mod cluster_notifications;
mod columns;
mod comparisons;
mod control;
mod damage;
mod database;
pub mod database_copy;
mod dataset_versions;
mod datasets;
mod deliveries;
mod derived;
mod error;
mod events;
mod facts;
mod figures;
mod generations;
mod handles;
mod idempotency;
mod job_summaries;
mod job_words;
mod jobs;
mod layouts;
mod lock;
mod mappings;
mod models;
mod monitors;
mod named_rows;
mod new_ids;
mod node_name;
mod nodes;
mod omf_definitions;
mod opening;
mod page;
mod postgres_address;
mod private_file;
mod queue;
mod quota_checks;
mod quotas;
mod recordings;
mod results;
mod retention;
mod row_cache;
mod sealed;
mod secret_keys;
mod sessions;
mod shared_database;
mod slices;
mod sources;
mod stop_request;
mod stored_bytes;
mod stream_marks;
mod streams;
mod submit;
#[cfg(test)]
mod tests;
pub mod tokens;
mod webhooks;
mod work_shares;
mod writer;

pub use audit::chain::AuditHead;
pub use audit::{AuditEntry, AuditLog, AuditRow, Loss};
pub use candidates::{CandidatePage, Candidates, NewCandidates};
pub use change::{Change, OnChange};
pub use checkpoints::{Checkpoint, Checkpoints};
pub use comparisons::{ComparisonRow, ComparisonSummary, Comparisons, NewComparison};
pub use control::Control;
pub use damage::{Damage, DamageMet};
pub use database::sqlite::schema_version;
pub use dataset_versions::{DatasetVersionRow, VersionAdded};
pub use datasets::{DatasetPart, DatasetRemoval, DatasetRow, Datasets, NewDataset};
pub use deliveries::{Attempt, Deliveries, DeliveryRow, DeliveryState};
pub use error::{Meaning, QuotaExceeded, StoreError};
pub use events::{JobEvents, StoredEvent};
pub use facts::{DatabaseFacts, PostgresFacts};
pub use figures::Figures;
pub use generations::Generations;
pub use handles::Store;
pub use idempotency::Idempotency;
pub use job_summaries::{EstimateInShort, JobSummaryRow, NamedDataset};
pub use job_words::{JobWords, LabelChange, Renamed};
pub use jobs::{JobFilter, JobRemoval, JobRow, Jobs};
pub use layouts::{LayoutOptions, LayoutPut, Layouts, MAX_LAYOUTS, SavedLayout};
pub use mappings::{MAX_MAPPINGS, MappingPut, MappingRow, Mappings, NewWrite};
pub use models::{MAX_UNUSED_MODELS, ModelRemoval, ModelRow, ModelStored, Models, NewModel};
pub use monitors::{Advance, AdvanceWindow, MonitorRow, Monitors, NewMonitor, NewWindowJob};
pub use nodes::Nodes;
pub use omf_definitions::{DefinitionsPut, MAX_DEFINITION_BYTES, MAX_DEFINITIONS};
pub use opening::{DatabasePlace, DatabaseSettings};
pub use page::Page;
pub use postgres_address::{AddressError, parse as postgres_options};
pub use queue::{QUEUE, SliceOfJob, SliceQueue, project_of, queue_of};
pub use quotas::Quotas;
pub use results::{Results, StoredResult};
pub use retention::{Retention, Tidied};
pub use sealed::check::Checked;
pub use secret_keys::{InvalidSecretKeys, SecretKeys};
pub use sessions::{NewHolder, PersonRow, SessionHolder, Sessions};
pub use slices::{Begin, Ending, HandedOn, Hold, Lease, Record, Reported, Slice, Slices};
pub use sources::{MAX_SOURCES, SeriesState, SourceRow, SourceState, Sources};
pub use stop_request::StopRequest;
pub use stored_bytes::StoredBytes;
pub use stream_marks::{
    MAX_STREAM_MARKS, NewStreamMarks, StreamMark, StreamMarked, StreamMarks, UnmarkedRows,
};
pub use streams::{
    Appended, BatchOutcome, DEFAULT_KEEP_MIB, Keep, MAX_STREAMS, NewBatch, StreamRemoval,
    StreamRow, Streams,
};
pub use submit::{NewJob, Submissions, Submitted};
pub use tokens::{TokenRow, Tokens};
pub use webhooks::{MAX_WEBHOOKS, WebhookRow, Webhooks};
pub use work_shares::{SharedPart, WorkShares};

use columns::unsigned;
use error::corrupt;
