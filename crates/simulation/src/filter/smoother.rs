//! The states and the disturbances of a record as all of its samples put them: the fixed-interval
//! smoother of A. E. Bryson and M. Frazier (*Smoothing for linear and nonlinear dynamic systems*,
//! 1963) in the form of G. J. Bierman (*Automatica* 9, 1973), which inverts no covariance.
//!
//! The filter goes forwards and leaves at each sample the states m with their covariance P, each
//! output's derivatives c, gain K, error ε and variance S, and the transition Φ to the next sample.
//! The smoother goes backwards with λ and Λ, both zero behind the last sample:
//!
//! | where | λ | Λ |
//! |---|---|---|
//! | at a measured output | (I − Kc)ᵀλ − cᵀε/S | (I − Kc)ᵀΛ(I − Kc) + cᵀc/S |
//! | over an interval | Φᵀλ | ΦᵀΛΦ |
//!
//! The smoothed states are m − Pλ with the covariance P − PΛP. A disturbance with memory or a walk is a
//! state itself. White noise of the strength σ is a state that stands still over an interval of the
//! length h and is drawn anew at the next: with λ and Λ of this state where the interval begins, the
//! noise has the mean −σ²/h·λ over the interval, with the variance σ²/h − (σ²/h)²·Λ.
//!
//! −λ/√Λ of a disturbance is standard normal where the noise model holds: it is the auxiliary residual
//! of A. C. Harvey and S. J. Koopman (*Journal of Business & Economic Statistics* 10, 1992), and far
//! from zero where something acted that the noise model does not expect.

use super::layout::FilterLayout;
use super::trace::TraceLayout;
use crate::DrivingInputs;
use crate::program::DisturbanceKind;

/// A record as all of its samples put it.
#[derive(Clone, Debug)]
pub struct SmoothedRecord {
    /// The states of the model, in its order.
    pub states: Vec<SmoothedPath>,
    /// The disturbances, in the order of the filter's layout. Where a disturbance is white, its path
    /// has the mean from each sample to the next.
    pub disturbances: Vec<SmoothedPath>,
    /// For each disturbance the auxiliary residual of what the disturbance received from each sample
    /// to the next; NaN at the last sample and where no later sample tells of the disturbance.
    pub residuals: Vec<Vec<f64>>,
}

/// A quantity with its error, sample by sample.
#[derive(Clone, Debug)]
pub struct SmoothedPath {
    /// The values, SI; NaN where there is none.
    pub values: Vec<f64>,
    /// One standard deviation of each value's error.
    pub deviations: Vec<f64>,
}

impl SmoothedPath {
    fn new(samples: usize) -> SmoothedPath {
        SmoothedPath {
            values: vec![f64::NAN; samples],
            deviations: vec![f64::NAN; samples],
        }
    }

    fn set(&mut self, sample: usize, value: f64, variance: f64) {
        self.values[sample] = value;
        // Rounding can put the variance of what the data fix a little below zero.
        self.deviations[sample] = variance.max(0.0).sqrt();
    }
}

/// A record that a traced filter has gone through.
#[derive(Clone, Copy, Debug)]
pub struct TracedRecord<'a> {
    /// The layout of the filter, which traces.
    pub layout: &'a FilterLayout,
    /// The inputs that drove the filter, the measured outputs behind those of the model.
    pub inputs: DrivingInputs<'a>,
    /// The number of outputs of the model.
    pub n_outputs: usize,
    /// For each disturbance its strength `[unit·√s]`.
    pub strengths: &'a [f64],
    /// The filter's answers: for each column its samples.
    pub columns: &'a [Vec<f64>],
}

/// λ and Λ on their way from the last sample to the first.
struct Adjoint {
    n: usize,
    /// λ.
    vector: Vec<f64>,
    /// Λ, row by row.
    matrix: Vec<f64>,
    scratch: Vec<f64>,
}

impl Adjoint {
    fn new(n: usize) -> Adjoint {
        Adjoint {
            n,
            vector: vec![0.0; n],
            matrix: vec![0.0; n * n],
            scratch: vec![0.0; n * n],
        }
    }

    /// Takes in an output with the derivatives c, the gain Pcᵀ, the error ε and its variance S.
    fn take_output(&mut self, derivatives: &[f64], gain: &[f64], [error, variance]: [f64; 2]) {
        let n = self.n;
        let gain: Vec<f64> = gain.iter().map(|gain| gain / variance).collect();
        // (I − Kc)ᵀλ − cᵀε/S = λ − cᵀ(Kᵀλ + ε/S).
        let pull = dot(&gain, &self.vector) + error / variance;
        for (value, derivative) in self.vector.iter_mut().zip(derivatives) {
            *value -= derivative * pull;
        }
        // (I − Kc)ᵀΛ(I − Kc) = Λ − cᵀ(ΛK)ᵀ − (ΛK)c + cᵀ(KᵀΛK)c.
        let along: Vec<f64> = (0..n)
            .map(|row| dot(&self.matrix[row * n..][..n], &gain))
            .collect();
        let both = dot(&along, &gain) + 1.0 / variance;
        for (index, value) in self.matrix.iter_mut().enumerate() {
            let (row, column) = (index / n, index % n);
            *value += derivatives[row] * derivatives[column] * both
                - derivatives[row] * along[column]
                - along[row] * derivatives[column];
        }
    }

    /// Forgets what later samples tell of a state.
    fn forget(&mut self, state: usize) {
        let n = self.n;
        self.vector[state] = 0.0;
        for index in 0..n {
            self.matrix[state * n + index] = 0.0;
            self.matrix[index * n + state] = 0.0;
        }
    }

