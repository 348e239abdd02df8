//! What a plant must say of itself to be simulated.

use super::lanes::{Real, RealArray};

/// A plant: ordinary differential equations driven by sampled inputs.
///
/// Time runs from sample to sample. At sample k the outputs are taken, then the inputs of sample
/// k are turned into *held* quantities (a controller that runs once a sample stands here), which
/// act, delayed by [`Dynamics::input_delay`], until the next sample. Between the samples the
/// equations are autonomous. All values SI.
pub trait Dynamics: Send + Sync + 'static {
    /// The states, in the order of the model's description.
    type State<R: Real>: RealArray<R>;
    /// What is held over a sample, e.g. the valve command.
    type Held<R: Real>: RealArray<R>;
    /// Quantities whose change of sign is a kink of the equations, e.g. a valve that opens.
    type Switches<R: Real>: RealArray<R>;
    /// What follows from a candidate's parameters alone.
    type Constants<R: Real>: Copy + Send + Sync;

    /// Derives the constants from the parameters, in the order of the model's description.
    fn constants<R: Real>(&self, parameters: &[R]) -> Self::Constants<R>;

    /// The state at the first sample where the job does not say otherwise.
    fn initial_state<R: Real>(&self, constants: &Self::Constants<R>) -> Self::State<R>;

    /// What sample's inputs become: `inputs` stand in the order of the input set in use.
    fn hold<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        inputs: &SampledInputs<'_>,
        state: &Self::State<R>,
    ) -> Self::Held<R>;

    /// The state's rate of change.
    fn derivative<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        held: &Self::Held<R>,
        state: &Self::State<R>,
    ) -> Self::State<R>;

    /// The switches at a state. A step that crosses one is taken in two parts.
    fn switches<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        held: &Self::Held<R>,
        state: &Self::State<R>,
    ) -> Self::Switches<R>;

    /// Writes the outputs, in the order of the model's description.
    fn outputs<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        state: &Self::State<R>,
        outputs: &mut [R],
    );

    /// How long the held quantities take to act `[s]`; none where the plant has no delay.
    fn input_delay<R: Real>(&self, _constants: &Self::Constants<R>) -> Option<R> {
        None
    }

    /// The fastest rate that a step must resolve [1/s], a property of the candidate: the fixed
    /// step is [`super::Accuracy::step_times_rate`] divided by it.
    fn resolved_rate(&self, constants: &Self::Constants<f64>) -> f64;

    /// A bound of the fastest rate at this state [1/s]; where a step times this rate leaves the
    /// range in which the explicit method is accurate, the sample is integrated by the stiff one.
    fn local_rate<R: Real>(
        &self,
        constants: &Self::Constants<R>,
        held: &Self::Held<R>,
        state: &Self::State<R>,
    ) -> R;

    /// The size that a change of each state is measured against, e.g. 1 MPa for a pressure.
    fn state_scale(&self) -> &'static [f64];

    /// Whether the equations hold at this state; a candidate that leaves the range has diverged.
    fn is_valid(&self, constants: &Self::Constants<f64>, state: &Self::State<f64>) -> bool;
}

/// The inputs at one sample.
#[derive(Clone, Copy, Debug)]
pub struct SampledInputs<'a> {
    /// Which of the model's input sets the values belong to.
    pub input_set: usize,
    /// A value for each input of the set, SI.
    pub values: &'a [f64],
}
