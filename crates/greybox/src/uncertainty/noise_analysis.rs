//! The analysis of the disturbances that move a plant beside its inputs.

use super::covariance::NORMAL_95;
use super::verdict::Trust;
use crate::estimation::problem::Coordinate;
use crate::estimation::process_noise::ProcessNoise;

/// Criteria that differ by no more leave two noise models standing.
const STANDING: f64 = 10.0;
/// Standard deviations by which the free run and a right noise model do not differ by chance: the errors of the
/// free run's blocks are too small in one record of ten.
const FREE_RUN_DIFFERS: f64 = 4.0;

/// The analysis of the disturbances that move a plant.
#[derive(Clone, Debug)]
pub struct NoiseAnalysis {
    /// The noise models that were compared, in the order in which they were tried.
    pub compared: Vec<ComparedNoise>,
    /// Which of them was taken.
    pub chosen: usize,
    /// Whether the innovations of all outputs pass for white noise.
    pub is_white: bool,
    /// The natural logarithm of the likelihood at the estimate.
    pub log_likelihood: f64,
    /// The disturbances of the noise model that was taken.
    pub disturbances: Vec<DisturbanceEstimate>,
    /// For each compared output the standard deviation of its sensor's noise, SI.
    pub sensors: Vec<NoiseEstimate>,
    /// For each coordinate of the plant what the free run makes of it.
    pub free_run: Vec<FreeRunEstimate>,
    /// For each compared output how what was held back lies within the band that is expected of it.
    pub bands: Vec<Option<Band>>,
}

impl NoiseAnalysis {
    /// The fits of other noise models that the data leave standing. Where the noise model that was taken
    /// leaves innovations that are not white, none is right and their likelihoods say little: every
    /// disturbance stands, but for one that misses an effect which the one that was taken does not miss. Where
    /// several disturbances act, which they are is less certain than a criterion says, and all stand that miss no
    /// effect.
    pub(super) fn rivals(&self) -> impl Iterator<Item = Rival<'_>> {
        let taken = &self.compared[self.chosen];
        let lowest = taken.fit.as_ref().map(|fit| fit.bic);
        let others = self.compared.iter().enumerate();
        let others =
            others.filter(|(place, compared)| *place != self.chosen && !compared.is_too_strong);
        others.filter_map(move |(_, compared)| {
            let fit = compared.fit.as_ref()?;
            let is_as_likely = lowest.is_some_and(|lowest| (fit.bic - lowest).abs() < STANDING);
            let is_explanation = taken.misses_an_effect || !compared.misses_an_effect;
            let is_disturbed = !compared.disturbances.is_empty();
            let is_uncertain = !self.is_white || taken.disturbances.len() > 1;
            let stands = is_as_likely || (is_uncertain && is_disturbed && is_explanation);
            stands.then_some(Rival { fit, is_as_likely })
        })
    }
}

impl FreeRunEstimate {
    /// How far the free run puts a coordinate from a position with this deviation, where that is further than
    /// both errors allow; none where the two agree.
    ///
    /// The errors of the free run are those of blocks of residuals, so that they hold for any disturbance. A
    /// right noise model differs from the free run by chance alone (J. A. Hausman, *Econometrica* 46, 1978).
    pub(super) fn disagreement(
        &self,
        coordinate: &Coordinate,
        position: f64,
        deviation: f64,
    ) -> Option<f64> {
        let Coordinate { lower, upper, .. } = *coordinate;
        let free = coordinate.scale.position(self.value, lower, upper);
        let error = self.standard_error? / coordinate.slope(free).abs();
        let by = free - position;
        (by.abs() > FREE_RUN_DIFFERS * error.hypot(deviation)).then_some(by)
    }
}

/// The fit of another noise model that the data leave standing.
pub(super) struct Rival<'a> {
    /// The fit.
    pub fit: &'a ComparedFit,
    /// Whether the data make it about as likely as the one that was taken.
    pub is_as_likely: bool,
}

