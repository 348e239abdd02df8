//! Room for the candidates of a row that use the method of eighth order.

use super::eighth::EighthOrderStages;
use crate::equations::Equations;
use greybox_numerics::lanes::Real;

/// The candidates that use the method of eighth order, and its stages.
pub struct Smooth<S, R> {
    /// The slopes of a step.
    pub stages: EighthOrderStages<S>,
    /// 1 for each candidate that uses it, 0 for the others.
    pub candidates: R,
    /// Whether there is one.
    pub is_used: bool,
}

/// Room for a row's states.
pub type SmoothRow<E, R> = Smooth<<E as Equations<R>>::States, R>;

impl<S: Clone, R: Real> Smooth<S, R> {
    /// Room for the candidates of a row, where their equations may be worth it.
    pub fn of<E: Equations<R, States = S>>(states: &S) -> Option<Box<Self>> {
        const { E::MAY_BE_SMOOTH }.then(|| {
            Box::new(Smooth {
                stages: EighthOrderStages::like(states),
                candidates: R::splat(0.0),
                is_used: false,
            })
        })
    }
}
