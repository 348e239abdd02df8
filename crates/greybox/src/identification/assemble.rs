//! Where the service and the method meet: a specification and its recordings become a problem,
//! and what was found becomes the result document.

mod assembly;
mod assumption;
mod budget;
mod changed;
mod constraints;
mod coordinates;
mod design;
mod disturbance;
mod experiment;
mod forecast;
mod noise;
mod outcome;
mod posterior;
mod preflight;
mod priors;
mod process_noise;
mod selection;
mod start;
mod tolerances;
mod trajectory;

pub use crate::estimation::Finding;
pub use assembly::{Assembly, problem};
pub use changed::changed;
pub use design::{Assessments, COST_OF_JOB, Designing, PastResult, check_design, design};
pub use disturbance::{
    DatedEvent, DisturbancePath, ExperimentDisturbances, NamedPath, OutputInnovations, disturbances,
};
pub use forecast::{Identifiability, Prediction, flat_directions, forecast, informs, unseen};
pub use outcome::{Origin, outcome};
pub use preflight::{Preflight, findings, preflight};
pub use selection::{HistoryWindow, LookedWindow, SelectedSpan, Selecting};
pub use start::{StartsElsewhere, starts_elsewhere};
pub use trajectory::{ExperimentTrajectory, OutputTrajectory, trajectory};