impl Rival<'_> {
    /// The ends of what the other noise model says of a position: its 95 % interval where it is about as likely
    /// as the one that was taken, else its estimate with the deviation of the one that was taken.
    pub(super) fn ends(&self, index: usize, deviation: Option<f64>) -> Option<[f64; 2]> {
        if self.is_as_likely {
            return self.fit.interval(index);
        }
        let half = NORMAL_95 * deviation?;
        Some([-half, half].map(|half| self.fit.positions[index] + half))
    }
}

/// A noise model that was fitted.
#[derive(Clone, Debug)]
pub struct ComparedNoise {
    /// The disturbances; empty where only sensors have noise.
    pub disturbances: Vec<ProcessNoise>,
    /// What the fit came to; none where it failed.
    pub fit: Option<ComparedFit>,
    /// Whether the disturbances would have left far more in the free run than was left: such a noise model is
    /// no explanation.
    pub is_too_strong: bool,
    /// Whether the innovations of an output follow each other so closely that the model misses an effect.
    pub misses_an_effect: bool,
}

/// What the fit of a noise model came to.
#[derive(Clone, Debug)]
pub struct ComparedFit {
    /// The natural logarithm of the likelihood.
    pub log_likelihood: f64,
    /// The Bayesian information criterion.
    pub bic: f64,
    /// The positions of the plant's unknowns, then those of the noise.
    pub positions: Vec<f64>,
    /// The standard deviation of each position; none where the data do not fix all of them.
    pub deviations: Option<Vec<f64>>,
}

impl ComparedFit {
    /// The ends of the 95 % interval of a position; none where the data do not fix all of them.
    pub(super) fn interval(&self, index: usize) -> Option<[f64; 2]> {
        let half = NORMAL_95 * self.deviations.as_ref()?[index];
        Some([-half, half].map(|half| self.positions[index] + half))
    }
}

/// A number of a disturbance or of a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseEstimate {
    /// The value, SI.
    pub value: f64,
    /// The standard deviation of the logarithm of the value; none where the value is given, or the data do
    /// not fix it.
    pub relative_error: Option<f64>,
}

impl NoiseEstimate {
    /// One standard deviation of the value's error, SI.
    #[must_use]
    pub fn standard_error(&self) -> Option<f64> {
        Some(self.value * self.relative_error?)
    }

    /// The ends of the 95 % interval, SI.
    #[must_use]
    pub fn interval(&self) -> Option<[f64; 2]> {
        let half = NORMAL_95 * self.relative_error?;
        Some([-half, half].map(|half| self.value * libm::exp(half)))
    }
}

/// A disturbance with what the data say of it.
#[derive(Clone, Debug)]
pub struct DisturbanceEstimate {
    /// The disturbance, with its numbers as they were looked for.
    pub sought: ProcessNoise,
    /// How strong it is `[unit of what it acts on · √s]`.
    pub strength: NoiseEstimate,
    /// How long it remembers `[s]`, where it has a memory.
    pub time_constant: Option<NoiseEstimate>,
    /// The standard deviation of one with memory, in the unit of what it acts on.
    pub std: Option<NoiseEstimate>,
    /// For each compared output the share of its variance that the disturbance makes.
    pub shares: Vec<Option<f64>>,
}

/// What the free run makes of an unknown of the plant.
#[derive(Clone, Copy, Debug)]
pub struct FreeRunEstimate {
    /// The value, SI.
    pub value: f64,
    /// One standard deviation of its error, SI.
    pub standard_error: Option<f64>,
    /// How far its total interval can be relied on.
    pub trust: Trust,
}

/// How samples lie within the 95 % band that is expected of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Band {
    /// The number of samples that were held back.
    pub samples: usize,
    /// The share of them that lies within the band.
    pub inside: f64,
    /// The mean square of their errors in units of what is expected.
    pub mean_square: f64,
    /// How many independent samples they are worth.
    pub effective_samples: f64,
}
