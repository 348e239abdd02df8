//! A controller within the equations: quantities that are computed from the states once a sample.

use std::ops::Range;

/// The most samples after which what a controller computes may act: the covariance has a row for each.
pub const LONGEST_DELAY: usize = 8;

/// Why a filter cannot follow a controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ControllerFault {
    /// The delay of a controller within the model depends on a parameter.
    #[error(
        "what the model computes from its states once a sample acts after a delay that depends on a \
         parameter: give the delay as a constant without a tolerance"
    )]
    UnknownDelay,
    /// A controller within the model acts too late.
    #[error(
        "what the model computes from its states once a sample acts more than {LONGEST_DELAY} samples later"
    )]
    LongDelay,
    /// White noise disturbs a controller that acts at the sample at which it computes.
    #[error(
        "white noise cannot disturb what is computed once a sample and acts without a delay: let the \
         disturbance have a memory"
    )]
    WhiteAtOnce,
    /// A controller within the model acts with a delay, and its samples are not evenly spaced.
    #[error(
        "what the model computes from its states once a sample acts after a delay, so that all samples \
         must be evenly spaced, by the same time in each experiment"
    )]
    UnevenSamples,
}

/// How what a controller computes reaches the plant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ControllerLayout {
    /// How many quantities the controller computes.
    pub n_quantities: usize,
    /// How many samples later the quantities act; a part of a sample counts as one.
    pub delay: usize,
}

impl ControllerLayout {
    /// How many values of a quantity are carried: a controller may read the value of the sample before.
    pub(crate) fn n_slots(self) -> usize {
        self.delay.max(1) + 1
    }

    /// How many states the filter has for the controller.
    #[must_use]
    pub fn n_states(self) -> usize {
        self.n_quantities * self.n_slots()
    }

    /// The state of the value that acts, where those of the controller begin with `first`.
    #[must_use]
    pub fn acting(self, first: usize, quantity: usize) -> usize {
        first + quantity * self.n_slots() + self.delay
    }

    /// The state of the value at the sample before, where those of the controller begin with `first`.
    #[must_use]
    pub fn previous(self, first: usize, quantity: usize) -> usize {
        first + quantity * self.n_slots() + 1
    }

    /// The slots of each quantity that the first `kept` hold.
    pub(crate) fn slots(
        self,
        first: usize,
        kept: usize,
    ) -> impl Iterator<Item = (usize, Range<usize>)> {
        (0..self.n_quantities).map(move |quantity| {
            let newest = first + quantity * self.n_slots();
            (quantity, newest..newest + kept)
        })
    }
}

/// A quantity of the controller that an output shows, by their places in the model's description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RecordedQuantity {
    /// The output.
    pub output: usize,
    /// The quantity that is computed once a sample.
    pub quantity: usize,
}