    /// Goes back over an interval with the transition Φ.
    fn go_back(&mut self, transition: &[f64]) {
        let n = self.n;
        let vector = (0..n).map(|column| {
            let rows = (0..n).map(|row| transition[row * n + column] * self.vector[row]);
            rows.sum()
        });
        self.vector = vector.collect();
        for row in 0..n {
            for column in 0..n {
                let inner = (0..n)
                    .map(|inner| self.matrix[row * n + inner] * transition[inner * n + column]);
                self.scratch[row * n + column] = inner.sum();
            }
        }
        for row in 0..n {
            for column in row..n {
                let inner = (0..n)
                    .map(|inner| transition[inner * n + row] * self.scratch[inner * n + column]);
                let value = inner.sum();
                self.matrix[row * n + column] = value;
                self.matrix[column * n + row] = value;
            }
        }
    }

    /// The part λ of a state, and Λ of the state with itself.
    fn of(&self, state: usize) -> [f64; 2] {
        [self.vector[state], self.matrix[state * (self.n + 1)]]
    }

    /// −λ/√Λ of a state; NaN where no sample tells of the state.
    fn residual(&self, state: usize) -> f64 {
        let [pull, information] = self.of(state);
        if information > 0.0 {
            -pull / information.sqrt()
        } else {
            f64::NAN
        }
    }

    /// What the samples from here on make of a state with this row of the covariance: (−Pλ, −PΛP).
    fn correction(&self, row: &[f64]) -> [f64; 2] {
        let n = self.n;
        let along = (0..n).map(|index| row[index] * dot(&self.matrix[index * n..][..n], row));
        [-dot(row, &self.vector), -along.sum::<f64>()]
    }
}

fn dot(left: &[f64], right: &[f64]) -> f64 {
    left.iter()
        .zip(right)
        .map(|(left, right)| left * right)
        .sum()
}

impl TracedRecord<'_> {
    /// Goes back through the record.
    #[must_use]
    pub fn smoothed(&self) -> SmoothedRecord {
        let samples = self.inputs.samples;
        let n_model_states = self.layout.starts.len();
        let n_disturbances = self.layout.disturbances.len();
        let trace = TraceLayout {
            n_states: self.layout.n_states(),
            n_outputs: self.n_outputs,
        };
        let paths = |count: usize| vec![SmoothedPath::new(samples); count];
        let mut record = SmoothedRecord {
            states: paths(n_model_states),
            disturbances: paths(n_disturbances),
            residuals: vec![vec![f64::NAN; samples]; n_disturbances],
        };
        let mut adjoint = Adjoint::new(trace.n_states);
        let mut row = vec![0.0; trace.n_columns()];
        for sample in (0..samples).rev() {
            for (value, column) in row.iter_mut().zip(self.columns) {
                *value = column[sample];
            }
            if sample + 1 < samples {
                self.cross(&mut adjoint, &row[trace.transition()], sample, &mut record);
            }
            self.take_sample(&mut adjoint, &row, trace, sample);
            let (means, covariance) = (&row[trace.mean()], &row[trace.covariance()]);
            let rows = means.iter().zip(covariance.chunks_exact(trace.n_states));
            let rows = rows.take(n_model_states + n_disturbances);
            for (state, (mean, covariances)) in rows.enumerate() {
                let [moved, less] = adjoint.correction(covariances);
                let path = match state.checked_sub(n_model_states) {
                    None => &mut record.states[state],
                    Some(place) if self.is_white(place) => continue,
                    Some(place) => &mut record.disturbances[place],
                };
                path.set(sample, mean + moved, covariances[state] + less);
            }
        }
        record
    }

    fn is_white(&self, disturbance: usize) -> bool {
        self.layout.disturbances[disturbance].kind == DisturbanceKind::White
    }

    /// Takes in what was measured at a sample, the last output first. What was recorded of a controller owes
    /// nothing to the states before.
    fn take_sample(&self, adjoint: &mut Adjoint, row: &[f64], trace: TraceLayout, sample: usize) {
        for output in (0..self.n_outputs).rev() {
            let measured = self.inputs.inputs[self.layout.n_inputs + output][sample];
            if !measured.is_nan() && !self.layout.shows_what_acted(output) {
                let error = measured - row[output];
                let variance = row[self.n_outputs + output];
                let derivatives = &row[trace.derivatives(output)];
                adjoint.take_output(derivatives, &row[trace.gain(output)], [error, variance]);
            }
        }
        let first = self.layout.first_of_controller();
        for shown in &self.layout.recorded {
            let measured = self.inputs.inputs[self.layout.n_inputs + shown.output][sample];
            if let Some(controller) = self.layout.controller.filter(|_| !measured.is_nan()) {
                adjoint.forget(controller.acting(first, shown.quantity));
            }
        }
    }

    /// Goes back over the interval behind a sample, and writes down what each disturbance received
    /// in it.
    fn cross(
        &self,
        adjoint: &mut Adjoint,
        transition: &[f64],
        sample: usize,
        record: &mut SmoothedRecord,
    ) {
        let first = self.layout.starts.len();
        for place in 0..self.layout.disturbances.len() {
            if self.is_white(place) {
                adjoint.forget(first + place);
            } else {
                record.residuals[place][sample] = adjoint.residual(first + place);
            }
        }
        adjoint.go_back(transition);
        let interval = self.inputs.interval(sample);
        for (place, strength) in self.strengths.iter().enumerate() {
            if self.is_white(place) {
                record.residuals[place][sample] = adjoint.residual(first + place);
                let variance = strength * strength / interval;
                let [pull, information] = adjoint.of(first + place);
                let left = variance - variance * variance * information;
                record.disturbances[place].set(sample, -variance * pull, left);
            }
        }
    }
}
