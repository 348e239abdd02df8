//! What a job is for the service: its name, its kind, its life and its events. What it is asked and
//! what it answers are the library's, in [`greybox::identification`].

pub mod candidate;
pub mod comparison;
pub mod design_task;
pub mod event;
pub mod failure;
pub mod id;
pub mod kind;
pub mod past_recording;
pub mod result;
pub mod selection_task;
pub mod state;
pub mod task;

pub use candidate::{Candidate, CandidateColumn};
pub use design_task::DesignTask;
pub use event::{Event, GenerationEvent};
pub use failure::Failure;
pub use id::{ComparisonId, DeliveryId, MonitorId, WebhookId};
pub use kind::JobKind;
pub use past_recording::RecordingOfPast;
pub use result::ResultOfJob;
pub use selection_task::SelectionTask;
pub use state::{IllegalTransition, Status};
pub use task::JobTask;
