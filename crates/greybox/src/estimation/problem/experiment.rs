//! One experiment of a problem: what was measured and what drove it.

use super::innovations::Innovations;

/// One experiment, in SI units.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// The experiment's place among those of the job; segments of one experiment share it.
    pub place: usize,
    /// The time from one sample to the next `[s]`; where the samples have instants of their own,
    /// the median.
    pub sample_time: f64,
    /// When the samples were taken `[s]`, rising, where they are not uniform.
    pub instants: Option<Vec<f64>>,
    /// How many samples.
    pub samples: usize,
    /// How many of the samples, from the first, are estimated from; the rest validates.
    pub estimation_samples: usize,
    /// From which sample on what is held back counts in the score of the validation.
    pub scored_from: usize,
    /// Which of the model's input sets drives the experiment.
    pub input_set: usize,
    /// The samples of each input of the set; none of them missing.
    pub inputs: Vec<Vec<f64>>,
    /// For each of the problem's outputs its samples; NaN where missing.
    pub measured: Vec<Vec<f64>>,
    /// For each of the problem's outputs, where its noise is not the same in all samples, the
    /// output's noise over that of each sample; NaN where there is no sample.
    pub weights: Vec<Option<Vec<f64>>>,
    /// For each state of the model where it starts; none: where a coordinate or else the model
    /// says.
    pub initial_state: Vec<Option<f64>>,
    /// Parameters that have a value of their own in this experiment, by their places.
    pub parameters: Vec<(usize, f64)>,
    /// Where an experiment that only validates starts, as far as that is unknown.
    pub unknown_starts: Vec<UnknownStart>,
    /// How many samples that start is fitted to, where the job says.
    pub start_samples: Option<usize>,
}

/// A state whose start is fitted to the first samples of an experiment that only validates.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnknownStart {
    /// The state, by its place.
    pub state: usize,
    /// The least start that is looked for, SI.
    pub lower: f64,
    /// The largest, SI.
    pub upper: f64,
}

impl Experiment {
    /// The experiment of `samples` samples from the sample `from` on, all of which are estimated from.
    #[must_use]
    pub fn part(&self, from: usize, samples: usize) -> Experiment {
        let part = |values: &Vec<f64>| values[from..from + samples].to_vec();
        Experiment {
            place: self.place,
            sample_time: self.sample_time,
            instants: self.instants.as_ref().map(part),
            samples,
            estimation_samples: samples,
            scored_from: samples,
            input_set: self.input_set,
            inputs: self.inputs.iter().map(part).collect(),
            measured: self.measured.iter().map(part).collect(),
            weights: self
                .weights
                .iter()
                .map(|weights| weights.as_ref().map(part))
                .collect(),
            initial_state: self.initial_state.clone(),
            parameters: self.parameters.clone(),
            unknown_starts: Vec::new(),
            start_samples: None,
        }
    }

    /// The measured outputs that correct what is expected where innovations are compared: they stand last
    /// among the inputs, in the order of the model.
    pub fn measured_inputs(&mut self, innovations: &Innovations) -> &mut [Vec<f64>] {
        let first = self.inputs.len() - innovations.n_outputs;
        &mut self.inputs[first..]
    }

    /// When a sample was taken, from the first `[s]`.
    #[must_use]
    pub fn instant(&self, sample: usize) -> f64 {
        match &self.instants {
            Some(instants) => instants[sample] - instants[0],
            None => sample as f64 * self.sample_time,
        }
    }

    /// What the residuals of an output count at a sample, 1 where its noise is always the same.
    #[must_use]
    #[inline]
    pub fn weight(&self, output: usize, sample: usize) -> f64 {
        match &self.weights[output] {
            Some(weights) => weights[sample],
            None => 1.0,
        }
    }
}
