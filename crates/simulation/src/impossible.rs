//! Whether candidates are where no plant can be.

use crate::SimulationFailure;
use crate::equations::Equations;
use greybox_numerics::lanes::Real;

/// No quantity of a plant is larger than this in SI units.
pub const LARGEST_NUMBER: f64 = 1e30;

/// The numbers of a row of which a candidate is where no plant can be.
#[derive(Clone, Copy, Debug)]
pub struct ImpossibleRow<R> {
    /// The sum of the sizes of states and outputs.
    size: R,
    /// At least 0 where the equations hold.
    validity: R,
}

impl<R: Real> ImpossibleRow<R> {
    /// Takes the outputs at the states of a row; answers something where a candidate cannot be there.
    #[inline(always)]
    pub fn at<E: Equations<R>>(
        equations: &mut E,
        states: &E::States,
        outputs: &mut [R],
    ) -> Option<ImpossibleRow<R>> {
        equations.outputs(states, outputs);
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let mut size = zero;
        for number in states.as_ref().iter().chain(&*outputs) {
            // A sum, so that what is not a number stays.
            size += number.abs();
        }
        let validity = equations.validity(states);
        // A size that is not a number is not below the limit either.
        let is_beyond = R::splat(LARGEST_NUMBER).select_ge(size, zero, one);
        let is_outside = validity.select_ge(zero, zero, one);
        let is_impossible = (is_beyond + is_outside).any_above(0.5);
        is_impossible.then_some(ImpossibleRow { size, validity })
    }

    /// Why a candidate cannot be where it is, if it cannot.
    pub fn failure(&self, lane: usize) -> Option<SimulationFailure> {
        let size = self.size.lane(lane);
        if size.is_nan() || size > LARGEST_NUMBER {
            Some(SimulationFailure::Diverged)
        } else if self.validity.lane(lane) < 0.0 {
            Some(SimulationFailure::OutOfRange)
        } else {
            None
        }
    }
}
