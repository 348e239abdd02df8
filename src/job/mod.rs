//! What a job is: its specification, its life, its events and its outcome. Pure types.

pub mod assemble;
pub mod budget;
pub mod candidate;
pub mod comparison;
pub mod design;
pub mod event;
pub mod failure;
pub mod id;
pub mod kind;
pub mod outcome;
pub mod simulation;
pub mod spec;
pub mod state;

pub use crate::estimation::{Phase, Progress};
pub use crate::parsing::fault::{self, Fault};
pub use candidate::{Candidate, CandidateColumn};
pub use event::{Event, GenerationEvent};
pub use failure::Failure;
pub use id::{ComparisonId, DatasetId, DeliveryId, InvalidId, JobId, MonitorId, WebhookId};
pub use kind::JobKind;
pub use outcome::Outcome;
pub use spec::JobSpec;
pub use state::{IllegalTransition, Status};
