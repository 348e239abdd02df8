//! What can be identified: the structure of a plant, its parameters, signals and equations.
//!
//! A model is one file (or folder) with its equations ([`crate::native::Dynamics`]) and its description, or a
//! document with its equations as text ([`document`]), and one line in [`Catalogue::built_in`].

mod catalogue;
mod description;
mod lookup;
mod parameter;
mod plant_model;
mod specialised;
mod tolerance;

pub mod document;
pub mod positioning_drive;
pub mod single_rod_servo;

pub use catalogue::Catalogue;
pub use description::ModelDescription;
pub use parameter::{
    InitialState, ParameterDescription, Scale, SignalDescription, StateDescription,
};
pub use plant_model::Model;
pub use tolerance::{Tolerance, ToleranceText};
