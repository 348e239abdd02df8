//! What a job is: its specification, its life, its events and its outcome. Pure types.

pub mod event;
pub mod id;
pub mod state;

pub use event::{Event, GenerationEvent};
pub use id::{DatasetId, InvalidId, JobId};
pub use state::{IllegalTransition, Status};
